/// renderer/atmosphere/fast_exp.h - exp in single precision, for loops that become vector instructions.
#pragma once

#include <bit>
#include <cstdint>

namespace narpa {

/// exp(x) for x <= 0, within 3e-7 of it relatively; 0 below -87.
[[nodiscard]] inline float exp_of_negative(float x) noexcept {
    const float t = (x < -87.0f ? -87.0f : x) * 1.44269504f;
    const auto whole = static_cast<std::int32_t>(t - 0.5f);  // towards zero: the nearest one
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

}  // namespace narpa
