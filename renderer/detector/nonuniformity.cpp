#include "renderer/detector/nonuniformity.h"

#include <algorithm>
#include <cmath>

#include "renderer/detector/noise.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr TableKey kNonuniformityRows[]{
    {"prnu", rows::number({.low = 0, .high = 0.5})},
    {"dsnu_e", rows::number(kNotNegative)},
};

class SiteNonuniformity final : public DetectorStage {
public:
    explicit SiteNonuniformity(const Nonuniformity& deviations) : deviations_(deviations) {}

    void draw(const PhiloxSchedule& random, FixedPatterns& p) const override {
        const bool gains = deviations_.prnu > 0, offsets = deviations_.dsnu_e > 0;
        if (gains) p.gain.resize(p.sites, 1);
        if (offsets) p.offset.resize(p.sites);
        const auto prnu = static_cast<float>(deviations_.prnu);
        for (std::size_t first = 0; first < p.sites; first += kLanes) {
            const NormalLanes normal =
                normals(philox(random, static_cast<std::uint32_t>(first), 0, SensorDraw::kPattern));
            for (std::size_t i = 0; i < kLanes && gains; ++i)
                p.gain[first + i] *= std::max(0.0f, 1 + prnu * normal.a[i]);
            if (offsets) std::copy(normal.b.begin(), normal.b.end(), &p.offset[first]);
        }
    }
    void add_to(SiteAmounts& amounts, const Detector&) const noexcept override {
        amounts.prnu = std::hypot(amounts.prnu, deviations_.prnu);
        amounts.dsnu_e = std::hypot(amounts.dsnu_e, deviations_.dsnu_e);
    }

private:
    Nonuniformity deviations_;
};

void read_nonuniformity(TableReader& table, Detector& d) {
    Nonuniformity deviations;
    table.read("prnu", deviations.prnu);
    table.read("dsnu_e", deviations.dsnu_e);
    if (deviations.prnu > 0 || deviations.dsnu_e > 0) d.stages.push_back(nonuniformity(deviations));
}

}  // namespace

std::shared_ptr<const DetectorStage> nonuniformity(const Nonuniformity& deviations) {
    return std::make_shared<SiteNonuniformity>(deviations);
}

constinit const DetectorStageKind kNonuniformity{kNonuniformityRows, read_nonuniformity};

}  // namespace narpa
