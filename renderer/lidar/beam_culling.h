/// renderer/lidar/beam_culling.h - which bodies a LiDAR's beams may meet.
///
/// Most beams of a turn meet nothing, also where the bodies' ellipsoids are all around the LiDAR, as that of its
/// own mount is. A beam, a cone, is held against the boxes about the parts of a body (Shape::boxes), sixteen beams
/// side by side; only those that touch a box are traced.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "renderer/geometry/tracer.h"

namespace narpa {

/// A box along a body's axes, of a tree, by its middle; metres.
struct BeamBox {
    float x, y, z, half_x, half_y, half_z;
    float radius;
    std::uint32_t children;  ///< index of the first of two; 0: a leaf
};

class BeamCulling {
public:
    /// `tangent`: of half the beams' full angle. Nothing beyond `range_max_m` counts. The tracer must outlive it.
    /// Allocates here alone.
    BeamCulling(const Tracer& tracer, double tangent, double range_max_m);

    /// Returns those of the beams that may meet a body. Conservative: no ray within a beam's cone meets the surface
    /// of any other body before the range's end.
    [[nodiscard]] std::uint32_t find_meeting(const BodyPoses& at, const RayBatch& beams) noexcept;
    /// The bodies that any of these beams of the batch may meet.
    [[nodiscard]] std::span<const std::uint32_t> bodies_of(std::uint32_t beams) noexcept;

private:
    struct BoxedShape {
        const Shape* shape;
        std::vector<BeamBox> boxes;
    };

    const Tracer& tracer_;
    double tangent_, range_max_m_;
    std::vector<BoxedShape> shapes_;
    std::vector<std::size_t> shape_of_body_;  ///< index into shapes_
    std::vector<std::uint32_t> meeting_;      ///< for each body a bit for each beam that may meet it
    std::vector<std::uint32_t> bodies_;
};

}  // namespace narpa
