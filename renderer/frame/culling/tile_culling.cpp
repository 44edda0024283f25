#include "renderer/frame/culling/tile_culling.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "renderer/frame/subpixel/subpixel_bodies.h"

namespace narpa {
namespace {

/// A moving body is marked at the middle of each of these parts of the exposure, with its bounds grown by its
/// motion up to the ends of that part: by about this much in the image, with not too many parts.
constexpr double kSweep_px = 4;
constexpr double kMaxParts = 8;

/// How far the points of a body move in camera axes within an exposure, at constant rates.
class RelativeMotion {
public:
    RelativeMotion(const PosePath& body, const PosePath& camera, double radius_m)
        : radius_m_(radius_m),
          shift_m_(norm((body.end().t - body.start().t) - (camera.end().t - camera.start().t))),
          turn_m_(radius_m * body.angle_rad()),
          camera_turn_rad_(camera.angle_rad()) {}

    /// Upper bound of the way of any point within a part of the exposure whose middle the body spends at
    /// `distance_m`.
    [[nodiscard]] double way_m(double part, double distance_m) const {
        const double shift_m = part * shift_m_;
        return shift_m + part * turn_m_ + part * camera_turn_rad_ * (distance_m + shift_m + radius_m_);
    }

private:
    double radius_m_, shift_m_, turn_m_, camera_turn_rad_;
};

}  // namespace

TileCulling::TileCulling(const Tracer& tracer, const Camera& camera)
    : tracer_(tracer),
      camera_(camera),
      tiles_x_((camera.width + kTileSize - 1) / kTileSize),
      tiles_y_((camera.height + kTileSize - 1) / kTileSize),
      mask_(tiles_x_, tiles_y_),
      max_listed_(std::min(kMaxListed, tracer.scene().bodies.size())),
      listed_(static_cast<std::size_t>(tiles_x_) * static_cast<std::size_t>(tiles_y_)),
      lists_(max_listed_ * listed_.size()) {
    if (camera.model->pinhole() == nullptr) cones_.emplace(*camera.model, mask_.all());
    for (const std::uint32_t body : tracer.all_bodies()) boxes_.push_back(tracer.shape(body).boxes());
}

void TileCulling::update(const BodyPoses& at, const CameraPose& camera, const Lens* lens) noexcept {
    std::fill(listed_.begin(), listed_.end(), std::uint8_t{0});
    for (const std::uint32_t body : tracer_.all_bodies()) {
        if (camera.over_time() && (camera.moves() || at.moves(body)))
            mark_swept(body, at, camera, lens);
        else
            mark(body, BodyView(at.T_world_body[body], camera.middle()), 0, lens);
        list(body);
    }
}

void TileCulling::mark_swept(std::uint32_t body, const BodyPoses& at, const CameraPose& camera,
                             const Lens* lens) noexcept {
    const RelativeMotion motion(at.path(body), camera.path(), tracer_.bounding_radius_m(body));
    const double distance_m = norm(at.T_world_body[body].t - camera.middle().t);
    const double way_px = camera_.model->pixels_per_radian() * motion.way_m(1, distance_m) / distance_m;
    // Not a number or infinite where the camera is at the body's origin.
    const double parts =
        way_px < kMaxParts * 2 * kSweep_px ? std::max(1.0, std::ceil(way_px / (2 * kSweep_px))) : kMaxParts;
    for (double part = 0; part < parts; ++part) {
        const double time = (part + 0.5) / parts;
        const BodyView view(at.T_world_body_at(body, time), camera.at(time));
        const double way_m = motion.way_m(0.5 / parts, norm(view.centre_camera));
        mark(body, view, (1 + 1e-9) * way_m + view.rounding_m, lens);
    }
}

void TileCulling::mark(std::uint32_t body, const BodyView& view, double sweep_m, const Lens* lens) noexcept {
    const CameraModel& model = *camera_.model;
    CulledBody culled{tracer_.bounds(body), boxes_[body], view,
                      kEmbreeSlack * tracer_.bounding_radius_m(body) + view.rounding_m + sweep_m};
    if (camera_.optics.point_spread) {
        const auto& [c, r] = culled.bounds;
        const auto& [x, y, z] = view.axes;
        culled.slack_m +=
            spread_reach_m(model, view.centre_camera + c.x * x + c.y * y + c.z * z, std::max({r.x, r.y, r.z}));
    }
    if (const Pinhole* pinhole = model.pinhole())
        mark_by_projection(*pinhole, camera_, lens, culled, mask_);
    else
        mark_by_cones(*cones_, lens, culled, mask_);
}

void TileCulling::list_all() noexcept {
    std::fill(listed_.begin(), listed_.end(), static_cast<std::uint8_t>(max_listed_ + 1));
}

void TileCulling::list(std::uint32_t body) noexcept {
    mask_.drain([&](int tile_x, int tile_y) {
        const std::size_t tile = index(tile_x, tile_y);
        std::uint8_t& n = listed_[tile];
        if (n < max_listed_) lists_[max_listed_ * tile + n] = body;
        if (n <= max_listed_) ++n;
    });
}

std::span<const std::uint32_t> TileCulling::bodies(int tile_x, int tile_y) const noexcept {
    assert(tile_x >= 0 && tile_x < tiles_x_ && tile_y >= 0 && tile_y < tiles_y_);
    const std::size_t tile = index(tile_x, tile_y), n = listed_[tile];
    if (n > max_listed_) return tracer_.all_bodies();
    return std::span(lists_).subspan(max_listed_ * tile, n);
}

}  // namespace narpa
