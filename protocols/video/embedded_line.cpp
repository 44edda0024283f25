#include "protocols/video/embedded_line.h"

#include <algorithm>
#include <array>
#include <bit>
#include <type_traits>

#include "protocols/crc32.h"
#include "protocols/ledger_fields.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::array<std::uint8_t, 4> kMagic{'N', 'R', 'P', 'A'};
constexpr std::size_t kVersion = 4, kSize = 5, kCrc = kEmbeddedLineBytes - 4;

/// A field's value at its place in the line; `bit` is of a flag.
template <class Whole>
void put(std::uint8_t* at, int, Whole value) {
    put_le(at, static_cast<std::make_unsigned_t<Whole>>(value));
}
void put(std::uint8_t* at, int bit, bool value) {
    *at = static_cast<std::uint8_t>(*at | value << bit);
}
void put(std::uint8_t* at, int, float value) {
    put_le(at, std::bit_cast<std::uint32_t>(value));
}
void put(std::uint8_t* at, int, const FrameLedger::Passes& passes) {
    for (std::size_t i = 0; i < passes.size(); ++i) put_le(at + 4 * i, passes[i]);
}

template <class Whole>
void get(const std::uint8_t* at, int, Whole& value) {
    value = static_cast<Whole>(get_le<std::make_unsigned_t<Whole>>(at));
}
void get(const std::uint8_t* at, int bit, bool& value) {
    value = (*at >> bit & 1) != 0;
}
void get(const std::uint8_t* at, int, float& value) {
    value = std::bit_cast<float>(get_le<std::uint32_t>(at));
}
void get(const std::uint8_t* at, int, FrameLedger::Passes& passes) {
    for (std::size_t i = 0; i < passes.size(); ++i) passes[i] = get_le<std::uint32_t>(at + 4 * i);
}

}  // namespace

bool encode_embedded_line(const FrameLedger& ledger, std::span<std::uint8_t> row) noexcept {
    if (row.size() < kEmbeddedLineBytes) return false;
    std::uint8_t* at = row.data();
    std::ranges::fill(row.first(kEmbeddedLineBytes), std::uint8_t{0});
    std::ranges::copy(kMagic, at);
    at[kVersion] = kEmbeddedLineVersion;
    at[kSize] = kEmbeddedLineBytes;
    for (const LedgerField& f : kLedgerFields)
        if (f.line_offset >= 0)
            visit_field(f, ledger, [&](const auto& value) { put(at + f.line_offset, f.line_bit, value); });
    put_le(at + kCrc, crc32(row.first(kCrc)));
    return true;
}

std::optional<FrameLedger> decode_embedded_line(std::span<const std::uint8_t> row) noexcept {
    if (row.size() < kEmbeddedLineBytes || !std::ranges::equal(kMagic, row.first(kMagic.size())))
        return std::nullopt;
    const std::uint8_t* at = row.data();
    if (at[kVersion] != kEmbeddedLineVersion || at[kSize] != kEmbeddedLineBytes) return std::nullopt;
    if (get_le<std::uint32_t>(at + kCrc) != crc32(row.first(kCrc))) return std::nullopt;
    FrameLedger ledger;
    for (const LedgerField& f : kLedgerFields) {
        if (f.line_offset < 0) continue;
        if (!f.signal.choices.empty() && at[f.line_offset] >= f.signal.choices.size()) return std::nullopt;
        visit_field(f, ledger, [&](auto& value) { get(at + f.line_offset, f.line_bit, value); });
    }
    return ledger;
}

}  // namespace narpa
