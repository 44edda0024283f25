#include "renderer/frame/culling/tile_culling.h"

#include <algorithm>
#include <cassert>

#include "renderer/frame/subpixel/subpixel_bodies.h"

namespace narpa {

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

void TileCulling::update(const BodyPoses& at, const Rigid3& T_world_camera, const Lens* lens) noexcept {
    std::fill(listed_.begin(), listed_.end(), std::uint8_t{0});
    const CameraModel& model = *camera_.model;
    for (const std::uint32_t body : tracer_.all_bodies()) {
        CulledBody culled{tracer_.bounds(body), boxes_[body], BodyView(at.T_world_body[body], T_world_camera),
                          kEmbreeSlack * tracer_.bounding_radius_m(body)};
        culled.slack_m += culled.view.rounding_m;
        if (camera_.optics.point_spread) {
            const auto& [c, r] = culled.bounds;
            const auto& [x, y, z] = culled.view.axes;
            culled.slack_m += spread_reach_m(model, culled.view.centre_camera + c.x * x + c.y * y + c.z * z,
                                             std::max({r.x, r.y, r.z}));
        }
        if (const Pinhole* pinhole = model.pinhole())
            mark_by_projection(*pinhole, camera_, lens, culled, mask_);
        else
            mark_by_cones(*cones_, lens, culled, mask_);
        list(body);
    }
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
