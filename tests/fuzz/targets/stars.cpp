// A star catalogue (CSV).
#include "renderer/assets/star_catalogue.h"

#include <cmath>

#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const auto stars = read_star_catalogue(folder.write("s.csv", fuzz::text_of(data, size)));
    if (!fuzz::count(bool(stars))) return fuzz::require(!stars.error().what.empty(), "an error has words"), 0;
    for (const CatalogueStar& star : *stars) {
        fuzz::require(std::abs(norm(star_direction(star, 1000)) - 1) < 1e-9, "a direction is unit");
        fuzz::require(star.b_v >= -0.5 && std::isfinite(star.v_magnitude), "a star has a colour and a magnitude");
    }
    return 0;
}
