// The recipe of a data set, beside its scene.
#include "dataset/recipe/recipe.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    static const std::string scene =
        folder.write("scene.toml", "[[body]]\nname = \"ball\"\nsphere = {radius_m = 2}\n");
    const auto recipe = dataset::read_recipe(folder.write("r.toml", fuzz::text_of(data, size)));
    if (!fuzz::count(bool(recipe))) return fuzz::require(!recipe.error().what.empty(), "an error has words"), 0;
    fuzz::require(!recipe->variants.empty() && !recipe->backdrops.empty(), "there is a variant and a background");
    for (const double u : {0.0, 0.999999}) {
        if (recipe->range_m) fuzz::require(recipe->range_m->at(u) > 0, "ranges are above 0");
        if (recipe->time_factor) fuzz::require(recipe->time_factor->at(u) > 0, "factors are above 0");
        if (recipe->phase_deg) fuzz::require(recipe->phase_deg->at(u) <= 180, "phase angles are at most 180 deg");
    }
    return 0;
}
