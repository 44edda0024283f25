// Messages between dynamics and navigation on CAN: both forms carry the same, and invalid ones are refused.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "base/constants.h"
#include "base/time.h"
#include "protocols/can/crc.h"
#include "protocols/can/messages.h"

namespace narpa {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

class Random {
public:
    explicit Random(std::uint64_t seed) : rng_(seed) {}
    double between(double a, double b) { return std::uniform_real_distribution<double>(a, b)(rng_); }
    Vec3 vector(double reach) { return {between(-reach, reach), between(-reach, reach), between(-reach, reach)}; }
    Quat rotation() { return exp_rotation(vector(1.7)); }
    std::uint64_t below(std::uint64_t limit) { return rng_() % limit; }
    std::int64_t time_ns() { return static_cast<std::int64_t>(below(100'000'000'000'000'000)); }

    void fill(ActuatorCommand& c) {
        c.counter = static_cast<std::uint8_t>(below(256));
        c.t_ns = time_ns();
        c.impulse_n_s = vector(8000);
        c.angular_impulse_n_m_s = vector(80);
        c.phase = static_cast<GuidancePhase>(below(kGuidancePhases.size()));
        c.leg = static_cast<std::uint8_t>(below(256));
        c.abort = static_cast<AbortReason>(below(kAbortReasons.size()));
    }
    void fill(NavigationEstimate& e) {
        e.cycle = static_cast<std::uint32_t>(below(1ull << 32));
        e.t_ns = time_ns();
        e.T_chaser_target = {rotation(), vector(1e5)};
        e.sigma_position_m = {between(0, 16), between(0, 1), between(0, 1e-3)};
        e.sigma_rotation_rad = {between(0, 1.6), between(0, 1e-2), between(0, 1e-5)};
        e.frames = static_cast<std::uint8_t>(below(256));
        e.sweeps = static_cast<std::uint8_t>(below(256));
    }
    void fill(AttitudeReport& r) {
        r.counter = static_cast<std::uint8_t>(below(256));
        r.t_ns = time_ns();
        r.q_world_chaser = rotation();
        r.rate_rad_s = vector(8);
    }
    void fill(DynamicsReport& r) {
        r.counter = static_cast<std::uint8_t>(below(256));
        r.t_ns = time_ns();
        r.t_start_ns = r.t_ns - static_cast<std::int64_t>(below(3600) * kSecond_ns);
        r.phase = static_cast<DynamicsPhase>(below(kDynamicsPhases.size()));
    }

private:
    std::mt19937_64 rng_;
};

template <class Message>
Message random_message(Random& random) {
    Message m;
    random.fill(m);
    return m;
}

double error(const Vec3& a, const Vec3& b) {
    const Vec3 d = a - b;
    return std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
}

constexpr double kAttitudeError_rad = 2e-6;  ///< of steps of 2^-22 in each of four components

void expect_near(const ActuatorCommand& a, const ActuatorCommand& b) {
    EXPECT_EQ(a.counter, b.counter);
    EXPECT_EQ(a.t_ns, b.t_ns);
    EXPECT_LE(error(a.impulse_n_s, b.impulse_n_s), 0.501e-3);
    EXPECT_LE(error(a.angular_impulse_n_m_s, b.angular_impulse_n_m_s), 0.501e-3);
    EXPECT_EQ(a.phase, b.phase);
    EXPECT_EQ(a.leg, b.leg);
    EXPECT_EQ(a.abort, b.abort);
}
void expect_near(const NavigationEstimate& a, const NavigationEstimate& b) {
    EXPECT_EQ(a.cycle, b.cycle);
    EXPECT_EQ(a.t_ns, b.t_ns);
    EXPECT_LE(error(a.T_chaser_target.t, b.T_chaser_target.t), 0.501e-6);
    EXPECT_LE(angle_between(a.T_chaser_target.q, b.T_chaser_target.q), kAttitudeError_rad);
    EXPECT_LE(error(a.sigma_position_m, b.sigma_position_m), 0.501e-6);
    EXPECT_LE(error(a.sigma_rotation_rad, b.sigma_rotation_rad), 0.501e-7);
    EXPECT_EQ(a.frames, b.frames);
    EXPECT_EQ(a.sweeps, b.sweeps);
}
void expect_near(const AttitudeReport& a, const AttitudeReport& b) {
    EXPECT_EQ(a.counter, b.counter);
    EXPECT_EQ(a.t_ns, b.t_ns);
    EXPECT_LE(angle_between(a.q_world_chaser, b.q_world_chaser), kAttitudeError_rad);
    EXPECT_LE(error(a.rate_rad_s, b.rate_rad_s), 0.501e-6);
}
void expect_near(const DynamicsReport& a, const DynamicsReport& b) {
    EXPECT_EQ(a.counter, b.counter);
    EXPECT_EQ(a.t_ns, b.t_ns);
    EXPECT_EQ(a.t_start_ns, b.t_start_ns);
    EXPECT_EQ(a.phase, b.phase);
}

template <class Message>
std::vector<CanFrame> classic(const Message& m) {
    const auto frames = encode_classic(m);
    return {frames.begin(), frames.end()};
}

template <class Message>
DecodeStatus accept_all(MessageDecoder<Message>& decoder, const std::vector<CanFrame>& frames, std::int64_t t_ns,
                        Message& out) {
    DecodeStatus status = DecodeStatus::not_mine;
    for (const CanFrame& f : frames) status = decoder.accept(f, t_ns, out);
    return status;
}
template <class Message>
DecodeStatus through(const std::vector<CanFrame>& frames, std::int64_t t_ns, Message& out) {
    MessageDecoder<Message> decoder;
    return accept_all(decoder, frames, t_ns, out);
}

/// A frame as its sender would have closed it after changing its payload.
CanFrame resealed(CanFrame f) {
    const std::array<std::uint8_t, 2> id{static_cast<std::uint8_t>(f.id & 0xFF),
                                         static_cast<std::uint8_t>(f.id >> 8)};
    f.data[7] = crc8_j1850(std::span(f.data).first(7), crc8_j1850(id));
    return f;
}

template <class Message>
class CanClosedLoop : public ::testing::Test {};
struct Names {
    template <class Message>
    static std::string GetName(int i) {
        return std::array{"Actuator", "Navigation", "Attitude", "Dynamics"}[static_cast<std::size_t>(i)];
    }
};
using Messages = ::testing::Types<ActuatorCommand, NavigationEstimate, AttitudeReport, DynamicsReport>;
TYPED_TEST_SUITE(CanClosedLoop, Messages, Names);

TYPED_TEST(CanClosedLoop, ComesBackWithinHalfAStepAndBothFormsAgree) {
    Random random(61);
    for (int trial = 0; trial < 300; ++trial) {
        const auto sent = random_message<TypeParam>(random);
        TypeParam classically, fd;
        const std::int64_t t_reference_ns = sent.t_ns + kSecond_ns * static_cast<std::int64_t>(random.below(3600));
        ASSERT_EQ(through(classic(sent), t_reference_ns, classically), DecodeStatus::complete);
        ASSERT_EQ(through({encode_fd(sent)}, t_reference_ns, fd), DecodeStatus::complete);
        expect_near(classically, sent);
        // What was read is a whole number of steps: both forms agree when they write the same again.
        EXPECT_EQ(encode_fd(classically).data, encode_fd(fd).data);
    }
}

TYPED_TEST(CanClosedLoop, PartsComeInAnyOrderAndMayComeTwice) {
    Random random(62);
    const auto sent = random_message<TypeParam>(random);
    std::vector<CanFrame> frames = classic(sent);
    std::ranges::reverse(frames);
    MessageDecoder<TypeParam> decoder;
    TypeParam out;
    for (const CanFrame& f : frames) {
        EXPECT_EQ(decoder.accept(f, sent.t_ns, out),
                  &f == &frames.back() ? DecodeStatus::complete : DecodeStatus::partial);
        EXPECT_EQ(decoder.accept(f, sent.t_ns, out), DecodeStatus::duplicate);
    }
    EXPECT_EQ(decoder.accept(encode_fd(sent), sent.t_ns, out), DecodeStatus::duplicate);
    expect_near(out, sent);
}

TYPED_TEST(CanClosedLoop, ALostFrameCostsItsSetAndNothingElse) {
    Random random(63);
    MessageDecoder<TypeParam> decoder;
    TypeParam first = random_message<TypeParam>(random), second = random_message<TypeParam>(random), out;
    for (std::size_t lost = 0; lost < classic(first).size(); ++lost) {
        random.fill(first);
        random.fill(second);
        std::vector<CanFrame> frames = classic(first);
        frames.erase(frames.begin() + static_cast<std::ptrdiff_t>(lost));
        EXPECT_EQ(accept_all(decoder, frames, first.t_ns, out), DecodeStatus::partial);
        ASSERT_EQ(accept_all(decoder, classic(second), second.t_ns, out), DecodeStatus::complete);
        expect_near(out, second);
    }
    EXPECT_EQ(decoder.count(DecodeStatus::incomplete_set), classic(first).size());
}

TYPED_TEST(CanClosedLoop, EveryFlippedBitIsFoundAndWhatIsWrongIsNamed) {
    Random random(64);
    const auto sent = random_message<TypeParam>(random);
    std::vector<CanFrame> frames = classic(sent);
    frames.push_back(encode_fd(sent));
    MessageDecoder<TypeParam> decoder;
    TypeParam out;
    for (const CanFrame& good : frames) {
        for (std::size_t bit = 0; bit < 8u * good.size; ++bit) {
            CanFrame bad = good;
            bad.data[bit / 8] ^= static_cast<std::uint8_t>(1u << bit % 8);
            EXPECT_EQ(decoder.accept(bad, sent.t_ns, out), DecodeStatus::bad_checksum) << bit;
        }
        CanFrame bad = good;
        bad.fd = !bad.fd;
        EXPECT_EQ(decoder.accept(bad, sent.t_ns, out), DecodeStatus::wrong_kind);
        bad = good;
        bad.remote = true;
        EXPECT_EQ(decoder.accept(bad, sent.t_ns, out), DecodeStatus::wrong_kind);
        bad = good;
        --bad.size;
        EXPECT_EQ(decoder.accept(bad, sent.t_ns, out), DecodeStatus::too_short);
        bad = good;
        bad.error = true;
        EXPECT_EQ(decoder.accept(bad, sent.t_ns, out), DecodeStatus::not_mine);
    }
}

TYPED_TEST(CanClosedLoop, RandomBytesGiveFiniteValuesOrNothing) {
    Random random(65);
    MessageDecoder<TypeParam> decoder;
    int complete = 0;
    for (int i = 0; i < 30'000; ++i) {
        TypeParam out;
        const auto sent = random_message<TypeParam>(random);
        std::vector<CanFrame> frames = classic(sent);
        frames.push_back(encode_fd(sent));
        CanFrame f = frames[random.below(frames.size())];
        for (std::uint64_t n = random.below(4); n > 0; --n)
            f.data[random.below(64)] = static_cast<std::uint8_t>(random.below(256));
        if (random.below(16) == 0) f.id = static_cast<std::uint32_t>(random.below(1ull << 32));
        if (random.below(16) == 0) f.size = static_cast<std::uint8_t>(random.below(256));
        if (!f.fd && f.size == 8 && random.below(2) == 0) f = resealed(f);
        const std::int64_t t_reference_ns = random.time_ns();
        if (decoder.accept(f, t_reference_ns, out) != DecodeStatus::complete) continue;
        ++complete;
        TypeParam again;  // only finite numbers and known choices come through the encoder
        ASSERT_EQ(through({encode_fd(out)}, t_reference_ns, again), DecodeStatus::complete);
        expect_near(again, out);
    }
    EXPECT_GT(complete, 0);
    EXPECT_GT(decoder.count(DecodeStatus::bad_checksum), 0u);
}

TEST(CanClosedLoopValues, ImpulsesSaturate) {
    Random random(66);
    auto sent = random_message<ActuatorCommand>(random);
    sent.impulse_n_s = {9000, -9000, 0.0006};
    sent.angular_impulse_n_m_s = {-1e300, 8388.607, -8388.607};
    ActuatorCommand out;
    ASSERT_EQ(through(classic(sent), sent.t_ns, out), DecodeStatus::complete);
    EXPECT_EQ(out.impulse_n_s, (Vec3{8388.607, -8388.607, 0.001}));
    EXPECT_EQ(out.angular_impulse_n_m_s, (Vec3{-8388.607, 8388.607, -8388.607}));
}

TEST(CanClosedLoopValues, DeviationsAndPositionsSaturate) {
    Random random(67);
    auto sent = random_message<NavigationEstimate>(random);
    sent.T_chaser_target.t = {1e30, -1e30, 0};
    sent.sigma_position_m = {1e9, kNaN, -1};
    sent.sigma_rotation_rad = {kInfinity, 2, 0};
    NavigationEstimate out;
    ASSERT_EQ(through(classic(sent), sent.t_ns, out), DecodeStatus::complete);
    EXPECT_NEAR(out.T_chaser_target.t.x, 140'737'488.355327, 1e-6);
    EXPECT_EQ(out.T_chaser_target.t.y, -out.T_chaser_target.t.x);
    EXPECT_EQ(out.sigma_position_m, (Vec3{16.777215, 16.777215, 0}));
    EXPECT_EQ(out.sigma_rotation_rad, (Vec3{1.6777215, 1.6777215, 0}));
}

TEST(CanClosedLoopValues, WhatIsNotFiniteIsNotAvailable) {
    Random random(68);
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
        auto command = random_message<ActuatorCommand>(random);
        command.angular_impulse_n_m_s.z = bad;
        EXPECT_EQ(through(classic(command), command.t_ns, command), DecodeStatus::not_a_number);
        auto estimate = random_message<NavigationEstimate>(random);
        estimate.T_chaser_target.t.y = bad;
        EXPECT_EQ(through(classic(estimate), estimate.t_ns, estimate), DecodeStatus::not_a_number);
        auto attitude = random_message<AttitudeReport>(random);
        attitude.rate_rad_s.x = bad;
        EXPECT_EQ(through({encode_fd(attitude)}, attitude.t_ns, attitude), DecodeStatus::not_a_number);
    }
}

TEST(CanClosedLoopValues, WhatIsNoRotationAndNoChoiceIsRefused) {
    Random random(69);
    auto attitude = random_message<AttitudeReport>(random);
    attitude.q_world_chaser = {0.9, 0.1, 0, 0};
    EXPECT_EQ(through(classic(attitude), attitude.t_ns, attitude), DecodeStatus::not_unit);
    auto estimate = random_message<NavigationEstimate>(random);
    estimate.T_chaser_target.q = {0, 0, 0, 0};
    EXPECT_EQ(through({encode_fd(estimate)}, estimate.t_ns, estimate), DecodeStatus::not_unit);

    auto command = random_message<ActuatorCommand>(random);
    std::vector<CanFrame> frames = classic(command);
    frames[4].data[1] = static_cast<std::uint8_t>(kGuidancePhases.size());
    frames[4] = resealed(frames[4]);
    EXPECT_EQ(through(frames, command.t_ns, command), DecodeStatus::not_a_number);
    frames[4].data[1] = static_cast<std::uint8_t>(kAbortReasons.size() << 4);
    frames[4] = resealed(frames[4]);
    EXPECT_EQ(through(frames, command.t_ns, command), DecodeStatus::not_a_number);
}

TEST(CanClosedLoopValues, TimesTurnWithTheReference) {
    for (const std::int64_t t_ns :
         {std::int64_t{-1}, std::int64_t{(1ll << 48) - 1}, std::int64_t{1ll << 48}, 1'800'000'000 * kSecond_ns}) {
        DynamicsReport sent{.counter = 1, .t_ns = t_ns, .t_start_ns = t_ns - 5}, out;
        ASSERT_EQ(through(classic(sent), t_ns + 3600 * kSecond_ns, out), DecodeStatus::complete);
        EXPECT_EQ(out.t_ns, t_ns);
        EXPECT_EQ(out.t_start_ns, t_ns - 5);
    }
}

/// No two sets share an identifier, and all have 11 bits.
TEST(CanClosedLoopValues, IdentifiersCollideWithNothing) {
    std::map<std::uint32_t, std::string> owner;
    const auto claim = [&](std::uint32_t base, const SetLayout& layout) {
        for (std::uint32_t i = 0; i <= kFdOffset; ++i) {
            if (i >= layout.frames.size() && (i != kFdOffset || layout.fd_counter_bit == 0)) continue;
            const auto [it, fresh] = owner.emplace(base + i, layout.name);
            EXPECT_TRUE(fresh) << layout.name << " and " << it->second << " share identifier " << base + i;
            EXPECT_LE(base + i, 0x7FFu);
        }
    };
    for (std::uint32_t body = 0; body <= kMaxBodyBaseId; body += kBaseIdStep) claim(body, kPoseLayout);
    for (std::uint8_t camera = 0; camera < kMaxTelemetryCameras; ++camera)
        claim(ledger_base_id(camera), kLedgerLayout);
    claim(kHeartbeatId, kHeartbeatLayout);
    claim(kEstimateBaseId, kEstimateLayout);
    claim(kActuatorBaseId, kActuatorLayout);
    claim(kNavigationBaseId, kNavigationLayout);
    claim(kAttitudeBaseId, kAttitudeLayout);
    claim(kDynamicsBaseId, kDynamicsLayout);
}

/// Every bit of a form belongs to one quantity at most, and to none that is checksum or counter.
TEST(CanClosedLoopValues, QuantitiesDoNotOverlap) {
    for (const SetLayout* layout : {&kActuatorLayout, &kNavigationLayout, &kAttitudeLayout, &kDynamicsLayout}) {
        std::map<std::pair<int, int>, std::string_view> classic_bits, fd_bits;
        for (int bit = 0; bit < 8; ++bit) fd_bits[{0, layout->fd_counter_bit + bit}] = "Counter";
        for (const Signal& s : layout->signals) {
            EXPECT_EQ(s.classic.length, s.fd.length) << s.name;
            for (int bit = 0; bit < s.classic.length; ++bit)
                EXPECT_TRUE(
                    classic_bits.emplace(std::pair{s.classic.frame, s.classic.start_bit + bit}, s.name).second);
            for (int bit = 0; bit < s.fd.length; ++bit)
                EXPECT_TRUE(fd_bits.emplace(std::pair{0, s.fd.start_bit + bit}, s.name).second) << s.name;
            EXPECT_LE(s.classic.start_bit + s.classic.length, kClassicPayloadBits) << s.name;
            EXPECT_LT(s.classic.frame, layout->frames.size()) << s.name;
        }
        EXPECT_LE(fd_bits.rbegin()->first.second, 487) << layout->name;
    }
}

}  // namespace
}  // namespace narpa
