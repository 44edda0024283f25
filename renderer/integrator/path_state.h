/// renderer/integrator/path_state.h - what path.cpp keeps of paths on their way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

#include "renderer/light/small_body_sampling.h"
#include "renderer/light/lights.h"

namespace narpa {

/// Paths that are on their way together: enough that those which go on always fill packets.
inline constexpr std::size_t kStream = 128;
static_assert(kStream % kLanes == 0);

/// Room for so many, none of them made before it is put there.
template <class T>
class Room {
public:
    T& operator[](std::size_t i) { return reinterpret_cast<T*>(bytes_)[i]; }
    const T& operator[](std::size_t i) const { return reinterpret_cast<const T*>(bytes_)[i]; }
    std::span<T> from(std::size_t i, std::size_t n) { return {&(*this)[i], n}; }

private:
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
    alignas(64) std::byte bytes_[kStream * sizeof(T)];
};

/// What is known of a path.
struct Path {
    std::uint32_t ray = 0;     ///< the one from the camera that it began with
    bool lit = false;          ///< its first surface has its light, and it has survived there
    bool sunlit = false;       ///< that is some
    int shares = -1;           ///< number of its first surface among the Starts; -1: it is none
    int bounce = -1;           ///< index of what it has found for all (shared_bounces.h); -1: nothing
    float radiance_scale = 1;  ///< the part of the throughput that leaving a dense medium undoes, or that is no
                               ///< part of what the path brings
    Rgb throughput{1, 1, 1};   ///< of what it adds to, per radiance along the ray
    Rgb* to = nullptr;         ///< where its light is added up: at the camera, or where a bounce receives it
    bool sun_asked = false;    ///< the Sun's light along the ray on its way has been asked for in full
    double direction_pdf = std::numeric_limits<double>::infinity();  ///< with which that ray's direction was chosen
    double length_m = 0;                                             ///< of the way from the camera to the point
    Receiver start{};  ///< of the ray, and of light asked for at the point, where any is
    SmallBodySampling guide{};     ///< of the next ray
};

/// Light that is asked for.
struct Question {
    std::size_t path;
    Vec3 towards;
    Rgb* to;             ///< where it is added
    Rgb light;           ///< that it brings there; of a body's surface for each unit of its radiance
    double range_m;      ///< of lights: how far off
    double scatter_pdf;  ///< with which the path itself could find it
    int body;            ///< of a body's surface, which must be met
    std::uint32_t face;
};

}  // namespace narpa
