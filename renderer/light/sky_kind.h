/// renderer/light/sky_kind.h - the kinds of skies that scenes name, one row each.
///
/// A new kind is a Sky in files of its own, with its row, and a line in sky_kinds.cpp.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "renderer/keys/keys.h"
#include "renderer/light/background.h"
#include "renderer/light/medium.h"
#include "renderer/scene/scene.h"

namespace narpa {

class TableReader;

struct SkyLight {
    std::unique_ptr<const Background> background;  ///< null: the scene's ambient radiance
    std::unique_ptr<const Medium> medium;          ///< dims the Sun; null: the scene's atmosphere, or a vacuum
};

/// A sky as a scene describes it.
class Sky {
public:
    virtual ~Sky() = default;
    /// Why a scene cannot have it; empty: it can.
    [[nodiscard]] virtual std::string problem(const Scene&) const { return {}; }
    [[nodiscard]] virtual SkyLight make(const Scene& scene) const = 0;
};

struct SkyKind {
    std::string_view name;                                             ///< `model` of [sky]
    std::span<const TableKey> keys{};                                  ///< of [sky], beside `model`
    std::shared_ptr<const Sky> (*read)(TableReader& table) = nullptr;  ///< never returns null
};

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const SkyKind* const> sky_kinds();

extern const TableKeys kSkyKeys;
/// [sky]; the Sun comes first.
void read_sky(TableReader& root, Scene& scene);

}  // namespace narpa
