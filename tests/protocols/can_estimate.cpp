// Estimated poses on CAN: both forms carry the same, and what cannot be said is said.
#include <gtest/gtest.h>

#include <limits>

#include "tests/protocols/can_support.h"

namespace narpa {
namespace {

EstimateReport random_estimate(std::mt19937_64& rng) {
    std::uniform_real_distribution<double> some(-1, 1), positive(0, 1);
    EstimateReport e;
    e.frame = static_cast<std::uint32_t>(rng());
    e.camera = static_cast<std::uint8_t>(rng() % 16);
    e.state = EstimateState::measured;
    e.t_ns = static_cast<std::int64_t>(rng() % 1'000'000'000'000);
    e.T_camera_target = {normalized(Quat{some(rng), some(rng), some(rng), some(rng)}),
                         {1e3 * some(rng), 1e3 * some(rng), 1e5 * positive(rng)}};
    e.answer = static_cast<AnswerKind>(rng() % kAnswerKinds.size());
    e.sigma_position_m = {positive(rng), positive(rng), 10 * positive(rng)};
    e.sigma_rotation_rad = {positive(rng), 1e-3 * positive(rng), 1e-6 * positive(rng)};
    return e;
}

/// Through the ten classic frames, in order.
DecodeStatus through_classic(const EstimateReport& sent, EstimateReport& out) {
    EstimateDecoder decoder;
    DecodeStatus status = DecodeStatus::not_mine;
    for (const CanFrame& frame : encode_classic(sent)) status = decoder.accept(frame, sent.t_ns, out);
    return status;
}

TEST(CanEstimate, ClassicAndFdCarryTheSameWithinAStep) {
    std::mt19937_64 rng(41);
    for (int trial = 0; trial < 500; ++trial) {
        const EstimateReport sent = random_estimate(rng);
        EstimateReport classic, fd;
        EstimateDecoder decoder;
        ASSERT_EQ(through_classic(sent, classic), DecodeStatus::complete);
        ASSERT_EQ(decoder.accept(encode_fd(sent), sent.t_ns, fd), DecodeStatus::complete);
        EXPECT_EQ(classic.T_camera_target, fd.T_camera_target);
        EXPECT_EQ(classic.sigma_position_m, fd.sigma_position_m);
        EXPECT_EQ(classic.sigma_rotation_rad, fd.sigma_rotation_rad);
        EXPECT_EQ(fd.frame, sent.frame);
        EXPECT_EQ(fd.camera, sent.camera);
        EXPECT_EQ(fd.state, sent.state);
        EXPECT_EQ(fd.answer, sent.answer);
        EXPECT_EQ(fd.t_ns, sent.t_ns);
        EXPECT_LT(norm(fd.T_camera_target.t - sent.T_camera_target.t), 1e-6);
        EXPECT_LT(angle_between(fd.T_camera_target.q, sent.T_camera_target.q), 1e-6);
        EXPECT_LT(norm(fd.sigma_position_m - sent.sigma_position_m), 1e-6);
        EXPECT_LT(norm(fd.sigma_rotation_rad - sent.sigma_rotation_rad), 1e-7);
    }
}

TEST(CanEstimate, DeviationsSaturate) {
    std::mt19937_64 rng(42);
    EstimateReport sent = random_estimate(rng), out;
    sent.sigma_position_m = {1e9, std::numeric_limits<double>::quiet_NaN(), -1};
    sent.sigma_rotation_rad = {std::numeric_limits<double>::infinity(), 2, 0};
    ASSERT_EQ(through_classic(sent, out), DecodeStatus::complete);
    EXPECT_EQ(out.sigma_position_m, (Vec3{16.777215, 16.777215, 0}));
    EXPECT_EQ(out.sigma_rotation_rad, (Vec3{1.6777215, 1.6777215, 0}));
}

TEST(CanEstimate, LostHasNoPose) {
    std::mt19937_64 rng(43);
    EstimateReport sent = random_estimate(rng);
    sent.state = EstimateState::lost;
    EstimateReport out;
    out.T_camera_target.t = {7, 7, 7};
    ASSERT_EQ(through_classic(sent, out), DecodeStatus::complete);
    EXPECT_EQ(out.state, EstimateState::lost);
    EXPECT_EQ(out.frame, sent.frame);
    EXPECT_EQ(out.T_camera_target.t, (Vec3{7, 7, 7})) << "there is no pose to write";
    sent.state = EstimateState::predicted;
    sent.T_camera_target.t.z = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(through_classic(sent, out), DecodeStatus::not_a_number);
}

}  // namespace
}  // namespace narpa
