/// renderer/atmosphere/fast_exp.h - exp in single precision, for vectorised loops.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <initializer_list>

namespace narpa {

/// exp(x) for x <= 0, within 3e-7 of it relatively; 0 below -87.
[[nodiscard]] inline float exp_of_negative(float x) noexcept {
    const float t = (x < -87.0f ? -87.0f : x) * 1.44269504f;
    const auto whole = static_cast<std::int32_t>(t - 0.5f);  // truncation of t - 0.5 <= 0 rounds t to nearest
    const float f = t - static_cast<float>(whole);           // in [-0.5, 0.5]
    float p = 1.5403530e-4f;
    p = p * f + 1.3333558e-3f;
    p = p * f + 9.6181291e-3f;
    p = p * f + 5.5504109e-2f;
    p = p * f + 2.4022651e-1f;
    p = p * f + 6.9314718e-1f;
    p = p * f + 1.0f;
    const float power = std::bit_cast<float>((whole + 127) << 23);
    return x < -87.0f ? 0.0f : p * power;
}

/// Eight floats in a SIMD vector, for loops too long for the compiler to vectorise. Passed by reference: passing or
/// returning a vector by value has a different ABI on each instruction set.
using Vector8 = float __attribute__((vector_size(32)));
inline void load(const float* from, Vector8& to) noexcept {
    std::memcpy(&to, from, sizeof to);
}
inline void store(const Vector8& v, float* to) noexcept {
    std::memcpy(to, &v, sizeof v);
}
/// Same results as the scalar version.
inline void exp_of_negative(const Vector8& x, Vector8& out) noexcept {
    using Int8 = std::int32_t __attribute__((vector_size(32)));
    const Vector8 t = (x < -87.0f ? Vector8{} - 87.0f : x) * 1.44269504f;
    const Int8 whole = __builtin_convertvector(t - 0.5f, Int8);
    const Vector8 f = t - __builtin_convertvector(whole, Vector8);
    Vector8 p = Vector8{} + 1.5403530e-4f;
    for (const float c : {1.3333558e-3f, 9.6181291e-3f, 5.5504109e-2f, 2.4022651e-1f, 6.9314718e-1f, 1.0f})
        p = p * f + c;
    const Int8 power = (whole + 127) << 23;
    Vector8 scale;
    std::memcpy(&scale, &power, sizeof scale);
    out = x < -87.0f ? Vector8{} : p * scale;
}

}  // namespace narpa
