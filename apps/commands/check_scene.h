/// apps/commands/check_scene.h - what is in a scene.
#pragma once

#include <nlohmann/json.hpp>

#include "emulator/world.h"

namespace narpa::cli {

[[nodiscard]] nlohmann::json describe_scene(const World& world);
void print_scene(const World& world);

}  // namespace narpa::cli
