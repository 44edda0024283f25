// Whatever bytes come, every decoder answers, and what it lets through is a valid frame or a finite pose.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "protocols/can/candump.h"
#include "protocols/can/slcan.h"
#include "protocols/can/udp_multicast.h"
#include "tests/protocols/can_support.h"

namespace narpa {
namespace {

constexpr int kMutations = 100'000;

/// Bytes changed, cut out, put in, doubled: one to six times. The copy has no slack, so that a read past its end is
/// seen by the address sanitizer.
std::vector<std::uint8_t> mutate(std::vector<std::uint8_t> bytes, std::mt19937_64& rng) {
    for (std::uint64_t n = 1 + rng() % 6; n > 0; --n) {
        const auto at = static_cast<std::ptrdiff_t>(bytes.empty() ? 0 : rng() % bytes.size());
        switch (bytes.empty() ? 2 : rng() % 6) {
            case 0: bytes[static_cast<std::size_t>(at)] = static_cast<std::uint8_t>(rng()); break;
            case 1: bytes[static_cast<std::size_t>(at)] ^= static_cast<std::uint8_t>(1u << rng() % 8); break;
            case 2: bytes.insert(bytes.begin() + at, static_cast<std::uint8_t>(rng())); break;
            case 3: bytes.erase(bytes.begin() + at); break;
            case 4: bytes.resize(static_cast<std::size_t>(at)); break;
            default: bytes.insert(bytes.end(), bytes.begin() + at, bytes.end()); break;
        }
        if (bytes.size() > 2048) bytes.resize(2048);
    }
    bytes.shrink_to_fit();
    return bytes;
}

bool valid(const CanFrame& f) {
    return f.id <= (f.extended || f.error ? 0x1FFFFFFFu : 0x7FFu) && f.size <= (f.fd ? 64 : 8) &&
           !(f.fd && f.remote);
}

std::vector<std::uint8_t> bytes_of(std::string_view text) {
    return {text.begin(), text.end()};
}
std::string_view text_of(const std::vector<std::uint8_t>& bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Feeds mutations of `seeds`; `decode` returns whether it let the bytes through. Some must pass, some must not:
/// otherwise the test would look at nothing.
void hammer(const std::vector<std::vector<std::uint8_t>>& seeds, std::uint64_t seed,
            const std::function<bool(const std::vector<std::uint8_t>&)>& decode) {
    std::mt19937_64 rng(seed);
    int passed = 0;
    for (int i = 0; i < kMutations; ++i) passed += decode(mutate(seeds[rng() % seeds.size()], rng)) ? 1 : 0;
    EXPECT_GT(passed, 0);
    EXPECT_LT(passed, kMutations);
}

TEST(CanHostile, SlcanLine) {
    hammer({bytes_of("t1008112233445566FFEE"), bytes_of("T1FFFFFFF3112233"), bytes_of("r1238"),
            bytes_of("R000001232")},
           21, [](const auto& bytes) {
               CanFrame f;
               const bool good = decode_slcan(text_of(bytes), f);
               EXPECT_TRUE(valid(f));
               return good;
           });
}

TEST(CanHostile, SlcanStream) {
    SlcanLines lines;
    hammer({bytes_of("C\rS6\rO\rt1008112233445566FFEE\rT1FFFFFFF3112233\r"),
            bytes_of(std::string(100, 'A') + "\rV\r")},
           22, [&](const auto& bytes) {
               const std::string_view text = text_of(bytes);
               std::span<const char> rest(text.data(), text.size());
               bool any = false;
               while (lines.next(rest)) {
                   any = true;
                   EXPECT_GT(lines.line().size(), 0u);
                   EXPECT_LE(lines.line().size(), 64u);
               }
               EXPECT_TRUE(rest.empty());
               return any;
           });
}

TEST(CanHostile, CandumpLine) {
    hammer({bytes_of("(1700000000.250000) vcan0 123#DEADBEEF R"), bytes_of("(1.5) can0 18FF50E5##1001122334455"),
            bytes_of("(0.1) c 7FF#R4")},
           23, [](const auto& bytes) {
               CandumpLine line;
               const bool good = parse_candump(text_of(bytes), line) == nullptr;
               EXPECT_TRUE(valid(line.frame));
               EXPECT_GE(line.t_ns, 0);
               return good;
           });
}

TEST(CanHostile, UdpMulticastDatagram) {
    std::vector<std::vector<std::uint8_t>> seeds;
    for (const int size : {0, 8, 64}) {
        CanFrame f;
        f.id = 0x123;
        f.fd = size > 8;
        f.size = static_cast<std::uint8_t>(size);
        std::array<std::uint8_t, kUdpMulticastMaxBytes> out;
        const std::size_t n = encode_udp_multicast(f, out);
        seeds.emplace_back(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n));
    }
    hammer(seeds, 24, [](const auto& bytes) {
        CanFrame f;
        const bool good = decode_udp_multicast(bytes, f);
        EXPECT_TRUE(valid(f));
        return good;
    });
}

/// Any frame at all, but often one that is nearly right.
CanFrame wild_frame(std::mt19937_64& rng, const std::vector<CanFrame>& good) {
    CanFrame f = good[rng() % good.size()];
    if (rng() % 8 != 0) f.data[rng() % 64] = static_cast<std::uint8_t>(rng());
    if (rng() % 16 == 0) f.id = static_cast<std::uint32_t>(rng());
    if (rng() % 16 == 0) f.size = static_cast<std::uint8_t>(rng());
    if (rng() % 16 == 0) f.fd = !f.fd;
    if (rng() % 16 == 0) f.remote = !f.remote;
    if (rng() % 16 == 0) f.extended = !f.extended;
    return f;
}

TEST(CanHostile, PoseFrames) {
    std::mt19937_64 rng(25);
    std::vector<CanFrame> good;
    for (int i = 0; i < 4; ++i) {
        const PoseCommand c = random_command(rng, 1e4);
        FrameSet frames;
        ASSERT_TRUE(encode_classic(c, 0x100, frames));
        good.insert(good.end(), frames.begin(), frames.end());
        ASSERT_TRUE(encode_fd(c, 0x100, good.emplace_back()));
    }
    PoseDecoder decoder(0x100);
    PoseCommand out;
    std::uint64_t total = 0;
    for (int i = 0; i < kMutations; ++i) {
        const PoseStatus status = decoder.accept(wild_frame(rng, good), static_cast<std::int64_t>(rng()), out);
        ASSERT_NE(status, PoseStatus::incomplete_set);
        if (status != PoseStatus::complete) continue;
        ASSERT_NEAR(norm(out.motion.T_world_body.q), 1.0, 1e-12);
        ASSERT_TRUE(is_finite(out.motion.T_world_body.t) && is_finite(out.motion.velocity_m_s) &&
                    is_finite(out.motion.rate_rad_s));
    }
    for (std::size_t s = 0; s < kDecodeStatusCount; ++s)
        if (static_cast<PoseStatus>(s) != PoseStatus::incomplete_set)
            total += decoder.count(static_cast<PoseStatus>(s));
    EXPECT_EQ(total, static_cast<std::uint64_t>(kMutations)) << "every frame is counted once";
    EXPECT_GT(decoder.count(PoseStatus::complete), 0u);
    EXPECT_GT(decoder.count(PoseStatus::bad_checksum), 0u);
}

TEST(CanHostile, TelemetryFrames) {
    std::mt19937_64 rng(26);
    std::vector<CanFrame> good{encode(Heartbeat{}), encode_fd(FrameLedger{})};
    for (const CanFrame& f : encode_classic(FrameLedger{})) good.push_back(f);
    LedgerDecoder ledgers;
    FrameLedger ledger;
    Heartbeat heartbeat;
    int complete = 0;
    for (int i = 0; i < kMutations; ++i) {
        const CanFrame f = wild_frame(rng, good);
        complete += ledgers.accept(f, static_cast<std::int64_t>(rng() >> 2), ledger) == DecodeStatus::complete;
        complete += decode(f, static_cast<std::int64_t>(rng() >> 2), heartbeat) == DecodeStatus::complete;
    }
    EXPECT_GT(complete, 0);
}

}  // namespace
}  // namespace narpa
