/// renderer/scene_file/kind_names.h - names of kinds in scene files, both ways.
#pragma once

#include <array>
#include <string_view>
#include <utility>

#include "renderer/scene/scene.h"

namespace narpa {

template <class Kind, std::size_t N>
using KindNames = std::array<std::pair<std::string_view, Kind>, N>;

inline constexpr KindNames<Light::Kind, 4> kLightKinds{{
    {"point", Light::Kind::point},
    {"directional", Light::Kind::directional},
    {"rectangle", Light::Kind::rectangle},
    {"disc", Light::Kind::disc},
}};
inline constexpr KindNames<RenderSettings::Method, 2> kMethods{{
    {"direct", RenderSettings::Method::direct},
    {"path", RenderSettings::Method::path},
}};

template <class Kind, std::size_t N>
[[nodiscard]] constexpr std::string_view name_of(Kind kind, const KindNames<Kind, N>& names) {
    for (const auto& [name, one] : names)
        if (one == kind) return name;
    return "";
}

}  // namespace narpa
