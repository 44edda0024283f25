/// protocols/can/dbc.h - the DBC file of a scene's CAN messages, from the tables of signals.h.
#pragma once

#include <span>
#include <string>

#include "protocols/can/identifiers.h"

namespace narpa {

/// Pose messages of each body, ledger messages of each camera (named Camera0, Camera1, ...), estimate, heartbeat
/// and the messages of a closed loop. Characters of a body's name other than letters, digits and _ become _. CAN FD
/// messages have VFrameFormat = StandardCAN_FD.
[[nodiscard]] std::string write_dbc(std::span<const CanBody> bodies, int cameras = 1);

}  // namespace narpa
