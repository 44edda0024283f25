#include "protocols/video/embedded_line.h"

#include <algorithm>
#include <array>
#include <bit>

#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::array<std::uint8_t, 4> kMagic{'N', 'R', 'P', 'A'};
constexpr std::uint8_t kFlagPoseStale = 1, kFlagDeadlineMet = 2;

// Offsets, each the one before plus its size.
constexpr std::size_t kVersion = 4, kSize = kVersion + 1, kCamera = kSize + 1, kPoseCounter = kCamera + 1,
                      kFlags = kPoseCounter + 1, kStep = kFlags + 1, kBudgetKind = kStep + 1,
                      kFrame = kBudgetKind + 1 + 1, kSamplesPerPixel = kFrame + 4, kError = kSamplesPerPixel + 4,
                      kSamples = kError + 4, kRays = kSamples + 8, kBudget = kRays + 8, kPasses = kBudget + 8,
                      kTimes = kPasses + 4 * FrameLedger::kPasses, kCrc = kTimes + 8 * 8;
static_assert(kCrc + 4 == kEmbeddedLineBytes);

// The eight times in the order of the wire.
template <class Ledger>
auto times(Ledger& l) {
    return std::array{&l.t_pose_ns,         &l.t_exposure_start_ns, &l.t_exposure_mid_ns, &l.t_exposure_end_ns,
                      &l.t_render_start_ns, &l.t_render_end_ns,     &l.t_hand_over_ns,    &l.t_deadline_ns};
}

// CRC-32 of IEEE 802.3 (reflected 0x04C11DB7, start and final exclusive or all ones), as zlib's crc32.
std::uint32_t crc32(std::span<const std::uint8_t> bytes) {
    std::uint32_t crc = 0xFFFF'FFFF;
    for (const std::uint8_t byte : bytes) {
        crc ^= byte;
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xEDB8'8320 : 0);
    }
    return ~crc;
}

}  // namespace

bool encode_embedded_line(const FrameLedger& ledger, std::span<std::uint8_t> row) noexcept {
    if (row.size() < kEmbeddedLineBytes) return false;
    std::uint8_t* at = row.data();
    std::ranges::copy(kMagic, at);
    at[kVersion] = kEmbeddedLineVersion;
    at[kSize] = kEmbeddedLineBytes;
    at[kCamera] = ledger.camera;
    at[kPoseCounter] = ledger.pose_counter;
    at[kFlags] = static_cast<std::uint8_t>((ledger.pose_stale ? kFlagPoseStale : 0) |
                                           (ledger.deadline_met ? kFlagDeadlineMet : 0));
    at[kStep] = ledger.step;
    at[kBudgetKind] = static_cast<std::uint8_t>(ledger.budget_kind);
    at[kBudgetKind + 1] = 0;
    put_le(at + kFrame, ledger.frame);
    put_le(at + kSamplesPerPixel, std::bit_cast<std::uint32_t>(ledger.samples_per_pixel));
    put_le(at + kError, std::bit_cast<std::uint32_t>(ledger.expected_error));
    put_le(at + kSamples, ledger.samples);
    put_le(at + kRays, ledger.rays);
    put_le(at + kBudget, ledger.budget);
    for (std::size_t i = 0; i < ledger.passes.size(); ++i) put_le(at + kPasses + 4 * i, ledger.passes[i]);
    std::size_t offset = kTimes;
    for (const std::int64_t* t_ns : times(ledger)) {
        put_le(at + offset, static_cast<std::uint64_t>(*t_ns));
        offset += 8;
    }
    put_le(at + kCrc, crc32(row.first(kCrc)));
    return true;
}

std::optional<FrameLedger> decode_embedded_line(std::span<const std::uint8_t> row) noexcept {
    if (row.size() < kEmbeddedLineBytes || !std::ranges::equal(kMagic, row.first(kMagic.size())))
        return std::nullopt;
    const std::uint8_t* at = row.data();
    if (at[kVersion] != kEmbeddedLineVersion || at[kSize] != kEmbeddedLineBytes) return std::nullopt;
    if (get_le<std::uint32_t>(at + kCrc) != crc32(row.first(kCrc))) return std::nullopt;
    if (at[kStep] >= kStepNames.size() || at[kBudgetKind] >= kBudgetKinds.size()) return std::nullopt;
    FrameLedger ledger;
    ledger.camera = at[kCamera];
    ledger.pose_counter = at[kPoseCounter];
    ledger.pose_stale = (at[kFlags] & kFlagPoseStale) != 0;
    ledger.deadline_met = (at[kFlags] & kFlagDeadlineMet) != 0;
    ledger.step = at[kStep];
    ledger.budget_kind = static_cast<BudgetKind>(at[kBudgetKind]);
    ledger.frame = get_le<std::uint32_t>(at + kFrame);
    ledger.samples_per_pixel = std::bit_cast<float>(get_le<std::uint32_t>(at + kSamplesPerPixel));
    ledger.expected_error = std::bit_cast<float>(get_le<std::uint32_t>(at + kError));
    ledger.samples = get_le<std::uint64_t>(at + kSamples);
    ledger.rays = get_le<std::uint64_t>(at + kRays);
    ledger.budget = get_le<std::uint64_t>(at + kBudget);
    for (std::size_t i = 0; i < ledger.passes.size(); ++i)
        ledger.passes[i] = get_le<std::uint32_t>(at + kPasses + 4 * i);
    std::size_t offset = kTimes;
    for (std::int64_t* t_ns : times(ledger)) {
        *t_ns = static_cast<std::int64_t>(get_le<std::uint64_t>(at + offset));
        offset += 8;
    }
    return ledger;
}

}  // namespace narpa
