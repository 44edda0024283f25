#include "estimator/dense/image_derivative.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
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

std::size_t index_in(int width, int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

/// Neighbouring points of one surface are at most this many times as far apart as its slope predicts.
constexpr double kSurfaceSteps = 2.5;
/// Lower limit of the cosine between ray and normal in that prediction.
constexpr double kLeastCosine = 0.02;
/// Bisections between two rays in the search for a contour.
constexpr int kHalvings = 8;
/// Step of the finite difference of the BSDF, as a part of the range.
constexpr double kViewStep = 1e-3;
/// Pixels, each way, whose borders are traced together.
constexpr int kSquare = 8;
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

/// Traces rays through any points of a grid, to the centre of the Sun from there.
class PointTracer {
public:
    PointTracer(const FineGrid& grid, const SensorModel& sensor) : grid_(grid), f_(grid.frame), sensor_(sensor) {
        p_.sample.fill(0);
        if (f_.sun) p_.to_sun.fill(f_.sun->centre());
    }
    /// `seen` is written by the next `trace`, if not before.
    void put(double x, double y, RaySample& seen) {
        x_[n_] = x, y_[n_] = y;
        p_.number[n_] = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(grid_.camera.width) +
                        static_cast<std::uint32_t>(x);
        seen_[n_++] = &seen;
        if (n_ == kLanes) trace();
    }
    void trace() {
        if (n_ == 0) return;
        p_.rays.n = n_;
        if (f_.over_time)
            for (std::size_t i = 0; i < n_; ++i) p_.rays.put(i, ray_through(f_, x_[i], y_[i]));
        else
            f_.model->directions(f_.T_world_camera.q, x_, y_, p_.rays.direction),
                p_.rays.origin.fill(f_.T_world_camera.t);
        f_.tracer.intersect(f_.at, p_.rays, f_.tracer.all_bodies(), p_.hits);
        if (f_.subpixel_bodies.any())
            for (std::size_t i = 0; i < n_; ++i) p_.hits.put(i, f_.subpixel_bodies.beyond(p_.rays[i], p_.hits[i]));
        RgbLanes radiance;
        f_.integrator.radiance(f_, p_, radiance);
        for (std::size_t i = 0; i < n_; ++i) {
            RaySample& seen = *seen_[i];
            seen = {signal_of(sensor_, radiance[i]), -1, kInfinity, {}, {}, p_.rays.direction[i]};
            if (p_.hits.body[i] < 0) continue;
            seen.body = p_.hits.body[i];
            seen.range_m = p_.hits.range_m[i];
            seen.position = p_.hits.position[i];
            seen.normal = p_.hits.geometric_normal[i];
        }
        n_ = 0;
    }

private:
    const FineGrid& grid_;
    const Frame& f_;
    const SensorModel& sensor_;
    CameraBatch p_;
    std::size_t n_ = 0;
    Lanes<double> x_{}, y_{};
    Lanes<RaySample*> seen_{};
};

/// Pixels of the image that are traced together.
struct Square {
    int x, y, columns, rows;
};

/// Points on the borders of a square's chosen pixels, as many on each as the grid has in a pixel's side.
class Borders {
public:
    Borders(int fineness, const Square& square)
        : n_(fineness), square_(square), left_(index(0, square.rows, 0)), upper_(index(0, square.rows + 1, 0)) {}

    [[nodiscard]] const Square& square() const noexcept { return square_; }

    void trace(PointTracer& tracer, int width, std::span<const std::uint8_t> chosen) {
        const auto is_chosen = [&](int c, int r) {
            return c >= 0 && r >= 0 && c < square_.columns && r < square_.rows &&
                   chosen[index_in(width, square_.x + c, square_.y + r)] != 0;
        };
        for (int r = 0; r <= square_.rows; ++r)
            for (int c = 0; c <= square_.columns; ++c) {
                const int x = (square_.x + c) * n_, y = (square_.y + r) * n_;
                if (is_chosen(c, r - 1) || is_chosen(c, r))
                    for (int i = 0; i < n_; ++i) tracer.put(x + i, y - 0.5, upper_[index(c, r, i)]);
                if (is_chosen(c - 1, r) || is_chosen(c, r))
                    for (int i = 0; i < n_; ++i) tracer.put(x - 0.5, y + i, left_[index(c, r, i)]);
            }
        tracer.trace();
    }
    /// Point i on the left border of the square's pixel (c, r), from above.
    [[nodiscard]] const RaySample& left(int c, int r, int i) const { return left_[index(c, r, i)]; }
    /// Point i on its upper border, from the left.
    [[nodiscard]] const RaySample& upper(int c, int r, int i) const { return upper_[index(c, r, i)]; }

private:
    [[nodiscard]] std::size_t index(int c, int r, int i) const {
        return index_in(square_.columns + 1, c, r) * static_cast<std::size_t>(n_) + static_cast<std::size_t>(i);
    }

    const int n_;
    const Square square_;
    std::vector<RaySample> left_, upper_;
};

/// While a row is exposed.
struct RowView {
    Vec3 t_camera_target{};
    ApparentMotion motion{};
    double row_s = 0;  ///< to the next row
};

/// The first two terms of one pixel.
class PixelSides {
public:
    /// Of the square's pixel (column, row).
    PixelSides(const FineGrid& grid, PointTracer& tracer, const Borders& borders, int column, int row,
               const RowView& view)
        : grid_(grid),
          tracer_(tracer),
          borders_(borders),
          column_(column),
          row_(row),
          x_(borders.square().x + column),
          y_(borders.square().y + row),
          view_(view),
          fine_row_s_(view.row_s / grid.fineness) {}

    /// Sum over the lines from border to border.
    Row sum() {
        const int n = grid_.fineness;
        const double left = x_ * n - 0.5, top = y_ * n - 0.5;
        for (int i = 0; i < n; ++i) {
            add(borders_.left(column_, row_, i), borders_.left(column_ + 1, row_, i), left, y_ * n + i, n, 0);
            add(borders_.upper(column_, row_, i), borders_.upper(column_, row_ + 1, i), x_ * n + i, top, 0, n);
        }
        add_contours();
        if (fine_row_s_ == 0) add_by_direction();
        return sum_ / (static_cast<double>(n) * n);
    }

private:
    /// From the sample on the nearer surface to that on the opposite border, grid points.
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
        const RaySample *near, *far;
        double range_m = near->range_m;  ///< of the nearer surface
        double on_near = 0, on_far = 1;
        RaySample last{};  ///< of the nearer surface before its end

        [[nodiscard]] double middle() const { return 0.5 * (on_near + on_far); }
        void halve(int body, double here_m) {
            if (body >= 0 && (body != far->body || std::abs(here_m - range_m) < std::abs(here_m - far->range_m)))
                on_near = middle(), range_m = here_m;
            else
                on_far = middle();
        }
    };

    /// The line from a at (x, y) to b.
    void add(const RaySample& a, const RaySample& b, double x, double y, double dx, double dy) {
        const double jump = a.signal - b.signal;
        if (jump == 0) return;
        const bool near_is_a = a.range_m <= b.range_m;
        const RaySample &near = near_is_a ? a : b, &far = near_is_a ? b : a;
        if (near.body < 0 || near.body == grid_.camera.mount) return;
        const Side side = near_is_a ? Side{x, y, dx, dy, jump} : Side{x + dx, y + dy, -dx, -dy, jump};
        if (is_contour(a, b))
            contours_.push_back({side, &near, &far});
        else
            add(side, 0.5, 2 / (1 / a.range_m + 1 / b.range_m));
    }

    /// `along`: where between the nearer sample, 0, and the other, 1, the edge lies.
    void add(const Side& side, double along, double range_m) {
        if (fine_row_s_ == 0) {
            Jumps& jumps = side.dy == 0 ? across_x_ : across_y_;
            jumps.sum += side.jump;
            jumps.over_range += side.jump / range_m;
        } else {
            sum_ += side.jump * velocity(side.x + along * side.dx, side.y + along * side.dy, range_m, side.dy == 0);
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
            for (Contour& c : batch) {
                const double x = c.side.x + c.on_near * c.side.dx, y = c.side.y + c.on_near * c.side.dy;
                tracer_.put(x, y, c.last);
            }
            tracer_.trace();
            for (const Contour& c : batch) {
                // What changes on the surface before its end moves with the surface.
                Side on_surface = c.side;
                on_surface.jump = (c.side.dx + c.side.dy > 0 ? 1 : -1) * (c.near->signal - c.last.signal);
                Side end = c.side;
                end.jump -= on_surface.jump;
                add(on_surface, 0.5 * c.on_near, 2 / (1 / c.near->range_m + 1 / c.range_m));
                add(end, c.middle(), c.range_m);
            }
        }
        contours_.clear();
    }

    /// True where the two are not points of one surface, by the slopes from their normals.
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
    PointTracer& tracer_;
    const Borders& borders_;
    const int column_, row_, x_, y_;
    const RowView& view_;
    const double fine_row_s_;
    Row sum_ = Row::Zero();
    Jumps across_x_, across_y_;
    std::vector<Contour> contours_;
};

/// The third term where a ray meets a surface: change of reflected sunlight with the direction to the camera, by
/// central differences of the BSDF. DN per metre of the surface against the camera, world axes. Textures are
/// averaged over the pixel.
Vec3 shading_change(const Frame& f, const SensorModel& sensor, const Ray& ray, const Hit& hit) {
    const Surface surface =
        surface_at(f.tracer, f.at, hit, ray.direction, hit.range_m / f.model->pixels_per_radian());
    const Vec3& to_sun = f.sun->centre();
    const double cosine = dot(surface.normal, to_sun);
    if (cosine <= 0 || f.tracer.occluded(f.at, hit, to_sun, kInfinity)) return {};
    const Vec3 seen = hit.range_m * ray.direction;
    const auto shine = [&](const Vec3& displaced) {
        return signal_of(sensor, bsdf(surface, surface.normal, to_sun, -normalized(displaced)));
    };
    const double d = kViewStep * hit.range_m;
    const Vec3 change{shine(seen + Vec3{d, 0, 0}) - shine(seen - Vec3{d, 0, 0}),
                      shine(seen + Vec3{0, d, 0}) - shine(seen - Vec3{0, d, 0}),
                      shine(seen + Vec3{0, 0, d}) - shine(seen - Vec3{0, 0, d})};
    return (cosine * static_cast<double>(f.sun->irradiance()) / (2 * d)) * change;
}

/// The same at the middle of each chosen pixel of a square.
class ShadingChanges {
public:
    ShadingChanges(const Frame& f, const SensorModel& sensor, const Square& square,
                   std::span<const std::uint8_t> chosen)
        : f_(f), sensor_(sensor) {
        rays_.n = 0;
        for (int r = 0; r < square.rows; ++r)
            for (int c = 0; c < square.columns; ++c) {
                const int x = square.x + c, y = square.y + r;
                if (chosen[index_in(f.camera.width, x, y)] == 0) continue;
                put(index_in(kSquare, c, r), ray_through(f, x, y));
            }
        trace();
    }
    /// Of the square's pixel (c, r).
    [[nodiscard]] Row at(int c, int r, const Vec3& t_camera_target) const {
        // Against the target's axes the camera moves by what the target's origin moves, less what turns it about
        // there.
        const Vec3 g = conjugate(f_.T_world_camera.q) * changes_[index_in(kSquare, c, r)];
        Row row;
        row << to_eigen(-cross(t_camera_target, g)), to_eigen(g);
        return row;
    }

private:
    void put(std::size_t pixel, const Ray& ray) {
        pixels_[rays_.n] = pixel;
        rays_.put(rays_.n++, ray);
        if (rays_.n == kLanes) trace();
    }
    void trace() {
        if (rays_.n == 0) return;
        f_.tracer.intersect(f_.at, rays_, f_.tracer.all_bodies(), hits_);
        const auto& materials = f_.tracer.scene().materials;
        for (std::size_t i = 0; i < rays_.n; ++i) {
            if (hits_.body[i] < 0 || hits_.body[i] == f_.camera.mount) continue;
            if (!depends_on_view(materials[static_cast<std::size_t>(hits_.material[i])])) continue;
            changes_[pixels_[i]] = shading_change(f_, sensor_, rays_[i], hits_[i]);
        }
        rays_.n = 0;
    }

    const Frame& f_;
    const SensorModel& sensor_;
    RayBatch rays_;
    HitBatch hits_;
    Lanes<std::size_t> pixels_;
    std::array<Vec3, static_cast<std::size_t>(kSquare) * kSquare> changes_{};
};

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
                                                     std::span<const std::uint8_t> chosen) {
    const double range_m = std::max(norm(T_camera_target.t), 1e-9);
    const double blur_rad = times_.exposure_s *
                            (norm(motion_.velocity_m_s) +
                             norm(motion_.rate_rad_s) * render_scene_.tracer().bounding_radius_m(target_)) /
                            range_m;
    const double blur_px = blur_rad * CameraModelHandle(camera_)->pixels_per_radian();
    const int parts = static_cast<int>(std::clamp(std::ceil(kPartsPerPixel * blur_px), 1.0, kMostParts));
    (void)place_camera(T_camera_target, camera_, target_, at_);
    std::ranges::fill(derivative_, PixelDerivative(PixelDerivative::Zero()));
    chosen_.assign(derivative_.size(), 1);
    std::ranges::copy(chosen, chosen_.begin());
    for (int k = 0; k < parts; ++k)
        add(T_camera_target, sensor, settings, fineness, times_.part(k, parts), 1.0F / static_cast<float>(parts));
    if (view_dependent_)
        for (int k = 0; k < parts; ++k)
            add_shading(T_camera_target, sensor, settings, times_.part(k, parts), 1.0F / static_cast<float>(parts));
    if (optics_.any()) apply_optics();
    return derivative_;
}

template <class Do>
void ImageDerivative::each_square(const Rigid3& T_camera_target, const RowTimes& times, float weight, Do&& act) {
    const int across = (camera_.width - 3) / kSquare + 1, down = (camera_.height - 3) / kSquare + 1;
    if (camera_.width < 3 || camera_.height < 3) return;
    tbb::parallel_for(0, across * down, [&](int number) {
        const FlushDenormals flush;
        const int x = 1 + kSquare * (number % across), y = 1 + kSquare * (number / across);
        const Square square{x, y, std::min(kSquare, camera_.width - 1 - x),
                            std::min(kSquare, camera_.height - 1 - y)};
        act(square, [&](auto&& derivative) {
            for (int r = 0; r < square.rows; ++r) {
                const double t_s = times.at(y + r);
                const RowView view{moved(T_camera_target, motion_, t_s).t, motion_, times.row_s};
                const Quat back =
                    exp_rotation(-t_s * motion_.rate_rad_s);  // from the row's error to mid-exposure's
                for (int c = 0; c < square.columns; ++c) {
                    const std::size_t p = index_in(camera_.width, x + c, y + r);
                    if (chosen_[p] == 0) continue;
                    Row row = derivative(c, r, view);
                    if (t_s != 0) row.head<3>() = to_eigen(back * to_vec3(row.head<3>()));
                    derivative_[p] += weight * row.cast<float>();
                }
            }
        });
    });
}

void ImageDerivative::add(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings,
                          int fineness, const RowTimes& times, float weight) {
    const Seen seen{at_.T_world_body[target_], T_camera_target, motion_, times};
    const FineGrid grid(render_scene_, at_, camera_, seen, settings, fineness);
    each_square(T_camera_target, times, weight, [&](const Square& square, auto&& each) {
        Borders borders(grid.fineness, square);
        PointTracer tracer(grid, sensor);
        borders.trace(tracer, camera_.width, chosen_);
        each(
            [&](int c, int r, const RowView& view) { return PixelSides(grid, tracer, borders, c, r, view).sum(); });
    });
}

void ImageDerivative::add_shading(const Rigid3& T_camera_target, const SensorModel& sensor,
                                  const FrameSettings& settings, const RowTimes& times, float weight) {
    const Seen seen{at_.T_world_body[target_], T_camera_target, motion_, times};
    const Frame frame = make_frame(render_scene_, at_, camera_, seen.path(1, camera_.height), settings);
    each_square(T_camera_target, times, weight, [&](const Square& square, auto&& each) {
        const ShadingChanges changes(frame, sensor, square, chosen_);
        each([&](int c, int r, const RowView& view) { return changes.at(c, r, view.t_camera_target); });
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
