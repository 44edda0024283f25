#include "renderer/detector/defective_pixels.h"

#include <fmt/format.h>

#include "renderer/detector/detector.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr Range kPixelShare{.low = 0, .high = 0.1};
constexpr TableKey kDefectRows[]{
    {"dead_pixel_share", rows::number(kPixelShare)}, {"hot_pixel_share", rows::number(kPixelShare)},
    {"hot_pixel_e_s", rows::number(kPositive)},      {"blinking_pixel_share", rows::number(kPixelShare)},
    {"blinking_e_s", rows::number(kPositive)},
};

class Defects final : public DetectorStage {
public:
    explicit Defects(const DefectivePixels& defects) : defects_(defects) {}

    void draw(const PhiloxSchedule& random, FixedPatterns& p) const override {
        using enum DefectSite::Kind;
        const double dead_below = defects_.dead_share * 0x1p32,
                     hot_below = dead_below + defects_.hot_share * 0x1p32,
                     blinking_below = hot_below + defects_.blinking_share * 0x1p32;
        for (std::size_t first = 0; first < p.sites; first += kLanes) {
            const RandomLanes lanes = philox(random, static_cast<std::uint32_t>(first), 0, SensorDraw::kDefects);
            for (std::size_t i = 0; i < kLanes; ++i)
                if (const double word = lanes.w0[i]; word < blinking_below)
                    p.defects.push_back({static_cast<std::uint32_t>(first + i), word < dead_below  ? dead
                                                                                : word < hot_below ? hot
                                                                                                   : blinking});
        }
        p.defects.shrink_to_fit();
    }
    void add_to(SiteAmounts& amounts, const Detector& detector) const noexcept override {
        amounts.hot_e += defects_.hot_e_s * dark_seconds(detector);
        amounts.blinking_e += defects_.blinking_e_s * dark_seconds(detector);
    }

private:
    DefectivePixels defects_;
};

/// A share of the pixels and the current of each, which belong together.
void read_share_and_current(TableReader& table, const char* share_key, const char* current_key, double& share,
                            double& current_e_s) {
    table.read(share_key, share);
    if (share > 0) table.require(current_key, "a number > 0, as there is such a share of pixels");
    if (!table.has(share_key)) table.refuse(current_key, fmt::format("there is no {}", share_key));
    table.read(current_key, current_e_s);
}

void read_defective_pixels(TableReader& table, Detector& d) {
    DefectivePixels p;
    table.read("dead_pixel_share", p.dead_share);
    read_share_and_current(table, "hot_pixel_share", "hot_pixel_e_s", p.hot_share, p.hot_e_s);
    read_share_and_current(table, "blinking_pixel_share", "blinking_e_s", p.blinking_share, p.blinking_e_s);
    if (p.dead_share + p.hot_share + p.blinking_share > 0) d.stages.push_back(defective_pixels(p));
}

}  // namespace

std::shared_ptr<const DetectorStage> defective_pixels(const DefectivePixels& defects) {
    return std::make_shared<Defects>(defects);
}

constinit const DetectorStageKind kDefectivePixels{kDefectRows, read_defective_pixels};

}  // namespace narpa
