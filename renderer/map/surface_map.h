/// renderer/map/surface_map.h - depth or height of the surface that a camera sees, pixel by pixel.
///
/// A map shows one instant. It uses the camera's projection with distortion, and ignores its shutter, lens and
/// budget.
#pragma once

#include <vector>

#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/tracer.h"
#include "renderer/map/contours.h"

namespace narpa {

/// One number of a surface point, metres.
struct MapQuantity {
    enum class Kind {
        depth,   ///< along the camera's z axis
        range,   ///< from the camera
        height,  ///< along `up`, from the frame's origin
        radius,  ///< distance from the frame's origin
    };
    Kind kind = Kind::depth;
    int body = -1;       ///< only the surface of this body is seen, and the frame is its own; -1: all bodies, world
    Vec3 up{0, 0, 1};    ///< unit, axes of the frame
    double datum_m = 0;  ///< subtracted: the height or radius that counts as 0
};

struct SurfaceMap {
    ScalarField quantity;          ///< m; NaN where the camera sees no surface
    std::vector<Vec3> position_m;  ///< in the frame of the quantity; 0 where there is no surface
    /// Hill shading from 0 to 1: the cosine between the normal and a light 45 degrees above the image plane, from
    /// the upper left. Independent of the scene's lights.
    std::vector<float> shade;

    /// Bilinear between pixel centres, so linear along a side of a cell.
    [[nodiscard]] Vec3 position_at(const ImagePoint& p) const;
};

class SurfaceMapper {
public:
    /// All arguments must outlive it.
    SurfaceMapper(const Tracer& tracer, const BodyPoses& at, const Camera& camera, const Rigid3& T_world_camera,
                  const MapQuantity& quantity);

    /// At the pixel centres. Same result on any number of threads.
    [[nodiscard]] SurfaceMap map() const;

    /// Whether one surface reaches from image point a to b, at most a pixel apart; otherwise there is an occlusion
    /// edge between them, a step in range. The interval is halved eight times, each time keeping the half with the
    /// larger difference of range. It has a step if the difference that is left, over 1/256 of the interval, is
    /// more than a quarter of the whole difference and more than 0.1 times the width of a pixel at that range. So
    /// surfaces count as continuous at the limb of a sphere, where the difference falls with the root of the
    /// distance (to 1/16), and where faces meet, up to 87 degrees of slope.
    [[nodiscard]] bool is_continuous(const ImagePoint& a, const ImagePoint& b) const;

private:
    /// Hit::body < 0 where the quantity's body is not hit.
    [[nodiscard]] Hit hit_at(const ImagePoint& p) const;

    const Tracer& tracer_;
    const BodyPoses& at_;
    const Camera& camera_;
    Rigid3 T_world_camera_, T_frame_world_;
    MapQuantity quantity_;
};

}  // namespace narpa
