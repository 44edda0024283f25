#include "protocols/lidar/ouster_packet.h"

#include <algorithm>

#include "protocols/little_endian.h"

namespace narpa {
namespace {

/// Bits of a pixel, counted from the least significant of its first byte; no field crosses a boundary of 8 bytes.
/// `shift`: the packet states value >> shift.
struct Field {
    unsigned first = 0, bits = 0, shift = 0;

    [[nodiscard]] constexpr std::uint64_t mask() const noexcept {
        return ((std::uint64_t{1} << bits) - 1) << (first % 64);
    }
    [[nodiscard]] std::uint32_t get(const std::array<std::uint64_t, 2>& words) const noexcept {
        return static_cast<std::uint32_t>((words[first / 64] & mask()) >> (first % 64) << shift);
    }
    void put(std::array<std::uint64_t, 2>& words, std::uint32_t value) const noexcept {
        words[first / 64] |= (std::uint64_t{value >> shift} << (first % 64)) & mask();
    }
};

struct ReturnFields {
    Field range_mm, flags, reflectivity, signal;
};

struct Layout {
    std::size_t header_bytes, column_header_bytes, pixel_bytes, column_footer_bytes, footer_bytes;
    std::array<ReturnFields, 2> returns;
    Field near_ir;

    [[nodiscard]] constexpr std::array<std::uint64_t, 2> used() const noexcept {
        std::array<std::uint64_t, 2> bits{};
        const auto add = [&](const Field& f) { bits[f.first / 64] |= f.mask(); };
        add(near_ir);
        for (const ReturnFields& r : returns) {
            add(r.range_mm);
            add(r.flags);
            add(r.reflectivity);
            add(r.signal);
        }
        return bits;
    }
};

/// In the order of OusterProfile.
constexpr std::array<Layout, 4> kLayouts{
    Layout{.header_bytes = 0,
           .column_header_bytes = 16,
           .pixel_bytes = 12,
           .column_footer_bytes = 4,
           .footer_bytes = 0,
           .returns = {ReturnFields{
                           .range_mm = {0, 20}, .flags = {28, 4}, .reflectivity = {32, 8}, .signal = {48, 16}},
                       ReturnFields{}},
           .near_ir = {64, 16}},
    Layout{.header_bytes = 32,
           .column_header_bytes = 12,
           .pixel_bytes = 12,
           .column_footer_bytes = 0,
           .footer_bytes = 32,
           .returns = {ReturnFields{
                           .range_mm = {0, 19}, .flags = {19, 5}, .reflectivity = {32, 8}, .signal = {48, 16}},
                       ReturnFields{}},
           .near_ir = {64, 16}},
    Layout{.header_bytes = 32,
           .column_header_bytes = 12,
           .pixel_bytes = 16,
           .column_footer_bytes = 0,
           .footer_bytes = 32,
           .returns = {ReturnFields{
                           .range_mm = {0, 19}, .flags = {19, 5}, .reflectivity = {24, 8}, .signal = {64, 16}},
                       ReturnFields{
                           .range_mm = {32, 19}, .flags = {51, 5}, .reflectivity = {56, 8}, .signal = {80, 16}}},
           .near_ir = {96, 16}},
    Layout{
        .header_bytes = 32,
        .column_header_bytes = 12,
        .pixel_bytes = 4,
        .column_footer_bytes = 0,
        .footer_bytes = 32,
        .returns = {ReturnFields{.range_mm = {0, 15, 3}, .flags = {15, 1}, .reflectivity = {16, 8}, .signal = {}},
                    ReturnFields{}},
        .near_ir = {24, 8, 4}}};

// Packet header.
constexpr std::size_t kFrameOffset = 2, kInitOffset = kFrameOffset + 2, kSerialOffset = kInitOffset + 3,
                      kRestOffset = kSerialOffset + 5, kHeaderBytes = kRestOffset + 20;
static_assert(kHeaderBytes == 32);
// Column header; in LEGACY the frame and the encoder stand where the others have 16 bits of status.
constexpr std::size_t kMeasurementOffset = 8, kColumnStatusOffset = kMeasurementOffset + 2,
                      kEncoderOffset = kColumnStatusOffset + 2;

const Layout& layout_of(OusterProfile profile) noexcept {
    return kLayouts[static_cast<std::size_t>(profile)];
}

std::uint64_t get_bytes(const std::uint8_t* at, std::size_t n) noexcept {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < n; ++i) value |= std::uint64_t{at[i]} << (8 * i);
    return value;
}

void put_bytes(std::uint8_t* at, std::size_t n, std::uint64_t value) noexcept {
    for (std::size_t i = 0; i < n; ++i) at[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

}  // namespace

std::size_t OusterFormat::column_at(int column) const noexcept {
    const Layout& l = layout_of(profile_);
    const std::size_t column_bytes =
        l.column_header_bytes + static_cast<std::size_t>(beams_) * l.pixel_bytes + l.column_footer_bytes;
    return l.header_bytes + static_cast<std::size_t>(column) * column_bytes;
}

std::size_t OusterFormat::pixel_at(int column, int beam) const noexcept {
    const Layout& l = layout_of(profile_);
    return column_at(column) + l.column_header_bytes + static_cast<std::size_t>(beam) * l.pixel_bytes;
}

std::size_t OusterFormat::bytes() const noexcept {
    return column_at(columns_) + layout_of(profile_).footer_bytes;
}

std::uint32_t OusterFormat::range_mm_max() const noexcept {
    const Field& f = layout_of(profile_).returns[0].range_mm;
    return ((1u << f.bits) - 1) << f.shift;
}

std::uint32_t OusterFormat::range_step_mm() const noexcept {
    return 1u << layout_of(profile_).returns[0].range_mm.shift;
}

std::uint32_t OusterFormat::valid_status() const noexcept {
    return profile_ == OusterProfile::legacy ? 0xFFFF'FFFFu : 1u;
}

bool OusterFormat::is_valid(const OusterColumn& column) const noexcept {
    return profile_ == OusterProfile::legacy ? column.status == valid_status() : (column.status & 1) != 0;
}

OusterHeader OusterFormat::header(std::span<const std::uint8_t> packet) const noexcept {
    OusterHeader h{.packet_type = OusterHeader::kLidar, .rest = {}, .footer = {}};
    if (layout_of(profile_).header_bytes == 0) return h;
    h.packet_type = get_le<std::uint16_t>(&packet[0]);
    h.frame_id = get_le<std::uint16_t>(&packet[kFrameOffset]);
    h.init_id = static_cast<std::uint32_t>(get_bytes(&packet[kInitOffset], 3));
    h.serial = get_bytes(&packet[kSerialOffset], 5);
    std::ranges::copy(packet.subspan(kRestOffset, h.rest.size()), h.rest.begin());
    std::ranges::copy(packet.last(h.footer.size()), h.footer.begin());
    return h;
}

void OusterFormat::put(const OusterHeader& h, std::span<std::uint8_t> packet) const noexcept {
    if (layout_of(profile_).header_bytes == 0) return;
    put_le(&packet[0], h.packet_type);
    put_le(&packet[kFrameOffset], h.frame_id);
    put_bytes(&packet[kInitOffset], 3, h.init_id);
    put_bytes(&packet[kSerialOffset], 5, h.serial);
    std::ranges::copy(h.rest, packet.subspan(kRestOffset).begin());
    std::ranges::copy(h.footer, packet.last(h.footer.size()).begin());
}

OusterColumn OusterFormat::column(std::span<const std::uint8_t> packet, int column) const noexcept {
    const std::uint8_t* at = &packet[column_at(column)];
    OusterColumn c{.t_ns = get_le<std::uint64_t>(at),
                   .measurement_id = get_le<std::uint16_t>(at + kMeasurementOffset)};
    if (profile_ != OusterProfile::legacy) {
        c.status = get_le<std::uint16_t>(at + kColumnStatusOffset);
        return c;
    }
    c.frame_id = get_le<std::uint16_t>(at + kColumnStatusOffset);
    c.encoder = get_le<std::uint32_t>(at + kEncoderOffset);
    c.status = get_le<std::uint32_t>(&packet[pixel_at(column, beams_)]);
    return c;
}

void OusterFormat::put(const OusterColumn& c, std::span<std::uint8_t> packet, int column) const noexcept {
    std::uint8_t* at = &packet[column_at(column)];
    put_le(at, c.t_ns);
    put_le(at + kMeasurementOffset, c.measurement_id);
    if (profile_ != OusterProfile::legacy) {
        put_le(at + kColumnStatusOffset, static_cast<std::uint16_t>(c.status));
        return;
    }
    put_le(at + kColumnStatusOffset, c.frame_id);
    put_le(at + kEncoderOffset, c.encoder);
    put_le(&packet[pixel_at(column, beams_)], c.status);
}

OusterPixel OusterFormat::pixel(std::span<const std::uint8_t> packet, int column, int beam) const noexcept {
    const Layout& l = layout_of(profile_);
    const std::uint8_t* at = &packet[pixel_at(column, beam)];
    const std::array<std::uint64_t, 2> words{get_bytes(at, std::min<std::size_t>(l.pixel_bytes, 8)),
                                             l.pixel_bytes > 8 ? get_bytes(at + 8, l.pixel_bytes - 8) : 0};
    OusterPixel p;
    for (std::size_t i = 0; i < 2; ++i) {
        const ReturnFields& f = l.returns[i];
        p.returns[i] = {.range_mm = f.range_mm.get(words),
                        .flags = static_cast<std::uint8_t>(f.flags.get(words)),
                        .reflectivity = static_cast<std::uint8_t>(f.reflectivity.get(words)),
                        .signal = static_cast<std::uint16_t>(f.signal.get(words))};
    }
    p.near_ir = static_cast<std::uint16_t>(l.near_ir.get(words));
    const std::array<std::uint64_t, 2> used = l.used();
    p.unused = {words[0] & ~used[0], words[1] & ~used[1]};
    return p;
}

void OusterFormat::put(const OusterPixel& p, std::span<std::uint8_t> packet, int column, int beam) const noexcept {
    const Layout& l = layout_of(profile_);
    const std::array<std::uint64_t, 2> used = l.used();
    std::array<std::uint64_t, 2> words{p.unused[0] & ~used[0], p.unused[1] & ~used[1]};
    for (std::size_t i = 0; i < 2; ++i) {
        const ReturnFields& f = l.returns[i];
        f.range_mm.put(words, p.returns[i].range_mm);
        f.flags.put(words, p.returns[i].flags);
        f.reflectivity.put(words, p.returns[i].reflectivity);
        f.signal.put(words, p.returns[i].signal);
    }
    l.near_ir.put(words, p.near_ir);
    std::uint8_t* at = &packet[pixel_at(column, beam)];
    put_bytes(at, std::min<std::size_t>(l.pixel_bytes, 8), words[0]);
    if (l.pixel_bytes > 8) put_bytes(at + 8, l.pixel_bytes - 8, words[1]);
}

}  // namespace narpa
