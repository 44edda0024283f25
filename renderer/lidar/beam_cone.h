/// renderer/lidar/beam_cone.h - the rays that sample a LiDAR's beam.
///
/// A beam is an evenly lit cone. Its rays are spread evenly over the disc that it lights: a lattice by the golden
/// section (Vogel 1979), turned about the axis at random from shot to shot, so that no edge favours the lattice.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/geometry/ray_batch.h"

namespace narpa {

class BeamCone {
public:
    /// Two unit vectors across a beam, at right angles to each other.
    struct Across {
        Vec3 x, y;
    };

    /// `divergence_rad`: the full angle. One ray alone is the axis. Allocates here and never again.
    BeamCone(double divergence_rad, int rays);

    [[nodiscard]] std::size_t size() const noexcept { return x_.size(); }
    /// Of half the full angle; 0 of one ray alone.
    [[nodiscard]] double tangent() const noexcept { return tangent_; }
    /// `beam`: a unit vector. `turn`: 32 random bits.
    [[nodiscard]] static Across across(const Vec3& beam, std::uint32_t turn) noexcept;
    /// Unit vector along the n-th ray of the beam; number 0 is nearest to the axis.
    [[nodiscard]] Vec3 direction(const Vec3& beam, const Across& across, std::size_t n) const noexcept {
        return normalized(beam + (x_[n] * across.x + y_[n] * across.y));
    }
    /// Appends `count` rays of the beam from its n-th on.
    void append(const Ray& beam, const Across& across, std::size_t n, std::size_t count,
                RayBatch& rays) const noexcept;

private:
    double tangent_ = 0;
    std::vector<double> x_, y_;  ///< of each ray from the axis, at a distance of 1
};

}  // namespace narpa
