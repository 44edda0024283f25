/// renderer/lidar/beam_cone.h - the rays that sample a LiDAR's beam.
///
/// A beam is a uniformly lit cone. Its rays sample the lit disc on a golden-angle lattice (Vogel 1979), turned
/// about the axis at random for each shot, so that the lattice causes no bias at edges. The first rays, however
/// many, are spread over the whole disc.
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

    /// `divergence_rad`: the full angle. One ray alone is the axis. Allocates only here.
    BeamCone(double divergence_rad, int rays);

    [[nodiscard]] std::size_t size() const noexcept { return x_.size(); }
    /// Tangent of half the full angle; 0 for a single ray.
    [[nodiscard]] double tangent() const noexcept { return tangent_; }
    /// Offset of the n-th ray from the axis, at a distance of 1, before the turn.
    [[nodiscard]] double x(std::size_t n) const noexcept { return x_[n]; }
    [[nodiscard]] double y(std::size_t n) const noexcept { return y_[n]; }
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
    void spread_the_first();

    double tangent_ = 0;
    std::vector<double> x_, y_;
};

}  // namespace narpa
