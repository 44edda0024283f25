// The joint of detector stages: a stage that the product does not have, a read-out whose gain falls with the
// signal, is this file alone: a scene names it, and frames show it.
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/detector/detector_stage.h"
#include "renderer/keys/toml_reader.h"
#include "tests/renderer/detector/detector_support.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using namespace test;

/// A signal of e electrons is read as e (1 - error * e / full well).
class Nonlinearity final : public DetectorStage {
public:
    explicit Nonlinearity(double error) : error_(static_cast<float>(error)) {}
    [[nodiscard]] Place place() const noexcept override { return Place::read_out; }
    void act(const ChargePlane& plane) const noexcept override {
        for (float& e : plane.charge_e) e -= error_ * e * e / plane.full_well_e;
    }

private:
    float error_;
};

constexpr TableKey kNonlinearityRows[]{{"nonlinearity", rows::number(kUnit)}};
const DetectorStageKind kNonlinearity{kNonlinearityRows, [](TableReader& table, Detector& detector) {
                                          if (const auto error = table.number("nonlinearity"))
                                              detector.stages.push_back(std::make_shared<Nonlinearity>(*error));
                                      }};

/// The shipped kinds and this one.
std::span<const DetectorStageKind* const> stage_kinds() {
    static const std::vector<const DetectorStageKind*> all = [] {
        std::vector<const DetectorStageKind*> kinds(detector_stage_kinds().begin(), detector_stage_kinds().end());
        kinds.push_back(&kNonlinearity);
        return kinds;
    }();
    return all;
}
std::vector<std::span<const TableKey>> added_keys() {
    return {kNonlinearity.keys};
}
constexpr TableKeys kDetectorTable{.parts = {&kDetectorKeys}, .listed = added_keys};
constexpr TableKey kRowsWithStage[]{{"detector", rows::table(kDetectorTable)}};
constexpr TableKeys kTableWithStage{.rows = kRowsWithStage};

/// One electron a DN, no noise, a full well of 60000 electrons.
Camera camera_with_stages(const std::string& stages) {
    Camera c = counting(40, 30);
    c.detector = read_table(
        "[detector]\nbits = 16\nblack_level_dn = 100\ngain_e_per_dn = 1\nfull_well_e = 60000\n" + stages,
        kTableWithStage, [](TableReader& camera) { return read_detector(camera, 1'000'000'000, stage_kinds()); });
    return c;
}

TEST(DetectorStageJoint, AnAddedStageActsOnTheSignalAfterTheFullWell) {
    const Camera plain = camera_with_stages(""), nonlinear = camera_with_stages("nonlinearity = 0.02");
    EXPECT_EQ(plain.detector->stages.size(), 0u);
    ASSERT_EQ(nonlinear.detector->stages.size(), 1u);
    for (const double light_e : {0.0, 500.0, 7000.0, 30'000.0, 59'000.0, 200'000.0}) {
        RadianceImage image(plain.width, plain.height);
        std::fill(image.pixels.begin(), image.pixels.end(), radiance_for(*plain.detector, light_e));
        const double collected = std::min(light_e, 60'000.0);
        for (const int e : electrons(plain, image)) EXPECT_NEAR(e, collected, 0.51);
        for (const int e : electrons(nonlinear, image))
            EXPECT_NEAR(e, collected - 0.02 * collected * collected / 60'000, 0.51) << light_e;
    }
}

TEST(DetectorStageJoint, AnAddedStageActsBesideTheShippedOnes) {
    const std::string shipped =
        "prnu = 0.01\ndsnu_e = 5\ndark_current_e_s = 1e4\nblooming = true\ncosmic_rays_per_cm2_s = 1e4\n";
    const Camera linear = camera_with_stages(shipped),
                 nonlinear = camera_with_stages(shipped + "nonlinearity = 0.1");
    RadianceImage image(linear.width, linear.height);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = radiance_for(*linear.detector, 60.0 * static_cast<double>(i));
    const std::vector<int> before = electrons(linear, image), after = electrons(nonlinear, image);
    for (std::size_t i = 0; i < before.size(); ++i) {
        // The offset, at most 6 standard deviations, is added to the signal after the stage.
        const double signal = before[i], slope = 1 - 0.2 * signal / 60'000;
        EXPECT_NEAR(after[i], signal - 0.1 * signal * signal / 60'000, 6 * 5 * (1 - slope) + 1.1) << i;
    }
    EXPECT_GT(before.back() - after.back(), 5000);
}

}  // namespace
}  // namespace narpa
