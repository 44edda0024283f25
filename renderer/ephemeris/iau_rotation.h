/// renderer/ephemeris/iau_rotation.h - attitude and rotation of planets, moons and asteroids.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/pose.h"

namespace narpa {

inline constexpr std::array<std::string_view, 15> kRotatingBodies{"mercury", "venus",  "earth",  "moon",    "mars",
                                                                  "jupiter", "saturn", "uranus", "neptune", "pluto",
                                                                  "ceres",   "vesta",  "eros",   "itokawa", "sun"};

/// The attitude of a body at a UTC instant: from its own axes (z: north pole, or the pole of rotation; x: longitude
/// 0) to those of ICRS. nullopt where the name is not one of kRotatingBodies.
///
/// Elements of the IAU Working Group on Cartographic Coordinates and Rotational Elements, report of 2015 (B.
/// Archinal et al., Celestial Mechanics and Dynamical Astronomy 130:22, 2018), but: the Earth by ERFA's IAU
/// 2006/2000A with UT1 = UTC, which is off by up to 0.9 s of rotation (14 arcsec); small periodic terms of Mercury,
/// Jupiter and Neptune (below 0.1, 0.02 and 0.9 degrees) are left out. TT stands for TDB.
[[nodiscard]] std::optional<Quat> q_icrs_body(std::string_view body, std::int64_t unix_ns);

/// The same with its rate, body axes: the central difference over a minute before and after.
struct BodyRotation {
    Quat q_icrs_body{};
    Vec3 rate_rad_s{};
};
[[nodiscard]] std::optional<BodyRotation> body_rotation_of(std::string_view body, std::int64_t unix_ns);

}  // namespace narpa
