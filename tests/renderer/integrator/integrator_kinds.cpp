// Each method has one row, and the row chooses the fastest integrator that computes all light of a scene.
#include <gtest/gtest.h>

#include <set>

#include "renderer/integrator/integrator.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
using Method = RenderSettings::Method;

Scene plate_in_the_sun() {
    Scene s;
    s.materials = {lambert(0.5f)};
    add_mesh(s, plate(2, 2));
    add_sun(s, {0, 0, 1});
    return s;
}

LightParts parts(const Scene& s, Method method, bool separate_sun = true) {
    const auto render_scene = RenderScene::create(s, 1);
    EXPECT_TRUE(render_scene);
    return integrator_kind(method).choose(*render_scene, separate_sun).parts();
}

TEST(IntegratorKinds, HaveDistinctNamesAndMethods) {
    std::set<std::string_view> names;
    std::set<Method> methods;
    for (const IntegratorKind& kind : integrator_kinds()) {
        EXPECT_TRUE(names.insert(kind.name).second) << kind.name;
        EXPECT_TRUE(methods.insert(kind.method).second) << kind.name;
        EXPECT_FALSE(kind.help.empty());
        EXPECT_EQ(&integrator_kind(kind.method), &kind);
    }
    EXPECT_EQ(methods, (std::set{Method::direct, Method::path}));
}

TEST(IntegratorKinds, SunlightIsComputedDirectlyWhereTheSunIsTheOnlyLight) {
    Scene s = plate_in_the_sun();
    EXPECT_EQ(parts(s, Method::direct), LightParts::direct);
    EXPECT_EQ(parts(s, Method::path), LightParts::both);
    EXPECT_EQ(parts(s, Method::path, false), LightParts::path);
    Light& lamp = s.lights.emplace_back();
    lamp.emission = {1, 1, 1};
    EXPECT_EQ(parts(s, Method::direct), LightParts::path);
    EXPECT_EQ(parts(s, Method::path), LightParts::path);
}

TEST(IntegratorKinds, EmissionThatCameraRaysCanMeetIsSeparate) {
    Scene s = plate_in_the_sun();
    Light& lamp = s.lights.emplace_back();
    lamp.emission = {1, 1, 1};
    lamp.kind = Light::Kind::point;
    EXPECT_EQ(parts(s, Method::path), LightParts::path);
    lamp.kind = Light::Kind::disc;
    lamp.radius_m = 0.1;
    EXPECT_EQ(parts(s, Method::path), LightParts::both);
    EXPECT_EQ(parts(s, Method::path, false), LightParts::path);
    EXPECT_EQ(parts(s, Method::direct), LightParts::path);
    s.lights.clear();
    EXPECT_EQ(parts(s, Method::path), LightParts::both);  // sunlight
    s.materials[0].emission = {1, 1, 1};
    EXPECT_EQ(parts(s, Method::path), LightParts::both);
    EXPECT_EQ(parts(s, Method::direct), LightParts::direct);
}

}  // namespace
}  // namespace narpa
