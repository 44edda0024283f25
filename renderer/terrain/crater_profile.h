/// renderer/terrain/crater_profile.h - the shape of a fresh simple crater.
#pragma once

namespace narpa {

inline constexpr double kCraterReach = 2;  ///< outer radius of the rim, in crater radii

/// Height above the ground at r crater radii (at most kCraterReach) from the centre of a crater of 1 m diameter: a
/// bowl of depth 0.196 below the crest, and a rim of height 0.036 that falls off (R. Pike, in Impact and Explosion
/// Cratering, 1977).
inline double crater_profile(double r) {
    constexpr double kRim = 0.036, kDepth = 0.196;
    if (r < 1) return kRim - kDepth * (1 - r * r);
    constexpr double kEnd = 1 / (kCraterReach * kCraterReach * kCraterReach);
    return kRim * (1 / (r * r * r) - kEnd) / (1 - kEnd);
}

}  // namespace narpa
