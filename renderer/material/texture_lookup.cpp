#include "renderer/material/texture_lookup.h"

#include <algorithm>
#include <cmath>

namespace narpa {
namespace {

Rgb texel(const Texture& t, int x, int y) {
    const std::size_t at =
        3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(t.width) + static_cast<std::size_t>(x));
    return Rgb{static_cast<float>(t.rgb[at]), static_cast<float>(t.rgb[at + 1]),
               static_cast<float>(t.rgb[at + 2])} *
           (1.0f / 65535.0f);
}

int wrap(double i, int n) {
    const double w = i - n * std::floor(i / n);
    return std::min(static_cast<int>(w), n - 1);
}

}  // namespace

Rgb texture_lookup(const Texture& texture, float u, float v) noexcept {
    if (texture.width <= 0 || texture.height <= 0 || !std::isfinite(u) || !std::isfinite(v)) return {1, 1, 1};
    const double x = static_cast<double>(u) * texture.width - 0.5;
    const double y = (1 - static_cast<double>(v)) * texture.height - 0.5;
    const double x0 = std::floor(x), y0 = std::floor(y);
    const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
    const int left = wrap(x0, texture.width), right = wrap(x0 + 1, texture.width);
    const int top = wrap(y0, texture.height), bottom = wrap(y0 + 1, texture.height);
    const Rgb upper = texel(texture, left, top) * (1 - fx) + texel(texture, right, top) * fx;
    const Rgb lower = texel(texture, left, bottom) * (1 - fx) + texel(texture, right, bottom) * fx;
    return upper * (1 - fy) + lower * fy;
}

}  // namespace narpa
