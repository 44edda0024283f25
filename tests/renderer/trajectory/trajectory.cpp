// The trajectory file: what is read back is what was written, and what is wrong is named with its place.
#include "renderer/trajectory/trajectory.h"

#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <random>

#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

class TrajectoryFile : public ::testing::Test {
protected:
    std::string write(const std::string& rows) const {
        const std::string path = folder_ / "t.csv";
        std::ofstream(path) << kTrajectoryHeader << "\n" << rows;
        return path;
    }
    test::TemporaryFolder folder_;
};

TEST_F(TrajectoryFile, RowsReadBackBitForBit) {
    std::mt19937_64 rng(7);
    std::normal_distribution<double> n(0, 1e3);
    std::string rows;
    std::vector<TrajectoryRow> truth;
    for (int i = 0; i < 200; ++i) {
        TrajectoryRow r{i * 100'000'007LL, "chaser", {}};
        r.motion.T_world_body = {normalized(Quat{n(rng), n(rng), n(rng), n(rng)}),
                                 {n(rng), n(rng) * 1e6, n(rng) * 1e-9}};
        r.motion.velocity_m_s = {n(rng), n(rng), n(rng)};
        r.motion.rate_rad_s = {n(rng), n(rng), n(rng)};
        std::array<char, 512> line{};
        rows.append(line.data(), format_trajectory_row(line, r.t_ns, r.body, r.motion));
        truth.push_back(r);
    }
    const auto read = read_trajectory(write(rows));
    ASSERT_TRUE(read) << read.error().text();
    ASSERT_EQ(read->size(), truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) {
        EXPECT_EQ((*read)[i].t_ns, truth[i].t_ns);
        EXPECT_EQ((*read)[i].motion.T_world_body.t, truth[i].motion.T_world_body.t);
        EXPECT_EQ((*read)[i].motion.T_world_body.q, truth[i].motion.T_world_body.q);
        EXPECT_EQ((*read)[i].motion.velocity_m_s, truth[i].motion.velocity_m_s);
        EXPECT_EQ((*read)[i].motion.rate_rad_s, truth[i].motion.rate_rad_s);
    }
}

TEST_F(TrajectoryFile, NegativeTimesAndCommentsAndSpacesAreFine) {
    const auto read = read_trajectory(write("# a comment\n-0.25 , b, 1, 2, 3, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0\r\n"));
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(read->front().t_ns, -250'000'000);
    std::array<char, 512> line{};
    const std::size_t n = format_trajectory_row(line, -250'000'000, "b", read->front().motion);
    EXPECT_TRUE(std::string_view(line.data(), n).starts_with("-0.250000000,b,"));
}

TEST_F(TrajectoryFile, TooShortABufferWritesNothing) {
    std::array<char, 40> line{};
    EXPECT_EQ(format_trajectory_row(line, 0, "chaser", {}), 0U);
}

struct BadRow {
    const char* rows;
    int line, column;
    const char* words;
};
void PrintTo(const BadRow& row, std::ostream* out) {
    *out << row.words;
}
class BadTrajectory : public TrajectoryFile, public ::testing::WithParamInterface<BadRow> {};

TEST_P(BadTrajectory, IsNamedWithItsPlace) {
    const auto read = read_trajectory(write(GetParam().rows));
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().line, GetParam().line);
    EXPECT_EQ(read.error().column, GetParam().column);
    EXPECT_NE(read.error().what.find(GetParam().words), std::string::npos) << read.error().what;
}

INSTANTIATE_TEST_SUITE_P(All, BadTrajectory,
                         ::testing::Values(BadRow{"0,b,1,2,3\n", 2, 1, "5 columns, expected 15"},
                                           BadRow{"0,b,1,2,nan,1,0,0,0,0,0,0,0,0,0\n", 2, 9, "finite number"},
                                           BadRow{"0,b,1,2,1e400,1,0,0,0,0,0,0,0,0,0\n", 2, 9, "finite number"},
                                           BadRow{"0,b,1,two,3,1,0,0,0,0,0,0,0,0,0\n", 2, 7, "\"two\""},
                                           BadRow{"0,b,1,2,3,1,1,0,0,0,0,0,0,0,0\n", 2, 11, "unit quaternion"},
                                           BadRow{"0,b,1,2,3,0,0,0,0,0,0,0,0,0,0\n", 2, 11, "unit quaternion"},
                                           BadRow{"0,,1,2,3,1,0,0,0,0,0,0,0,0,0\n", 2, 3, "empty body name"},
                                           BadRow{"1e12,b,1,2,3,1,0,0,0,0,0,0,0,0,0\n", 2, 1, "less than 9e9"},
                                           BadRow{"1,b,1,2,3,1,0,0,0,0,0,0,0,0,0\n1,b,1,2,3,1,0,0,0,0,0,0,0,0,0\n",
                                                  3, 1, "does not come after"},
                                           BadRow{"", 0, 0, "no rows"}));

}  // namespace
}  // namespace narpa
