/// base/lanes.h - batches of sixteen rays or pixels as structures of arrays, so that the compiler vectorises loops
/// over them.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "base/pose.h"

namespace narpa {

inline constexpr std::size_t kLanes = 16;  ///< rays that are traced together
template <class T>
using Lanes = std::array<T, kLanes>;

inline bool is_set(std::uint32_t bits, std::size_t i) noexcept {
    return (bits >> i & 1u) != 0;
}
/// Mask of the first n lanes.
inline std::uint32_t lanes_below(std::size_t n) noexcept {
    return (1u << n) - 1;
}

/// Expands a bit mask to one int per lane: -1 where the bit is set, else 0, for branch-free selection in loops.
[[nodiscard]] inline Lanes<int> masks_of(std::uint32_t bits) noexcept {
    Lanes<int> masks;
    for (std::size_t i = 0; i < kLanes; ++i) masks[i] = -static_cast<int>(bits >> i & 1u);
    return masks;
}
[[nodiscard]] inline std::uint32_t bits_of(const Lanes<int>& masks) noexcept {
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < kLanes; ++i) bits |= static_cast<std::uint32_t>(masks[i]) & 1u << i;
    return bits;
}

[[nodiscard]] inline std::uint32_t lanes_with(const Lanes<int>& values, int value) noexcept {
    Lanes<int> same;
    for (std::size_t i = 0; i < kLanes; ++i) same[i] = -static_cast<int>(values[i] == value);
    return bits_of(same);
}
template <class F>
void for_each_lane(std::uint32_t bits, const F& f) {
    for (; bits != 0; bits &= bits - 1) f(static_cast<std::size_t>(std::countr_zero(bits)));
}

/// A vector for each ray.
struct alignas(64) Vec3Lanes {
    Lanes<double> x, y, z;

    [[nodiscard]] Vec3 operator[](std::size_t i) const { return {x[i], y[i], z[i]}; }
    void put(std::size_t i, const Vec3& v) { x[i] = v.x, y[i] = v.y, z[i] = v.z; }
    void fill(const Vec3& v) { x.fill(v.x), y.fill(v.y), z.fill(v.z); }
};

/// Three bands for each ray.
struct alignas(64) RgbLanes {
    Lanes<float> r, g, b;

    [[nodiscard]] Rgb operator[](std::size_t i) const { return {r[i], g[i], b[i]}; }
    void put(std::size_t i, const Rgb& c) { r[i] = c.x, g[i] = c.y, b[i] = c.z; }
    void fill(const Rgb& c) { r.fill(c.x), g.fill(c.y), b.fill(c.z); }
};

/// A pose for each ray.
struct alignas(64) PoseLanes {
    Lanes<double> w, x, y, z;
    Vec3Lanes t;

    [[nodiscard]] Rigid3 operator[](std::size_t i) const { return {{w[i], x[i], y[i], z[i]}, t[i]}; }
    void put(std::size_t i, const Rigid3& T) {
        w[i] = T.q.w, x[i] = T.q.x, y[i] = T.q.y, z[i] = T.q.z, t.put(i, T.t);
    }
    void fill(const Rigid3& T) { w.fill(T.q.w), x.fill(T.q.x), y.fill(T.q.y), z.fill(T.q.z), t.fill(T.t); }
};

/// `then` if the condition holds, else `otherwise`; branch-free.
[[nodiscard]] inline double choose(bool condition, double then, double otherwise) noexcept {
    return condition ? then : otherwise;
}
[[nodiscard]] inline Vec3 choose(bool condition, const Vec3& then, const Vec3& otherwise) noexcept {
    return {condition ? then.x : otherwise.x, condition ? then.y : otherwise.y, condition ? then.z : otherwise.z};
}

}  // namespace narpa
