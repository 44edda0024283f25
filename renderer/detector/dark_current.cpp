#include "renderer/detector/dark_current.h"

#include "renderer/detector/detector.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr Range kCelsius{.low = -273.15, .high = 200};
constexpr TableKey kDarkCurrentRows[]{
    {"dark_current_e_s", rows::number(kNotNegative)},
    {"temperature_c", rows::number(kCelsius)},
    {"dark_reference_c", rows::number(kCelsius)},
    {"dark_doubling_c", rows::number({.low = 1, .high = 100})},
};

class DarkCurrent final : public DetectorStage {
public:
    explicit DarkCurrent(double e_s) : e_s_(e_s) {}
    void add_to(SiteAmounts& amounts, const Detector& detector) const noexcept override {
        amounts.dark_e += e_s_ * dark_seconds(detector);
    }

private:
    double e_s_;
};

void read_dark_current(TableReader& table, Detector& d) {
    table.read("dark_reference_c", d.dark_reference_c);
    d.temperature_c = table.number("temperature_c").value_or(d.dark_reference_c);
    table.read("dark_doubling_c", d.dark_doubling_c);
    if (const double e_s = table.number("dark_current_e_s").value_or(0); e_s > 0)
        d.stages.push_back(dark_current(e_s));
}

}  // namespace

std::shared_ptr<const DetectorStage> dark_current(double e_s) {
    return std::make_shared<DarkCurrent>(e_s);
}

constinit const DetectorStageKind kDarkCurrent{kDarkCurrentRows, read_dark_current};

}  // namespace narpa
