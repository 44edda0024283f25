#include "renderer/optics/image_optics.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr int kBands = 3;

/// Share of the light that vignetting leaves at each pixel; empty: all of it.
std::vector<float> gain_of(const Optics& optics, const ImagePlane& plane) {
    std::vector<const OpticalEffect*> vignettes;
    for (const auto& effect : optics.effects)
        if (effect->vignettes()) vignettes.push_back(effect.get());
    std::vector<float> gain;
    if (vignettes.empty()) return gain;
    gain.reserve(static_cast<std::size_t>(plane.width) * static_cast<std::size_t>(plane.height));
    for (int y = 0; y < plane.height; ++y)
        for (int x = 0; x < plane.width; ++x) {
            const Vec3 d = plane.model->direction({static_cast<double>(x), static_cast<double>(y)});
            const double angle_rad = std::atan2(std::hypot(d.x, d.y), d.z);
            double share = 1;
            for (const OpticalEffect* effect : vignettes) share *= effect->transmission(angle_rad);
            gain.push_back(static_cast<float>(share));
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

ImageOptics::ImageOptics(const Optics& optics, const ImagePlane& plane)
    : width_(plane.width), height_(plane.height), gain_(gain_of(optics, plane)) {
    for (const auto& effect : optics.effects)
        if (auto made = effect->make(plane)) effects_.push_back(std::move(made));
    if (gain_.empty() && !optics.point_spread) return;
    if (optics.point_spread)
        filter_ = filter_of(*optics.point_spread);
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

void ImageOptics::add_effects(const ImageExposure& exposure, RadianceImage& image) noexcept {
    for (const auto& effect : effects_) effect->apply(exposure, image);
}

float ImageOptics::gain_at(const ImagePoint& p) const noexcept {
    if (gain_.empty()) return 1;
    const double x = std::clamp(std::round(p.x), 0.0, width_ - 1.0);
    const double y = std::clamp(std::round(p.y), 0.0, height_ - 1.0);
    return gain_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
}

}  // namespace narpa
