#include "estimator/dense/image_derivative.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/constants.h"
#include "estimator/view/measured_image.h"
#include "estimator/view/model_view.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/film/camera_batch.h"
#include "renderer/geometry/flush_denormals.h"
#include "renderer/integrator/shading.h"

namespace narpa {
namespace {

using Row = Eigen::Matrix<double, 6, 1>;

/// Neighbouring points of one surface are at most this many times as far apart as its slope predicts.
constexpr double kSurfaceSteps = 2.5;
/// Lower limit of the cosine between ray and normal in that prediction.
constexpr double kLeastCosine = 0.02;
/// Bisections between two rays in the search for a contour.
constexpr int kHalvings = 10;
/// Step of the finite difference of the BSDF, as a part of the range.
constexpr double kViewStep = 1e-3;
/// Rays each way in any pixel; more in the pixels that hold this part of the information by those.
constexpr int kAnywhere = 3;
constexpr double kRefined = 0.85;
/// Pixels side by side that are traced together.
constexpr int kMostInStrip = 8;
/// Parts of an exposure for each pixel of motion during it, and at the most.
constexpr double kPartsPerPixel = 1, kMostParts = 8;

bool depends_on_view(const Material& m) {
    if (is_specular(m) || m.kind == Material::Kind::lambert) return false;
    return m.kind != Material::Kind::phong || m.specular != Rgb{};
}

Camera finer_camera(const Camera& camera, int factor) {
    Camera c = scaled(camera, factor, factor);
    c.lens.reset();
    return c;
}

FrameSettings one_ray(FrameSettings settings) {
    settings.spp = 1;
    settings.budget = {};
    return settings;
}

/// DN above black of this radiance, not clipped.
double signal_of(const SensorModel& sensor, const Rgb& L) {
    const auto& k = sensor.dn_per_radiance;
    return k[0] * static_cast<double>(L.x) + k[1] * static_cast<double>(L.y) + k[2] * static_cast<double>(L.z);
}

/// What the camera sees of the target while it is exposed.
struct Seen {
    const Rigid3& T_world_target;
    const Rigid3& T_camera_target;  ///< in mid-exposure
    const ApparentMotion& motion;
    const RowTimes& times;

    /// Of an image with so many rows for each of `times`.
    [[nodiscard]] CameraPose path(double fineness, int rows) const {
        return camera_path(T_world_target, T_camera_target, motion, times.scaled(1 / fineness), rows);
    }
};

/// Through a point of the image, in the middle of its row's exposure.
Ray ray_through(const Frame& f, double x, double y) {
    return camera_ray(f.model, f.pose.at(f.pose.time(y, f.camera.height, 0.5)), x, y);
}

/// A camera with fineness x fineness pixels for each pixel of another.
struct FineGrid {
    /// All but `pixels` and `seen` outlive it.
    FineGrid(const RenderScene& render_scene, const BodyPoses& at, const Camera& pixels, const Seen& seen,
             const FrameSettings& for_all, int factor)
        : fineness(factor),
          camera(finer_camera(pixels, factor)),
          settings(one_ray(for_all)),
          frame(make_frame(render_scene, at, camera, seen.path(factor, camera.height), settings)) {}
    FineGrid(const FineGrid&) = delete;
    FineGrid& operator=(const FineGrid&) = delete;

    const int fineness;
    const Camera camera;
    const FrameSettings settings;
    const Frame frame;
};

/// The first hit of one ray. None: body -1, infinite range.
struct RaySample {
    double signal = 0;  ///< DN above black
    int body = -1;
    double range_m = 0;                          ///< along the ray
    Vec3 position{}, normal{}, ray_direction{};  ///< world
};

/// Pixels side by side, and the ring of grid points around them.
class Strip {
public:
    /// Traces all but the ring's corners.
    void trace(const FineGrid& grid, const SensorModel& sensor, int x, int y, int pixels) {
        const int s = grid.fineness, end = pixels * s;
        const Frame& f = grid.frame;
        width_ = end + 2;
        points_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(s + 2));
        CameraBatch p;
        CameraSamples samples;
        samples.centre = true;
        samples.sample.fill(0);
        Lanes<std::size_t> place;
        const auto trace = [&] {
            RgbLanes radiance;
            trace_rays(f, samples, f.tracer.all_bodies(), p);
            f.integrator.radiance(f, p, radiance);
            for (std::size_t i = 0; i < samples.n; ++i) {
                RaySample& seen = points_[place[i]];
                seen = {signal_of(sensor, radiance[i]), -1, kInfinity, {}, {}, p.rays.direction[i]};
                if (p.hits.body[i] < 0) continue;
                seen.body = p.hits.body[i];
                seen.range_m = p.hits.range_m[i];
                seen.position = p.hits.position[i];
                seen.normal = p.hits.geometric_normal[i];
            }
            samples.n = 0;
        };
        for (int j = -1; j <= s; ++j)
            for (int i = -1; i <= end; ++i) {
                if ((i == -1 || i == end) && (j == -1 || j == s)) continue;
                const int fine_x = x * s + i, fine_y = y * s + j;
                samples.x[samples.n] = fine_x, samples.y[samples.n] = fine_y;
                samples.number[samples.n] =
                    static_cast<std::uint32_t>(fine_y) * static_cast<std::uint32_t>(grid.camera.width) +
                    static_cast<std::uint32_t>(fine_x);
                place[samples.n++] = index(i, j);
                if (samples.n == kLanes) trace();
            }
        if (samples.n > 0) trace();
    }

    /// Point (i, j), counted from the first pixel's first.
    [[nodiscard]] const RaySample& at(int i, int j) const { return points_[index(i, j)]; }

private:
    [[nodiscard]] std::size_t index(int i, int j) const {
        return static_cast<std::size_t>(j + 1) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(i + 1);
    }

    int width_ = 0;
    std::vector<RaySample> points_;
};

/// While a row is exposed.
struct RowView {
    Vec3 t_camera_target{};
    ApparentMotion motion{};
    double row_s = 0;  ///< to the next row
};

/// The first two terms of one pixel, on one grid.
class PixelSides {
public:
    /// Of the strip's pixel `k`, which is pixel (x, y) of the image.
    PixelSides(const FineGrid& grid, const Strip& strip, int k, int x, int y, const RowView& view)
        : grid_(grid),
          strip_(strip),
          first_(k * grid.fineness),
          x_(x),
          y_(y),
          view_(view),
          fine_row_s_(view.row_s / grid.fineness) {}

    /// Sum over the sides within the pixel and its share of those on its border.
    Row sum() {
        const int s = grid_.fineness;
        for (int j = 0; j < s; ++j)
            for (int i = -1; i < s; ++i) {
                add(i, j, i + 1, j);
                add(j, i, j, i + 1);
            }
        add_contours();
        if (fine_row_s_ == 0) add_by_direction();
        return sum_ / (static_cast<double>(s) * s);
    }

private:
    /// From the sample on the nearer surface to its neighbour, grid points.
    struct Side {
        double x, y, dx, dy;
        double jump;  ///< DN, left or upper minus right or lower sample
    };
    /// Of the sides across one direction of the image.
    struct Jumps {
        double sum = 0, over_range = 0;  ///< DN, DN / m
    };
    struct Contour {
        Side side;
        const RaySample* far;
        double range_m;  ///< of the nearer surface
        bool near_within, far_within;
        double on_near = 0, on_far = 1;

        [[nodiscard]] double middle() const { return 0.5 * (on_near + on_far); }
        void halve(int body, double here_m) {
            if (body >= 0 && (body != far->body || std::abs(here_m - range_m) < std::abs(here_m - far->range_m)))
                on_near = middle(), range_m = here_m;
            else
                on_far = middle();
        }
    };

    [[nodiscard]] bool within(int i, int j) const {
        return i >= 0 && j >= 0 && i < grid_.fineness && j < grid_.fineness;
    }

    /// The side between a and b, its neighbour to the right or below.
    void add(int ia, int ja, int ib, int jb) {
        const RaySample &a = strip_.at(first_ + ia, ja), &b = strip_.at(first_ + ib, jb);
        const double jump = a.signal - b.signal;
        if (jump == 0) return;
        const bool near_is_a = a.range_m <= b.range_m;
        const RaySample &near = near_is_a ? a : b, &far = near_is_a ? b : a;
        if (near.body < 0 || near.body == grid_.camera.mount) return;
        const double s = grid_.fineness, to_far = near_is_a ? 1 : -1;
        const Side side{x_ * s + (near_is_a ? ia : ib), y_ * s + (near_is_a ? ja : jb), to_far * (ib - ia),
                        to_far * (jb - ja), jump};
        // A side on the border counts half for this pixel, except a contour, whose position is known.
        const bool a_within = within(ia, ja), b_within = within(ib, jb);
        if (is_contour(a, b))
            contours_.push_back(
                {side, &far, near.range_m, near_is_a ? a_within : b_within, near_is_a ? b_within : a_within});
        else
            add(side, 0.5, near.range_m, 0.5 * a_within + 0.5 * b_within);
    }

    /// `along`: where between the nearer sample, 0, and the other, 1, the edge lies.
    void add(const Side& side, double along, double range_m, double share) {
        const double jump = share * side.jump;
        if (fine_row_s_ == 0) {
            Jumps& jumps = side.dy == 0 ? across_x_ : across_y_;
            jumps.sum += jump;
            jumps.over_range += jump / range_m;
        } else {
            sum_ += jump * velocity(side.x + along * side.dx, side.y + along * side.dy, range_m, side.dy == 0);
        }
    }

    /// Where rows are exposed together a velocity is linear in the inverse range, and hardly changes in a pixel
    /// otherwise: that of its centre.
    void add_by_direction() {
        const CameraModel& model = *grid_.frame.model;
        const double middle = 0.5 * (grid_.fineness - 1);
        const Vec3 direction = model.direction({x_ * grid_.fineness + middle, y_ * grid_.fineness + middle});
        const ProjectionJacobian J = model.jacobian(direction);
        const auto add_sides = [&](const Jumps& jumps, const Vec3& move) {
            const Vec3 turn =
                jumps.sum * cross(direction, move) - jumps.over_range * cross(view_.t_camera_target, move);
            sum_.head<3>() += to_eigen(turn);
            sum_.tail<3>() += to_eigen(jumps.over_range * move);
        };
        add_sides(across_x_, J.x);
        add_sides(across_y_, J.y);
    }

    /// Bisects contours side by side: where between two samples the nearer surface ends, and its range there.
    void add_contours() {
        const Frame& f = grid_.frame;
        RayBatch rays;
        HitBatch hits;
        for (std::size_t first = 0; first < contours_.size(); first += kLanes) {
            rays.n = std::min(kLanes, contours_.size() - first);
            const std::span<Contour> batch(&contours_[first], rays.n);
            for (int k = 0; k < kHalvings; ++k) {
                for (std::size_t i = 0; i < batch.size(); ++i) {
                    const Contour& c = batch[i];
                    rays.put(i,
                             ray_through(f, c.side.x + c.middle() * c.side.dx, c.side.y + c.middle() * c.side.dy));
                }
                f.tracer.intersect(f.at, rays, f.tracer.all_bodies(), hits);
                for (std::size_t i = 0; i < batch.size(); ++i) batch[i].halve(hits.body[i], hits.range_m[i]);
            }
            for (const Contour& c : batch)
                add(c.side, c.middle(), c.range_m, (c.middle() < 0.5 ? c.near_within : c.far_within) ? 1 : 0);
        }
        contours_.clear();
    }

    /// True where the two are not neighbouring points of one surface, by the slopes from their normals.
    static bool is_contour(const RaySample& a, const RaySample& b) {
        if (a.body != b.body) return true;
        const double cosine =
            std::max(std::min(std::abs(dot(a.normal, a.ray_direction)), std::abs(dot(b.normal, b.ray_direction))),
                     kLeastCosine);
        const double range_m = kSurfaceSteps * std::max(a.range_m, b.range_m);
        const Vec3 apart = a.position - b.position, turn = a.ray_direction - b.ray_direction;
        return dot(apart, apart) * cosine * cosine > range_m * range_m * dot(turn, turn);
    }

    /// Image velocity across a side at this point of the grid: grid points per unit of the pose's error.
    [[nodiscard]] Row velocity(double x, double y, double range_m, bool horizontal) const {
        const CameraModel& model = *grid_.frame.model;
        const Vec3 point = range_m * model.direction({x, y});
        const Vec3 a = point - view_.t_camera_target;  // about the target's origin, in camera axes
        const ProjectionJacobian J = model.jacobian(point);
        Vec3 move = horizontal ? J.x : J.y;
        if (fine_row_s_ != 0) {  // what moves down is exposed later, and has moved on by then
            const Vec3 v_m_s = view_.motion.velocity_m_s + cross(view_.motion.rate_rad_s, a);
            const Vec3 down = (1 / (1 - dot(J.y, v_m_s) * fine_row_s_)) * J.y;
            move = horizontal ? J.x + dot(J.x, v_m_s) * fine_row_s_ * down : down;
        }
        Row row;
        row << to_eigen(cross(a, move)), to_eigen(move);
        return row;
    }

    const FineGrid& grid_;
    const Strip& strip_;
    const int first_;
    const int x_, y_;
    const RowView& view_;
    const double fine_row_s_;
    Row sum_ = Row::Zero();
    Jumps across_x_, across_y_;
    std::vector<Contour> contours_;
};

/// The third term, at the pixel's centre: change of reflected sunlight with the direction to the camera, by central
/// differences of the BSDF.
Row shading_change(const Frame& f, const SensorModel& sensor, int x, int y, const Vec3& t_camera_target) {
    const Ray ray = ray_through(f, x, y);
    const Hit hit = f.tracer.intersect(f.at, ray, kInfinity);
    if (hit.body < 0 || hit.body == f.camera.mount) return Row::Zero();
    if (!depends_on_view(f.tracer.scene().materials[static_cast<std::size_t>(hit.material)])) return Row::Zero();
    const Surface surface =
        surface_at(f.tracer, f.at, hit, ray.direction, hit.range_m / f.model->pixels_per_radian());
    const Vec3& to_sun = f.sun->centre();
    const double cosine = dot(surface.normal, to_sun);
    if (cosine <= 0 || f.tracer.occluded(f.at, hit, to_sun, kInfinity)) return Row::Zero();
    const Vec3 seen = hit.range_m * ray.direction;
    const auto shine = [&](const Vec3& displaced) {
        return signal_of(sensor, bsdf(surface, surface.normal, to_sun, -normalized(displaced)));
    };
    const double d = kViewStep * hit.range_m;
    const Vec3 change{shine(seen + Vec3{d, 0, 0}) - shine(seen - Vec3{d, 0, 0}),
                      shine(seen + Vec3{0, d, 0}) - shine(seen - Vec3{0, d, 0}),
                      shine(seen + Vec3{0, 0, d}) - shine(seen - Vec3{0, 0, d})};
    // DN per metre of the surface against the camera. Against the target's axes the camera moves by what the
    // target's origin moves, less what turns it about there.
    const Vec3 per_metre = (cosine * static_cast<double>(f.sun->irradiance()) / (2 * d)) * change;
    const Vec3 g = conjugate(f.T_world_camera.q) * per_metre;
    Row row;
    row << to_eigen(-cross(t_camera_target, g)), to_eigen(g);
    return row;
}

/// The pixels that hold kRefined of the information about the pose, by these derivatives: 1. `weights`: inverse
/// variances; none: all pixels in which anything changes.
void choose(std::span<const PixelDerivative> derivative, std::span<const float> weights,
            std::vector<std::uint8_t>& chosen) {
    chosen.assign(derivative.size(), 0);
    if (weights.empty()) {
        for (std::size_t p = 0; p < chosen.size(); ++p) chosen[p] = derivative[p].isZero(0) ? 0 : 1;
        return;
    }
    Matrix6 information = Matrix6::Zero();
    for (std::size_t p = 0; p < chosen.size(); ++p)
        if (!derivative[p].isZero(0))
            information.selfadjointView<Eigen::Lower>().rankUpdate(derivative[p].cast<double>(),
                                                                   static_cast<double>(weights[p]));
    const Eigen::LLT<Matrix6> root(information);
    if (root.info() != Eigen::Success) return choose(derivative, {}, chosen);
    struct Part {
        double of_information;
        std::size_t pixel;
    };
    std::vector<Part> parts;
    parts.reserve(chosen.size());
    double sum = 0;
    for (std::size_t p = 0; p < chosen.size(); ++p) {
        if (derivative[p].isZero(0)) continue;
        const Vector6 g = derivative[p].cast<double>();
        parts.push_back({static_cast<double>(weights[p]) * root.matrixL().solve(g).squaredNorm(), p});
        sum += parts.back().of_information;
    }
    std::ranges::sort(parts, std::ranges::greater{}, &Part::of_information);
    double held = 0;
    for (const Part& part : parts) {
        if (held > kRefined * sum) break;
        held += part.of_information;
        chosen[part.pixel] = 1;
    }
}

}  // namespace

ImageDerivative::ImageDerivative(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                                 const BodyPoses& at)
    : render_scene_(render_scene),
      camera_(camera),
      target_(target),
      at_(at),
      optics_(camera),
      before_optics_(optics_.any() ? camera.width : 0, optics_.any() ? camera.height : 0),
      after_optics_(before_optics_) {
    const auto& materials = render_scene.scene().materials;
    view_dependent_ = render_scene.scene().sun && std::any_of(materials.begin(), materials.end(), depends_on_view);
    derivative_.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
}

void ImageDerivative::begin_frame(const BodyPoses& at, const ApparentMotion& motion, const RowTimes& times) {
    stand_still(at, at_);
    motion_ = times.at_once() ? ApparentMotion{} : motion, times_ = times;
}

std::span<const PixelDerivative> ImageDerivative::at(const Rigid3& T_camera_target, const SensorModel& sensor,
                                                     const FrameSettings& settings, int fineness,
                                                     std::span<const float> weights) {
    const double range_m = std::max(norm(T_camera_target.t), 1e-9);
    const double blur_rad = times_.exposure_s *
                            (norm(motion_.velocity_m_s) +
                             norm(motion_.rate_rad_s) * render_scene_.tracer().bounding_radius_m(target_)) /
                            range_m;
    const double blur_px = blur_rad * CameraModelHandle(camera_)->pixels_per_radian();
    const int parts = static_cast<int>(std::clamp(std::ceil(kPartsPerPixel * blur_px), 1.0, kMostParts));
    (void)place_camera(T_camera_target, camera_, target_, at_);
    const auto add_parts = [&](int of_grid) {
        for (std::size_t p = 0; p < chosen_.size(); ++p)
            if (chosen_[p] != 0) derivative_[p].setZero();
        for (int k = 0; k < parts; ++k)
            add(T_camera_target, sensor, settings, of_grid, times_.part(k, parts),
                1.0F / static_cast<float>(parts));
    };
    std::ranges::fill(derivative_, PixelDerivative(PixelDerivative::Zero()));
    chosen_.assign(derivative_.size(), 1);
    for (std::size_t p = 0; p < weights.size(); ++p) chosen_[p] = weights[p] > 0 ? 1 : 0;
    add_parts(std::min(fineness, kAnywhere));
    if (fineness > kAnywhere) {
        choose(derivative_, weights, chosen_);
        add_parts(fineness);
    }
    if (view_dependent_)
        for (int k = 0; k < parts; ++k)
            add_shading(T_camera_target, sensor, settings, weights, times_.part(k, parts),
                        1.0F / static_cast<float>(parts));
    if (optics_.any()) apply_optics();
    return derivative_;
}

template <class Do>
void ImageDerivative::each_row(const Rigid3& T_camera_target, const RowTimes& times, float weight, Do&& rows) {
    tbb::parallel_for(1, std::max(camera_.height - 1, 1), [&](int y) {
        const FlushDenormals flush;
        const double t_s = times.at(y);
        const RowView view{moved(T_camera_target, motion_, t_s).t, motion_, times.row_s};
        const Quat back = exp_rotation(-t_s * motion_.rate_rad_s);  // from the row's error to that of mid-exposure
        const std::size_t first = static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width);
        rows(y, view, [&](int x, Row row) {
            if (t_s != 0) row.head<3>() = to_eigen(back * to_vec3(row.head<3>()));
            derivative_[first + static_cast<std::size_t>(x)] += weight * row.cast<float>();
        });
    });
}

void ImageDerivative::add(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings,
                          int fineness, const RowTimes& times, float weight) {
    const Seen seen{at_.T_world_body[target_], T_camera_target, motion_, times};
    const FineGrid grid(render_scene_, at_, camera_, seen, settings, fineness);
    each_row(T_camera_target, times, weight, [&](int y, const RowView& view, auto&& put) {
        Strip strip;
        const std::uint8_t* const chosen =
            &chosen_[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width)];
        const int end = camera_.width - 1;
        for (int x = 1; x < end; ++x) {
            int pixels = 0;
            while (pixels < kMostInStrip && x + pixels < end && chosen[x + pixels] != 0) ++pixels;
            if (pixels == 0) continue;
            strip.trace(grid, sensor, x, y, pixels);
            for (int k = 0; k < pixels; ++k) put(x + k, PixelSides(grid, strip, k, x + k, y, view).sum());
            x += pixels - 1;
        }
    });
}

void ImageDerivative::add_shading(const Rigid3& T_camera_target, const SensorModel& sensor,
                                  const FrameSettings& settings, std::span<const float> weights,
                                  const RowTimes& times, float weight) {
    const Seen seen{at_.T_world_body[target_], T_camera_target, motion_, times};
    const Frame frame = make_frame(render_scene_, at_, camera_, seen.path(1, camera_.height), settings);
    each_row(T_camera_target, times, weight, [&](int y, const RowView& view, auto&& put) {
        for (int x = 1; x < camera_.width - 1; ++x)
            if (weights.empty() || weights[static_cast<std::size_t>(y * camera_.width + x)] > 0)
                put(x, shading_change(frame, sensor, x, y, view.t_camera_target));
    });
}

/// The image's optics, over three columns at a time.
void ImageDerivative::apply_optics() {
    for (const int first : {0, 3}) {
        for (std::size_t i = 0; i < derivative_.size(); ++i) {
            const PixelDerivative& d = derivative_[i];
            before_optics_.pixels[i] = {d[first], d[first + 1], d[first + 2]};
        }
        optics_.apply(before_optics_, after_optics_);
        for (std::size_t i = 0; i < derivative_.size(); ++i) {
            const Rgb& d = after_optics_.pixels[i];
            derivative_[i].segment<3>(first) << d.x, d.y, d.z;
        }
    }
}

}  // namespace narpa
