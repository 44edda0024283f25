// The approach beside the docking scene, checked from the outside: as a table of numbers, against the meshes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "base/pose.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

const std::filesystem::path kScene = std::filesystem::path(test::build_path("scenes/docking"));

struct Row {
    double t_s = 0;
    Motion motion{};
};
std::vector<Row> read_rows() {
    std::vector<Row> rows;
    std::ifstream file(kScene / "approach.csv");
    std::string line, body;
    std::getline(file, line);
    EXPECT_EQ(line, "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s");
    while (std::getline(file, line)) {
        std::array<double, 14> n{};
        std::istringstream in(line);
        char comma = 0;
        in >> n[0] >> comma;
        std::getline(in, body, ',');
        EXPECT_EQ(body, "chaser");
        for (std::size_t i = 1; i < n.size(); ++i) {
            in >> n[i];
            in >> comma;
        }
        rows.push_back(
            {n[0], {{{n[4], n[5], n[6], n[7]}, {n[1], n[2], n[3]}}, {n[8], n[9], n[10]}, {n[11], n[12], n[13]}}});
    }
    return rows;
}

/// Turning vector of a small rotation.
Vec3 log_rotation(Quat q) {
    if (q.w < 0) q = -q;
    const double s = norm(q.vec());
    return s < 1e-12 ? 2.0 * q.vec() : (2 * std::atan2(s, q.w) / s) * q.vec();
}

TEST(Approach, IsAMinuteFromSixtyMetresToContact) {
    const std::vector<Row> rows = read_rows();
    ASSERT_EQ(rows.size(), 601u);
    for (std::size_t k = 0; k < rows.size(); ++k) {
        EXPECT_NEAR(rows[k].t_s, 0.1 * static_cast<double>(k), 1e-9);
        EXPECT_NEAR(norm(rows[k].motion.T_world_body.q), 1, 1e-9);
        if (k > 0) {
            EXPECT_GT(dot(rows[k].motion.T_world_body.q, rows[k - 1].motion.T_world_body.q), 0.99) << "sign kept";
        }
    }
    const Motion &first = rows.front().motion, &last = rows.back().motion;
    const Quat facing{0, 0, 0, 1};
    EXPECT_NEAR(first.T_world_body.t.x, 60, 1);
    EXPECT_GT(std::hypot(first.T_world_body.t.y, first.T_world_body.t.z), 1);
    EXPECT_GT(angle_between(first.T_world_body.q, facing), 0.03);
    EXPECT_LT(norm(last.T_world_body.t), 1e-9);
    EXPECT_LT(angle_between(last.T_world_body.q, facing), 1e-9);
    // Contact within the limits of the docking standard: 0.05 to 0.10 m/s, straight.
    EXPECT_NEAR(last.velocity_m_s.x, -0.075, 0.025);
    EXPECT_LT(std::hypot(last.velocity_m_s.y, last.velocity_m_s.z), 1e-6);
    EXPECT_LT(norm(last.rate_rad_s), 1e-6);
    const auto held = std::count_if(rows.begin(), rows.end(), [](const Row& r) {
        return std::abs(r.motion.T_world_body.t.x - 10) < 0.02 && std::abs(r.motion.velocity_m_s.x) < 0.02;
    });
    EXPECT_GE(held, 40) << "rows of the hold at 10 m";
}

TEST(Approach, VelocitiesAndRatesAreTheDerivativesOfThePoses) {
    const std::vector<Row> rows = read_rows();
    ASSERT_EQ(rows.size(), 601u);
    const double h = 0.1;
    for (std::size_t k = 2; k + 2 < rows.size(); ++k) {
        const auto at = [&](int d) -> const Motion& { return rows[k + static_cast<std::size_t>(d)].motion; };
        const auto x = [&](int d) { return at(d).T_world_body.t; };
        const auto turn = [&](int d) {
            return log_rotation(conjugate(at(0).T_world_body.q) * at(d).T_world_body.q);
        };
        // Five points: the error is h^4 / 30 of the fifth derivative, except where legs of the path meet.
        const Vec3 v = (8.0 * (x(1) - x(-1)) - (x(2) - x(-2))) / (12 * h);
        const Vec3 w = (8.0 * (turn(1) - turn(-1)) - (turn(2) - turn(-2))) / (12 * h);
        EXPECT_LT(norm(v - at(0).velocity_m_s), 3e-4) << "at " << rows[k].t_s << " s";
        EXPECT_LT(norm(w - at(0).rate_rad_s), 1e-5) << "at " << rows[k].t_s << " s";
    }
}

TEST(Approach, AccelerationIsContinuous) {
    const std::vector<Row> rows = read_rows();
    ASSERT_EQ(rows.size(), 601u);
    const auto accelerations = [&](std::size_t k) {
        const double h = 0.1;
        return std::pair{(rows[k + 1].motion.velocity_m_s - rows[k].motion.velocity_m_s) / h,
                         (rows[k + 1].motion.rate_rad_s - rows[k].motion.rate_rad_s) / h};
    };
    for (std::size_t k = 0; k + 2 < rows.size(); ++k) {
        const auto [a0, b0] = accelerations(k);
        const auto [a1, b1] = accelerations(k + 1);
        EXPECT_LT(norm(a1 - a0), 0.02) << "m/s^2 a step, at " << rows[k].t_s << " s";
        EXPECT_LT(norm(b1 - b0), 3e-4) << "rad/s^2 a step, at " << rows[k].t_s << " s";
        EXPECT_LT(norm(a0), 0.6);
    }
}

struct Box {
    Vec3 low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
    void add(const Vec3& p) {
        for (int i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    }
    [[nodiscard]] bool meets(const Box& b) const {
        for (int i = 0; i < 3; ++i)
            if (low[i] > b.high[i] || b.low[i] > high[i]) return false;
        return true;
    }
};
using Corners = std::array<Vec3, 3>;
Box box_of(const Corners& t) {
    Box box;
    for (const Vec3& p : t) box.add(p);
    return box;
}
/// Does the segment from p to q pass through the triangle? (Möller and Trumbore 1997)
bool pierces(const Vec3& p, const Vec3& q, const Corners& t) {
    const Vec3 d = q - p, e1 = t[1] - t[0], e2 = t[2] - t[0], h = cross(d, e2);
    const double det = dot(e1, h);
    if (std::abs(det) < 1e-15) return false;
    const Vec3 s = p - t[0], r = cross(s, e1);
    const double u = dot(s, h) / det, v = dot(d, r) / det, f = dot(e2, r) / det;
    return u >= 0 && v >= 0 && u + v <= 1 && f >= 0 && f <= 1;
}
bool intersect(const Corners& a, const Corners& b) {
    for (std::size_t i = 0; i < 3; ++i)
        if (pierces(a[i], a[(i + 1) % 3], b) || pierces(b[i], b[(i + 1) % 3], a)) return true;
    return false;
}
std::vector<Corners> triangles(const Mesh& mesh, const Rigid3& T) {
    std::vector<Corners> out;
    for (const auto& f : mesh.faces)
        out.push_back({T * vec_cast<double>(mesh.positions[f[0]]), T * vec_cast<double>(mesh.positions[f[1]]),
                       T * vec_cast<double>(mesh.positions[f[2]])});
    return out;
}

/// Triangles of the two meshes that cut each other.
std::size_t collisions(const Mesh& station, const Mesh& chaser, const Rigid3& T_station_chaser) {
    Box chaser_box;
    const std::vector<Corners> ours = triangles(chaser, T_station_chaser);
    for (const Corners& t : ours)
        for (const Vec3& p : t) chaser_box.add(p);
    std::vector<Corners> near;
    Box station_box;
    for (const Corners& t : triangles(station, {}))
        if (box_of(t).meets(chaser_box)) {
            near.push_back(t);
            for (const Vec3& p : t) station_box.add(p);
        }
    std::size_t count = 0;
    for (const Corners& a : ours)
        if (const Box box = box_of(a); box.meets(station_box))
            for (const Corners& b : near)
                if (box.meets(box_of(b)) && intersect(a, b)) ++count;
    return count;
}

TEST(Approach, ChaserTouchesNothingBeforeContact) {
    const Result<Scene> scene = read_scene((kScene / "docking.toml").string());
    ASSERT_TRUE(scene.has_value()) << scene.error().text();
    const Mesh& station = scene->meshes[static_cast<std::size_t>(std::get<int>(scene->bodies[0].shape))];
    const Mesh& chaser = scene->meshes[static_cast<std::size_t>(std::get<int>(scene->bodies[1].shape))];

    Rigid3 deep{{0, 0, 0, 1}, {-0.05, 0, 0}};
    EXPECT_GT(collisions(station, chaser, deep), 0u) << "5 cm past contact the rings must cut each other";
    for (const Row& row : read_rows()) {
        if (row.t_s > 59.95) break;  // contact
        const int tenths = static_cast<int>(std::lround(row.t_s * 10));
        if (tenths % (row.t_s < 50 ? 50 : 10) != 0 && tenths != 599) continue;
        EXPECT_EQ(collisions(station, chaser, row.motion.T_world_body), 0u) << "at " << row.t_s << " s";
    }
}

}  // namespace
}  // namespace narpa
