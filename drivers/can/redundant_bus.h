/// drivers/can/redundant_bus.h - two CAN buses that stand for one (ECSS-E-ST-50-15C, bus redundancy).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "drivers/can/can_bus.h"

namespace narpa {

/// "A+B": the parts of two buses, neither of them a log; empty: this is one bus.
[[nodiscard]] std::vector<std::string> redundant_parts(const std::string& text);

/// `a` and `b` differ, and are no logs. Hot until `CanBus::set_redundancy`.
[[nodiscard]] std::unique_ptr<CanBus> make_redundant(std::unique_ptr<CanBus> a, std::unique_ptr<CanBus> b);

}  // namespace narpa
