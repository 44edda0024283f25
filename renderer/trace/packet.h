/// renderer/trace/packet.h - sixteen rays side by side, laid out so that the compiler works on several of them with
/// each instruction.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "base/pose.h"

namespace narpa {

inline constexpr std::size_t kPacket = 16;  ///< rays that are traced together
template <class T>
using Lanes = std::array<T, kPacket>;

inline bool is_set(std::uint32_t bits, std::size_t i) noexcept {
    return (bits >> i & 1u) != 0;
}
/// The first n lanes.
inline std::uint32_t lanes_below(std::size_t n) noexcept {
    return (1u << n) - 1;
}

/// A vector for each ray.
struct alignas(64) VecPerRay {
    Lanes<double> x, y, z;

    [[nodiscard]] Vec3 operator[](std::size_t i) const { return {x[i], y[i], z[i]}; }
    void put(std::size_t i, const Vec3& v) { x[i] = v.x, y[i] = v.y, z[i] = v.z; }
    void fill(const Vec3& v) { x.fill(v.x), y.fill(v.y), z.fill(v.z); }
};

/// Three bands for each ray.
struct alignas(64) RgbPerRay {
    Lanes<float> r, g, b;

    [[nodiscard]] Rgb operator[](std::size_t i) const { return {r[i], g[i], b[i]}; }
    void put(std::size_t i, const Rgb& c) { r[i] = c.x, g[i] = c.y, b[i] = c.z; }
    void fill(const Rgb& c) { r.fill(c.x), g.fill(c.y), b.fill(c.z); }
};

[[nodiscard]] inline VecPerRay operator-(const VecPerRay& a, const Vec3& b) noexcept {
    VecPerRay out;
    for (std::size_t i = 0; i < kPacket; ++i) out.x[i] = a.x[i] - b.x;
    for (std::size_t i = 0; i < kPacket; ++i) out.y[i] = a.y[i] - b.y;
    for (std::size_t i = 0; i < kPacket; ++i) out.z[i] = a.z[i] - b.z;
    return out;
}

/// The vectors, in the world's axes, in those of a body.
[[nodiscard]] inline VecPerRay to_body(const Quat& q_world_body, const VecPerRay& v) noexcept {
    const auto [bx, by, bz] = columns(q_world_body);  // the body's axes
    VecPerRay out;
    for (std::size_t i = 0; i < kPacket; ++i) out.x[i] = bx.x * v.x[i] + bx.y * v.y[i] + bx.z * v.z[i];
    for (std::size_t i = 0; i < kPacket; ++i) out.y[i] = by.x * v.x[i] + by.y * v.y[i] + by.z * v.z[i];
    for (std::size_t i = 0; i < kPacket; ++i) out.z[i] = bz.x * v.x[i] + bz.y * v.y[i] + bz.z * v.z[i];
    return out;
}

/// Where each ray enters a bounding sphere about the origin, as `bounding_span` has it; infinity where it misses.
[[nodiscard]] inline Lanes<double> bounding_entries(const VecPerRay& o, const VecPerRay& unit_d,
                                                    double radius) noexcept {
    Lanes<double> entry, exit;  // NaN where the line misses: no comparison holds
    for (std::size_t i = 0; i < kPacket; ++i) {
        const double b = -(o.x[i] * unit_d.x[i] + o.y[i] * unit_d.y[i] + o.z[i] * unit_d.z[i]);
        const double cx = o.x[i] + b * unit_d.x[i], cy = o.y[i] + b * unit_d.y[i], cz = o.z[i] + b * unit_d.z[i];
        const double half_chord = std::sqrt(radius * radius - (cx * cx + cy * cy + cz * cz));
        entry[i] = b - half_chord;
        exit[i] = b + half_chord;
    }
    for (std::size_t i = 0; i < kPacket; ++i)
        if (!(exit[i] >= 0)) entry[i] = std::numeric_limits<double>::infinity();
    return entry;
}

}  // namespace narpa
