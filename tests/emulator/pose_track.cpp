// Poses between, at and beyond commands; and what a track refuses.
#include "emulator/pose_track.h"

#include <gtest/gtest.h>

#include <thread>

#include "base/constants.h"

namespace narpa {
namespace {

constexpr std::int64_t kMs = 1'000'000, kSecond = 1'000 * kMs;

PoseCommand command(std::int64_t t_ns, const Motion& m, std::uint8_t counter = 0) {
    return {counter, t_ns, m};
}

/// A body that moves and turns at constant rates.
Motion drifting(double t_s) {
    const Motion start{
        {normalized(Quat{0.9, 0.1, -0.3, 0.2}), {10, -20, 30}}, {0.5, -0.25, 0.125}, {0.02, -0.01, 0.03}};
    return extrapolate(start, t_s);
}

TEST(PoseTrack, IsTheScenesOwnMotionBeforeTheFirstCommand) {
    const PoseTrack track({{{}, {1, 2, 3}}, {1, 0, 0}, {}}, 0.5);
    const TrackedPose p = track.at(2 * kSecond);
    EXPECT_FALSE(p.commanded);
    EXPECT_TRUE(p.stale);
    EXPECT_EQ(p.motion.T_world_body.t, (Vec3{3, 2, 3}));
}

TEST(PoseTrack, IsExactlyTheCommandAtItsTime) {
    PoseTrack track({}, 0.5);
    for (int i = 0; i < 5; ++i)
        ASSERT_EQ(track.push(command(i * 100 * kMs, drifting(0.1 * i), static_cast<std::uint8_t>(i)), 0),
                  TrackStatus::taken);
    for (int i = 0; i < 5; ++i) {
        const TrackedPose p = track.at(i * 100 * kMs);
        EXPECT_EQ(p.motion.T_world_body, drifting(0.1 * i).T_world_body) << i;
        EXPECT_EQ(p.counter, i);
        EXPECT_FALSE(p.stale);
    }
}

TEST(PoseTrack, FollowsConstantRatesBetweenAndBeyondCommands) {
    PoseTrack track({}, 0.5);
    for (int i = 0; i < 5; ++i)
        ASSERT_EQ(track.push(command(i * 100 * kMs, drifting(0.1 * i)), 0), TrackStatus::taken);
    for (std::int64_t t = 0; t <= 900 * kMs; t += 7 * kMs) {
        const Motion truth = drifting(static_cast<double>(t) * 1e-9);
        const TrackedPose p = track.at(t);
        EXPECT_LT(norm(p.motion.T_world_body.t - truth.T_world_body.t), 1e-12) << t;
        EXPECT_LT(angle_between(p.motion.T_world_body.q, truth.T_world_body.q), 1e-12) << t;
        EXPECT_LT(norm(p.motion.velocity_m_s - truth.velocity_m_s), 1e-11) << t;
        EXPECT_LT(norm(p.motion.rate_rad_s - truth.rate_rad_s), 1e-11) << t;
        EXPECT_FALSE(p.stale);
    }
}

TEST(PoseTrack, FollowsRatesOfManyTurnsBetweenCommands) {
    const Vec3 axis = Vec3{2, -1, 2} / 3;
    for (const double rate : {-40.0, -7.0, -3.2, 0.5, 3.1, 3.2, 2 * kPi, 9.0, 100.0}) {
        Motion start{{normalized(Quat{0.9, 0.1, -0.3, 0.2}), {}}, {}, rate * axis};
        PoseTrack track({}, 0.5);
        ASSERT_EQ(track.push(command(0, start), 0), TrackStatus::taken);
        ASSERT_EQ(track.push(command(kSecond, extrapolate(start, 1)), 0), TrackStatus::taken);
        for (std::int64_t t = 0; t <= kSecond; t += 13 * kMs) {
            const Motion truth = extrapolate(start, static_cast<double>(t) * 1e-9), m = track.at(t).motion;
            EXPECT_LT(angle_between(m.T_world_body.q, truth.T_world_body.q), 1e-9) << rate << " rad/s, " << t;
            EXPECT_LT(norm(m.rate_rad_s - truth.rate_rad_s), 1e-9) << rate << " rad/s, " << t;
        }
    }
}

TEST(PoseTrack, GoesByTheShortestArcWhereRatesAreOfLessThanHalfATurn) {
    for (const double rate : {0.0, 1.0, -3.0}) {
        PoseTrack track({}, 0.5);
        const Motion start{{{}, {}}, {}, {0, 0, rate}}, end{{exp_rotation({0, 0, 3}), {}}, {}, {0, 0, rate}};
        ASSERT_EQ(track.push(command(0, start), 0), TrackStatus::taken);
        ASSERT_EQ(track.push(command(kSecond, end), 0), TrackStatus::taken);
        EXPECT_NEAR(track.at(kSecond / 2).motion.rate_rad_s.z, 3, 1e-12);
    }
}

TEST(PoseTrack, CubicMotionIsExactBetweenCommands) {
    const auto cubic = [](double t) {
        return Motion{{{}, {1 + 2 * t - 3 * t * t + 0.5 * t * t * t, 0, 0}}, {2 - 6 * t + 1.5 * t * t, 0, 0}, {}};
    };
    PoseTrack track({}, 0.5);
    for (int i = 0; i < 4; ++i) ASSERT_EQ(track.push(command(i * kSecond, cubic(i)), 0), TrackStatus::taken);
    for (double t = 0; t < 3; t += 0.11) {
        const Motion m = track.at(std::llround(t * 1e9)).motion;
        EXPECT_NEAR(m.T_world_body.t.x, cubic(t).T_world_body.t.x, 1e-8);
        EXPECT_NEAR(m.velocity_m_s.x, cubic(t).velocity_m_s.x, 1e-7);
    }
}

TEST(PoseTrack, CommandsWithoutVelocitiesGiveStraightLines) {
    PoseTrack track({}, 0.5);
    ASSERT_EQ(track.push(command(0, {{{}, {0, 0, 0}}, {}, {}}), 0), TrackStatus::taken);
    ASSERT_EQ(track.push(command(kSecond, {{{}, {4, 0, 0}}, {}, {}}), 0), TrackStatus::taken);
    EXPECT_DOUBLE_EQ(track.at(250 * kMs).motion.T_world_body.t.x, 1.0);
}

TEST(PoseTrack, HoldsAndIsStaleBeyondTheLimit) {
    PoseTrack track({}, 0.5);
    ASSERT_EQ(track.push(command(0, {{{}, {0, 0, 0}}, {2, 0, 0}, {}}), 0), TrackStatus::taken);
    EXPECT_DOUBLE_EQ(track.at(500 * kMs).motion.T_world_body.t.x, 1.0);
    EXPECT_FALSE(track.at(500 * kMs).stale);
    const TrackedPose late = track.at(60 * kSecond);
    EXPECT_EQ(late.motion.T_world_body.t, track.at(500 * kMs).motion.T_world_body.t);
    EXPECT_EQ(late.motion.velocity_m_s, Vec3{});
    EXPECT_TRUE(late.stale);
    EXPECT_TRUE(track.at(-60 * kSecond).stale);
}

TEST(PoseTrack, QuaternionsOfBothSignsAreOneAttitude) {
    PoseTrack a({}, 0.5), b({}, 0.5);
    for (int i = 0; i < 6; ++i) {
        Motion m = drifting(0.1 * i);
        ASSERT_EQ(a.push(command(i * 100 * kMs, m), 0), TrackStatus::taken);
        if (i % 2) m.T_world_body.q = -m.T_world_body.q;
        ASSERT_EQ(b.push(command(i * 100 * kMs, m), 0), TrackStatus::taken);
    }
    for (std::int64_t t = 0; t < 600 * kMs; t += 13 * kMs)
        EXPECT_LT(angle_between(a.at(t).motion.T_world_body.q, b.at(t).motion.T_world_body.q), 1e-15) << t;
}

TEST(PoseTrack, RefusesWhatIsNotNewer) {
    PoseTrack track({}, 0.5);
    ASSERT_EQ(track.push(command(kSecond, {}), 0), TrackStatus::taken);
    EXPECT_EQ(track.push(command(kSecond, {}), 0), TrackStatus::past);
    EXPECT_EQ(track.push(command(kSecond - 1, {}), 0), TrackStatus::past);
    EXPECT_EQ(track.push(command(kSecond + 1, {}), 0), TrackStatus::taken);
}

TEST(PoseTrack, RefusesToForgetWhatIsStillInUse) {
    PoseTrack track({}, 0.5);
    std::size_t taken = 0;
    while (track.push(command(static_cast<std::int64_t>(taken) * kMs, {}), 0) == TrackStatus::taken) ++taken;
    EXPECT_EQ(taken, PoseTrack::kDepth - 1);
    EXPECT_EQ(track.push(command(10 * kSecond, {}), 0), TrackStatus::overrun);
    EXPECT_EQ(track.push(command(10 * kSecond, {}), 5 * kSecond), TrackStatus::taken);  // the clock has moved on
}

TEST(PoseTrack, KeepsUpWithAThousandCommandsASecond) {
    PoseTrack track({}, 0.5);
    for (std::int64_t i = 0; i < 5000; ++i) {
        const std::int64_t t_now_ns = (i - 256) * kMs;
        ASSERT_EQ(track.push(command(i * kMs, drifting(0.001 * static_cast<double>(i))), t_now_ns),
                  TrackStatus::taken)
            << i;
    }
    const std::int64_t t_now_ns = (4999 - 256) * kMs;
    for (std::int64_t t = t_now_ns - kSecond; t < 5 * kSecond; t += kMs / 4) {
        const TrackedPose p = track.at(t);
        EXPECT_EQ(p.t_pose_ns, t / kMs * kMs);
        EXPECT_LT(norm(p.motion.T_world_body.t - drifting(static_cast<double>(t) * 1e-9).T_world_body.t), 1e-11);
        EXPECT_FALSE(p.stale);
    }
}

TEST(PoseTrack, ReadersNeverSeeHalfACommand) {
    // Position and velocity of every command are equal whole numbers, so a torn sample would show: a mixture of two
    // that are kDepth commands apart. A reader that was held up meets a neighbour instead, carried on for at most
    // 0.2 ms.
    PoseTrack track({}, 1e9);
    ASSERT_EQ(track.push(command(1, {{{}, {1, 1, 1}}, {1, 1, 1}, {}}), 1), TrackStatus::taken);
    std::atomic<bool> done{false};
    std::thread writer([&] {
        for (std::int64_t i = 2; i < 200'000; ++i) {
            const double v = static_cast<double>(i);
            (void)track.push(command(i, {{{}, {v, v, v}}, {v, v, v}, {}}), i + 10 * kSecond);
        }
        done = true;
    });
    std::uint64_t reads = 0, torn = 0;
    while (!done || reads == 0) {
        const std::int64_t t = track.newest_ns();
        const Motion m = track.at(t).motion;
        torn +=
            std::abs(m.T_world_body.t.x / m.velocity_m_s.x - 1) > 5e-4 || m.T_world_body.t.x != m.T_world_body.t.z;
        ++reads;
    }
    writer.join();
    EXPECT_EQ(torn, 0U);
}

}  // namespace
}  // namespace narpa
