#include "renderer/material/texture/texture_lookup.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>

namespace narpa {
namespace {

constexpr int kMaxTaps = 15;
constexpr float kFullScale = 1.0f / 65535.0f;

struct Image {
    int width, height;
    const std::uint16_t* rgb;
};

inline Image image_of(const Texture& t, std::size_t level) {
    if (level == 0) return {t.width, t.height, t.rgb.data()};
    const Texture::Level& l = t.coarser[level - 1];
    return {l.width, l.height, l.rgb.data()};
}

struct Edges {
    bool repeat_u, repeat_v, poles;
};

Edges edges_of(const Texture& t, TextureLayout layout) {
    if (layout == TextureLayout::globe) return {true, false, true};
    const bool repeat = t.wrap == Texture::Wrap::repeat;
    return {repeat, repeat, false};
}

inline double into_unit(double x, bool repeat) {
    if (x >= 0 && x <= 1) return x;
    return repeat ? x - std::floor(x) : std::clamp(x, 0.0, 1.0);
}

/// The two texels around a position in [0, 1], and the fraction of the way from the first to the second.
struct Between {
    int first, second;
    float part;
};

inline Between between(double place, int n, bool repeat) {
    const double x = place * n - 0.5;
    int first = static_cast<int>(x + 1) - 1, second = first + 1;  // x >= -0.5
    const float part = static_cast<float>(x - first);
    if (first < 0) first = repeat ? n - 1 : 0;
    if (second >= n) second = repeat ? 0 : n - 1;
    return {first, second, part};
}

/// Three bands and an unused fourth element: one SIMD register.
using Bands [[gnu::vector_size(16)]] = float;
using Codes [[gnu::vector_size(16)]] = std::int32_t;
using Halves [[gnu::vector_size(16)]] = std::uint16_t;

/// The lowest three 16-bit codes of the eight bytes.
inline Bands bands_of(std::uint64_t texel) {
    using Words [[gnu::vector_size(16)]] = std::uint64_t;
    const auto codes = std::bit_cast<Halves>(Words{texel, 0});
    const auto wide = std::bit_cast<Codes>(__builtin_shufflevector(codes, Halves{}, 0, 8, 1, 9, 2, 10, 3, 11));
    return __builtin_convertvector(wide, Bands);
}

inline std::uint64_t eight_bytes(const std::uint16_t* from) {
    std::uint64_t bytes;
    std::memcpy(&bytes, from, sizeof bytes);
    return bytes;
}

/// Adds two texels of a row, interpolated; 65535 = 1.
inline void add_pair(const Image& t, const Between& x, int y, float weight, Bands& sum) {
    const std::uint16_t* row = t.rgb + 3 * static_cast<std::size_t>(y) * static_cast<std::size_t>(t.width);
    const std::uint16_t *const a = row + 3 * x.first, *const b = row + 3 * x.second;
    const float of_b = weight * x.part, of_a = weight - of_b;
    if (b == a + 3)  // reads exactly these twelve bytes
        sum += of_a * bands_of(eight_bytes(a)) + of_b * bands_of(eight_bytes(b - 1) >> 16);
    else
        sum += of_a * Bands{static_cast<float>(a[0]), static_cast<float>(a[1]), static_cast<float>(a[2]), 0} +
               of_b * Bands{static_cast<float>(b[0]), static_cast<float>(b[1]), static_cast<float>(b[2]), 0};
}

/// `u` and `v` in [0, 1].
inline void add_bilinear(const Image& t, const Edges& edges, double u, double v, float weight, Bands& sum) {
    const Between x = between(u, t.width, edges.repeat_u), y = between(1 - v, t.height, edges.repeat_v);
    const float of_lower = weight * y.part, of_upper = weight - of_lower;
    if (edges.poles && y.first == y.second) {  // the row beyond a pole is the same row, shifted by half a turn
        const Between opposite = between(u < 0.5 ? u + 0.5 : u - 0.5, t.width, true);
        add_pair(t, v > 0.5 ? opposite : x, y.first, of_upper, sum);
        add_pair(t, v > 0.5 ? x : opposite, y.first, of_lower, sum);
        return;
    }
    add_pair(t, x, y.first, of_upper, sum);
    add_pair(t, x, y.second, of_lower, sum);
}

/// Filter taps for a footprint: lookups in a row about its centre, each from two neighbouring mip levels.
struct Filter {
    std::size_t level = 0;
    float towards_coarser = 0;  ///< weight of the next level
    float level_texel = 1;      ///< filter width of a single lookup, in texels of the finest level
    int beside = 0;             ///< lookups on either side of the middle one
    float last_weight = 1;      ///< of the outermost two; the others have weight 1
    double du = 0, dv = 0;      ///< step between lookups
};

/// A footprint as an ellipse: lengths in texels of the finest level.
struct Ellipse {
    double major = 0, minor = 0;      ///< half axes
    double along_x = 1, along_y = 0;  ///< direction of the major axis, unit; y up
};

Ellipse ellipse_of(const Texture& t, const TextureFootprint& f) {
    const double x1 = static_cast<double>(f.axis1[0]) * t.width, y1 = static_cast<double>(f.axis1[1]) * t.height;
    const double x2 = static_cast<double>(f.axis2[0]) * t.width, y2 = static_cast<double>(f.axis2[1]) * t.height;
    // Singular values of the matrix whose columns are the two axes.
    const double xx = x1 * x1 + x2 * x2, yy = y1 * y1 + y2 * y2, xy = x1 * y1 + x2 * y2;
    const double half = 0.5 * (xx - yy), q = std::sqrt(half * half + xy * xy);
    Ellipse e;
    e.major = std::sqrt(0.5 * (xx + yy) + q);
    if (!(e.major > 0)) return e;
    e.minor = std::abs(x1 * y2 - x2 * y1) / e.major;
    const double ex = half >= 0 ? q + half : xy, ey = half >= 0 ? xy : q - half,
                 length = std::sqrt(ex * ex + ey * ey);
    if (length > 0) e.along_x = ex / length, e.along_y = ey / length;
    return e;
}

/// Chooses two levels and a weight for this texel width. Between two levels the weight grows linearly with the
/// width.
void choose_level(const Texture& t, float width, Filter& f) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(width);  // width >= 1: 2^level (1 + towards_coarser)
    f.level_texel = width;
    f.level = (bits >> 23) - 127;
    f.towards_coarser = std::bit_cast<float>((bits & 0x7fffffu) | 0x3f800000u) - 1;
    if (f.level >= t.coarser.size()) f.level = t.coarser.size(), f.towards_coarser = 0;
}

/// Ratio of width to height of a texel on a globe, at most 1: towards the poles texels are narrow, and neighbouring
/// ones hardly differ.
double narrowness(const Texture& t, float v) {
    return std::clamp(std::sin(std::numbers::pi * static_cast<double>(v)) * 2 * t.height / t.width, 0.0, 1.0);
}

Filter filter_for(const Texture& t, const TextureFootprint& footprint, float v, TextureLayout layout) {
    Filter f;
    if (footprint == TextureFootprint{}) return f;
    const Ellipse e = ellipse_of(t, footprint);
    const double length = 2 * e.major;
    if (length <= 1) return f;
    if (!std::isfinite(length)) {  // or NaN: mean of the whole image
        f.level = t.coarser.size();
        return f;
    }
    double gap = length / kMaxTaps;
    double width = gap;
    if (layout == TextureLayout::globe) {
        // Where texels are narrow, lookups may skip some before v is blurred too.
        const double x = e.along_x * narrowness(t, v), y = e.along_y;
        width *= std::sqrt(x * x + y * y);
    }
    width = std::max({1.0, 2 * e.minor, width});
    gap = std::max(gap, width);
    choose_level(t, static_cast<float>(std::min(width, 1e9)), f);
    const double taps = std::max(1.0, length / gap);
    f.beside = static_cast<int>(std::ceil(0.5 * (taps - 1)));
    f.last_weight = static_cast<float>(0.5 * (taps - 1) - (f.beside - 1));
    f.du = gap * e.along_x / t.width, f.dv = gap * e.along_y / t.height;
    return f;
}

/// A lookup at any position.
void add_wrapped(const Image& t, const Edges& edges, double u, double v, float weight, Bands& sum) {
    if (edges.poles && !(v >= 0 && v <= 1)) {
        v -= 2 * std::floor(0.5 * v);  // once around over both poles is 2
        if (v > 1) v = 2 - v, u += 0.5;
    }
    add_bilinear(t, edges, into_unit(u, edges.repeat_u), into_unit(v, edges.repeat_v), weight, sum);
}

/// A lookup whose four texels lie in the image; x, y: texels from the centre of the first, y down.
inline void add_inner(const Image& t, double x, double y, float weight, Bands& sum) {
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    const float of_right = static_cast<float>(x - column), of_lower = weight * static_cast<float>(y - row);
    const std::size_t stride = 3 * static_cast<std::size_t>(t.width);
    const std::uint16_t *const upper = t.rgb + static_cast<std::size_t>(row) * stride + 3 * column, *const lower =
                                                                                                        upper +
                                                                                                        stride;
    // Reads exactly each row's twelve bytes.
    const Bands left = (weight - of_lower) * bands_of(eight_bytes(upper)) + of_lower * bands_of(eight_bytes(lower));
    const Bands right = (weight - of_lower) * bands_of(eight_bytes(upper + 2) >> 16) +
                        of_lower * bands_of(eight_bytes(lower + 2) >> 16);
    sum += left + of_right * (right - left);
}

/// All of a filter's lookups in one level.
void add_level(const Image& t, const Edges& edges, const Filter& f, double u, double v, float weight, Bands& sum) {
    const double x = u * t.width - 0.5, dx = f.du * t.width, reach_x = std::abs(f.beside * dx);
    const double y = (1 - v) * t.height - 0.5, dy = -f.dv * t.height, reach_y = std::abs(f.beside * dy);
    const bool inner =
        x - reach_x >= 0 && x + reach_x < t.width - 1 && y - reach_y >= 0 && y + reach_y < t.height - 1;
    for (int i = -f.beside; i <= f.beside; ++i) {
        const float part = f.beside > 0 && std::abs(i) == f.beside ? weight * f.last_weight : weight;
        if (inner)
            add_inner(t, x + i * dx, y + i * dy, part, sum);
        else
            add_wrapped(t, edges, u + i * f.du, v + i * f.dv, part, sum);
    }
}

Rgb filtered(const Texture& t, const Edges& edges, const Filter& f, double u, double v) {
    if (edges.repeat_u) u = into_unit(u, true);
    if (edges.repeat_v) v = into_unit(v, true);
    Bands sum{};
    add_level(image_of(t, f.level), edges, f, u, v, 1 - f.towards_coarser, sum);
    if (f.towards_coarser > 0) add_level(image_of(t, f.level + 1), edges, f, u, v, f.towards_coarser, sum);
    const float weights = f.beside > 0 ? static_cast<float>(2 * f.beside - 1) + 2 * f.last_weight : 1;
    const float scale = kFullScale / weights;  // the clamp removes rounding above 1
    return {std::min(sum[0] * scale, 1.0f), std::min(sum[1] * scale, 1.0f), std::min(sum[2] * scale, 1.0f)};
}

/// One lookup in the finest level: `filtered` with an empty footprint.
Rgb unfiltered(const Texture& t, const Edges& edges, double u, double v) {
    if (edges.repeat_u) u = into_unit(u, true);
    if (edges.repeat_v) v = into_unit(v, true);
    const Image finest = image_of(t, 0);
    const double x = u * t.width - 0.5, y = (1 - v) * t.height - 0.5;
    Bands sum{};
    if (x >= 0 && x < t.width - 1 && y >= 0 && y < t.height - 1)
        add_inner(finest, x, y, 1, sum);
    else
        add_wrapped(finest, edges, u, v, 1, sum);
    const Bands rgb = sum * kFullScale;  // the clamp removes rounding above 1
    return {std::min(rgb[0], 1.0f), std::min(rgb[1], 1.0f), std::min(rgb[2], 1.0f)};
}

bool can_look_up(const Texture& t, float u, float v) {
    return t.width > 0 && t.height > 0 && std::isfinite(u) && std::isfinite(v);
}

}  // namespace

Rgb texture_lookup(const Texture& texture, float u, float v, const TextureFootprint& footprint,
                   TextureLayout layout) noexcept {
    if (!can_look_up(texture, u, v)) return {1, 1, 1};
    const Edges edges = edges_of(texture, layout);
    if (footprint == TextureFootprint{})
        return unfiltered(texture, edges, static_cast<double>(u), static_cast<double>(v));
    return filtered(texture, edges, filter_for(texture, footprint, v, layout), static_cast<double>(u),
                    static_cast<double>(v));
}

TextureSlope texture_slope(const Texture& texture, float u, float v, const TextureFootprint& footprint,
                           TextureLayout layout) noexcept {
    if (!can_look_up(texture, u, v)) return {};
    const Edges edges = edges_of(texture, layout);
    const Filter f = filter_for(texture, footprint, v, layout);
    const double texel = static_cast<double>(f.level_texel), dv = texel / texture.height;
    double du = texel / texture.width;
    // On a globe, u spans the same ground distance as v; otherwise rounded heights would become cliffs where texels
    // are narrow.
    if (layout == TextureLayout::globe) du /= std::max(narrowness(texture, v), 1e-6);
    const double max_u = std::min(du, 0.25);  // smaller within a texel of a pole: the slope fades away
    const auto height = [&](double by_u, double by_v) {
        return mean_band(filtered(texture, edges, f, static_cast<double>(u) + by_u, static_cast<double>(v) + by_v));
    };
    return {(height(0.5 * max_u, 0) - height(-0.5 * max_u, 0)) / static_cast<float>(du),
            (height(0, 0.5 * dv) - height(0, -0.5 * dv)) / static_cast<float>(dv)};
}

}  // namespace narpa
