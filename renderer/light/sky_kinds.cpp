#include <array>

#include "renderer/keys/toml_reader.h"
#include "renderer/light/analytic_sky.h"
#include "renderer/light/sky_kind.h"

namespace narpa {
namespace {

constexpr std::array kSkyKinds{&kHosekWilkie};
constexpr TableKey kSkyRows[]{{"model", rows::kind(), "\"hosek-wilkie\""}};

}  // namespace

constinit const TableKeys kSkyKeys{.rows = kSkyRows, .kinds = [] {
                                       std::vector<TableKind> kinds;
                                       for (const SkyKind* k : kSkyKinds) kinds.push_back({k->name, k->keys});
                                       return kinds;
                                   }};

void read_sky(TableReader& root, Scene& scene) {
    auto table = root.table("sky");
    if (!table) return;
    scene.sky = kSkyKinds[table->kind().value_or(0)]->read(*table);
    table->finish();
    if (const std::string why = scene.sky->problem(scene); !why.empty()) root.fail("sky", why);
    for (const std::string_view other : {"atmosphere", "ambient"})
        root.refuse(other, "the scene has a [sky] too, expected one of the two");
}

}  // namespace narpa
