#include "renderer/frame/subpixel/subpixel_light.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "renderer/frame/pixel_samples.h"
#include "renderer/integrator/sampler.h"
#include "renderer/optics/lens.h"

namespace narpa {
namespace {

/// First random sequence of subpixel bodies; distinct from those of the pixels.
constexpr std::uint32_t kFirstNumber = 0x80000000u;

/// A point of the unit disc and the area that it represents.
struct DiscPoint {
    double x, y, area;
};

/// One of n evenly spread points of the disc: a golden-ratio lattice, whose error over the outlines of bodies is
/// half that of a Sobol set of the same size (measured, 1024 points: 0.7 % of a rectangle's area).
DiscPoint lattice_point(std::uint32_t i, std::uint32_t n) {
    const double turns = i / std::numbers::phi;
    const auto [x, y] = concentric_disc((i + 0.5) / n, turns - std::floor(turns));
    return {x, y, std::numbers::pi / n};
}

/// The part of the disc that the Sun can light gets half of the samples, however thin its crescent; the rest gets
/// the other half. Each part is the disc, compressed along x.
DiscPoint disc_point(double lit, std::uint32_t s, std::uint32_t samples) {
    constexpr double kMostlyLit = 0.75;
    const std::uint32_t half = samples / 2;
    if (lit > kMostlyLit) return lattice_point(s, samples);
    const auto [a, y, area] = lattice_point(s % half, half);
    const double half_chord = std::sqrt(std::max(0.0, 1 - y * y));
    if (s < half) return {lit * a + (1 - lit) * half_chord, y, lit * area};
    return {(1 - lit) * a - lit * half_chord, y, (1 - lit) * area};
}

/// As many samples as its pixels would take, within limits; even.
std::uint32_t samples_of(const SubpixelDisc& disc, int spp) {
    const double as_pixels = spp * std::numbers::pi * disc.radius_px * disc.radius_px;
    const double samples = std::clamp<double>(as_pixels, kSubpixelSamplesLeast, kSubpixelSamplesMost);
    return 2 * static_cast<std::uint32_t>(samples / 2);
}

/// The integral from 0 to t of the cubic convolution kernel (Keys 1981, a = -1/2), by which a sampled function is
/// interpolated without an error of second order.
double cubic_integral(double t) {
    const double x = std::min(std::abs(t), 2.0);
    const double inner = std::min(x, 1.0), outer = std::max(x, 1.0);
    const auto from_zero = [](double u) { return u - 5.0 / 6 * u * u * u + 3.0 / 8 * u * u * u * u; };
    const auto from_one = [](double u) { return u * (2 + u * (-2 + u * (5.0 / 6 - u / 8))) - 17.0 / 24; };
    return std::copysign(from_zero(inner) + from_one(outer), t);
}

/// The share of a sample's light that a pixel gets along one axis, by its distance from the sample, px. Without a
/// point spread function the sample's pixel gets all of it. With one, the filter that is applied later treats the
/// image as a smooth function, so the body must keep its subpixel position and its width. The share is then the
/// integral of cubic interpolation over the pixel's area; negative at the edges.
double pixel_share(bool spread, double distance_px) {
    if (!spread) return distance_px > -0.5 && distance_px <= 0.5 ? 1 : 0;
    return cubic_integral(distance_px + 0.5) - cubic_integral(distance_px - 0.5);
}

/// Sums the samples' light in the pixels of a block.
class Collector {
public:
    Collector(const Frame& f, const PixelBlock& block)
        : f_(f), block_(block), pixel_angle_rad_(f.transport.path.pixel_angle_rad) {}

    void sample(const SubpixelDisc& disc);
    void put_into(RadianceImage& out, std::vector<float>* variance) const;

private:
    void add(const SubpixelDisc& disc, std::uint32_t s, std::uint32_t samples);
    /// Shares out ray i, seen at this image point; true if any of its light falls in the block.
    bool share_out(const ImagePoint& p, std::size_t i);
    void trace(std::size_t body);

    Frame f_;  ///< with the footprint of a body's samples
    const PixelBlock& block_;
    double pixel_angle_rad_;
    TracedRays batch_;
    Lanes<Lanes<double>> columns_{}, rows_{};  ///< of each ray: shares of the block's columns and rows
    Lanes<double> area_px2_{};                 ///< area of the image that each ray represents
    Lanes<Vec3> light_{};                      ///< of each pixel
    Lanes<double> covered_{}, variance_{};
    Lanes<double> body_sum_{}, body_squares_{};  ///< of one body's samples
};

void Collector::sample(const SubpixelDisc& disc) {
    body_sum_.fill(0);
    body_squares_.fill(0);
    const std::uint32_t samples = samples_of(disc, f_.settings.spp);
    const double area_m2 = std::numbers::pi * norm(cross(disc.right, disc.up));
    f_.transport.path.pixel_angle_rad =
        std::min(pixel_angle_rad_, std::sqrt(area_m2 / samples) / norm(disc.centre));
    for (std::uint32_t s = 0; s < samples; ++s) {
        add(disc, s, samples);
        if (batch_.rays.n == kLanes) trace(disc.body);
    }
    if (batch_.rays.n > 0) trace(disc.body);
    for (std::size_t i = 0; i < block_.n; ++i)
        variance_[i] += body_squares_[i] - body_sum_[i] * body_sum_[i] / samples;
}

void Collector::add(const SubpixelDisc& disc, std::uint32_t s, std::uint32_t samples) {
    const PixelSampler numbers(0, 0, 0);  // the same for every body and frame, as the points are
    Vec3 from{};                          // point on the aperture, camera axes
    if (f_.lens != nullptr) {
        const SamplePoint u = numbers.point(s);
        from = aperture_point(*f_.lens, u[2], u[3]);
    }
    const DiscPoint at = disc_point(disc.lit, s, samples);
    const Vec3 start = f_.T_world_camera.q * from;  // world axes, relative to the camera's centre, as the disc is
    const Vec3 way = disc.centre + at.x * disc.right + at.y * disc.up - start;
    const double range = norm(way);
    const Vec3 direction = way / range, seen = conjugate(f_.T_world_camera.q) * direction;
    const Vec3 chief = f_.lens != nullptr ? normalized(chief_direction(*f_.lens, seen, from)) : seen;
    const auto image = f_.model->project(chief);
    if (!image) return;
    const std::size_t i = batch_.rays.n;
    if (!share_out(*image, i)) return;
    ++batch_.rays.n;
    const double solid_angle = at.area * std::abs(dot(cross(disc.right, disc.up), direction)) / (range * range);
    const double tilt = chief.z / seen.z;  // solid angles of the two rays on the plane of focus
    area_px2_[i] = solid_angle * f_.model->pixels_per_sr(chief) * (tilt * tilt * tilt);
    batch_.rays.put(i, {f_.T_world_camera.t + start, direction});
    batch_.number[i] = kFirstNumber + static_cast<std::uint32_t>(disc.body) * kSubpixelSamplesMost + s;
    if (!f_.sun) return;
    const SamplePoint u = numbers.point(s, 1);
    batch_.to_sun.put(i, f_.one_sample() ? f_.sun->centre() : f_.sun->sample(u[0], u[1]));
}

bool Collector::share_out(const ImagePoint& p, std::size_t i) {
    const bool spread = f_.camera.optics.point_spread.has_value();
    bool any = false;
    for (std::size_t pixel = 0; pixel < block_.n; ++pixel) {
        columns_[i][pixel] = pixel_share(spread, block_.x[pixel] - p.x);
        rows_[i][pixel] = pixel_share(spread, block_.y[pixel] - p.y);
        any |= columns_[i][pixel] != 0 && rows_[i][pixel] != 0;
    }
    return any;
}

void Collector::trace(std::size_t body) {
    f_.tracer.intersect(f_.at, batch_.rays, f_.tracer.all_bodies(), batch_.hits);
    for (std::size_t i = 0; i < batch_.rays.n; ++i)
        if (batch_.hits.body[i] != static_cast<int>(body)) batch_.hits.put(i, {});
    RgbLanes radiance;
    f_.integrator.radiance(f_.transport, batch_, radiance);
    for (std::size_t i = 0; i < batch_.rays.n; ++i) {
        if (batch_.hits.body[i] < 0) continue;
        for (std::size_t pixel = 0; pixel < block_.n; ++pixel) {
            const double area_px2 = area_px2_[i] * columns_[i][pixel] * rows_[i][pixel];
            if (area_px2 == 0) continue;
            const Vec3 share = area_px2 * vec_cast<double>(radiance[i]);
            covered_[pixel] += area_px2;
            light_[pixel] += share;
            body_sum_[pixel] += mean_band(share);
            body_squares_[pixel] += mean_band(share) * mean_band(share);
        }
    }
    batch_.rays.n = 0;
}

void Collector::put_into(RadianceImage& out, std::vector<float>* variance) const {
    for (std::size_t i = 0; i < block_.n; ++i) {
        if (covered_[i] == 0) continue;
        const std::size_t at = block_.index(i, out.width);
        const double past = std::max(0.0, 1 - covered_[i]);
        out.pixels[at] = vec_cast<float>(past * vec_cast<double>(out.pixels[at]) + light_[i]);
        if (variance == nullptr) continue;
        const double seen_past = past * past * static_cast<double>((*variance)[at]);
        (*variance)[at] = static_cast<float>(seen_past + variance_[i]);
    }
}

}  // namespace

void add_subpixel_bodies(const Frame& f, const PixelBlock& block, std::span<const std::uint32_t> bodies,
                         RadianceImage& out, std::vector<float>* variance) {
    std::optional<Collector> collector;  // constructed only for blocks that need it
    for (const std::uint32_t body : bodies) {
        const auto disc =
            f.subpixel_bodies.disc_within(static_cast<int>(body), block.x_first, block.y_first,
                                          block.x_first + block.width - 1, block.y_first + block.height - 1);
        if (!disc) continue;
        if (!collector) collector.emplace(f, block);
        collector->sample(*disc);
    }
    if (collector) collector->put_into(out, variance);
}

}  // namespace narpa
