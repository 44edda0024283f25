/// dataset/image/image_random.h - the random numbers of one image: functions of the recipe's seed, the image's
/// number and what they are for, so that they depend on no other image.
#pragma once

#include <cstdint>

#include "base/counter_random.h"

namespace narpa::dataset {

/// What a random number is for. Written in no file, but a change of the numbers changes all data sets.
enum class Purpose : std::uint32_t {
    variant,
    backdrop,
    range,
    attitude,
    place,
    sun,
    exposure_time,
    gain,
    albedo,
    camera_roll,
    backdrop_pose,
};

class ImageRandom {
public:
    ImageRandom(std::uint64_t seed, std::uint32_t image) : schedule_(seed ^ kStream), image_(image) {}

    /// Uniform in [0, 1), multiples of 2^-53; `index` < 32 numbers them.
    [[nodiscard]] double uniform(Purpose purpose, std::size_t index = 0) const noexcept {
        const RandomLanes r = philox(schedule_, 0, image_, static_cast<std::uint32_t>(purpose));
        const std::size_t lane = index / 2 % kLanes;
        const std::uint64_t high = index % 2 == 0 ? r.w0[lane] : r.w2[lane];
        const std::uint64_t low = index % 2 == 0 ? r.w1[lane] : r.w3[lane];
        return static_cast<double>((high << 32 | low) >> 11) * 0x1p-53;
    }

private:
    static constexpr std::uint64_t kStream = 0x64617461'73657473u;  ///< not that of pixels' noise

    PhiloxSchedule schedule_;
    std::uint32_t image_;
};

}  // namespace narpa::dataset
