// Tabulated rays: those of the model within the stated error, one by one and in batches, and the model's own where
// its rays are not smooth.
#include "renderer/projection/tabulated_model.h"

#include <gtest/gtest.h>

#include <random>

#include "renderer/projection/double_sphere.h"
#include "renderer/projection/projection_kind.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

using namespace test;

constexpr int kWidth = 640, kHeight = 480;
const Pinhole kLens{610, 605, 325.3, 236.8};

struct TabulatedCase {
    const char* name;
    std::shared_ptr<const CameraModel> model;
    int width = kWidth, height = kHeight;
};

std::vector<TabulatedCase> tabulated_cases() {
    return {{"barrel", brown_conrady(kLens, {-0.35, 0.14, 1.2e-3, -8e-4, -0.025})},
            {"thin prism", brown_conrady(kLens, {-0.2, 0.05, 1e-3, 1e-3, 0, 0, 0, 0, 2e-3, -1e-3, -3e-3, 5e-4})},
            {"fisheye", kannala_brandt(kLens, {-0.02, 0.005, -0.003, 4e-4})},
            {"fisheye of 180 degrees", kannala_brandt({204, 204, 319.5, 239.5}, {0.01, 0, 0, 0})},
            {"double sphere", make_projection({&kDoubleSphere, {300, 300, 319.5, 239.5}, {-0.2, 0.6}})},
            {"small", brown_conrady({100, 100, 79.5, 59.5}, {-0.2, 0.05, 1e-3, 0}), 160, 121}};
}

Vec3Lanes directions_of(const CameraModel& model, const Lanes<double>& x, const Lanes<double>& y) {
    Vec3Lanes out;
    model.directions({}, x, y, out);
    return out;
}

TEST(TabulatedModel, RaysAreWithinTheStatedError) {
    std::mt19937_64 random(7);
    for (const TabulatedCase& c : tabulated_cases()) {
        const auto table = tabulated(c.model, c.width, c.height);
        ASSERT_NE(table, c.model) << c.name;
        std::uniform_real_distribution<double> column(-0.5, c.width - 0.5), row(-0.5, c.height - 0.5), within(0, 8);
        double largest_px = 0;
        for (int i = 0; i < 4000; ++i) {
            const double x0 = column(random), y0 = row(random);
            Lanes<double> x, y;
            for (std::size_t k = 0; k < kLanes; ++k) {
                x[k] = std::min(8 * std::floor(x0 / 8) + within(random) - 0.5, c.width - 0.5);
                y[k] = std::min(8 * std::floor(y0 / 8) + within(random) - 0.5, c.height - 0.5);
            }
            const Vec3Lanes found = directions_of(*table, x, y);
            for (std::size_t k = 0; k < kLanes; ++k) {
                const auto image = c.model->project(found[k]);
                ASSERT_TRUE(image) << c.name;
                largest_px = std::max(largest_px, std::hypot(image->x - x[k], image->y - y[k]));
                EXPECT_NEAR(norm(found[k]), 1, 1e-14);
            }
        }
        EXPECT_LT(largest_px, kTabulatedError_px) << c.name;
        EXPECT_GT(largest_px, 1e-12) << c.name << ": is it tabulated?";
    }
}

/// The bytes of a frame do not depend on which samples share a batch.
TEST(TabulatedModel, ARayDoesNotDependOnItsBatch) {
    std::mt19937_64 random(8);
    std::uniform_real_distribution<double> column(-1.4, kWidth + 0.4), row(-1.4, kHeight + 0.4);
    for (const TabulatedCase& c : tabulated_cases()) {
        const auto table = tabulated(c.model, c.width, c.height);
        for (int i = 0; i < 200; ++i) {
            Lanes<double> x, y;
            for (std::size_t k = 0; k < kLanes; ++k) x[k] = column(random), y[k] = row(random);
            const Vec3Lanes mixed = directions_of(*table, x, y);
            for (std::size_t k = 0; k < kLanes; ++k) {
                Lanes<double> same_x, same_y;
                same_x.fill(x[k]), same_y.fill(y[k]);
                const Vec3Lanes alone = directions_of(*table, same_x, same_y);
                ASSERT_EQ(norm(mixed[k] - alone[0]), 0) << c.name << " at " << x[k] << ", " << y[k];
            }
        }
    }
}

TEST(TabulatedModel, BeyondTheRimAndTheImageRaysAreTheModelsOwn) {
    // r - 0.35 r^3 folds over at 397 px from the centre: inside this image.
    const auto model = brown_conrady(kLens, {-0.35, 0, 0, 0});
    const auto table = tabulated(model, 1280, 960);
    for (const ImagePoint p : {ImagePoint{725, 240}, {1270, 950}, {-40, 20}, {3, 4000}}) {
        Lanes<double> x, y;
        x.fill(p.x), y.fill(p.y);
        const double apart = norm(directions_of(*table, x, y)[0] - directions_of(*model, x, y)[0]);
        EXPECT_LE(apart, p.x > 0 && p.y < 960 ? kTabulatedError_px / kLens.fx : 0) << p.x << ", " << p.y;
        EXPECT_EQ(table->sees(p), model->sees(p));
    }
}

TEST(TabulatedModel, APinholeStaysAsItIs) {
    const auto pinhole = std::make_shared<Pinhole>(kLens);
    EXPECT_EQ(tabulated(pinhole, kWidth, kHeight), pinhole);
}

}  // namespace
}  // namespace narpa
