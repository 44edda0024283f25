#include "renderer/detector/blooming.h"

#include <tbb/parallel_for.h>

#include "base/each_isa.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr TableKey kBloomingRows[]{{"blooming", rows::boolean()}};

NARPA_EACH_ISA void bloom_each(float* charge_e, std::size_t width, std::size_t height, std::size_t first,
                               float full_well_e) noexcept {
    if (width - first >= kLanes)
        bloom(charge_e + first, width, height, kLanes, full_well_e);
    else
        bloom(charge_e + first, width, height, width - first, full_well_e);
}

class Blooming final : public DetectorStage {
public:
    [[nodiscard]] Place place() const noexcept override { return Place::transfer; }
    void act(const ChargePlane& plane) const noexcept override {
        const auto width = static_cast<std::size_t>(plane.sensor.width),
                   height = static_cast<std::size_t>(plane.sensor.height);
        tbb::parallel_for(std::size_t{0}, (width + kLanes - 1) / kLanes, [&](std::size_t block) {
            bloom_each(plane.charge_e.data(), width, height, block * kLanes, plane.full_well_e);
        });
    }
};

void read_blooming(TableReader& table, Detector& d) {
    if (table.boolean("blooming").value_or(false)) d.stages.push_back(blooming());
}

}  // namespace

std::shared_ptr<const DetectorStage> blooming() {
    return std::make_shared<Blooming>();
}

constinit const DetectorStageKind kBlooming{kBloomingRows, read_blooming};

}  // namespace narpa
