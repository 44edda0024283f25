#include "renderer/frame/camera_rays.h"

#include <cassert>

#include "base/each_isa.h"
#include "renderer/geometry/poses_at.h"
#include "renderer/integrator/batch_sampler.h"
#include "renderer/integrator/path_dimensions.h"
#include "renderer/optics/lens.h"

namespace narpa {
namespace {

// Lanes from the batch's `n` on are computed with the others and never read. Results are gathered in local arrays,
// which the compiler knows not to alias anything.

using Points = BatchSampler::Points;

BatchSampler sampler_of(const Frame& f, const CameraSamples& s) noexcept {
    return {f.transport.seed, f.transport.frame, s.n, s.number, s.sample};
}

struct ImagePoints {
    Lanes<double> x, y;
};

void aim_through(const Frame& f, const ImagePoints& p, RayBatch& rays) noexcept {
    f.model->directions(f.T_world_camera.q, p.x, p.y, rays.direction);
    rays.origin.fill(f.T_world_camera.t);
}

void aim_at_centres(const Frame& f, const CameraSamples& s, RayBatch& rays) noexcept {
    ImagePoints p;
    for (std::size_t i = 0; i < kLanes; ++i) p.x[i] = s.x[i], p.y[i] = s.y[i];
    aim_through(f, p, rays);
}

/// Each sample's point in its pixel. `u`: out, sample coordinates; the last two are unused here.
NARPA_EACH_ISA void points_in_pixels(const Frame& f, const CameraSamples& s, ImagePoints& p, Points& u) noexcept {
    sampler_of(f, s).points(u);
    if (s.centre) u[0].fill(0.5), u[1].fill(0.5);
    for (std::size_t i = 0; i < kLanes; ++i) {
        p.x[i] = s.x[i] + u[0][i] - 0.5;
        p.y[i] = s.y[i] + u[1][i] - 0.5;
    }
}

/// Moves rays through the centre of the lens to the points (u, v) of the aperture. `rays`: in, directions in camera
/// axes.
NARPA_EACH_ISA void move_over_lens(const Lens& lens, const Rigid3& T_world_camera, const Lanes<double>& u,
                                   const Lanes<double>& v, RayBatch& rays) noexcept {
    Vec3Lanes origin, direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 from = aperture_point(lens, u[i], v[i]);
        origin.put(i, T_world_camera * from);
        direction.put(i, T_world_camera.q * lens_direction(lens, rays.direction[i], from));
    }
    rays.origin = origin;
    rays.direction = direction;
}

NARPA_EACH_ISA void next_points(const Frame& f, const CameraSamples& s, std::uint32_t group, Points& u) noexcept {
    sampler_of(f, s).points(group, u);
}

NARPA_EACH_ISA void aim_at_sun(const SunDisc& sun, const Lanes<double>& u, const Lanes<double>& v,
                               Vec3Lanes& to_sun) noexcept {
    Vec3Lanes direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 d = sun.sample(u[i], v[i]);
        direction.x[i] = d.x, direction.y[i] = d.y, direction.z[i] = d.z;
    }
    to_sun = direction;
}

/// The dimensions with which a path would choose its point on the Sun from the first surface; free if that point is
/// chosen here.
constexpr std::uint32_t kPathsOwn = 2;

/// Aims the camera rays. Points on the Sun are chosen only if it is the only light or is sampled separately; paths
/// choose their own.
void aim_at_mid_exposure(const Frame& f, const CameraSamples& s, TracedRays& p) noexcept {
    const bool sun = f.sun && (f.parts == LightParts::direct || f.thins_paths);
    p.rays.n = s.n;
    if (s.centre && f.one_sample()) {
        aim_at_centres(f, s, p.rays);
        if (!sun) return;
        if (f.parts == LightParts::direct) {
            p.to_sun.fill(f.sun->centre());
            return;
        }
        Points u;
        next_points(f, s, kPathsOwn, u);
        aim_at_sun(*f.sun, u[2], u[3], p.to_sun);
        return;
    }
    Points u;
    ImagePoints image;
    points_in_pixels(f, s, image, u);
    if (f.lens == nullptr) {
        aim_through(f, image, p.rays);
        if (sun) aim_at_sun(*f.sun, u[2], u[3], p.to_sun);
    } else {
        f.model->directions({}, image.x, image.y, p.rays.direction);
        move_over_lens(*f.lens, f.T_world_camera, u[2], u[3], p.rays);
        if (!sun) return;
        next_points(f, s, kPathsOwn, u);
        aim_at_sun(*f.sun, u[2], u[3], p.to_sun);
    }
}

NARPA_EACH_ISA void random_times(const Frame& f, const CameraSamples& s, Lanes<double>& u) noexcept {
    sampler_of(f, s).first_dimension(kTimeGroup, u);
}

/// `u`: time within the exposure of each ray's row, in [0, 1).
NARPA_EACH_ISA void set_times(const Frame& f, const CameraSamples& s, const Lanes<double>& u,
                              Lanes<double>& time) noexcept {
    const int rows = f.camera.height;
    for (std::size_t i = 0; i < kLanes; ++i) time[i] = f.pose.time(s.y[i], rows, u[i]);
}

NARPA_EACH_ISA void move_camera(const Rigid3& from, const PoseLanes& to, RayBatch& rays) noexcept {
    const Quat back = conjugate(from.q);
    Vec3Lanes origin, direction;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Rigid3 T = to[i];
        const Quat turn = T.q * back;
        origin.put(i, T.t + turn * (rays.origin[i] - from.t));
        direction.put(i, turn * rays.direction[i]);
    }
    rays.origin = origin;
    rays.direction = direction;
}

/// Moves rays from the camera's pose at mid-exposure to its pose at their own times.
void move_to_times(const Frame& f, const CameraSamples& s, const Lanes<double>& u, RayBatch& rays) noexcept {
    set_times(f, s, u, rays.time);
    if (!f.pose.moves()) return;
    PoseLanes T_world_camera;
    poses_at(f.pose.path(), rays.time, T_world_camera);
    move_camera(f.T_world_camera, T_world_camera, rays);
}

}  // namespace

void aim_rays(const Frame& f, const CameraSamples& s, TracedRays& p) {
    assert(s.n <= kLanes);
    PhaseClock clock(p.times);
    aim_at_mid_exposure(f, s, p);
    if (f.over_time) {
        Lanes<double> u = kMidExposureLanes;
        if (!s.centre || !f.one_sample()) random_times(f, s, u);
        move_to_times(f, s, u, p.rays);
    }
    p.number = s.number;
    p.sample = s.sample;
    clock.ends(Phase::aim);
}

void find_first_hits(const Frame& f, std::span<const std::uint32_t> bodies, TracedRays& p) {
    PhaseClock clock(p.times);
    f.tracer.intersect(f.at, p.rays, bodies, p.hits);
    p.rays_traced += p.rays.n;
    if (f.subpixel_bodies.any())
        for (std::size_t i = 0; i < p.rays.n; ++i) p.hits.put(i, f.subpixel_bodies.beyond(p.rays[i], p.hits[i]));
    clock.ends(Phase::rays);
}

void trace_centres(const Frame& f, const CameraSamples& s, TracedRays& p) {
    p.rays.n = s.n;
    aim_at_centres(f, s, p.rays);
    if (f.over_time) move_to_times(f, s, kMidExposureLanes, p.rays);
    f.tracer.intersect(f.at, p.rays, f.tracer.all_bodies(), p.hits);
    p.rays_traced += s.n;
}

}  // namespace narpa
