/// protocols/can/dbc.h - the DBC file of a scene's CAN messages, from their descriptions.
#pragma once

#include <span>
#include <string>

#include "protocols/can/messages.h"

namespace narpa {

/// Messages of each body (named after it) and of each camera (Camera0, Camera1, ...), and those that exist once.
/// Characters of a body's name other than letters, digits and _ become _, and names that would be the same then get
/// a number. Names have at most 32 characters; those of bodies with long names are shortened, and the attribute
/// SystemMessageLongSymbol has the whole. CAN FD messages have VFrameFormat =
/// StandardCAN_FD.
[[nodiscard]] std::string write_dbc(std::span<const CanBody> bodies, int cameras = 1,
                                    std::span<const SetLayout* const> messages = can_messages());

}  // namespace narpa
