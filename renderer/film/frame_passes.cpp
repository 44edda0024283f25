#include "renderer/film/frame_passes.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

#include "renderer/camera/camera_ray.h"
#include "renderer/film/subpixel_light.h"
#include "renderer/film/tile_worker.h"
#include "renderer/geometry/flush_denormals.h"
#include "renderer/light/lights.h"

namespace narpa {
namespace {

/// Tiles that a thread takes at a time. Sums are made chunk by chunk, so that the threads have no say in them.
constexpr std::size_t kChunk = 8;
constexpr std::size_t kManyTiles = 4096;
/// In a frame of a fixed number of samples, one of so many is followed by paths: the others show edges. At least
/// two are.
constexpr std::uint32_t kSamplesOfAPath = 2;

int standing_for(int x, int width, int stride) {
    return stride == 1 ? x : std::min(x - x % stride + 1, width - 1);
}

// Lattices of tiles, the first of squares of 4 x 4.
bool in_a_fifth(int tx, int ty) {
    return (tx / 4 + 2 * (ty / 4)) % 5 == 0;
}
bool in_a_sixteenth(int tx, int ty) {
    return (tx + 6 * ty) % 16 == 0;
}

/// Where rays that meet no body may still find light: the Sun's disc, lights with extent, a background that is not
/// uniform, a medium.
class EmittersInView {
public:
    EmittersInView(const Frame& f, const Lens* lens) : f_(f) {
        everywhere_ = !f.quick && (f.render_scene.lights().any_with_extent() ||
                                   !f.render_scene.background().uniform() || f.render_scene.medium() != nullptr);
        if (f.quick || f.path.direct || !f.sun || f.sun->is_point()) return;
        // Bounds, all of them generous: of half the disc, of half a tile and of the way from point to point of a
        // lens.
        const double disc_rad = f.tracer.scene().sun->angular_diameter_rad;
        const double tile_rad = kTile / std::min(f.camera.fx, f.camera.fy);
        const double lens_rad = lens != nullptr ? lens->aperture_diameter_m / lens->focus_distance_m : 0;
        within_rad_ = disc_rad + tile_rad + lens_rad;
        sun_ = true;
    }
    /// Through a tile that begins here.
    [[nodiscard]] bool any(int x, int y) const {
        if (everywhere_ || !sun_) return everywhere_;
        const Vec3 to_tile = camera_ray(f_.camera, f_.T_world_camera, x + 0.5 * kTile, y + 0.5 * kTile).direction;
        const Vec3& to_sun = f_.sun->centre();
        return std::atan2(norm(cross(to_tile, to_sun)), dot(to_tile, to_sun)) < within_rad_;
    }

private:
    const Frame& f_;
    bool everywhere_ = false, sun_ = false;
    double within_rad_ = 0;
};

}  // namespace

FramePasses::FramePasses(const Tracer& tracer, const Camera& camera)
    : camera_(camera),
      cover_(tracer, camera),
      looks_(camera.width, camera.height),
      errors_(looks_.tiles() / kChunk + 1),
      blank_(looks_.tiles(), 0) {
    tiles_.reserve(looks_.tiles());
}

FramePasses::Tile FramePasses::tile(std::uint32_t index) const noexcept {
    const int tx = static_cast<int>(index) % looks_.tiles_x(), ty = static_cast<int>(index) / looks_.tiles_x();
    const int x = tx * kTile, y = ty * kTile;
    return {index,
            x,
            y,
            std::min(kTile, camera_.width - x),
            std::min(kTile, camera_.height - y),
            cover_.bodies(tx, ty)};
}

template <class Work>
PassCount FramePasses::over_tiles(const Frame& f, Sums sums, const PassLimit& limit, Work&& work) {
    const std::int64_t start = now_ns();
    std::atomic<bool> given_up{false};
    std::atomic<std::uint64_t> samples{0}, rays{0}, paths{0}, path_rays{0};
    const auto over_chunk = [&](std::size_t chunk, auto&& room) {
        const std::int64_t begun = f.settings.times ? now_ns() : 0;
        PhaseTimes times{};
        Worker w(f, limit, given_up, room);
        if (f.settings.times)
            for (Packet& p : w.packets) p.times = &times;
        const std::size_t first = chunk * kChunk, end = std::min(first + kChunk, tiles_.size());
        for (std::size_t i = first; i < end; ++i) {
            w.look_at_clock();
            if (given_up.load(std::memory_order_relaxed)) break;
            work(w, tile(tiles_[i]));
        }
        samples.fetch_add(w.traced, std::memory_order_relaxed);
        paths.fetch_add(w.followed, std::memory_order_relaxed);
        path_rays.fetch_add(w.rays_traced(&Packet::path_rays), std::memory_order_relaxed);
        if (rays.fetch_add(w.rays_traced(), std::memory_order_relaxed) + w.rays_traced() > limit.rays)
            given_up.store(true, std::memory_order_relaxed);
        if (sums == Sums::errors) errors_[chunk] = w.error;
        if (!f.settings.times) return;
        std::int64_t rest = now_ns() - begun;
        for (std::size_t i = 0; i < kPhases; ++i) rest -= times[i];
        times[static_cast<std::size_t>(Phase::passes)] += rest;
        for (std::size_t i = 0; i < kPhases; ++i) phase_ns_[i].fetch_add(times[i], std::memory_order_relaxed);
    };
    const std::size_t chunks = (tiles_.size() + kChunk - 1) / kChunk;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, chunks, 1),
        [&](const tbb::blocked_range<std::size_t>& one) {
            if (given_up.load(std::memory_order_relaxed)) return;
            const FlushDenormals flush;
            if (f.quick)
                over_chunk(one.begin(), Worker::Room<1>());
            else
                over_chunk(one.begin(), Worker::Room<kTogether>());
        },
        tbb::simple_partitioner());
    return {!given_up, samples, rays, paths, path_rays, now_ns() - start};
}

void FramePasses::begin(const Frame& f, const Lens* lens) {
    find_background(f);
    looks_.begin_frame(background_);
    cover_.update(f.at, f.T_world_camera, lens);
    const EmittersInView emitters(f, lens);
    tiles_.clear();
    pixels_ = 0;
    for (std::uint32_t i = 0; i < looks_.tiles(); ++i) {
        const Tile t = tile(i);
        if (t.bodies.empty() && !emitters.any(t.x, t.y)) continue;
        tiles_.push_back(i);
        looks_.set_looked_at(i);
        pixels_ += static_cast<std::uint64_t>(t.width * t.height);
    }
}

/// What a ray sees that meets nothing, and that looks away from the Sun.
void FramePasses::find_background(const Frame& f) {
    Packet p;
    RgbLanes radiance;
    p.rays.n = 1;
    p.rays.put(0, {f.T_world_camera.t, f.sun ? -f.sun->centre() : f.T_world_camera.q * Vec3{0, 0, 1}});
    p.hits.met = 0;
    p.hits.body.fill(-1);
    if (f.sun) p.to_sun.fill(f.sun->centre());
    f.integrator.radiance(f, p, radiance);
    background_ = radiance[0];
}

void FramePasses::fill_background(RadianceImage& out) {
    if (blank_image_ != out.pixels.data() || blank_background_ != background_)
        std::fill(blank_.begin(), blank_.end(), std::uint8_t{0});
    blank_image_ = out.pixels.data();
    blank_background_ = background_;
    tbb::parallel_for(0, looks_.tiles_y(), [&](int ty) {
        for (int tx = 0; tx < looks_.tiles_x(); ++tx) {
            const auto i = static_cast<std::uint32_t>(ty * looks_.tiles_x() + tx);
            const Tile t = tile(i);
            Rgb* const first = &out.pixels[static_cast<std::size_t>(t.y) * static_cast<std::size_t>(out.width) +
                                           static_cast<std::size_t>(t.x)];
            const bool stays = blank_[i] != 0 && *first == background_;  // else another image took its place
            blank_[i] = !looks_.looked_at(i);
            if (blank_[i] == 0 || stays) continue;
            for (int y = 0; y < t.height; ++y)
                std::fill_n(first + static_cast<std::ptrdiff_t>(y) * out.width, t.width, background_);
        }
    });
}

namespace {

std::size_t index_of(int x, int y, int width) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

/// A packet's worth of a tile's pixels, from (x, y) in it on.
template <class Tile>
PixelBlock block_of(const Tile& t, int x, int y) {
    PixelBlock b;
    b.x_first = t.x + x, b.y_first = t.y + y;
    b.width = std::min(kBlock, t.width - x), b.height = std::min(kBlock, t.height - y);
    for (int py = b.y_first; py < b.y_first + b.height; ++py)
        for (int px = b.x_first; px < b.x_first + b.width; ++px) b.x[b.n] = px, b.y[b.n] = py, ++b.n;
    return b;
}

template <class Tile>
void add_tiny(const Frame& f, const Tile& t, RadianceImage& out, std::vector<float>* variance) {
    if (!f.tiny.any()) return;
    for (int y = 0; y < t.height; y += kBlock)
        for (int x = 0; x < t.width; x += kBlock) add_tiny_bodies(f, block_of(t, x, y), out, variance);
}

/// Of each pixel's mean, block by block.
template <class Tile>
void put_variances(const Tile& t, const PerPixel<PixelSamples>& first, const PerPixel<PixelSamples>& by_paths,
                   int image_width, std::vector<float>& variance) {
    for (int by = 0; by < t.height; by += kBlock)
        for (int bx = 0; bx < t.width; bx += kBlock) {
            const PixelBlock block = block_of(t, bx, by);
            for (std::size_t i = 0; i < block.n; ++i) variance[block.index(i, image_width)] = 0;
            for (const auto* part : {&first, &by_paths}) {
                Lanes<PixelSamples> of_block;
                Lanes<double> of_means;
                for (std::size_t i = 0; i < block.n; ++i)
                    of_block[i] = (*part)[place_in_tile(block.x[i] - t.x, block.y[i] - t.y)];
                if (of_block[0].count() == 0) continue;
                variances_of_means(std::span(of_block).first(block.n), of_means);
                for (std::size_t i = 0; i < block.n; ++i)
                    variance[block.index(i, image_width)] += static_cast<float>(of_means[i]);
            }
        }
}

/// The same where pixels have as many samples as they need.
template <class Tile>
void put_variances(const Tile& t, const PerPixel<PixelMeans>& means, const TileContrast& contrast, int image_width,
                   std::vector<float>& variance) {
    const auto at_least = [](const PixelMean& mean, float one) {
        return mean.count() == 0 ? 0 : std::max(mean.step() * mean.step(), one / static_cast<float>(mean.count()));
    };
    t.each_pixel([&](int x, int y, std::size_t at) {
        const auto& [first, by_paths] = means[at];
        const float paths = contrast.shared[at], one = contrast.edge[at] + std::max(contrast.noise[at], 0.0f);
        const bool alone = first.count() == 0;
        variance[index_of(x, y, image_width)] =
            means[at].any() ? at_least(first, one) + at_least(by_paths, alone ? one + paths : paths)
                            : contrast.middle[at];
    });
}

Rgb look_at(const GBufferTile& looks, std::size_t place) {
    return {looks.r[place], looks.g[place], looks.b[place]};
}

/// Samples of a pixel in the order of its sequence; paths follow the first of them.
struct SampleRange {
    std::uint32_t begin, end, paths;
};

/// All samples of a tile, pixel by pixel; where paths share what they find so many of each pixel, then the next.
template <class Worker, class Tile, class Samples, class Sink>
void sample_tile(Worker& w, const Tile& t, int image_width, Samples&& samples, Sink&& sink) {
    w.begin(false);
    const bool first_part = w.f.quick || w.f.sun_first, all_by_paths = !first_part;
    const std::uint32_t most = w.f.quick ? std::numeric_limits<std::uint32_t>::max() : kOfAPixel;
    std::uint32_t left = 1;
    for (std::uint32_t done = 0; left > 0; done += most) {
        left = 0;
        t.each_pixel([&](int x, int y, std::size_t at) {
            const auto number = static_cast<std::uint32_t>(index_of(x, y, image_width));
            const auto [begin, end, paths] = samples(at);
            const std::uint32_t from = begin + std::min(done, end - begin), to = from + std::min(most, end - from);
            left = std::max(left, end - to);
            for (std::uint32_t s = from; s < to; ++s)
                w.add(t, x, y, at, number, s, {first_part, !w.f.quick && (all_by_paths || s - begin < paths)},
                      sink);
        });
        w.finish(t, sink);
    }
}

/// Adds the samples of a packet to their pixels.
template <class Batch>
void add_samples(const Batch& b, const PacketLight& light, PerPixel<PixelMeans>& means) {
    for_each_lane(b.first, [&](std::size_t i) { means[b.place[i]].first.add(light.first[i]); });
    for_each_lane(b.by_paths, [&](std::size_t i) { means[b.place[i]].by_paths.add(light.by_paths[i]); });
}

}  // namespace

PassCount FramePasses::uniform(const Frame& f, RadianceImage& out, std::vector<float>* variance) {
    fill_background(out);
    const auto spp = static_cast<std::uint32_t>(f.settings.spp);
    const PassCount count = over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        if (f.one_sample()) {
            show_one_sample(w, t, out);
        } else {
            PerPixel<PixelMeans> means{};
            PerPixel<PixelSamples> spread, spread_by_paths;
            const auto store = [&](const Worker::Batch& b, const Packet&, const PacketLight& light) {
                add_samples(b, light, means);
                if (variance == nullptr) return;
                for_each_lane(b.first, [&](std::size_t i) { spread[b.place[i]].add(light.first[i]); });
                for_each_lane(b.by_paths,
                              [&](std::size_t i) { spread_by_paths[b.place[i]].add(light.by_paths[i]); });
            };
            const std::uint32_t paths = std::max((spp + kSamplesOfAPath - 1) / kSamplesOfAPath, 2u);
            sample_tile(
                w, t, out.width,
                [&](std::size_t) {
                    return SampleRange{0, spp, paths};
                },
                store);
            t.each_pixel([&](int x, int y, std::size_t at) {
                out.pixels[index_of(x, y, out.width)] = vec_cast<float>(means[at].mean());
                w.error.add(means[at]);
            });
            if (variance != nullptr) put_variances(t, spread, spread_by_paths, out.width, *variance);
        }
        add_tiny(f, t, out, variance);
        if (f.settings.pixels_done != nullptr)
            f.settings.pixels_done->fetch_add(static_cast<std::size_t>(t.width * t.height),
                                              std::memory_order_relaxed);
    });
    if (f.settings.pixels_done != nullptr)
        f.settings.pixels_done->fetch_add(out.pixels.size() - pixels_, std::memory_order_relaxed);
    if (f.one_sample()) estimate_middles(f);
    return count;
}

void FramePasses::show_one_sample(Worker& w, const Tile& t, RadianceImage& out) {
    const Frame& f = w.f;
    const auto row = [&](int y) { return &out.pixels[index_of(t.x, y, out.width)]; };
    if (!looks_serve(t.index)) {
        w.middles(t, out.width, out.height, 1, 0,
                  [&](const Worker::Batch& b, const Packet&, const PacketLight& light) {
                      for (std::size_t i = 0; i < b.samples.n; ++i)
                          row(b.samples.y[i])[b.samples.x[i] - t.x] = light(f, i);
                  });
        return;
    }
    const GBufferTile& looks = looks_.tile(t.index);
    w.middles(t, out.width, out.height, 1, 0, looks_);
    for (int y = 0; y < t.height; ++y)
        for (int x = 0; x < t.width; ++x) row(t.y + y)[x] = look_at(looks, place_in_tile(x, y));
}

/// Of many tiles a fifth is looked at, in squares: an estimate within a tenth for a fifth of the time.
bool FramePasses::estimates(std::uint32_t tile) const noexcept {
    const int tx = static_cast<int>(tile) % looks_.tiles_x(), ty = static_cast<int>(tile) / looks_.tiles_x();
    return tiles_.size() < kManyTiles || in_a_fifth(tx, ty);
}

/// To these tiles, or to those beside them.
bool FramePasses::looks_serve(std::uint32_t tile) const noexcept {
    if (tiles_.size() < kManyTiles) return true;
    const int tx = static_cast<int>(tile) % looks_.tiles_x(), ty = static_cast<int>(tile) / looks_.tiles_x();
    for (int y = ty - 1; y <= ty + 1; ++y)
        for (int x = tx - 1; x <= tx + 1; ++x)
            if (x >= 0 && y >= 0 && in_a_fifth(x, y)) return true;
    return false;
}

void FramePasses::estimate_middles(const Frame& f) {
    const auto counts = [&](std::uint32_t tile) { return estimates(tile); };
    const double seen = static_cast<double>(std::count_if(tiles_.begin(), tiles_.end(), counts));
    over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        if (!counts(t.index)) return;
        TileContrast contrast;
        looks_.contrast(f, t.index, contrast);
        w.error.add_middles(contrast, static_cast<double>(tiles_.size()) / seen);
    });
}

PassCount FramePasses::middles(const Frame& f, int stride, int made, const PassLimit& limit, Tiles which) {
    return over_tiles(f, Sums::counts, limit, [&](Worker& w, const Tile& t) {
        if (which != Tiles::all && in_a_sixteenth(t.x / kTile, t.y / kTile) != (which == Tiles::a_sixteenth))
            return;
        w.middles(t, camera_.width, camera_.height, stride, made, looks_);
    });
}

void FramePasses::show_middles(const Frame& f, int stride, RadianceImage& out) {
    fill_background(out);
    over_tiles(f, Sums::counts, {}, [&](Worker&, const Tile& t) {
        const GBufferTile& looks = looks_.tile(t.index);
        t.each_pixel([&](int x, int y, std::size_t) {
            const int from_x = standing_for(x, out.width, stride), from_y = standing_for(y, out.height, stride);
            out.pixels[index_of(x, y, out.width)] = look_at(looks, place_in_tile(from_x % kTile, from_y % kTile));
        });
        add_tiny(f, t, out, nullptr);
    });
}

void FramePasses::make_plan(const Frame& f) {
    if (!plan_) plan_.emplace(looks_.tiles());
    if (means_.empty()) means_.resize(looks_.tiles());
    plan_->weigh(f, looks_, tiles_);
    over_tiles(f, Sums::errors, {},
               [&](Worker& w, const Tile& t) { w.error.add_middles(plan_->contrast(t.index)); });
}

PassCount FramePasses::refine(const Frame& f, SamplePlan::Stage from, SamplePlan::Stage to,
                              const PassLimit& limit) {
    return over_tiles(f, Sums::counts, limit, [&](Worker& w, const Tile& t) {
        PerPixel<PixelMeans>& means = means_[t.index];
        const auto store = [&](const Worker::Batch& b, const Packet&, const PacketLight& light) {
            add_samples(b, light, means);
        };
        const GBufferTile& looks = looks_.tile(t.index);
        t.each_pixel([&](int, int, std::size_t at) {
            if (plan_->count(t.index, at, from) > 0) return;
            means[at] = {};
            // Of paths the middle counts as well: it had no say in what its pixel gets.
            if (f.sun_first && plan_->count(t.index, at, to) > 0)
                means[at].by_paths.add({looks.paths_r[at], looks.paths_g[at], looks.paths_b[at]});
        });
        const auto samples = [&](std::size_t at) {
            return SampleRange{plan_->count(t.index, at, from), plan_->count(t.index, at, to),
                               plan_->paths(t.index, at, to) - plan_->paths(t.index, at, from)};
        };
        sample_tile(w, t, camera_.width, samples, store);
    });
}

void FramePasses::show_means(const Frame& f, RadianceImage& out, std::vector<float>* variance) {
    fill_background(out);
    over_tiles(f, Sums::errors, {}, [&](Worker& w, const Tile& t) {
        const GBufferTile& looks = looks_.tile(t.index);
        const PerPixel<PixelMeans>& means = means_[t.index];
        t.each_pixel([&](int x, int y, std::size_t at) {
            out.pixels[index_of(x, y, out.width)] =
                means[at].any() ? vec_cast<float>(means[at].mean()) : look_at(looks, at);
        });
        w.error.add_tile(plan_->contrast(t.index), means);
        if (variance != nullptr) put_variances(t, means, plan_->contrast(t.index), out.width, *variance);
        add_tiny(f, t, out, variance);
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
