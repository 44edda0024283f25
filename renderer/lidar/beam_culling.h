/// renderer/lidar/beam_culling.h - which bodies a LiDAR's beams may meet.
///
/// Most beams of a rotation hit nothing, even where the LiDAR is inside a bounding ellipsoid, as in that of its own
/// mount. Beams, which are cones, are tested against a body's tree of boxes (Shape::boxes), sixteen at a time; only
/// those that touch a leaf are traced. Among many bodies those near the beams are found in the tree over them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "renderer/geometry/tracer.h"

namespace narpa {

/// Node of a tree of boxes along a body's axes, by centre and half extents; metres.
struct BeamBox {
    float x, y, z, half_x, half_y, half_z;
    float radius;
    std::uint32_t children;  ///< index of the first of two; 0: a leaf
};

class BeamCulling {
public:
    /// `tangent`: of half the beams' full angle. Surfaces beyond `range_max_m` are ignored. The tracer must outlive
    /// it. Allocates only here.
    BeamCulling(const Tracer& tracer, double tangent, double range_max_m);

    /// Returns the beams that may hit a body. Conservative: no ray within a beam's cone meets the surface of any
    /// other body before the range's end.
    [[nodiscard]] std::uint32_t find_meeting(const BodyPoses& at, const RayBatch& beams) noexcept;
    /// The bodies that any of these beams of the batch may meet.
    [[nodiscard]] std::span<const std::uint32_t> bodies_of(std::uint32_t beams) noexcept;

private:
    struct BoxedShape {
        const Shape* shape;
        std::vector<BeamBox> boxes;
    };

    struct Meeting {
        std::uint32_t body, beams;  ///< a bit for each beam that may meet the body
    };
    [[nodiscard]] std::uint32_t meeting(const BodyPoses& at, const RayBatch& beams,
                                        std::size_t body) const noexcept;

    const Tracer& tracer_;
    double tangent_, range_max_m_;
    std::vector<BoxedShape> shapes_;
    std::vector<std::size_t> shape_of_body_;  ///< index into shapes_
    std::vector<Meeting> meetings_;           ///< of the batch, by body; as long as there are bodies
    std::size_t met_ = 0;                     ///< number of them
    std::vector<std::uint32_t> bodies_;
};

}  // namespace narpa
