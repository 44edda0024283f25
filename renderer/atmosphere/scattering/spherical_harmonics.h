/// renderer/atmosphere/scattering/spherical_harmonics.h - real spherical harmonics, orthonormal, even in azimuth.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace narpa {

/// Highest degree of the harmonics, and of the phase functions in multiple scattering.
constexpr std::size_t kMaxDegree = 8, kHarmonics = (kMaxDegree + 1) * (kMaxDegree + 2) / 2;
using Harmonics = std::array<float, kHarmonics>;

/// Recurrence over the degree of the associated Legendre functions divided by (2 m - 1)!! sin^m; `norm` makes the
/// harmonics orthonormal.
struct HarmonicRecurrence {
    Harmonics norm{}, up{}, down{};
};
inline constexpr HarmonicRecurrence kHarmonicRecurrence = [] {
    HarmonicRecurrence r;
    std::size_t i = 0;
    for (std::size_t l = 0; l <= kMaxDegree; ++l)
        for (std::size_t m = 0; m <= l; ++m, ++i) {
            double ratio = 1, diagonal = 1;  // (l - m)! / (l + m)!; (2 m - 1)!!
            for (std::size_t k = l - m + 1; k <= l + m; ++k) ratio /= static_cast<double>(k);
            for (std::size_t k = 1; k < 2 * m; k += 2) diagonal *= static_cast<double>(k);
            const auto degree = static_cast<double>(l), order = static_cast<double>(m);
            const double square =
                (2 * degree + 1) * 0.079577471545947668 * (m == 0 ? 1 : 2) * ratio * diagonal * diagonal;
            double root = square > 1 ? square : 1;
            for (int step = 0; step < 60; ++step) root = 0.5 * (root + square / root);
            r.norm[i] = static_cast<float>(root);
            r.up[i] = static_cast<float>((2 * degree + 1) / (degree + 1 - order));
            r.down[i] = static_cast<float>((degree + order) / (degree + 1 - order));
        }
    return r;
}();

/// The harmonics of a unit vector up to degree `most`, by ascending degree, then order. `z`, `x`: components along
/// the axis and in the direction of azimuth zero.
inline void harmonics(float z, float x, std::size_t most, Harmonics& out) noexcept {
    const float y = std::sqrt(std::max(0.0f, 1 - z * z - x * x));
    float real = 1, imaginary = 0;  // (x + i y)^m
    for (std::size_t m = 0; m <= most; ++m) {
        float before = 0, p = 1;
        for (std::size_t l = m; l <= most; ++l) {
            const std::size_t i = l * (l + 1) / 2 + m;
            out[i] = kHarmonicRecurrence.norm[i] * p * real;
            const float next = kHarmonicRecurrence.up[i] * z * p - kHarmonicRecurrence.down[i] * before;
            before = p, p = next;
        }
        const float turned = real * x - imaginary * y;
        imaginary = real * y + imaginary * x;
        real = turned;
    }
}

}  // namespace narpa
