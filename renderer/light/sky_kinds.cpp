#include <array>

#include "renderer/keys/toml_reader.h"
#include "renderer/light/analytic_sky.h"
#include "renderer/light/sky_kind.h"

namespace narpa {
namespace {

constexpr TableKey kSkyRows[]{{"model", rows::kind(), "\"hosek-wilkie\""}};

}  // namespace

std::span<const SkyKind* const> sky_kinds() {
    static constexpr std::array all{&kHosekWilkie};
    return all;
}

constinit const TableKeys kSkyKeys{.rows = kSkyRows, .kinds = kinds_of<sky_kinds>};

void read_sky(TableReader& root, Scene& scene) {
    auto table = root.table("sky");
    if (!table) return;
    scene.sky = sky_kinds()[table->kind().value_or(0)]->read(*table);
    table->finish();
    if (const std::string why = scene.sky->problem(scene); !why.empty()) root.fail("sky", why);
    for (const std::string_view other : {"atmosphere", "ambient"})
        root.refuse(other, "the scene has a [sky] too, expected one of the two");
}

}  // namespace narpa
