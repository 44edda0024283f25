// Beams without return: a pose whose model has surfaces where they pass is refused; lost returns, mirrors and black
// surfaces do not refuse a pose that is right.
#include "estimator/cloud/empty_beams.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <random>

#include "estimator/cloud/cloud_icp.h"
#include "protocols/lidar/velodyne.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

constexpr CertainReturn kWithin50m{0, 50, 0};

/// A box with a fin, of grey material 0; its end towards +z is of material 1 and may be longer.
Scene tug(double end_m, const Material& end) {
    Scene s;
    s.materials = {test::lambert(0.3F), end};
    Mesh m = test::box(2, 1.4, 2);
    const auto append = [&](const Mesh& part, const Vec3& at, int material) {
        const auto first = static_cast<std::uint32_t>(m.positions.size());
        for (const Vec3f& p : part.positions) m.positions.push_back(vec_cast<float>(vec_cast<double>(p) + at));
        for (const auto& f : part.faces) m.faces.push_back({first + f[0], first + f[1], first + f[2]});
        m.face_material.resize(m.faces.size(), static_cast<std::uint16_t>(material));
    };
    append(test::box(0.4, 1, 1), {1.2, 0, -0.3}, 0);
    if (end_m > 0) append(test::box(2, 1.4, end_m), {0, 0, 1 + 0.5 * end_m}, 1);
    test::add_mesh(s, std::move(m));
    return s;
}

struct Target {
    Scene scene;
    Tracer tracer;
    explicit Target(Scene s) : scene(std::move(s)), tracer(*Tracer::create(scene, 1)) {}
};

/// From the side and a little below, so that the end towards +z is out of sight.
const Rigid3 kPose{normalized(exp_rotation({-0.5, 0, 0}) * exp_rotation({0, 0, 2.2})), {0.3, 14, 0.2}};
const ApparentMotion kMotion{{0.05, -0.1, 0.02}, {0.01, -0.02, 0.015}};

/// 41 x 31 beams, 0.6 degrees apart; `lost`: share of the returns that are lost by chance.
LidarSweep look_at(const Target& target, std::mt19937_64& random, double lost = 0) {
    std::normal_distribution<double> noise(0, 0.02);
    std::uniform_real_distribution<double> chance(0, 1);
    LidarSweep out;
    BodyPoses at(1);
    for (int line = -15; line <= 15; ++line)
        for (int column = -20; column <= 20; ++column) {
            const double a = 0.6 * kRadPerDeg * column, w = 0.6 * kRadPerDeg * line, t_s = 1e-3 * column;
            const Vec3 beam{std::cos(w) * std::sin(a), std::cos(w) * std::cos(a), std::sin(w)};
            at.set(0, moved(kPose, kMotion, t_s));
            const Hit hit = target.tracer.intersect(at, {{}, beam}, 200);
            const bool mirror =
                hit.body >= 0 && target.scene.materials[std::size_t(hit.material)].kind == &kinds::mirror;
            if (hit.body < 0 || mirror || chance(random) < lost)
                out.empty.push_back({{}, beam, t_s});
            else
                out.points.push_back({{}, beam, hit.range_m + noise(random), t_s});
        }
    return out;
}

CloudEstimate align(const Target& model, const LidarSweep& sweep, bool with_empty,
                    const CertainReturn& certain = kWithin50m) {
    CloudIcp icp(model.tracer, 0, {.noise = {0.02, 5e-5}, .certain = certain});
    const Rigid3 start{normalized(exp_rotation({0.03, 0, -0.02}) * kPose.q), kPose.t + Vec3{0.1, -0.2, 0.1}};
    auto e = icp.align(sweep.points, kMotion, start, 0.5,
                       with_empty ? std::span(sweep.empty) : std::span<const EmptyBeam>{});
    EXPECT_TRUE(e) << e.error().text();
    return *e;
}

double nees(const CloudEstimate& e) {
    return normalised_error_squared(error_between(e.T_lidar_target, kPose), e.covariance);
}

/// All points lie on the model, which goes on where the target ends.
TEST(EmptyBeams, AModelWithExtraSurfacesIsRefused) {
    std::mt19937_64 random(1);
    const Target target(tug(0, {})), model(tug(2, test::lambert(0.3F)));
    const LidarSweep sweep = look_at(target, random);
    const CloudEstimate blind = align(model, sweep, false), seeing = align(model, sweep, true);
    EXPECT_TRUE(blind.answer.usable()) << blind.answer.why;
    EXPECT_EQ(blind.empty_beams.empty, 0u);
    EXPECT_EQ(seeing.answer.kind, AnswerKind::refused);
    EXPECT_NE(seeing.answer.why.find("beams without return pass through the model"), std::string::npos)
        << seeing.answer.why;
    EXPECT_GT(seeing.empty_beams.empty, 50u);
    EXPECT_LT(seeing.empty_beams.chance, 1e-20);
}

TEST(EmptyBeams, CorrectPosesAreNotRefused) {
    std::mt19937_64 random(2);
    const Target target(tug(2, test::lambert(0.3F)));
    for (const double lost : {0.0, 0.02, 0.3, 0.8}) {
        const CloudEstimate e = align(target, look_at(target, random, lost), true);
        EXPECT_TRUE(e.answer.usable()) << lost << ": " << e.answer.why;
        EXPECT_LT(nees(e), 30) << lost;
        EXPECT_EQ(e.empty_beams.empty > 0, lost > 0) << lost;
        EXPECT_GT(e.empty_beams.chance, 1e-3) << lost;
    }
}

/// A mirror sends nothing back, and a black end too little for this LiDAR; the model says so.
TEST(EmptyBeams, SurfacesWithUncertainReturnRefuseNothing) {
    std::mt19937_64 random(3);
    Material mirror;
    mirror.kind = &kinds::mirror;
    mirror.specular = {0.9F, 0.9F, 0.9F};
    const Target mirrored(tug(2, mirror));
    const LidarSweep sweep = look_at(mirrored, random);
    const CloudEstimate e = align(mirrored, sweep, true);
    EXPECT_TRUE(e.answer.usable()) << e.answer.why;
    EXPECT_EQ(e.empty_beams.empty, 0u);
    const Target black(tug(2, test::lambert(0.01F)));
    const CertainReturn limited{0, 50, 0.05 / (14 * 14)};
    EXPECT_TRUE(align(black, sweep, true, limited).answer.usable());
    EXPECT_EQ(align(black, sweep, true).answer.kind, AnswerKind::refused) << "without a limit";
    EXPECT_TRUE(align(black, sweep, true, {0, 10, 0}).answer.usable()) << "beyond the range";
}

/// Where the pose is not held, its outline is not either.
TEST(EmptyBeams, BeamsBesideAnUncertainOutlineAreNotCounted) {
    std::mt19937_64 random(4);
    const Target target(tug(0, {})), model(tug(2, test::lambert(0.3F)));
    const LidarSweep sweep = look_at(target, random);
    EmptyBeams beams(model.tracer, 0, {0.02, 5e-5}, kWithin50m);
    beams.take(sweep.points, sweep.empty, kMotion);
    const Matrix6 sure = 1e-6 * Matrix6::Identity(), unsure = 0.04 * Matrix6::Identity();
    EXPECT_TRUE(beams.count(kPose, sure).refutes());
    EXPECT_EQ(beams.count(kPose, unsure).empty, 0u);
    EXPECT_EQ(beams.count({kPose.q, -kPose.t}, sure).empty, 0u) << "behind the LiDAR";
}

TEST(EmptyBeams, ProbabilityIsThatOfEnumeratedOrders) {
    for (const unsigned n : {1u, 3u, 8u, 14u})
        for (unsigned empty = 0; empty <= n; ++empty) {
            std::vector<double> orders(n + 2);
            double all = 0;
            for (unsigned bits = 0; bits < 1u << n; ++bits) {
                if (static_cast<unsigned>(std::popcount(bits)) != empty) continue;
                ++orders[static_cast<std::size_t>(std::popcount(bits & ~(bits << 1)))];
                ++all;
            }
            double fewer = 0;
            for (unsigned stretches = 0; stretches <= n; ++stretches) {
                fewer += orders[stretches];
                if (empty > 0)
                    EXPECT_NEAR(chance_of_stretches(empty, n - empty, stretches), fewer / all, 1e-12);
                else
                    EXPECT_EQ(chance_of_stretches(0, n, stretches), 1);
            }
        }
    EXPECT_LT(chance_of_stretches(1000, 2000, 10), 1e-200) << "and no overflow";
}

TEST(EmptyBeams, AllocateNothingAfterTheFirstSweep) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer's heap is not counted";
    std::mt19937_64 random(5);
    const Target target(tug(2, test::lambert(0.3F)));
    const LidarSweep sweep = look_at(target, random, 0.3);
    CloudIcp icp(target.tracer, 0, {.noise = {0.02, 5e-5}, .certain = kWithin50m});
    const auto first = icp.align(sweep.points, kMotion, kPose, 0.3, sweep.empty);
    const test::AllocationCounter heap;
    const auto again = icp.align(sweep.points, kMotion, kPose, 0.3, sweep.empty);
    EXPECT_EQ(heap.on_this_thread(), 0u);
    ASSERT_TRUE(first && again);
    EXPECT_GT(first->empty_beams.empty, 50u);
    EXPECT_EQ(first->empty_beams.chance, again->empty_beams.chance);
}

TEST(EmptyBeams, InvalidBeamsAreReported) {
    std::mt19937_64 random(6);
    const Target target(tug(0, {}));
    LidarSweep sweep = look_at(target, random);
    CloudIcp icp(target.tracer, 0);
    sweep.empty[7].direction = {0, 1.1, 0};
    const auto e = icp.align(sweep.points, {}, kPose, 0, sweep.empty);
    ASSERT_FALSE(e);
    EXPECT_NE(e.error().text().find("beam without return 7 of the sweep: expected a direction of length 1"),
              std::string::npos)
        << e.error().text();
}

TEST(EmptyBeams, ReturnsAreCertainWhereTheLidarSaysSo) {
    Lidar lidar;
    lidar.range_max_m = 100;
    const double unstated = certain_return_of(lidar, {}).min_light_1_m2;
    EXPECT_NEAR(unstated, 3 * 0.1 / (50.0 * 50), 1e-12);
    lidar.receiver.range_at_10_percent_m = 100;
    EXPECT_NEAR(certain_return_of(lidar, {}).min_light_1_m2, unstated / 4, 1e-12);
    lidar.receiver.detection_snr = 4, lidar.receiver.sunlight_noise = 3, lidar.receiver.range_min_m = 0.5;
    const CertainReturn noisy = certain_return_of(lidar, {});
    EXPECT_NEAR(noisy.min_light_1_m2, unstated, 1e-12) << "twice the limit and twice the noise";
    EXPECT_EQ(noisy.nearest_m, 0.5);
    EXPECT_EQ(noisy.farthest_m, 100);
    Scene dusty;
    dusty.atmosphere.emplace();
    EXPECT_EQ(certain_return_of(lidar, dusty).farthest_m, 0);
}

/// A packet of every second shot without return, as read: all shots are there, each once.
TEST(SweepReader, KeepsBeamsWithoutReturn) {
    for (const LidarReturns returns : {LidarReturns::strongest, LidarReturns::dual}) {
        const auto unit = vlp16().configure({.rate_hz = 10, .returns = returns});
        std::vector<LidarEchoes> echoes(unit->spec().shots_per_packet);
        for (std::size_t i = 0; i < echoes.size(); i += 2)
            echoes[i] = {.strongest = {12, 0.5F}, .second = {}, .last = {12, 0.5F}};
        std::vector<std::uint8_t> bytes(unit->spec().data_packet_bytes);
        unit->encode(5, 0, echoes, bytes);
        std::vector<LidarShot> shots(echoes.size());
        unit->shots(5, shots);
        SweepReader reader(*unit);
        LidarSweep sweep;
        reader.append(bytes, 1'000'000, sweep);
        ASSERT_EQ(sweep.points.size(), echoes.size() / 2);
        ASSERT_EQ(sweep.empty.size(), echoes.size() / 2);
        for (std::size_t k = 0; k < sweep.empty.size(); ++k) {
            const LidarShot& fired = shots[2 * k + 1];
            EXPECT_GT(dot(sweep.empty[k].direction, fired.direction), std::cos(3e-4));
            EXPECT_EQ(sweep.empty[k].origin_m, fired.origin_m);
            EXPECT_NEAR(sweep.empty[k].t_s, 1e-3 + 1e-9 * static_cast<double>(fired.t_offset_ns), 1e-12);
        }
        bytes.pop_back();
        reader.append(bytes, 0, sweep);
        EXPECT_EQ(sweep.empty.size(), echoes.size() / 2) << "no packet";
    }
}

}  // namespace
}  // namespace narpa
