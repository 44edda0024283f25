#include "bench/terrain_cost.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <numbers>

#include "bench/statistics.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/tracer.h"
#include "renderer/terrain/terrain_mesh.h"

namespace narpa {
namespace {

/// Value noise of all scales down to two posts (K. Perlin 1985, with values in place of gradients), amplitudes in
/// proportion to the scale to the power 0.8, rounded to steps of 0.1 m as a file of 16 bits has them.
class FractalGround final : public HeightSource {
public:
    FractalGround(int posts, double spacing_m) : posts_(posts), spacing_m_(spacing_m) {}

    [[nodiscard]] int columns() const override { return posts_; }
    [[nodiscard]] int rows() const override { return posts_; }
    [[nodiscard]] bool read_rows(int row, int count, double* heights) override {
        std::fill_n(heights, static_cast<std::size_t>(count) * static_cast<std::size_t>(posts_), 0.0);
        for (int scale = 2048; scale >= 2; scale /= 2) add_octave(scale, row, count, heights);
        for (std::size_t i = 0; i < static_cast<std::size_t>(count) * static_cast<std::size_t>(posts_); ++i)
            heights[i] = 0.1 * std::round(10 * heights[i]);
        return true;
    }
    [[nodiscard]] double at_middle() {
        std::vector<double> row(static_cast<std::size_t>(posts_));
        static_cast<void>(read_rows(posts_ / 2, 1, row.data()));
        return row[row.size() / 2];
    }

private:
    static double value(std::uint32_t x, std::uint32_t y, std::uint32_t scale) {
        std::uint64_t z = (std::uint64_t{x} << 32 | y) ^ std::uint64_t{scale} * 0x9e37'79b9'7f4a'7c15ull;
        z = (z ^ (z >> 30)) * 0xbf58'476d'1ce4'e5b9ull;
        z = (z ^ (z >> 27)) * 0x94d0'49bb'1331'11ebull;
        return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
    }
    void add_octave(int scale, int row, int count, double* heights) const {
        const double amplitude_m = 0.12 * std::pow(scale * spacing_m_, 0.8);
        const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
        const auto step = static_cast<std::uint32_t>(scale);
        for (int i = 0; i < count; ++i) {
            const auto y = static_cast<std::uint32_t>(row + i);
            const double v = smooth(static_cast<double>(y % step) / scale);
            double* const out = heights + static_cast<std::size_t>(i) * static_cast<std::size_t>(posts_);
            double left = 0, right = 0;
            for (std::uint32_t x = 0; x < static_cast<std::uint32_t>(posts_); ++x) {
                if (x % step == 0) {
                    const auto at = [&](std::uint32_t cx) {
                        return (1 - v) * value(cx, y / step, step) + v * value(cx, y / step + 1, step);
                    };
                    left = x == 0 ? at(0) : right, right = at(x / step + 1);
                }
                const double u = smooth(static_cast<double>(x % step) / scale);
                out[x] += amplitude_m * (left + u * (right - left));
            }
        }
    }
    int posts_;
    double spacing_m_;
};

Mesh mesh_of(TerrainMesh&& t) {
    Mesh mesh;
    mesh.name = "terrain";
    mesh.height_field = true;
    mesh.origin_m = t.origin_m;
    mesh.positions = std::move(t.positions), mesh.normals = std::move(t.normals);
    mesh.uvs = std::move(t.uvs), mesh.faces = std::move(t.faces);
    mesh.face_material.assign(mesh.faces.size(), 0);
    return mesh;
}

/// The mesh of these faces alone, in their order.
Mesh part_of(const Mesh& whole, const std::vector<bool>& faces) {
    Mesh part;
    part.name = "visible";
    part.height_field = true;
    part.origin_m = whole.origin_m;
    constexpr std::uint32_t kNone = 0xffff'ffffu;
    std::vector<std::uint32_t> id(whole.positions.size(), kNone);
    for (std::size_t f = 0; f < whole.faces.size(); ++f) {
        if (!faces[f]) continue;
        auto face = whole.faces[f];
        for (std::uint32_t& v : face) {
            if (id[v] == kNone) {
                id[v] = static_cast<std::uint32_t>(part.positions.size());
                part.positions.push_back(whole.positions[v]), part.normals.push_back(whole.normals[v]);
                part.uvs.push_back(whole.uvs[v]);
            }
            v = id[v];
        }
        part.faces.push_back(face);
    }
    part.face_material.assign(part.faces.size(), 0);
    return part;
}

/// A scene of one mesh, and its tracer.
struct Traced {
    std::unique_ptr<Scene> scene = std::make_unique<Scene>();
    std::unique_ptr<Tracer> tracer;

    static Result<Traced> make(Mesh mesh) {
        Traced t;
        t.scene->materials.emplace_back();
        t.scene->meshes.push_back(std::move(mesh));
        t.scene->bodies.push_back({.name = "ground", .shape = 0});
        auto tracer = Tracer::create(*t.scene);
        if (!tracer) return tracer.error();
        t.tracer = std::make_unique<Tracer>(*std::move(tracer));
        return t;
    }
};

/// A nadir view from a position, x to the right.
class DownwardView {
public:
    DownwardView(const TerrainCostSettings& s, const Vec3& from)
        : width_(s.width),
          height_(s.height),
          focal_px_(0.5 * s.width / std::tan(0.5 * s.fov_deg * std::numbers::pi / 180)),
          from_(from) {}

    /// Calls `use(rays)` for blocks of 4 x 4 samples, `side` x `side` of them in each pixel.
    template <class Use>
    void each_batch(int side, const Use& use) const {
        RayBatch rays;
        for (int y = 0; y < side * height_; y += 4)
            for (int x = 0; x < side * width_; x += 4) {
                rays.n = 0;
                for (int i = 0; i < 16; ++i) {
                    const double u = (x + i % 4 + 0.5) / side - 0.5 * width_,
                                 v = (y + i / 4 + 0.5) / side - 0.5 * height_;
                    rays.put(rays.n++, {from_, normalized(Vec3{u, -v, -focal_px_})});
                }
                use(rays);
            }
    }

private:
    int width_, height_;
    double focal_px_;
    Vec3 from_;
};

double ray_ns(const Traced& t, const DownwardView& view) {
    const BodyPoses at(1);
    HitBatch hits;
    std::size_t rays_traced = 0;
    const double start_s = cpu_s(CLOCK_THREAD_CPUTIME_ID);
    view.each_batch(1, [&](const RayBatch& rays) {
        t.tracer->intersect(at, rays, t.tracer->all_bodies(), hits);
        rays_traced += rays.n;
    });
    return 1e9 * (cpu_s(CLOCK_THREAD_CPUTIME_ID) - start_s) / static_cast<double>(rays_traced);
}

/// The faces that side x side rays in each pixel hit.
struct Seen {
    std::vector<bool> faces;
    std::size_t rays = 0, missed = 0, from_below = 0;

    Seen(const Traced& t, const DownwardView& view, int side) : faces(t.scene->meshes.front().faces.size()) {
        const BodyPoses at(1);
        HitBatch hits;
        view.each_batch(side, [&](const RayBatch& batch) {
            t.tracer->intersect(at, batch, t.tracer->all_bodies(), hits);
            for_each_lane(hits.met, [&](std::size_t i) { faces[hits.face[i]] = true; });
            rays += batch.n;
            missed += batch.n - static_cast<std::size_t>(std::popcount(hits.met));
            from_below += static_cast<std::size_t>(std::popcount(hits.met & ~hits.outside));
        });
    }
};

/// The ground, and the levels of detail of a path above its middle.
class Ground {
public:
    explicit Ground(const TerrainCostSettings& s)
        : heights_(s.posts, s.spacing_m), middle_m_(heights_.at_middle()) {
        placement_.map = {0, s.spacing_m, 0, 0, 0, -s.spacing_m};
        placement_.x0 = 0.5 * s.spacing_m * (s.posts - 1), placement_.y0 = -placement_.x0;
        const double x = std::tan(0.5 * s.fov_deg * std::numbers::pi / 180), y = x * s.height / s.width;
        options_.pixels_per_rad = 0.5 * s.width / x * (1 + x * x + y * y);
    }
    [[nodiscard]] Vec3 above(double height_m) const { return {0, 0, middle_m_ + height_m}; }
    Result<Traced> terrain(const std::vector<Vec3>& seen_from, std::size_t& all_triangles) {
        options_.seen_from = seen_from;
        auto terrain = build_terrain(heights_, placement_, options_);
        if (!terrain) return terrain.error();
        all_triangles = terrain->summary.full_triangles;
        return Traced::make(mesh_of(*std::move(terrain)));
    }

private:
    FractalGround heights_;
    double middle_m_;
    Placement placement_;
    TerrainOptions options_;
};

}  // namespace

Result<TerrainCost> measure_terrain_cost(const TerrainCostSettings& s,
                                         const std::function<void(const std::string&)>& progress) {
    TerrainCost cost;
    Ground ground(s);
    progress("terrain");
    const double start_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID);
    const auto whole = ground.terrain({ground.above(s.from_m), ground.above(s.to_m)}, cost.all_triangles);
    if (!whole) return whole.error();
    cost.build_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID) - start_s;
    cost.triangles = whole->tracer->triangle_count();
    for (const double height_m : s.heights_m) {
        progress(fmt::format("from {:g} m", height_m));
        const DownwardView view(s, ground.above(height_m));
        const Seen all(*whole, view, s.visible_rays), once(*whole, view, 1);
        const Mesh& mesh = whole->scene->meshes.front();
        const auto visible = Traced::make(part_of(mesh, all.faces)), met = Traced::make(part_of(mesh, once.faces)),
                   own = ground.terrain({ground.above(height_m)}, cost.all_triangles);
        for (const auto* made : {&visible, &met, &own})
            if (!*made) return made->error();
        TerrainCostRow row{
            .height_m = height_m, .rays = all.rays, .missed = all.missed, .from_below = all.from_below};
        const std::array<std::pair<const Traced*, RayCost*>, 4> candidates{
            {{&*whole, &row.terrain}, {&*visible, &row.visible}, {&*met, &row.met}, {&*own, &row.for_this_height}}};
        std::array<std::vector<double>, 4> ns;
        for (int n = 0; n < s.turns; ++n)
            for (std::size_t i = 0; i < candidates.size(); ++i) ns[i].push_back(ray_ns(*candidates[i].first, view));
        for (std::size_t i = 0; i < candidates.size(); ++i)
            *candidates[i].second = {candidates[i].first->tracer->triangle_count(), median(ns[i])};
        cost.rows.push_back(row);
    }
    return cost;
}

std::vector<std::string> terrain_cost_faults(const TerrainCost& cost) {
    std::vector<std::string> faults;
    for (const TerrainCostRow& row : cost.rows) {
        if (!(row.ratio() <= kTerrainRatioMost))
            faults.push_back(
                fmt::format("from {:g} m: {:.2f} times a mesh of the visible triangles, expected at most {:g}",
                            row.height_m, row.ratio(), kTerrainRatioMost));
        if (row.from_below > 0)
            faults.push_back(fmt::format("from {:g} m: {} of {} rays meet the terrain from below, expected none",
                                         row.height_m, row.from_below, row.rays));
    }
    return faults;
}

}  // namespace narpa
