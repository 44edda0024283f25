#include "renderer/optics/image_optics.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
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

/// Numbers of a row that are filtered together; their sums stay in vector registers.
using Part [[gnu::vector_size(32), gnu::aligned(alignof(float)), gnu::may_alias]] = float;
constexpr int kPart = sizeof(Part) / sizeof(float), kParts = 8, kFilterBlock = kParts * kPart;
constexpr int kRowsOfATask = 64;

/// Adds `weights`[k] times the block at `in` + k `step`, for k < n, to the block at `sum`.
NARPA_EACH_ISA void add_weighted(const float* weights, int n, const float* in, std::ptrdiff_t step,
                                 float* sum) noexcept {
    Part parts[kParts];
#pragma GCC unroll 8
    for (int i = 0; i < kParts; ++i) parts[i] = *reinterpret_cast<const Part*>(sum + i * kPart);
    for (int k = 0; k < n; ++k, in += step)
#pragma GCC unroll 8
        for (int i = 0; i < kParts; ++i) parts[i] += weights[k] * *reinterpret_cast<const Part*>(in + i * kPart);
#pragma GCC unroll 8
    for (int i = 0; i < kParts; ++i) *reinterpret_cast<Part*>(sum + i * kPart) = parts[i];
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
    SeparableFilter filter{.radius = 0, .terms = {{{1.0f}, {1.0f}}}};
    if (optics.point_spread) filter = filter_of(*optics.point_spread);
    radius_ = filter.radius;
    terms_ = std::move(filter.terms);
    for (SeparableFilter::Term& term : terms_) {  // a convolution: the first weight is that of the last pixel
        std::ranges::reverse(term.row);
        std::ranges::reverse(term.column);
    }
    blocks_ = (kBands * width_ + kFilterBlock - 1) / kFilterBlock;
    step_ = static_cast<std::size_t>(blocks_ * kFilterBlock) + kPart;  // not a multiple of 4096 bytes
    padded_step_ = step_ + static_cast<std::size_t>(2 * radius_ * kBands);
    rows_.resize(step_ * static_cast<std::size_t>(height_));
    padded_.resize(padded_step_ * static_cast<std::size_t>(height_));
    lit_blocks_.resize(static_cast<std::size_t>(height_));
    lit_rows_.resize(static_cast<std::size_t>(blocks_));
}

std::size_t ImageOptics::index_of(int y, int block) const noexcept {
    return static_cast<std::size_t>(y) * step_ + static_cast<std::size_t>(block * kFilterBlock);
}

/// Applies vignetting to a row and extends it by `radius_` pixels on each side, which repeat the border pixels.
/// Finds its blocks with light, and clears those that have lost it since the last image.
void ImageOptics::pad_row(const RadianceImage& in, int y) noexcept {
    const auto width = static_cast<std::size_t>(width_), first = static_cast<std::size_t>(y) * width;
    const std::span row = std::span(in.pixels).subspan(first, width);
    const auto is_lit = [](const Rgb& c) { return c != Rgb{}; };
    const auto begin = std::ranges::find_if(row, is_lit);
    Range& lit = lit_blocks_[static_cast<std::size_t>(y)];
    const Range before = lit;
    lit = {};
    if (begin != row.end()) {
        const auto end = std::find_if(row.rbegin(), row.rend(), is_lit).base();
        const int from = std::max(static_cast<int>(begin - row.begin()) - radius_, 0);
        const int to = std::min(static_cast<int>(end - row.begin()) + radius_, width_);
        lit = {kBands * from / kFilterBlock, (kBands * to + kFilterBlock - 1) / kFilterBlock};
    }
    for (int block = before.first; block < before.end; ++block)
        if (block < lit.first || block >= lit.end) std::fill_n(&rows_[index_of(y, block)], kFilterBlock, 0.0f);
    if (lit.empty()) return;
    Rgb* const padded = reinterpret_cast<Rgb*>(padded_row(y));
    Rgb* const out = padded + radius_;
    if (gain_.empty())
        std::ranges::copy(row, out);
    else
        for (std::size_t x = 0; x < width; ++x) out[x] = gain_[first + x] * row[x];
    std::fill_n(padded, radius_, out[0]);
    std::fill_n(out + width_, radius_, out[width_ - 1]);
}

void ImageOptics::find_lit_rows() noexcept {
    std::ranges::fill(lit_rows_, Range{height_, 0});
    for (int y = 0; y < height_; ++y) {
        const Range lit = lit_blocks_[static_cast<std::size_t>(y)];
        for (int block = lit.first; block < lit.end; ++block) {
            Range& rows = lit_rows_[static_cast<std::size_t>(block)];
            rows = {std::min(rows.first, y), y + 1};
        }
    }
}

void ImageOptics::filter_row(const SeparableFilter::Term& term, int y) noexcept {
    const Range lit = lit_blocks_[static_cast<std::size_t>(y)];
    for (int block = lit.first; block < lit.end; ++block) {
        float* const out = &rows_[index_of(y, block)];
        std::fill_n(out, kFilterBlock, 0.0f);
        add_weighted(term.row.data(), 2 * radius_ + 1, padded_row(y) + block * kFilterBlock, kBands, out);
    }
}

/// Adds a term to some rows of a block of columns. Beyond the image its border rows are repeated.
void ImageOptics::filter_columns(const SeparableFilter::Term& term, int block, Range rows,
                                 RadianceImage& out) const noexcept {
    const Range lit = lit_rows_[static_cast<std::size_t>(block)];
    const int first = block * kFilterBlock, n = std::min(kFilterBlock, kBands * width_ - first);
    const auto step = static_cast<std::ptrdiff_t>(step_);
    std::array<float, kFilterBlock> last{};  // the last block of a row may be incomplete
    for (int y = std::max(rows.first, lit.first - radius_); y < std::min(rows.end, lit.end + radius_); ++y) {
        float* const to = floats_of(out, y) + first;
        float* const sum = n == kFilterBlock ? to : last.data();
        if (sum != to) std::copy_n(to, n, sum);
        const auto add = [&](int from, int end, int row, std::ptrdiff_t row_step) {
            if (from >= end) return;
            const float* const weights = &term.column[static_cast<std::size_t>(from + radius_ - y)];
            add_weighted(weights, end - from, &rows_[index_of(row, block)], row_step, sum);
        };
        const int from = std::max(y - radius_, lit.first), end = std::min(y + radius_ + 1, lit.end);
        add(y - radius_, 0, 0, 0);
        add(from, end, from, step);
        add(height_, y + radius_ + 1, height_ - 1, 0);
        if (sum != to) std::copy_n(sum, n, to);
    }
}

void ImageOptics::apply(const RadianceImage& in, RadianceImage& out) noexcept {
    if (terms_.empty()) {
        std::ranges::copy(in.pixels, out.pixels.begin());
        return;
    }
    std::ranges::fill(out.pixels, Rgb{});
    tbb::parallel_for(0, height_, [&](int y) { pad_row(in, y); });
    find_lit_rows();
    const int tasks = (height_ + kRowsOfATask - 1) / kRowsOfATask;
    for (const SeparableFilter::Term& term : terms_) {
        tbb::parallel_for(0, height_, [&](int y) { filter_row(term, y); });
        tbb::parallel_for(0, blocks_ * tasks, [&](int i) {
            const int y = i % tasks * kRowsOfATask;
            filter_columns(term, i / tasks, {y, std::min(y + kRowsOfATask, height_)}, out);
        });
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
