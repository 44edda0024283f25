/// renderer/frame/culling/body_culling.h - which tiles of an image may show a body.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "renderer/camera/scene_camera.h"
#include "renderer/frame/culling/tile_mask.h"

namespace narpa {

/// A body in the camera's frame, and the camera in the body's. Differences first, rotations then: positions may be
/// 4e8 m from the world's origin.
struct BodyView {
    Vec3 camera_body;               ///< position of the camera
    std::array<Vec3, 3> axes;       ///< the body's, in the camera's frame
    std::array<Vec3, 3> axes_body;  ///< the camera's, in the body's frame
    Vec3 centre_camera;             ///< the body's origin
    double rounding_m;              ///< bound of a ray's displacement by rounding

    BodyView(const Rigid3& T_world_body, const Rigid3& T_world_camera) {
        const Vec3 apart = T_world_body.t - T_world_camera.t;
        const Quat q_camera_body = conjugate(T_world_camera.q) * T_world_body.q;
        camera_body = conjugate(T_world_body.q) * -apart;
        centre_camera = conjugate(T_world_camera.q) * apart;
        axes = columns(q_camera_body);
        axes_body = columns(conjugate(q_camera_body));
        rounding_m = 0x1p-49 * (norm(T_world_body.t) + norm(T_world_camera.t) + norm(apart)) + 1e-12;  // above 0
    }
};

/// A body's bounding volumes: the leaves of its mesh's box tree, each grown by `slack_m`; without boxes the
/// ellipsoid `bounds`.
struct CulledBody {
    const BodyBounds& bounds;
    std::span<const BoxNode> boxes;
    BodyView view;
    double slack_m;
};
/// The box around these bounds.
[[nodiscard]] BoxNode box_about(const BodyBounds& bounds) noexcept;

/// Cones of the rays through rectangles of tiles: the image's, and those that halves() makes of it. A cone is
/// computed when it is first asked for; the model does not change.
class TileCones {
public:
    /// `model` outlives it.
    TileCones(const CameraModel& model, const TileRect& image);
    /// `number`: 0 for the image; 2 n + 1 and 2 n + 2 for the halves of n.
    [[nodiscard]] const DirectionCone& at(std::size_t number, const TileRect& rect) noexcept;

private:
    const CameraModel& model_;
    std::vector<DirectionCone> cones_;
};

/// Marks the tiles that may show the body, by the projection of its boxes or of its ellipsoid. `lens` may be null.
void mark_by_projection(const Pinhole& pinhole, const Camera& camera, const Lens* lens, const CulledBody& body,
                        TileMask& mask) noexcept;
/// The same for any camera model. The rays of a rectangle of tiles lie in a cone about their origin
/// (CameraModel::bounds), the parts of a body in spheres: if the cone and a sphere's cone do not overlap, the
/// rectangle does not show the sphere. The wider of the two is subdivided, down to single tiles and the leaves of
/// the box tree. Looser and slower than the projection.
void mark_by_cones(TileCones& cones, const Lens* lens, const CulledBody& body, TileMask& mask) noexcept;

}  // namespace narpa
