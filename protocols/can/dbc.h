/// protocols/can/dbc.h - the DBC file of a scene's CAN messages, from the tables of signals.h.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace narpa {

struct DbcBody {
    std::string name;           ///< characters other than letters, digits and _ become _
    std::uint32_t base_id = 0;  ///< the body's can_id
};

/// Pose messages of each body, ledger messages of each camera (named Camera0, Camera1, ...), estimate, heartbeat
/// and what a closed loop says. CAN FD messages carry VFrameFormat = StandardCAN_FD.
[[nodiscard]] std::string write_dbc(std::span<const DbcBody> bodies, int cameras = 1);

}  // namespace narpa
