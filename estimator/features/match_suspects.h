/// estimator/features/match_suspects.h - what matches say about an error of the camera that is not told.
#pragma once

#include "estimator/features/model_matches.h"
#include "estimator/uncertainty/observability.h"

namespace narpa {

struct MatchSuspicion {
    double sigmas = 0;                ///< about a normal number if there is no such error
    Vector6 shift = Vector6::Zero();  ///< of the pose, if the error is solved for
};

/// Rows that see the target at a pose that changes linearly with the row: six more unknowns. Their covariance is
/// that of the matches, which share errors where their windows overlap, at the scatter that the longer fit leaves.
[[nodiscard]] MatchSuspicion progressive_rows(const ModelMatches& matches, const CameraModel& camera,
                                              const Rigid3& T_camera_target, double floor_px);

/// The pose with the guess along the unobserved motions, and the others solved again.
[[nodiscard]] Rigid3 with_guess_where_unobserved(const ModelMatches& matches, const CameraModel& camera,
                                                 const Observability& o, const Rigid3& T_camera_target,
                                                 const Rigid3& guess, double floor_px);

}  // namespace narpa
