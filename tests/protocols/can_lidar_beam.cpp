// The message of a LiDAR's shot: both forms carry the same, and what is missing stays so.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "protocols/can/messages.h"

namespace narpa {
namespace {

TEST(CanLidarBeam, BothFormsCarryTheSame) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> range(0, 1e8), velocity(-1e4, 1e4);
    MessageDecoder<LidarBeamReport> classic, fd;
    for (int k = 0; k < 10'000; ++k) {
        LidarBeamReport sent{.counter = static_cast<std::uint8_t>(k),
                             .lidar = static_cast<std::uint8_t>(random()),
                             .beam = static_cast<std::uint16_t>(random()),
                             .t_ns = static_cast<std::int64_t>(random() >> 8)};
        if (k % 3 != 0) sent.range_m = range(random);
        if (k % 4 != 0) sent.velocity_m_s = velocity(random);
        LidarBeamReport a, b;
        std::size_t complete = 0;
        for (const CanFrame& frame : encode_classic(sent))
            complete += classic.accept(frame, sent.t_ns + 1'000'000'000, a) == DecodeStatus::complete;
        ASSERT_EQ(complete, 1U);
        ASSERT_EQ(fd.accept(encode_fd(sent), sent.t_ns - 1'000'000'000, b), DecodeStatus::complete);
        for (const LidarBeamReport& got : {a, b}) {
            ASSERT_EQ(got.counter, sent.counter);
            ASSERT_EQ(got.lidar, sent.lidar);
            ASSERT_EQ(got.beam, sent.beam);
            ASSERT_EQ(got.t_ns, sent.t_ns);
            ASSERT_EQ(std::isnan(got.range_m), std::isnan(sent.range_m));
            ASSERT_EQ(std::isnan(got.velocity_m_s), std::isnan(sent.velocity_m_s));
            if (k % 3 != 0) {
                ASSERT_NEAR(got.range_m, sent.range_m, 0.51e-6);
            }
            if (k % 4 != 0) {
                ASSERT_NEAR(got.velocity_m_s, sent.velocity_m_s, 0.51e-6);
            }
        }
    }
    CanFrame broken = encode_fd(LidarBeamReport{});
    broken.data[3] ^= 1;
    LidarBeamReport out;
    EXPECT_EQ(fd.accept(broken, 0, out), DecodeStatus::bad_checksum);
}

}  // namespace
}  // namespace narpa
