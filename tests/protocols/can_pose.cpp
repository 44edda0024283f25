#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "base/constants.h"
#include "protocols/can/candump.h"
#include "protocols/can/crc.h"
#include "tests/protocols/can_support.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

constexpr std::uint32_t kBase = 0x100;

PoseCommand command_at(std::int64_t t_valid_ns, std::uint8_t counter) {
    PoseCommand c{counter, t_valid_ns, {}};
    c.motion.T_world_body = {normalized(Quat{0.9, -0.1, 0.3, 0.2}), {1.5, -20.25, 300.125}};
    c.motion.velocity_m_s = {0.1, -0.2, 7500};
    c.motion.rate_rad_s = {0.01, -0.02, 0.03};
    return c;
}

FrameSet classic(const PoseCommand& c, std::uint32_t base_id = kBase) {
    FrameSet frames;
    const EncodeStatus status = encode_classic(c, base_id, frames);
    EXPECT_TRUE(status) << status.text();
    return frames;
}

CanFrame fd(const PoseCommand& c, std::uint32_t base_id = kBase) {
    CanFrame frame;
    const EncodeStatus status = encode_fd(c, base_id, frame);
    EXPECT_TRUE(status) << status.text();
    return frame;
}

/// Makes the checksum of a classic frame right again, by the rule in protocols/can/README.md.
void mend_crc(CanFrame& f) {
    const std::array<std::uint8_t, 2> id{static_cast<std::uint8_t>(f.id), static_cast<std::uint8_t>(f.id >> 8)};
    f.data[7] = crc8_j1850(std::span(f.data).first(7), crc8_j1850(id));
}
void mend_fd_crc(CanFrame& f) {
    const std::array<std::uint8_t, 2> id{static_cast<std::uint8_t>(f.id), static_cast<std::uint8_t>(f.id >> 8)};
    const std::uint16_t crc = crc16_ccitt_false(std::span(f.data).first(62), crc16_ccitt_false(id));
    f.data[62] = static_cast<std::uint8_t>(crc);
    f.data[63] = static_cast<std::uint8_t>(crc >> 8);
}

TEST(CanPose, ClassicLayoutIsTheDocumentedOne) {
    PoseCommand c = command_at(0x0123'4567'89AB, 0x5A);
    c.motion.T_world_body = {{1, 0, 0, 0}, {1, -1e-6, 0}};
    c.motion.velocity_m_s = {2e-5, 0, 0};
    c.motion.rate_rad_s = {-2e-5, 0, 0};
    const FrameSet frames = classic(c);
    using Bytes = std::array<std::uint8_t, 7>;
    const auto head = [&](std::size_t i) {
        Bytes b{};
        std::copy_n(frames[i].data.begin(), 7, b.begin());
        return b;
    };
    EXPECT_EQ(head(0), (Bytes{0xAB, 0x89, 0x67, 0x45, 0x23, 0x01, 0x5A}));
    EXPECT_EQ(head(1), (Bytes{0x40, 0x42, 0x0F, 0x00, 0x00, 0x00, 0x5A}));  // 1 m = 1000000 um = 0xF4240
    EXPECT_EQ(head(2), (Bytes{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x5A}));
    EXPECT_EQ(head(4), (Bytes{0x00, 0x00, 0x40, 0x00, 0x00, 0x00, 0x5A}));  // w = 1 = 2^22 raw
    EXPECT_EQ(head(6), (Bytes{0x01, 0x00, 0x00, 0xC0, 0xFF, 0xFF, 0x5A}));  // 30 bits of 1, then 18 bits of -1
    for (std::size_t i = 0; i < frames.size(); ++i) {
        EXPECT_EQ(frames[i].id, kBase + i);
        EXPECT_EQ(frames[i].size, 8);
        EXPECT_FALSE(frames[i].fd || frames[i].extended || frames[i].remote);
        CanFrame mended = frames[i];
        mended.data[7] = 0;
        mend_crc(mended);
        EXPECT_EQ(mended.data[7], frames[i].data[7]);
    }
}

TEST(CanPose, FdLayoutIsTheDocumentedOne) {
    PoseCommand c = command_at(0x0123'4567'89AB, 0x5A);
    c.motion.T_world_body.q = {-1, 0, 0, 0};
    c.motion.rate_rad_s = {0, 0, -2e-5};
    const CanFrame f = fd(c);
    EXPECT_EQ(f.id, kBase + 15);
    EXPECT_TRUE(f.fd);
    EXPECT_EQ(f.size, 64);
    EXPECT_EQ(f.data[0], 0xAB);
    EXPECT_EQ(f.data[24 + 2], 0xC0);  // w = -1 = -2^22 raw, bytes 24..26
    EXPECT_EQ(f.data[56], 0xFF);
    EXPECT_EQ(f.data[57], 0x5A);
    for (std::size_t i = 58; i < 62; ++i) EXPECT_EQ(f.data[i], 0) << i;
    CanFrame mended = f;
    mended.data[62] = mended.data[63] = 0;
    mend_fd_crc(mended);
    EXPECT_EQ(mended.data, f.data);
}

TEST(CanPose, ClassicAndFdDecodeToTheSameBits) {
    std::mt19937_64 rng(1);
    for (int i = 0; i < 20000; ++i) {
        const PoseCommand sent = random_command(rng, std::pow(10.0, 8.0 * static_cast<double>(i % 1000) / 1000.0));
        PoseCommand from_classic, from_fd;
        ASSERT_EQ(decode_all(classic(sent), kBase, sent.t_valid_ns, from_classic), PoseStatus::complete);
        const CanFrame one = fd(sent);
        ASSERT_EQ(decode_all({&one, 1}, kBase, sent.t_valid_ns, from_fd), PoseStatus::complete);
        ASSERT_TRUE(same(from_classic, from_fd));
        ASSERT_EQ(from_classic.t_valid_ns, sent.t_valid_ns);
        ASSERT_EQ(from_classic.counter, sent.counter);
        const Motion &a = sent.motion, &b = from_classic.motion;
        ASSERT_LE(norm(a.T_world_body.t - b.T_world_body.t), 0.9e-6);
        ASSERT_LE(angle_between(a.T_world_body.q, b.T_world_body.q), 5e-7);
        ASSERT_LE(norm(a.velocity_m_s - b.velocity_m_s), 1.8e-5);
        ASSERT_LE(norm(a.rate_rad_s - b.rate_rad_s), 1.8e-5);
    }
}

TEST(CanPose, DecodedPoseEncodesToTheSameFrames) {
    std::mt19937_64 rng(2);
    for (int i = 0; i < 5000; ++i) {
        PoseCommand c = random_command(rng, 1e5);
        PoseCommand decoded;
        ASSERT_EQ(decode_all(classic(c), kBase, c.t_valid_ns, decoded), PoseStatus::complete);
        const FrameSet first = classic(c), again = classic(decoded);
        for (const std::size_t f : {0, 1, 2, 3, 6, 7, 8}) ASSERT_EQ(first[f].data, again[f].data) << f;
        // The attitude was normalised in between, which may move its last bit.
        ASSERT_LE(angle_between(c.motion.T_world_body.q, decoded.motion.T_world_body.q), 5e-7);
    }
}

/// The pixel of a world point, camera axes = body axes (z forward), f = 2000 px.
std::array<double, 2> project(const Rigid3& T_world_camera, const Vec3& p_world) {
    const Vec3 p = inverse(T_world_camera) * p_world;
    return {2000.0 * p.x / p.z, 2000.0 * p.y / p.z};
}

Rigid3 over_the_wire(const Rigid3& T) {
    PoseCommand sent, decoded;
    sent.motion.T_world_body = T;
    EXPECT_EQ(decode_all(classic(sent), kBase, 0, decoded), PoseStatus::complete);
    return decoded.motion.T_world_body;
}

// The quantisation may cost 0.01 px at f = 2000 px. Worst of all cases: camera and target are both commanded, and
// the points lie at the corners of a 640x480 image.
TEST(CanPose, QuantisationMovesNoPixelByAHundredth) {
    std::mt19937_64 rng(3);
    std::uniform_real_distribution<double> log_range(std::log(0.5), std::log(1e5)), unit(0, 1);
    double worst_px = 0;
    for (int i = 0; i < 20000; ++i) {
        const double range_m = i < 2000 ? 0.5 : std::exp(log_range(rng));
        const Rigid3 T_world_camera = random_command(rng, i % 2 == 0 ? range_m : 7e6).motion.T_world_body;
        const Quat q_world_target = random_command(rng, 1).motion.T_world_body.q;
        const Rigid3 camera_wire = over_the_wire(T_world_camera);
        for (const double u : {-320.0, 320.0}) {
            for (const double v : {-240.0, 240.0}) {
                const Vec3 p_world = T_world_camera * (range_m * Vec3{u / 2000, v / 2000, 1});
                // The target's origin lies up to half the range from the point that is seen.
                const Vec3 arm =
                    0.5 * range_m * unit(rng) * normalized(random_command(rng, 1).motion.T_world_body.t);
                const Rigid3 T_world_target{q_world_target, p_world - q_world_target * arm};
                const Vec3 p_world_wire = over_the_wire(T_world_target) * arm;
                const auto [x, y] = project(camera_wire, p_world_wire);
                worst_px = std::max(worst_px, std::hypot(x - u, y - v));
            }
        }
    }
    RecordProperty("worst_px", std::to_string(worst_px));
    EXPECT_LT(worst_px, 0.01);
    EXPECT_GT(worst_px, 1e-4);  // the test does look at something
}

TEST(CanPose, TakesEffectInAnyOrder) {
    std::mt19937_64 rng(4);
    const PoseCommand sent = command_at(5'000'000'000, 7);
    PoseCommand in_order;
    ASSERT_EQ(decode_all(classic(sent), kBase, 0, in_order), PoseStatus::complete);
    for (int i = 0; i < 500; ++i) {
        FrameSet frames = classic(sent);
        std::shuffle(frames.begin(), frames.end(), rng);
        PoseDecoder decoder(kBase);
        PoseCommand out;
        out.counter = 99;
        for (std::size_t k = 0; k + 1 < frames.size(); ++k) {
            ASSERT_EQ(decoder.accept(frames[k], 0, out), PoseStatus::partial);
            ASSERT_EQ(out.counter, 99);  // untouched until it is whole
        }
        ASSERT_EQ(decoder.accept(frames[frames.size() - 1], 0, out), PoseStatus::complete);
        ASSERT_TRUE(same(out, in_order));
    }
}

TEST(CanPose, NewCounterDropsThePartialSet) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    const FrameSet first = classic(command_at(1'000'000, 10)), second = classic(command_at(2'000'000, 11));
    for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(decoder.accept(first[i], 0, out), PoseStatus::partial);
    for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(decoder.accept(second[i], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 1u);
    EXPECT_EQ(decoder.accept(second[8], 0, out), PoseStatus::complete);
    EXPECT_EQ(out.counter, 11);
    EXPECT_EQ(out.t_valid_ns, 2'000'000);
    // What was missing of the first set comes too late to be mixed with anything.
    EXPECT_EQ(decoder.accept(first[8], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 1u);
    EXPECT_EQ(decoder.count(PoseStatus::complete), 1u);
}

TEST(CanPose, OtherContentUnderTheSameCounterIsAnotherSet) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    const FrameSet first = classic(command_at(1'000'000, 10)), second = classic(command_at(2'000'000, 10));
    EXPECT_EQ(decoder.accept(first[0], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(first[1], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(second[0], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 1u);
    for (std::size_t i = 1; i < 8; ++i) EXPECT_EQ(decoder.accept(second[i], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(second[8], 0, out), PoseStatus::complete);
    EXPECT_EQ(out.t_valid_ns, 2'000'000);
}

TEST(CanPose, StandingBodyIsCommandedAgainUnderTheNextCounter) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    for (int i = 0; i < 600; ++i) {  // the counter wraps twice; only time and counter change
        for (const CanFrame& f : classic(command_at(i, static_cast<std::uint8_t>(i))))
            (void)decoder.accept(f, i, out);
        ASSERT_EQ(out.t_valid_ns, i);
    }
    EXPECT_EQ(decoder.count(PoseStatus::complete), 600u);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 0u);
    EXPECT_EQ(decoder.count(PoseStatus::duplicate), 0u);
}

TEST(CanPose, RestartedSenderMayUseTheLastCounterAgain) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    for (const CanFrame& f : classic(command_at(1'000, 0))) (void)decoder.accept(f, 0, out);
    for (const CanFrame& f : classic(command_at(2'000, 0))) (void)decoder.accept(f, 0, out);
    EXPECT_EQ(out.t_valid_ns, 2'000);
    EXPECT_EQ(decoder.count(PoseStatus::complete), 2u);
}

TEST(CanPose, RestartedSenderMayUseTheLastCounterInAnyOrderOfFrames) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    for (const std::int64_t t_ns : {1'000, 2'000}) {  // all frames but that of the time are equal
        const FrameSet frames = classic(command_at(t_ns, 0));
        for (std::size_t i = 9; i-- > 0;) (void)decoder.accept(frames[i], 0, out);
        EXPECT_EQ(out.t_valid_ns, t_ns);
    }
    EXPECT_EQ(decoder.count(PoseStatus::complete), 2u);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 0u);
}

TEST(CanPose, FramesOfARepeatAreNoPartOfALaterSet) {
    PoseDecoder decoder(kBase);
    PoseCommand out, other = command_at(2'000, 0);
    other.motion.rate_rad_s.z += 0.5;  // in the last frame
    const FrameSet old = classic(command_at(1'000, 0)), frames = classic(other);
    for (const CanFrame& f : old) (void)decoder.accept(f, 0, out);
    EXPECT_EQ(decoder.accept(old[8], 0, out), PoseStatus::duplicate);
    for (std::size_t i = 0; i < 8; ++i)
        EXPECT_EQ(decoder.accept(frames[i], kRepeat_ns + 1, out), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(frames[8], kRepeat_ns + 1, out), PoseStatus::complete);
    EXPECT_NEAR(out.motion.rate_rad_s.z, other.motion.rate_rad_s.z, 1e-5);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 0u);
}

TEST(CanPose, DuplicatesAreNamed) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    const FrameSet frames = classic(command_at(1, 1));
    EXPECT_EQ(decoder.accept(frames[3], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(frames[3], 0, out), PoseStatus::duplicate);
    for (const CanFrame& f : frames) (void)decoder.accept(f, 0, out);
    EXPECT_EQ(decoder.count(PoseStatus::complete), 1u);
    for (const CanFrame& f : frames) EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::duplicate);
    EXPECT_EQ(decoder.accept(fd(command_at(1, 1)), 0, out), PoseStatus::duplicate) << "the same command as FD";
    EXPECT_EQ(decoder.accept(fd(command_at(2, 2)), 0, out), PoseStatus::complete);
    EXPECT_EQ(decoder.accept(fd(command_at(2, 2)), 0, out), PoseStatus::duplicate);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 0u);
}

TEST(CanPose, FdCommandDropsAPartialClassicSet) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    EXPECT_EQ(decoder.accept(classic(command_at(1, 1))[0], 0, out), PoseStatus::partial);
    EXPECT_EQ(decoder.accept(fd(command_at(2, 2)), 0, out), PoseStatus::complete);
    EXPECT_EQ(decoder.count(PoseStatus::incomplete_set), 1u);
}

TEST(CanPose, RejectsOtherIdentifiers) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    CanFrame error = classic(command_at(1, 1))[0];
    error.error = true;
    EXPECT_EQ(decoder.accept(error, 0, out), PoseStatus::not_mine);
    EXPECT_EQ(decoder.accept(classic(command_at(1, 1), 0x110)[0], 0, out), PoseStatus::not_mine);
    for (std::uint32_t id = kBase + 9; id < kBase + 15; ++id) {
        CanFrame f;
        f.id = id;
        f.size = 8;
        EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::not_mine);
    }
}

TEST(CanPose, RejectsWrongLengths) {
    PoseDecoder decoder(kBase);
    PoseCommand out;
    CanFrame f = classic(command_at(1, 1))[0];
    for (const int size : {0, 1, 7}) {
        f.size = static_cast<std::uint8_t>(size);
        EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::too_short);
    }
    f.size = 9;
    EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::too_long);
    CanFrame g = fd(command_at(1, 1));
    for (const int size : {0, 8, 48, 63}) {
        g.size = static_cast<std::uint8_t>(size);
        EXPECT_EQ(decoder.accept(g, 0, out), PoseStatus::too_short);
    }
    g.size = 255;
    EXPECT_EQ(decoder.accept(g, 0, out), PoseStatus::too_long);
}

TEST(CanPose, RejectsWrongKinds) {
    const CanFrame good = classic(command_at(1, 1))[0], good_fd = fd(command_at(1, 1));
    PoseDecoder decoder(kBase);
    PoseCommand out;
    CanFrame f = good;
    f.remote = true;
    EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::wrong_kind);
    f = good;
    f.extended = true;
    EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::wrong_kind);
    f = good;
    f.fd = true;
    EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::wrong_kind);
    f = good_fd;
    f.fd = false;
    EXPECT_EQ(decoder.accept(f, 0, out), PoseStatus::wrong_kind);
}

TEST(CanPose, RejectsEveryFlippedBit) {
    const PoseCommand sent = command_at(123'456'789, 77);
    PoseDecoder decoder(kBase);
    PoseCommand out;
    for (const CanFrame& good : classic(sent)) {
        for (std::size_t bit = 0; bit < 64; ++bit) {
            CanFrame f = good;
            f.data[bit / 8] = static_cast<std::uint8_t>(f.data[bit / 8] ^ (1u << bit % 8));
            ASSERT_EQ(decoder.accept(f, 0, out), PoseStatus::bad_checksum) << f.id << " bit " << bit;
        }
        CanFrame f = good;  // the identifier is part of the checksum
        f.id = kBase + (f.id + 1 - kBase) % 9;
        ASSERT_EQ(decoder.accept(f, 0, out), PoseStatus::bad_checksum);
    }
    for (std::size_t bit = 0; bit < 512; ++bit) {
        CanFrame f = fd(sent);
        f.data[bit / 8] = static_cast<std::uint8_t>(f.data[bit / 8] ^ (1u << bit % 8));
        ASSERT_EQ(decoder.accept(f, 0, out), PoseStatus::bad_checksum) << "bit " << bit;
    }
    EXPECT_EQ(decoder.count(PoseStatus::bad_checksum), 9u * 65u + 512u);
}

TEST(CanPose, RejectsNotAvailable) {
    PoseCommand out;
    FrameSet frames = classic(command_at(1, 1));
    std::fill_n(frames[2].data.begin(), 6, std::uint8_t{0});
    frames[2].data[5] = 0x80;  // position y = -2^47
    mend_crc(frames[2]);
    EXPECT_EQ(decode_all(frames, kBase, 0, out), PoseStatus::not_a_number);
    frames = classic(command_at(1, 1));
    frames[7].data[3] = static_cast<std::uint8_t>(frames[7].data[3] & 0x3F);  // rate y = -2^17 in the top 18 bits
    frames[7].data[4] = 0;
    frames[7].data[5] = 0x80;
    mend_crc(frames[7]);
    EXPECT_EQ(decode_all(frames, kBase, 0, out), PoseStatus::not_a_number);
    CanFrame f = fd(command_at(1, 1));
    std::fill_n(f.data.begin() + 36, 4, std::uint8_t{0});
    f.data[39] = 0x80;  // velocity x = -2^31
    mend_fd_crc(f);
    EXPECT_EQ(decode_all({&f, 1}, kBase, 0, out), PoseStatus::not_a_number);
}

TEST(CanPose, RejectsWhatIsNoRotation) {
    PoseCommand out;
    FrameSet frames = classic(command_at(1, 1));
    std::fill_n(frames[4].data.begin(), 6, std::uint8_t{0});
    mend_crc(frames[4]);
    EXPECT_EQ(decode_all(frames, kBase, 0, out), PoseStatus::not_unit);
    // The border: |q| = 1.0009 passes and comes out normalised, 1.0011 does not pass.
    for (const double size : {1.0009, 1.0011}) {
        CanFrame f = fd(command_at(1, 1));
        std::fill_n(f.data.begin() + 24, 12, std::uint8_t{0});
        const auto raw = static_cast<std::uint32_t>(std::lround(size * 4194304.0));
        for (std::size_t i = 0; i < 3; ++i) f.data[24 + i] = static_cast<std::uint8_t>(raw >> (8 * i));
        mend_fd_crc(f);
        const PoseStatus expected = size < 1.001 ? PoseStatus::complete : PoseStatus::not_unit;
        EXPECT_EQ(decode_all({&f, 1}, kBase, 0, out), expected);
    }
    EXPECT_EQ(out.motion.T_world_body.q, (Quat{1, 0, 0, 0}));
}

TEST(CanPose, EncodeReturnsWhatDoesNotFit) {
    FrameSet frames;
    CanFrame frame;
    PoseCommand c = command_at(1, 1);
    c.motion.velocity_m_s.y = 12'000;
    const EncodeStatus status = encode_classic(c, kBase, frames);
    EXPECT_FALSE(status);
    EXPECT_EQ(status.quantity, "VelocityY");
    EXPECT_EQ(status.value, 12'000);
    EXPECT_EQ(status.text(), "VelocityY = 12000 m/s is outside -10737.4182 .. 10737.4182 m/s");
    EXPECT_EQ(frames[0].size, 0) << "nothing is written";
    EXPECT_TRUE(encode_fd(c, kBase, frame)) << "CAN FD reaches further";

    c = command_at(1, 1);
    c.motion.T_world_body.t.z = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(encode_fd(c, kBase, frame).quantity, "PositionZ");
    c.motion.T_world_body.t.z = -kInfinity;
    EXPECT_EQ(encode_fd(c, kBase, frame).quantity, "PositionZ");
    c.motion.T_world_body.t.z = 140'737'488.4;
    EXPECT_EQ(encode_classic(c, kBase, frames).quantity, "PositionZ");
    c = command_at(1, 1);
    c.motion.rate_rad_s.x = -2.63;
    EXPECT_EQ(encode_classic(c, kBase, frames).quantity, "RateX");
    c = command_at(1, 1);
    c.motion.T_world_body.q = {0, 0, 0, 0};
    EXPECT_EQ(encode_classic(c, kBase, frames).quantity, "AttitudeNorm");
}

TEST(CanPose, LimitsThemselvesFit) {
    for (const double sign : {-1.0, 1.0}) {
        PoseCommand c, out;
        c.motion.T_world_body = {{sign, 0, 0, 0}, {sign * 140'737'488.355327, 0, 0}};
        c.motion.velocity_m_s.x = sign * 536'870'911 * 2e-5;
        c.motion.rate_rad_s.x = sign * 131'071 * 2e-5;
        ASSERT_EQ(decode_all(classic(c), kBase, 0, out), PoseStatus::complete);
        EXPECT_EQ(out.motion.T_world_body.q.w, sign);
        EXPECT_NEAR(out.motion.T_world_body.t.x, c.motion.T_world_body.t.x, 1e-6);
        EXPECT_NEAR(out.motion.velocity_m_s.x, c.motion.velocity_m_s.x, 1e-9);
    }
}

// 1 s before the 48-bit clock wraps: the same poses, at times that go on counting.
TEST(CanPose, TimeWrapsUnseen) {
    constexpr std::int64_t period_ns = std::int64_t{1} << 48;
    for (const std::int64_t turn : {std::int64_t{1}, std::int64_t{2}, std::int64_t{1000}}) {
        PoseDecoder decoder(kBase), plain(kBase);
        PoseCommand out, expected;
        std::int64_t t_reference_ns = turn * period_ns - 1'000'000'000;
        for (int i = 0; i < 200; ++i) {
            const std::int64_t t_ns = turn * period_ns - 1'000'000'000 + i * 10'000'000;
            PoseCommand c = command_at(t_ns, static_cast<std::uint8_t>(i));
            c.motion.T_world_body.t.x = i;
            const CanFrame f = fd(c);
            c.t_valid_ns = i * 10'000'000;
            ASSERT_EQ(decoder.accept(f, t_reference_ns, out), PoseStatus::complete);
            ASSERT_EQ(plain.accept(fd(c), 0, expected), PoseStatus::complete);
            ASSERT_EQ(out.t_valid_ns, t_ns);
            ASSERT_EQ(out.motion.T_world_body, expected.motion.T_world_body);
            t_reference_ns = out.t_valid_ns;
        }
    }
}

TEST(CanPose, UnwrapsToTheNearestTurn) {
    constexpr std::int64_t period = std::int64_t{1} << 48, half = period / 2;
    const auto unwrap = [](std::int64_t t, std::int64_t t_reference) {
        return unwrap_time(static_cast<std::uint64_t>(t) & (period - 1), 48, t_reference);
    };
    for (const std::int64_t reference :
         {std::int64_t{0}, std::int64_t{5}, half, period - 1, 7 * period + 3, -period / 3}) {
        for (const std::int64_t ahead : {std::int64_t{0}, std::int64_t{1}, half - 1, std::int64_t{-1}, -half})
            EXPECT_EQ(unwrap(reference + ahead, reference), reference + ahead) << reference << " " << ahead;
        EXPECT_EQ(unwrap(reference + half, reference), reference - half)
            << "half a turn ahead is half a turn behind";
    }
    constexpr std::int64_t last = std::numeric_limits<std::int64_t>::max();
    EXPECT_EQ(unwrap(last, last), last);
}

// The frames that the README shows are the ones that narpa sends, with the values that it states.
TEST(CanPose, WorkedExampleOfTheReadme) {
    std::ifstream readme(test::source_path("protocols/can/README.md"));
    std::vector<CanFrame> frames;
    for (std::string text; std::getline(readme, text);)
        if (CandumpLine line; parse_candump(text, line) == nullptr && !line.frame.error)
            frames.push_back(line.frame);
    ASSERT_EQ(frames.size(), 10u);
    PoseCommand sent{7, 1'250'000'000, {}};
    sent.motion = {{{0.6, 0, 0.8, 0}, {1, -2, 10.5}}, {0, 0, -0.1}, {0, 0.01, 0}};
    const FrameSet expected = classic(sent);
    for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_EQ(frames[i].id, expected[i].id);
        EXPECT_EQ(frames[i].data, expected[i].data);
    }
    EXPECT_EQ(frames[9].data, fd(sent).data);
    PoseCommand out;
    ASSERT_EQ(decode_all(std::span(frames).first(9), kBase, 0, out), PoseStatus::complete);
    EXPECT_EQ(out.motion.T_world_body.t, (Vec3{1, -2, 10.5}));
    EXPECT_EQ(out.motion.rate_rad_s, (Vec3{0, 0.01, 0}));
}

TEST(CanPose, BodyBaseIdentifiers) {
    EXPECT_TRUE(check_body_base_id(0x100));
    EXPECT_TRUE(check_body_base_id(0));
    EXPECT_TRUE(check_body_base_id(0x5F0));
    EXPECT_FALSE(check_body_base_id(0x600)) << "telemetry";
    EXPECT_FALSE(check_body_base_id(-16));
    const Status odd = check_body_base_id(0x101);
    ASSERT_FALSE(odd);
    EXPECT_EQ(odd.error().what, "can_id 0x101 cannot be a body's: expected a multiple of 16 from 0x000 to 0x5F0");
}

TEST(CanPose, EveryStatusHasAName) {
    EXPECT_EQ(name(PoseStatus::not_mine), "not_mine");
    EXPECT_EQ(name(PoseStatus::incomplete_set), "incomplete_set");
    EXPECT_EQ(name(PoseStatus::not_unit), "not_unit");
}

}  // namespace
}  // namespace narpa
