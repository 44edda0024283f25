#include "renderer/optics/image_optics.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "base/each_isa.h"
#include "renderer/scene/scene.h"

namespace narpa {
namespace {

constexpr int kBands = 3;

/// Share of the light that passes the lens at an angle from the axis, radians.
double relative_illumination(const Vignetting& v, double theta) {
    const double s = theta * theta, cosine = std::max(0.0, std::cos(theta));
    const auto [a, b, c] = v.polynomial;
    return std::max(0.0, (v.cos4 ? std::pow(cosine, 4) : 1) * (1 + s * (a + s * (b + s * c))));
}

std::vector<float> gain_of(const Camera& camera) {
    std::vector<float> gain;
    gain.reserve(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const Vec3 d = camera.model->direction({static_cast<double>(x), static_cast<double>(y)});
            gain.push_back(static_cast<float>(
                relative_illumination(*camera.vignetting, std::atan2(std::hypot(d.x, d.y), d.z))));
        }
    return gain;
}

NARPA_EACH_ISA void add_weighted(float weight, const float* in, float* out, std::size_t n) noexcept {
    for (std::size_t i = 0; i < n; ++i) out[i] += weight * in[i];
}

static_assert(sizeof(Rgb) == kBands * sizeof(float));
float* floats_of(RadianceImage& image, int y) noexcept {
    return &image.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width)].x;
}

}  // namespace

ImageOptics::ImageOptics(const Camera& camera)
    : any_(camera.vignetting || camera.point_spread || camera.veiling_glare > 0),
      width_(camera.width),
      height_(camera.height),
      veil_(static_cast<float>(camera.veiling_glare)) {
    if (!camera.vignetting && !camera.point_spread) return;
    if (camera.vignetting) gain_ = gain_of(camera);
    if (camera.point_spread)
        filter_ = filter_of(*camera.point_spread);
    else
        filter_.terms = {{{1.0f}, {1.0f}}};
    rows_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    padded_.resize(static_cast<std::size_t>(width_ + 2 * filter_.radius) * static_cast<std::size_t>(height_));
    lit_.resize(static_cast<std::size_t>(height_));
}

/// Applies vignetting to a row and extends it by `radius` pixels on each side, which repeat the border pixels.
void ImageOptics::pad_row(const RadianceImage& in, int y) noexcept {
    const auto width = static_cast<std::size_t>(width_), first = static_cast<std::size_t>(y) * width;
    const std::span row = std::span(in.pixels).subspan(first, width);
    const auto is_lit = [](const Rgb& c) { return c != Rgb{}; };
    const auto begin = std::ranges::find_if(row, is_lit);
    Extent& extent = lit_[static_cast<std::size_t>(y)];
    extent = {};
    if (begin == row.end()) return;
    const auto end = std::find_if(row.rbegin(), row.rend(), is_lit).base();
    const int radius = filter_.radius;
    extent = {std::max(static_cast<int>(begin - row.begin()) - radius, 0),
              std::min(static_cast<int>(end - row.begin()) + radius, width_)};
    Rgb* out = padded_row(y) + radius;
    if (gain_.empty())
        std::ranges::copy(row, out);
    else
        for (std::size_t x = 0; x < width; ++x) out[x] = gain_[first + x] * row[x];
    std::fill_n(out - radius, radius, out[0]);
    std::fill_n(out + width_, radius, out[width_ - 1]);
}

void ImageOptics::filter_row(const SeparableFilter::Term& term, int y) noexcept {
    const Extent extent = lit_[static_cast<std::size_t>(y)];
    if (extent.first == extent.end) return;
    const auto n = static_cast<std::size_t>(kBands * (extent.end - extent.first));
    float* out = &rows_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                        static_cast<std::size_t>(extent.first)]
                      .x;
    std::fill_n(out, n, 0.0f);
    for (int k = 0; k <= 2 * filter_.radius; ++k)
        add_weighted(term.row[static_cast<std::size_t>(2 * filter_.radius - k)], &padded_row(y)[extent.first + k].x,
                     out, n);
}

void ImageOptics::gather_row(const SeparableFilter::Term& term, int y, float* out) const noexcept {
    for (int k = -filter_.radius; k <= filter_.radius; ++k) {
        const auto from = static_cast<std::size_t>(std::clamp(y + k, 0, height_ - 1));
        const Extent extent = lit_[from];
        if (extent.first == extent.end) continue;
        const auto first = static_cast<std::size_t>(extent.first);
        add_weighted(term.column[static_cast<std::size_t>(filter_.radius - k)],
                     &rows_[from * static_cast<std::size_t>(width_) + first].x, out + kBands * first,
                     static_cast<std::size_t>(kBands * (extent.end - extent.first)));
    }
}

Rgb ImageOptics::mean(const RadianceImage& image) const noexcept {
    Vec3 sum;
    for (const Rgb& c : image.pixels) sum = sum + vec_cast<double>(c);
    return vec_cast<float>(sum / static_cast<double>(image.pixels.size()));
}

void ImageOptics::apply(const RadianceImage& in, RadianceImage& out) noexcept {
    if (filter_.terms.empty()) {
        std::ranges::copy(in.pixels, out.pixels.begin());
        return;
    }
    std::ranges::fill(out.pixels, Rgb{});
    tbb::parallel_for(0, height_, [&](int y) { pad_row(in, y); });
    for (const SeparableFilter::Term& term : filter_.terms) {
        tbb::parallel_for(0, height_, [&](int y) { filter_row(term, y); });
        tbb::parallel_for(0, height_, [&](int y) { gather_row(term, y, floats_of(out, y)); });
    }
}

void ImageOptics::add_veiling_glare(RadianceImage& image) const noexcept {
    if (!(veil_ > 0)) return;
    const Rgb veil = veil_ * mean(image);
    for (Rgb& c : image.pixels) c = (1 - veil_) * c + veil;
}

float ImageOptics::gain_at(const ImagePoint& p) const noexcept {
    if (gain_.empty()) return 1;
    const double x = std::clamp(std::round(p.x), 0.0, width_ - 1.0);
    const double y = std::clamp(std::round(p.y), 0.0, height_ - 1.0);
    return gain_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
}

}  // namespace narpa
