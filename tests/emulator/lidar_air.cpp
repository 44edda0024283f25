// A world for LiDARs alone has their air, and not the camera's.
#include <gtest/gtest.h>

#include "renderer/light/medium.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

class LidarAir : public LoopTest {
protected:
    /// A LiDAR 80 m above a planet's ground, in haze that absorbs and sends echoes back.
    Scene above_ground(const std::string& air) {
        return scene("[scene]\nepoch = 2026-11-21T12:00:00Z\n[sun]\ndirection = [0, 0, 1]\n" + air +
                     "[[body]]\nname = \"planet\"\nsphere = {radius_m = 6371000}\nposition_m = [0, 0, -6371080]\n"
                     "material = {kind = \"lambert\", albedo = 0.3}\n"
                     "[[lidar]]\nname = \"top\"\nmodel = \"VLP-16\"\nattitude_wxyz = [0.7071067811865476, "
                     "0.7071067811865476, "
                     "0, 0]\nrange_at_10_percent_m = 200\n");
    }
    static std::vector<std::uint8_t> packets(const World& world) {
        LidarUnit unit(world, 0);
        std::vector<std::uint8_t> all;
        for (std::int64_t p = 0; p < 20; ++p) {
            unit.fire(p);
            all.insert(all.end(), unit.bytes().begin(), unit.bytes().end());
        }
        return all;
    }
};

TEST_F(LidarAir, GivesTheSamePacketsWithoutTheAirOfCameras) {
    const std::string air = "[atmosphere]\nbody = \"planet\"\nsteps = 8\nsamples_per_band = 1\nturbidity = 9\n";
    const auto all = World::create(above_ground(air)), alone = World::create_for_lidars(above_ground(air)),
               vacuum = World::create_for_lidars(above_ground(""));
    ASSERT_TRUE(all && alone && vacuum) << (all ? "" : all.error().text());
    EXPECT_EQ(packets(**all), packets(**alone));
    EXPECT_NE(packets(**alone), packets(**vacuum)) << "the air has an effect";
    BodyPoses at(1);
    at.set(0, {{}, {0, 0, -6371080}});
    const Ray far{{0, 0, 0}, {1, 0, 0}};
    EXPECT_LT((*all)->render_scene().medium()->transmittance(at, far, 1e4)[0], 0.99F);
    EXPECT_EQ((*alone)->render_scene().medium()->transmittance(at, far, 1e4)[0], 1.0F) << "no tables for light";
    EXPECT_EQ((*vacuum)->render_scene().medium(), nullptr);
}

}  // namespace
}  // namespace narpa::test
