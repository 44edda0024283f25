// A rehearsal's scenario, beside its scene.
#include "rehearsal/scenario/scenario.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    static const std::string scene =
        folder.write("scene.toml",
                     "[sun]\ndirection = [1, 0, 0]\n"
                     "[[body]]\nname = \"station\"\nsphere = {radius_m = 2}\ncan_id = 0x110\n"
                     "[[body]]\nname = \"chaser\"\nsphere = {radius_m = 1}\ncan_id = 0x100\n"
                     "[[body]]\nname = \"earth\"\nsphere = {radius_m = 6378137}\ncan_id = 0x120\n"
                     "[[camera]]\nname = \"nav\"\nmount = \"chaser\"\nresolution = [64, 48]\nfov_diagonal_deg = "
                     "30\nrate_hz = 1\n"
                     "[[lidar]]\nname = \"top\"\nmount = \"chaser\"\nmodel = \"VLP-16\"\n");
    const auto scenario = rehearsal::read_scenario(folder.write("s.toml", fuzz::text_of(data, size)));
    if (!fuzz::count(bool(scenario))) return fuzz::require(!scenario.error().what.empty(), "an error has words"), 0;
    fuzz::require(scenario->target.mass_kg > 0 && scenario->duration_s > 0, "masses and durations are above 0");
    return 0;
}
