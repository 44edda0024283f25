/// renderer/integrator/path_state.h - the state of a path between its vertices.
#pragma once

#include <cstdint>
#include <limits>

#include "renderer/light/lights.h"
#include "renderer/light/small_body_sampling.h"

namespace narpa {

struct Path {
    std::uint32_t ray = 0;  ///< of the camera
    Rgb throughput{1, 1, 1};
    Rgb* to = nullptr;         ///< where its light is added: to the camera's ray, or to a second vertex
    float radiance_scale = 1;  ///< part of the throughput that is undone on leaving a dense medium, or that is no
                               ///< part of what the path brings to the camera: not for the roulette
    double direction_pdf = std::numeric_limits<double>::infinity();  ///< of the ray, per solid angle
    double length_m = 0;                                             ///< from the camera to the vertex
    Receiver start{};                  ///< of the ray, or of shadow rays; where anything needs it
    SmallBodySampling small_bodies{};  ///< part in the choice of the next ray
    bool sun_sampled = false;          ///< next-event estimation has found all sunlight along the ray
    // Path reuse:
    bool lit = false;        ///< the direct light of its first surface is known, and it has survived there
    bool sunlit = false;     ///< that light is not zero
    int first_vertex = -1;   ///< number among FirstVertices; -1: none
    int second_vertex = -1;  ///< number among the second vertices; -1: none
};

}  // namespace narpa
