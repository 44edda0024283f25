/// renderer/integrator/wavefront.h - wavefront light transport: many paths, advanced one vertex at a time.
///
/// Each round
///   extend:  traces the ray of every path; adds emission and the light of escaped rays;
///   connect: next-event estimation at the vertices; shadow rays are traced in batches;
///   scatter: Russian roulette, then BSDF sampling of the next ray.
/// Finished paths are removed from the arrays, so that batches stay full. The result of a path depends only on its
/// own ray and random numbers, unless paths are reused.
///
/// Direct lighting is one round, path tracing max_depth rounds. Used only by path.h.
#pragma once

#include "base/uninitialized_array.h"
#include "renderer/integrator/batch_sampler.h"
#include "renderer/integrator/path.h"
#include "renderer/integrator/path_dimensions.h"
#include "renderer/integrator/path_reuse.h"
#include "renderer/integrator/path_vertex.h"
#include "renderer/light/small_body_sampling.h"

namespace narpa {

/// Maximum number of paths traced together.
inline constexpr std::size_t kWavefront = 128;
static_assert(kWavefront % kLanes == 0);

/// A shadow ray and its contribution.
struct ShadowRay {
    std::size_t path;  ///< path whose current vertex it leaves
    Vec3 direction{};
    double range_m;      ///< to the light; infinite for the Sun and the background
    Rgb* to;             ///< where the contribution is added if unoccluded
    Rgb contribution{};  ///< for emissive surfaces: per unit of radiance
    // For an emissive surface, which the ray must hit:
    double scatter_pdf;  ///< density with which BSDF sampling chooses the direction
    int body;
    std::uint32_t face;
};

class Wavefront {
public:
    /// `transport` outlives it.
    explicit Wavefront(const Transport& transport);

    /// Traces each path on its own, at most kWavefront.
    void run(std::span<const PathStart> starts, std::span<Rgb> radiance);
    /// With path reuse; see reused_path_radiance.
    void run_reused(std::span<const PathStart> starts, std::span<Rgb> radiance, std::span<float> variance);
    [[nodiscard]] std::uint64_t rays_traced() const { return rays_traced_; }

private:
    using Points = BatchSampler::Points;

    void begin();
    void run_rounds();

    // Extend.
    void extend();
    void arrive(int vertex);
    void find_segments(int vertex);
    void shade(std::size_t i, bool emission_counts);
    [[nodiscard]] Rgb ambient(std::size_t i) const;
    [[nodiscard]] Rgb escaped(const Path& path, const Vec3& direction, int vertex) const;

    // Connect: wavefront_connect.cpp.
    void connect(int vertex, bool lit_surfaces_count);
    void sample_sun(std::size_t i, double u, double v, SecondVertex* second);
    void sample_emitters(std::size_t i, double choice, double u, double v, SecondVertex* second);
    void sample_background(std::size_t i, double u, double v, SecondVertex* second);
    struct ShadowBatch;
    void fill(const UninitializedArray<ShadowRay, kWavefront>& rays, std::size_t first, std::size_t end,
              ShadowBatch& batch);
    void trace_shadow_rays(UninitializedArray<ShadowRay, kWavefront>& rays, std::size_t n);
    void trace_to_surfaces();
    [[nodiscard]] Rgb emission(const Path& path, const Vec3& direction, const Hit& hit) const;
    [[nodiscard]] Rgb transmittance(std::size_t path, const Vec3& direction, double range_m) const;

    // Scatter.
    void scatter(int vertex, bool last);
    [[nodiscard]] BsdfSample next_direction(std::size_t i, const SamplePoint& numbers) const;
    [[nodiscard]] double scatter_pdf(const Path& path, const Vec3& direction, double bsdf_pdf) const;
    [[nodiscard]] float survival(const Path& path, int vertices) const;
    [[nodiscard]] float first_survival(const Rgb& albedo, bool unlit) const;

    // Path reuse.
    void sample_small_bodies(Path& path, const PathStart& unlit) const;
    void collect_second_vertices();
    [[nodiscard]] SecondVertex* second_vertex(const Path& path, int vertex);
    void reuse();

    /// Draws the sample dimensions of a group for the batch that begins with path `first`.
    void draw(std::size_t first, std::uint32_t group, Points& u) const;
    /// The sample numbers of a path.
    [[nodiscard]] PixelSampler sampler(const PathStart& start) const {
        return {transport_.seed, transport_.frame, start.pixel};
    }
    void keep(std::size_t from, std::size_t to);
    static void add(const Path& path, const Rgb& radiance) { *path.to += path.throughput * radiance; }

    const RenderScene& render_scene_;
    const Tracer& tracer_;
    const Lights& lights_;
    const Background& background_;
    const Medium* const medium_;
    const BodyPoses& at_;
    const PathSettings& settings_;
    const Transport& transport_;
    std::span<const PathStart> starts_;
    // Features of the scene; absent ones cost nothing:
    const Lights::Group group_;
    const SunDisc* const sun_;
    const bool sun_has_extent_, narrow_sun_;
    const bool small_bodies_;  ///< some body may have a small angular size from another
    const bool emitters_;      ///< emitters other than the Sun exist
    const bool background_sampled_;
    const bool receivers_;    ///< Path::start is needed
    const bool finds_alone_;  ///< escaped rays find light that is not reused: background, a wide Sun
    const bool sun_alone_;    ///< the Sun is the only source of light
    bool grouped_ = false;    ///< paths of several pixels (run_reused), with roulette at their first vertices
    bool reuse_ = false;

    std::span<Rgb> radiance_;
    std::span<float> variance_;
    std::uint64_t rays_traced_ = 0;

    std::size_t n_ = 0;  ///< number of active paths
    template <class T>
    using PerPath = UninitializedArray<T, kWavefront>;
    PerPath<Path> paths_;
    PerPath<PathVertex> vertices_;
    PerPath<Vec3> directions_;         ///< of the rays
    PerPath<MediumSegment> segments_;  ///< along the rays, where there is a medium
    PerPath<Hit> hits_;                ///< start points of the rays; after `extend` their hits
    std::size_t n_shadow_ = 0, n_to_lights_ = 0, n_to_surfaces_ = 0;
    PerPath<ShadowRay> shadow_rays_;  ///< of infinite length
    PerPath<ShadowRay> to_lights_, to_surfaces_;
    std::size_t n_second_ = 0;
    UninitializedArray<SecondVertex, kReuseGroup> second_;
    FirstVertices first_;
};

}  // namespace narpa
