#include "renderer/frame/frame_passes.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "renderer/frame/tile_worker.h"
#include "renderer/frame/tuning.h"
#include "renderer/geometry/flush_denormals.h"

namespace narpa {
namespace {

using namespace tuning;

/// Sums are formed per chunk, so that they do not depend on the threads.
constexpr std::size_t kChunk = kTilesPerTask;

/// Finds tiles that may show light although no body is in view: the Sun's disc, area lights, a non-uniform
/// background, a medium.
class EmittersInView {
public:
    EmittersInView(const Frame& f, const Lens* lens) : f_(f) {
        everywhere_ = f.render_scene.lights().any_with_extent() || !f.render_scene.background().uniform() ||
                      f.render_scene.medium() != nullptr;
        if (f.transport.path.direct || !f.sun || f.sun->is_point()) return;
        // Generous upper bounds of the Sun's angular radius, of the deflection of rays by the lens and of the
        // camera's rotation from the pose at mid-exposure.
        const double disc_rad = f.tracer.scene().sun->angular_diameter_rad;
        const double lens_rad = lens != nullptr ? lens->aperture_diameter_m / lens->focus_distance_m : 0;
        within_rad_ = disc_rad + lens_rad + f.pose.path().angle_rad();
        sun_ = true;
    }
    /// True if rays through the tile at pixel (x, y) may meet an emitter.
    [[nodiscard]] bool any(int x, int y) const {
        if (everywhere_ || !sun_) return everywhere_;
        const DirectionCone tile = f_.model->bounds({x - 0.5, y - 0.5, x + kTile - 0.5, y + kTile - 0.5});
        const Vec3 to_tile = f_.T_world_camera.q * tile.axis, &to_sun = f_.sun->centre();
        return std::atan2(norm(cross(to_tile, to_sun)), dot(to_tile, to_sun)) < within_rad_ + tile.half_angle_rad;
    }

private:
    const Frame& f_;
    bool everywhere_ = false, sun_ = false;
    double within_rad_ = 0;
};

/// The squared error of reconstruction as a part of the squared difference between traced pixels and their
/// neighbours.
double part_not_noise(const Frame& f) {
    return f.parts == LightParts::direct ? 1 : kPartNotNoise;
}

// Lattices of tiles: a tenth of them, in blocks of 4 x 4, and a sixteenth.
bool is_error_tile(int tx, int ty) {
    return (tx / 4 + 3 * (ty / 4)) % 10 == 0;
}
bool is_pilot_tile(int tx, int ty) {
    return (tx + 6 * ty) % 16 == 0;
}

}  // namespace

FramePasses::FramePasses(const Tracer& tracer, const Camera& camera)
    : camera_(camera),
      culling_(tracer, camera),
      g_buffer_(camera.width, camera.height),
      counts_(g_buffer_.tiles() / kChunk + 1),
      errors_(counts_.size()),
      blank_(g_buffer_.tiles(), 0) {
    tiles_.reserve(g_buffer_.tiles());
}

FramePasses::Tile FramePasses::tile(std::uint32_t index) const noexcept {
    const int tx = static_cast<int>(index) % g_buffer_.tiles_x(),
              ty = static_cast<int>(index) / g_buffer_.tiles_x();
    const int x = tx * kTile, y = ty * kTile;
    return {index,
            x,
            y,
            std::min(kTile, camera_.width - x),
            std::min(kTile, camera_.height - y),
            culling_.bodies(tx, ty)};
}

template <class Work>
PassCount FramePasses::over_tiles(const Frame& f, Sums sums, const PassLimit& limit, Work&& work) {
    const std::int64_t start = now_ns();
    std::atomic<bool> stop{false};
    std::atomic<std::uint64_t> rays{0};
    std::fill(counts_.begin(), counts_.end(), PassCount{});
    const auto over_chunk = [&](std::size_t chunk, auto&& storage) {
        const std::int64_t chunk_start = f.settings.times ? now_ns() : 0;
        PhaseTimes times{};
        Worker w(f, limit, stop, f.settings.times ? &times : nullptr, storage);
        const std::size_t first = chunk * kChunk, end = std::min(first + kChunk, tiles_.size());
        for (std::size_t i = first; i < end; ++i) {
            w.read_clock();
            if (stop.load(std::memory_order_relaxed)) break;
            work(w, tile(tiles_[i]));
        }
        w.flush();
        const PassCount& count = counts_[chunk] = w.count();
        if (rays.fetch_add(count.rays, std::memory_order_relaxed) + count.rays > limit.rays)
            stop.store(true, std::memory_order_relaxed);
        if (sums == Sums::errors) errors_[chunk] = w.error;
        if (!f.settings.times) return;
        std::int64_t rest = now_ns() - chunk_start;
        for (std::size_t i = 0; i < kPhases; ++i) rest -= times[i];
        times[static_cast<std::size_t>(Phase::passes)] += rest;
        for (std::size_t i = 0; i < kPhases; ++i) phase_ns_[i].fetch_add(times[i], std::memory_order_relaxed);
    };
    const std::size_t chunks = (tiles_.size() + kChunk - 1) / kChunk;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, chunks, 1),
        [&](const tbb::blocked_range<std::size_t>& one) {
            if (stop.load(std::memory_order_relaxed)) return;
            const FlushDenormals flush;
            if (f.parts == LightParts::direct) {
                Worker::Storage<1> storage;
                over_chunk(one.begin(), storage);
            } else {
                Worker::Storage<kMaxBatches> storage;  // a megabyte: not cleared
                over_chunk(one.begin(), storage);
            }
        },
        tbb::simple_partitioner());
    PassCount sum;
    for (const PassCount& count : counts_) sum += count;
    sum.complete = !stop;
    sum.wall_ns = now_ns() - start;
    return sum;
}

void FramePasses::begin(const Frame& f, const Lens* lens) {
    find_background(f);
    g_buffer_.begin_frame(background_, f.parts);
    if (f.settings.mechanisms.tile_culling)
        culling_.update(f.at, f.pose, lens);
    else
        culling_.list_all();
    const EmittersInView emitters(f, lens);
    tiles_.clear();
    pixels_ = 0;
    for (std::uint32_t i = 0; i < g_buffer_.tiles(); ++i) {
        const Tile t = tile(i);
        if (t.bodies.empty() && !emitters.any(t.x, t.y)) continue;
        tiles_.push_back(i);
        g_buffer_.set_traced(i);
        pixels_ += static_cast<std::uint64_t>(t.width * t.height);
    }
}

/// Radiance of an escaped ray that points away from the Sun.
void FramePasses::find_background(const Frame& f) {
    TracedRays p;
    RgbLanes radiance;
    p.rays.n = 1;
    p.rays.put(0, {f.T_world_camera.t, f.sun ? -f.sun->centre() : f.T_world_camera.q * Vec3{0, 0, 1}});
    p.hits.met = 0;
    p.hits.body.fill(-1);
    if (f.sun) p.to_sun.fill(f.sun->centre());
    f.integrator.radiance(f.transport, p, radiance);
    background_ = radiance[0];
}

void FramePasses::fill_background(RadianceImage& out) {
    assert(out.width == camera_.width && out.height == camera_.height);
    if (blank_image_ != out.pixels.data() || blank_background_ != background_)
        std::fill(blank_.begin(), blank_.end(), std::uint8_t{0});
    blank_image_ = out.pixels.data();
    blank_background_ = background_;
    tbb::parallel_for(0, g_buffer_.tiles_y(), [&](int ty) {
        for (int tx = 0; tx < g_buffer_.tiles_x(); ++tx) {
            const auto i = static_cast<std::uint32_t>(ty * g_buffer_.tiles_x() + tx);
            const Tile t = tile(i);
            Rgb* const first = &out.pixels[static_cast<std::size_t>(t.y) * static_cast<std::size_t>(out.width) +
                                           static_cast<std::size_t>(t.x)];
            const bool stays = blank_[i] != 0 && *first == background_;  // else `out` is another image
            blank_[i] = !g_buffer_.is_traced(i);
            if (blank_[i] == 0 || stays) continue;
            for (int y = 0; y < t.height; ++y)
                std::fill_n(first + static_cast<std::ptrdiff_t>(y) * out.width, t.width, background_);
        }
    });
}

PassCount FramePasses::uniform(const Frame& f, RadianceImage& out, std::vector<float>* variance,
                               std::span<const std::uint8_t> chosen) {
    assert(chosen.empty() || (chosen.size() == out.pixels.size() && f.settings.spp > 1));
    assert(variance == nullptr || variance->size() == out.pixels.size());
    fill_background(out);
    const PassCount count = over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        if (f.one_sample())
            show_one_sample(w, t, out);
        else
            show_samples(w, t, chosen, out, variance);
        add_subpixel_light(f, t, out, variance);
        if (f.settings.pixels_done != nullptr)
            f.settings.pixels_done->fetch_add(static_cast<std::size_t>(t.width * t.height),
                                              std::memory_order_relaxed);
    });
    if (f.settings.pixels_done != nullptr)
        f.settings.pixels_done->fetch_add(out.pixels.size() - pixels_, std::memory_order_relaxed);
    if (f.one_sample()) estimate_centres(f);
    return count;
}

void FramePasses::show_samples(Worker& w, const Tile& t, std::span<const std::uint8_t> chosen, RadianceImage& out,
                               std::vector<float>* variance) {
    PerPixel<PixelMeans> means{};
    PerPixel<PixelSamples> spread, spread_by_paths;
    PerPixel<std::uint32_t> count;
    count.fill(static_cast<std::uint32_t>(w.f.settings.spp));
    if (!chosen.empty()) {
        bool any = false;
        t.each_pixel([&](int x, int y, std::size_t at) {
            const bool is_chosen = chosen[index_of(x, y, out.width)] != 0;
            any = any || is_chosen;
            if (!is_chosen) count[at] = 0;
        });
        if (!any) return;
    }
    const auto none = [](std::size_t) { return 0u; };
    const auto all = [&](std::size_t at) { return count[at]; };
    w.samples(t, out.width, none, all, [&](const SampleBatch& b, const TracedRays&, const BatchRadiance& light) {
        add_samples(b, light, means);
        if (variance == nullptr) return;
        for_each_lane(b.direct_lanes, [&](std::size_t i) { spread[b.place[i]].add(light.direct[i]); });
        for_each_lane(b.path_lanes, [&](std::size_t i) { spread_by_paths[b.place[i]].add(light.path[i]); });
    });
    t.each_pixel([&](int x, int y, std::size_t at) {
        if (count[at] == 0) return;
        out.pixels[index_of(x, y, out.width)] = vec_cast<float>(means[at].mean());
        w.error.add(means[at]);
    });
    if (variance == nullptr) return;
    t.each_pixel([&](int x, int y, std::size_t) { (*variance)[index_of(x, y, out.width)] = 0; });
    add_variances(t, spread, means, &PixelMeans::direct, out.width, *variance);
    add_variances(t, spread_by_paths, means, &PixelMeans::path, out.width, *variance);
}

void FramePasses::show_one_sample(Worker& w, const Tile& t, RadianceImage& out) {
    prefetch_pixels(t, out);
    if (fills_g_buffer(t.index)) {
        w.centres(t, out.width, kAllPlaces, g_buffer_);
        const GBufferTile& centres = g_buffer_.tile(t.index);
        return put_pixels(t, centres.r, centres.g, centres.b, out);
    }
    PerPixel<float> r, g, b;
    w.centres(t, out.width, kAllPlaces,
              [&](const SampleBatch& batch, const TracedRays&, const BatchRadiance& light) {
                  put_in_tile(w.f, light, batch.place, batch.samples.n, r, g, b);
              });
    put_pixels(t, r, g, b, out);
}

/// True if the tile is used for the error estimate: all tiles, or a tenth of many.
bool FramePasses::estimates(std::uint32_t tile, std::size_t many) const noexcept {
    const int tx = static_cast<int>(tile) % g_buffer_.tiles_x(), ty = static_cast<int>(tile) / g_buffer_.tiles_x();
    return tiles_.size() < many || is_error_tile(tx, ty);
}

/// The tiles of the error estimate and their neighbours.
bool FramePasses::fills_g_buffer(std::uint32_t tile) const noexcept {
    if (tiles_.size() < kManyTiles) return true;
    const int tx = static_cast<int>(tile) % g_buffer_.tiles_x(), ty = static_cast<int>(tile) / g_buffer_.tiles_x();
    for (int y = ty - 1; y <= ty + 1; ++y)
        for (int x = tx - 1; x <= tx + 1; ++x)
            if (x >= 0 && y >= 0 && is_error_tile(x, y)) return true;
    return false;
}

void FramePasses::estimate_centres(const Frame& f) {
    const auto counts = [&](std::uint32_t tile) { return estimates(tile, kManyTiles); };
    const double counted = static_cast<double>(std::count_if(tiles_.begin(), tiles_.end(), counts));
    over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        if (!counts(t.index)) return;
        TileContrast contrast;
        g_buffer_.contrast(f, t.index, contrast);
        w.error.add_centres(contrast, static_cast<double>(tiles_.size()) / counted);
    });
}

PassCount FramePasses::centres(const Frame& f, const PassLimit& limit, bool with_paths) {
    return over_tiles(f, Sums::counts, limit, [&](Worker& w, const Tile& t) {
        w.with_paths = with_paths;
        w.centres(t, camera_.width, kAllPlaces, g_buffer_);
    });
}

void FramePasses::show_centres(const Frame& f, RadianceImage& out, std::vector<float>* variance) {
    fill_background(out);
    const double each = weight_of_error_tiles(variance);
    over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        const GBufferTile& centres = g_buffer_.tile(t.index);
        put_pixels(t, centres.r, centres.g, centres.b, out);
        if (variance != nullptr || estimates(t.index, kManyFilledTiles)) {
            TileContrast contrast;
            g_buffer_.contrast(f, t.index, contrast);
            w.error.add_centres(contrast, each);
            if (variance != nullptr)
                t.each_pixel([&](int x, int y, std::size_t at) {
                    (*variance)[index_of(x, y, out.width)] = contrast.centre[at];
                });
        }
        add_subpixel_light(f, t, out, variance);
    });
}

/// Of the tiles from which the error of centres and filled images is estimated: all if the variance is wanted.
double FramePasses::weight_of_error_tiles(const std::vector<float>* variance) const {
    if (variance != nullptr) return 1;
    const auto counted = std::count_if(tiles_.begin(), tiles_.end(),
                                       [&](std::uint32_t tile) { return estimates(tile, kManyFilledTiles); });
    return counted > 0 ? static_cast<double>(tiles_.size()) / static_cast<double>(counted) : 0;
}

void FramePasses::begin_fill() {
    keep_fill();
    fill_->begin(tiles_);
}

PassCount FramePasses::fill(const Frame& f, PixelFill::Stage from, PixelFill::Stage to, const PassLimit& limit) {
    const int few = f.parts == LightParts::direct ? kFewCentres : 0;  // paths are reused within a tile
    const PassCount count = over_tiles(f, Sums::counts, limit, [&](Worker& w, const Tile& t) {
        const std::uint64_t places = fill_->between(t.index, from, to);
        if (places == 0) return;
        if (std::popcount(places) <= few)
            w.gather_centres(t, camera_.width, places, g_buffer_);
        else
            w.centres(t, camera_.width, places, g_buffer_);
    });
    if (count.complete)
        fill_->take(g_buffer_, tiles_, from, to);
    else
        fill_->set_overwritten();
    return count;
}

void FramePasses::show_filled(const Frame& f, RadianceImage& out, std::vector<float>* variance) {
    const double part = part_not_noise(f);
    fill_background(out);
    const double each = weight_of_error_tiles(variance);
    over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        const GBufferTile& pixels = g_buffer_.tile(t.index);
        put_pixels(t, pixels.r, pixels.g, pixels.b, out);
        if (variance != nullptr || estimates(t.index, kManyFilledTiles)) {
            TileContrast contrast;
            g_buffer_.contrast(f, t.index, contrast);
            t.each_pixel([&](int x, int y, std::size_t at) {
                const double squared = fill_->is_traced(t.index, at) ? static_cast<double>(contrast.centre[at])
                                                                     : part * fill_->error_of(t.index, at);
                w.error.add_squared(each * squared);
                if (variance != nullptr) (*variance)[index_of(x, y, out.width)] = static_cast<float>(squared);
            });
        }
        add_subpixel_light(f, t, out, variance);
    });
}

void FramePasses::make_plan(const Frame& f, bool adaptive) {
    if (!plan_) plan_.emplace(g_buffer_.tiles());
    if (means_.empty()) means_.resize(g_buffer_.tiles());
    if (f.parts == LightParts::both && !sunlight_plan_) sunlight_plan_.emplace(g_buffer_.tiles());
    if (!adaptive) return plan_->make_uniform(f, tiles_);
    plan_->make_adaptive(f, g_buffer_, tiles_);
    over_tiles(f, Sums::errors, {},
               [&](Worker& w, const Tile& t) { w.error.add_centres(plan_->contrast(t.index)); });
}

PassCount FramePasses::refine(const Frame& f, SamplePlan::Stage from, SamplePlan::Stage to, const PassLimit& limit,
                              Tiles which) {
    assert(plan_ && to.level >= from.level);
    if (from == SamplePlan::none()) direct_apart_ = false;
    return over_tiles(f, Sums::counts, limit, [&](Worker& w, const Tile& t) {
        if (which != Tiles::all && is_pilot_tile(t.x / kTile, t.y / kTile) != (which == Tiles::pilot)) return;
        const auto begin = [&](std::size_t at) { return plan_->count(t.index, at, from); };
        const auto end = [&](std::size_t at) { return plan_->count(t.index, at, to); };
        PerPixel<PixelMeans>& means = means_[t.index];
        t.each_pixel([&](int, int, std::size_t at) {
            if (begin(at) == 0) means[at] = {};
        });
        // The first samples of a uniform plan fill the G-buffer: with fewer than two samples per pixel, the error
        // comes from contrasts.
        const bool fill = plan_->is_uniform() && from == SamplePlan::none();
        w.samples(t, camera_.width, begin, end,
                  [&](const SampleBatch& b, const TracedRays& p, const BatchRadiance& light) {
                      add_samples(b, light, means);
                      if (fill) g_buffer_.store(f, p, light, b.place, t.index);
                  });
    });
}

bool FramePasses::plan_sunlight(const Frame& f) {
    if (tiles_.size() < g_buffer_.tiles()) sunlight_plan_->clear();
    sunlight_plan_->make_adaptive(f, g_buffer_, tiles_);
    return sunlight_plan_->any_contrast();
}

PassCount FramePasses::refine_sunlight(const Frame& f, SamplePlan::Stage from, SamplePlan::Stage to,
                                       const PassLimit& limit) {
    assert(sunlight_plan_ && f.parts == LightParts::both);
    direct_apart_ = true;
    return over_tiles(f, Sums::counts, limit, [&](Worker& w, const Tile& t) {
        w.with_paths = false;
        const auto begin = [&](std::size_t at) { return plan_->count(t.index, at, from); };
        const auto end = [&](std::size_t at) {
            return std::max(begin(at), sunlight_plan_->count(t.index, at, to));
        };
        PerPixel<PixelMeans>& means = means_[t.index];
        w.samples(t, camera_.width, begin, end,
                  [&](const SampleBatch& b, const TracedRays&, const BatchRadiance& light) {
                      add_samples(b, light, means);
                  });
    });
}

void FramePasses::show_means(const Frame& f, SamplePlan::Stage stage, bool filled, RadianceImage& out,
                             std::vector<float>* variance) {
    assert(plan_ && (variance == nullptr || variance->size() == out.pixels.size()));
    fill_background(out);
    const double part = part_not_noise(f);
    const bool uniform = plan_->is_uniform();
    // One sample of the paths, more of the direct part.
    const bool one_path = uniform && direct_apart_ && !SamplePlan::reaches(stage, 2);
    // The plan's contrasts are those of direct light alone.
    const bool needs_contrast =
        uniform ? variance != nullptr || !SamplePlan::reaches(stage, 2) : f.parts != LightParts::direct;
    over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        const GBufferTile& centres = g_buffer_.tile(t.index);
        const PerPixel<PixelMeans>& means = means_[t.index];
        t.each_pixel([&](int x, int y, std::size_t at) {
            out.pixels[index_of(x, y, out.width)] =
                means[at].count() > 0 ? vec_cast<float>(means[at].mean()) : radiance_at(centres, at);
        });
        TileContrast of_samples;
        if (needs_contrast && one_path) g_buffer_.contrast_of_paths(f, t.index, of_samples);
        if (needs_contrast && !one_path) g_buffer_.contrast(f, t.index, of_samples);
        const TileContrast& contrast = uniform || needs_contrast ? of_samples : plan_->contrast(t.index);
        w.error.add_tile(uniform && !needs_contrast ? nullptr : &contrast, means);
        if (variance != nullptr) put_variances(t, means, contrast, one_path, out.width, *variance);
        if (filled)
            t.each_pixel([&](int x, int y, std::size_t at) {
                if (means[at].count() > 0 || fill_->is_traced(t.index, at)) return;
                const double squared = part * fill_->error_of(t.index, at);
                w.error.add_squared(squared - static_cast<double>(contrast.centre[at]));
                if (variance != nullptr) (*variance)[index_of(x, y, out.width)] = static_cast<float>(squared);
            });
        add_subpixel_light(f, t, out, variance);
    });
}

double FramePasses::standard_error() const noexcept {
    FrameError sum;
    for (std::size_t chunk = 0; chunk * kChunk < tiles_.size(); ++chunk) sum += errors_[chunk];
    return sum.standard_error(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height));
}

PhaseTimes FramePasses::times() noexcept {
    PhaseTimes times;
    for (std::size_t i = 0; i < kPhases; ++i) times[i] = phase_ns_[i].exchange(0, std::memory_order_relaxed);
    return times;
}

}  // namespace narpa
