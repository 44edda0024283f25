#include <gtest/gtest.h>

#include <limits>

#include "base/constants.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/cameras.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

using test::data_file;
using test::MemoryFolder;

Scene read_good(const std::string& path) {
    Result<Scene> scene = read_scene(path);
    if (!scene) {
        ADD_FAILURE() << scene.error().text();
        return {};
    }
    return std::move(*scene);
}

Scene read_good_text(const std::string& text) {
    const MemoryFolder folder;
    return read_good(folder.write("s.toml", text));
}

void expect_close(const Vec3& a, const Vec3& b, double tolerance) {
    EXPECT_LE(norm(a - b), tolerance) << a.x << " " << a.y << " " << a.z << " against " << b.x << " " << b.y << " "
                                      << b.z;
}

constexpr const char* kSphere = "[[body]]\nname = \"ball\"\nsphere = {radius_m = 2}\n";
constexpr const char* kCamera = "[[camera]]\nname = \"c\"\nresolution = [640, 480]\nfov_horizontal_deg = 90\n";

TEST(SceneFile, ManualShowsTheCompleteScene) {
    const std::string manual = test::read_text(test::source_path("docs/scene.md"));
    const std::size_t from = manual.rfind("```toml\n") + 8;
    ASSERT_LT(from, manual.size());
    EXPECT_EQ(manual.substr(from, manual.find("```", from) - from), test::read_text(data_file("complete.toml")));
}

TEST(SceneFile, ReadsMarks) {
    const Scene s = read_good(data_file("complete.toml"));
    ASSERT_EQ(s.bodies[0].marks.size(), 3u);
    EXPECT_TRUE(s.bodies[1].marks.empty());
    const Mark &lamp = s.bodies[0].marks[0], &mirror = s.bodies[0].marks[1], &tag = s.bodies[0].marks[2];
    EXPECT_EQ(lamp.name, "lamp");
    EXPECT_EQ(lamp.radius_m, 0.02);
    EXPECT_FALSE(lamp.is_spherical);
    expect_close(lamp.T_body_mark * Vec3{0, 0, 1}, {2, 0, 0.5}, 1e-15);  // its normal is the mark's z
    EXPECT_EQ(mirror.kind, Mark::Kind::reflector);
    EXPECT_TRUE(mirror.is_spherical);
    EXPECT_EQ(kTagDictionaries[static_cast<std::size_t>(tag.dictionary)].name, "APRILTAG_36h11");
    EXPECT_EQ(tag.id, 586);
    EXPECT_EQ(tag.side_m, 0.4);
    expect_close(tag.T_body_mark.q * Vec3{1, 0, 0}, {0, 1, 0}, 1e-15);
}

TEST(SceneFile, MarksFaceAnyDirection) {
    for (const Vec3& n : {Vec3{0, 0, 1}, Vec3{0, 0, -1}, Vec3{1e-9, 0, -1}, Vec3{-3, 0, 0}, Vec3{1, 2, -2}}) {
        const Scene m =
            read_good_text(std::string(kSphere) +
                           "mark = [{name = \"a\", kind = \"lamp\", radius_m = 1, position_m = [0, 0, 0], "
                           "normal = [" +
                           std::to_string(n.x) + ", " + std::to_string(n.y) + ", " + std::to_string(n.z) + "]}]\n" +
                           kCamera + "[ambient]\nradiance = 1\n");
        expect_close(m.bodies[0].marks.at(0).T_body_mark.q * Vec3{0, 0, 1}, normalized(n), 1e-6);
    }
}

TEST(SceneFile, ReadsSurroundings) {
    const Scene s = read_good(data_file("complete.toml"));
    EXPECT_EQ(s.name, "every key");
    EXPECT_EQ(s.epoch_unix_ns, 1772366400'000'000'000);  // date -u -d 2026-03-01T12:00:00Z +%s
    ASSERT_TRUE(s.sun);
    EXPECT_NEAR(norm(s.sun->direction), 1, 1e-15);
    expect_close(s.sun->direction, normalized(Vec3{1, -0.5, 0.2}), 1e-15);
    EXPECT_DOUBLE_EQ(s.sun->angular_diameter_rad, 0.533 * kPi / 180);
    EXPECT_EQ(s.ambient, (Rgb{0.1f, 0.1f, 0.2f}));
    ASSERT_TRUE(s.stars);
    EXPECT_EQ(s.stars->stars.size(), 4u);
    EXPECT_EQ(s.render.method, RenderSettings::Method::path);
    EXPECT_EQ(s.render.max_depth, 12);
    EXPECT_EQ(s.render.spp, 4);
    EXPECT_EQ(s.render.seed, 7u);
    EXPECT_EQ(s.render.stale_after_s, 0.5);
    EXPECT_EQ(s.render.command_ahead_max_s, 30);
    EXPECT_TRUE(s.warnings.empty());
}

TEST(SceneFile, ReadsBodiesAndTheirMaterials) {
    const Scene s = read_good(data_file("complete.toml"));
    ASSERT_EQ(s.bodies.size(), 10u);
    const Body& target = s.bodies[0];
    EXPECT_EQ(target.name, "target");
    EXPECT_EQ(target.initial.T_world_body.t, (Vec3{10, 0, 0}));
    EXPECT_NEAR(norm(target.initial.T_world_body.q), 1, 1e-15);
    EXPECT_EQ(target.initial.velocity_m_s, (Vec3{0, 0.01, 0}));
    EXPECT_EQ(target.initial.rate_rad_s, (Vec3{0, 0, 0.001}));
    EXPECT_EQ(target.can_id, 0x100u);
    EXPECT_EQ(s.bodies[1].can_id, 0x110u);
    EXPECT_FALSE(s.bodies[2].can_id);
    const auto& moon = std::get<ExactShape>(s.bodies[2].shape);
    EXPECT_EQ(moon.kind->name, "sphere");
    EXPECT_EQ(moon.values, std::vector{1737400.0});
    EXPECT_FLOAT_EQ(s.materials[static_cast<std::size_t>(moon.material)].diffuse.x, 0.12f);
    EXPECT_EQ(semi_axes_m(s.bodies[3]), (Vec3{13000, 11400, 9100}));

    ASSERT_TRUE(s.bodies[1].mesh_material);
    const Material& phong = s.materials[static_cast<std::size_t>(*s.bodies[1].mesh_material)];
    EXPECT_EQ(phong.kind, &kinds::phong);
    EXPECT_EQ(phong.specular, (Rgb{0.3f, 0.3f, 0.3f}));
    EXPECT_EQ(phong.exponent, 40);
    ASSERT_GE(phong.texture, 0);
    EXPECT_EQ(
        s.materials[s.meshes[static_cast<std::size_t>(std::get<int>(target.shape))].face_material.front()].texture,
        phong.texture)
        << "the mesh and the material name the same file";
}

TEST(SceneFile, GroundOfTheAirIsAnUntexturedLambertBodys) {
    const MemoryFolder folder;
    folder.write("t.ppm", "P3 1 1 255\n9 9 9\n");
    const auto albedo = [&](const std::string& material, const std::string& air) {
        return read_good(folder.write("s.toml", "[sun]\ndirection = [1, 0, 0]\n[atmosphere]\nbody = \"p\"\n" + air +
                                                    "\n[[body]]\nname = \"p\"\nsphere = {radius_m = 6e6}\n"
                                                    "material = {" +
                                                    material + "}\n" + kCamera))
            .atmosphere->air.ground_albedo;
    };
    EXPECT_NEAR(albedo("albedo = [0.3, 0.4, 0.5]", ""), 0.4, 1e-6);
    EXPECT_EQ(albedo("albedo = [0.3, 0.4, 0.5], texture = \"t.ppm\"", ""), 0.1);
    EXPECT_EQ(albedo("texture = \"t.ppm\"", "planet = \"mars\""), 0.2);
    EXPECT_EQ(albedo("kind = \"hapke\"", ""), 0.1);
    EXPECT_EQ(albedo("texture = \"t.ppm\"", "ground_albedo = 0.7"), 0.7);
}

TEST(SceneFile, ReadsCamerasAndLidars) {
    const Scene s = read_good(data_file("complete.toml"));
    ASSERT_EQ(s.cameras.size(), 2u);
    const Camera& c = s.cameras[0];
    EXPECT_EQ(c.mount, 1);
    EXPECT_EQ(c.width, 640);
    EXPECT_EQ(c.height, 480);
    EXPECT_EQ(test::pinhole_of(c).fx, 800);
    EXPECT_EQ(test::pinhole_of(c).cy, 239.5);
    EXPECT_EQ(c.format, PixelFormat::y16);
    EXPECT_EQ(c.period_ns, 33'333'333);
    EXPECT_TRUE(c.embedded_line);
    EXPECT_EQ(c.late, LatePolicy::repeat);
    ASSERT_TRUE(c.control);
    EXPECT_EQ(c.control->latency_ns, 5'000'000);
    EXPECT_EQ(c.control->gain_max_cdb, 1800);
    EXPECT_DOUBLE_EQ(c.white_radiance, 1361.0 / kPi);
    ASSERT_TRUE(c.detector);
    EXPECT_EQ(c.detector->exposure_s, 0.002);
    EXPECT_EQ(c.detector->full_well_e, 13500);
    EXPECT_EQ(c.detector->bits, 10);
    EXPECT_EQ(c.detector->black_level_dn, 16);
    EXPECT_TRUE(c.detector->shot_noise);

    const Camera& overview = s.cameras[1];
    EXPECT_EQ(overview.mount, -1);
    // 30 degrees over the diagonal of 500 x 500: f = hypot(250, 250) / tan(15 deg) = 1319.479 px
    EXPECT_NEAR(test::pinhole_of(overview).fx, 1319.479, 5e-4);
    EXPECT_EQ(test::pinhole_of(overview).fx, test::pinhole_of(overview).fy);
    EXPECT_EQ(test::pinhole_of(overview).cx, 249.5);
    EXPECT_EQ(overview.period_ns, 400'000'000);
    EXPECT_EQ(overview.white_radiance, 300);
    EXPECT_FALSE(overview.detector);
    ASSERT_TRUE(overview.optics.lens && c.optics.lens);
    EXPECT_DOUBLE_EQ(overview.optics.lens->aperture_diameter_m, 0.05 / 2.8);
    EXPECT_EQ(overview.optics.lens->focus_distance_m, 20);
    EXPECT_EQ(c.optics.lens->aperture_diameter_m, 0.004);
    EXPECT_EQ(c.optics.lens->focus_distance_m, std::numeric_limits<double>::infinity());

    ASSERT_EQ(s.lidars.size(), 1u);
    EXPECT_EQ(s.lidars[0].mount, 1);
    EXPECT_EQ(s.lidars[0].model->spec().name, "VLP-16");
    expect_close(s.lidars[0].T_mount_lidar * Vec3{0, 2, 0}, {2.5, 0, 0.5},
                 1e-15);  // y is forward: along +x of the body
    expect_close(s.lidars[0].T_mount_lidar * Vec3{0, 0, 1}, {0.5, 0, 1.5}, 1e-15);  // z is up
}

TEST(SceneFile, ReadsLights) {
    const Scene s = read_good(data_file("complete.toml"));
    ASSERT_EQ(s.lights.size(), 4u);
    const Light &beacon = s.lights[0], &earthshine = s.lights[1], &floodlight = s.lights[2], &panel = s.lights[3];
    EXPECT_EQ(beacon.name, "beacon");
    EXPECT_EQ(beacon.kind, Light::Kind::point);
    EXPECT_EQ(beacon.mount, 0);
    EXPECT_EQ(beacon.T_mount_light.t, (Vec3{0, 0, 1.5}));
    EXPECT_EQ(beacon.emission, (Rgb{2, 0.5f, 0.5f}));
    EXPECT_EQ(earthshine.kind, Light::Kind::directional);
    EXPECT_EQ(earthshine.mount, -1);
    EXPECT_EQ(earthshine.emission, (Rgb{80, 90, 120}));
    expect_close(earthshine.T_mount_light.q * Vec3{0, 0, 1}, {0, 0, -1}, 1e-15);  // shines along its z: downward
    EXPECT_EQ(floodlight.kind, Light::Kind::disc);
    EXPECT_EQ(floodlight.mount, 1);
    EXPECT_EQ(floodlight.radius_m, 0.05);
    EXPECT_EQ(floodlight.emission, (Rgb{5000, 5000, 5000}));
    expect_close(floodlight.T_mount_light.q * Vec3{0, 0, 1}, normalized(Vec3{9.5, -0.3, 0}), 1e-15);
    EXPECT_EQ(panel.kind, Light::Kind::rectangle);
    EXPECT_EQ(panel.width_m, 1);
    EXPECT_EQ(panel.height_m, 0.5);
    expect_close(panel.T_mount_light.q * Vec3{0, 0, 1}, {0, 0, -1}, 1e-15);
}

TEST(SceneFile, LightsSitAsCamerasDo) {
    const std::string place = "position_m = [1, 2, 3]\nlook_at = [-4, 5, 2]\nup = [0, 1, 0.5]\n";
    const Scene s =
        read_good_text(std::string("[ambient]\nradiance = 1\n") + kSphere + kCamera + place +
                       "[[light]]\nname = \"l\"\nkind = \"disc\"\nradius_m = 1\nradiance_w_m2_sr = 1\n" + place);
    EXPECT_EQ(s.lights.at(0).T_mount_light, s.cameras.at(0).T_mount_camera);
}

TEST(SceneFile, LookAtPutsTheTargetAheadAndUpUpward) {
    const Scene s = read_good(data_file("complete.toml"));
    const Rigid3& T = s.cameras[0].T_mount_camera;
    expect_close(inverse(T) * Vec3{10, 0, 0}, {0, 0, 9.5}, 1e-14);  // along z
    expect_close(T.q * Vec3{0, 1, 0}, {0, 0, -1}, 1e-15);           // y is down
    expect_close(T.q * Vec3{1, 0, 0}, {0, -1, 0}, 1e-15);           // x is right: looking along +x, right is -y
}

TEST(SceneFile, LookAtWorksInScenesOfEverySize) {
    const auto attitude = [](const char* eye, const char* point) {
        const Scene s = read_good_text(std::string("[ambient]\nradiance = 1\n") + kSphere + kCamera +
                                       "position_m = " + eye + "\nlook_at = " + point + "\n");
        return s.cameras.at(0).T_mount_camera.q.vec();
    };
    const Vec3 metres = attitude("[1, 2, 3]", "[-4, 5, 2]");
    for (const auto& [eye, point] : {std::pair{"[1e-12, 2e-12, 3e-12]", "[-4e-12, 5e-12, 2e-12]"},
                                     {"[1e-200, 2e-200, 3e-200]", "[-4e-200, 5e-200, 2e-200]"},
                                     {"[1e20, 2e20, 3e20]", "[-4e20, 5e20, 2e20]"}})
        expect_close(attitude(eye, point), metres, 1e-14);
}

TEST(SceneFile, DirectionsMayHaveAnyLength) {
    const auto read = [](const char* sun, const char* up) {
        return read_good_text(std::string("[sun]\ndirection = ") + sun + "\n" + kSphere + kCamera +
                              "position_m = [1, 2, 3]\nlook_at = [4, 5, 6]\nup = " + up + "\n");
    };
    const Scene unit = read("[0.6, 0, -0.8]", "[0, 1, 0.5]");
    for (const auto& [sun, up] : {std::pair("[6e-301, 0, -8e-301]", "[0, 2e-300, 1e-300]"),
                                  std::pair("[6e300, 0, -8e300]", "[0, 1e308, 5e307]")}) {
        const Scene s = read(sun, up);
        expect_close(s.sun->direction, unit.sun->direction, 1e-15);
        expect_close(s.cameras[0].T_mount_camera.q.vec(), unit.cameras[0].T_mount_camera.q.vec(), 1e-15);
    }
    EXPECT_NEAR(norm(read("[0, 5e-324, 0]", "[0, 1, 0]").sun->direction), 1, 1e-15)
        << "the smallest number there is";
}

TEST(SceneFile, DefaultsAreTheManuals) {
    const Scene s = read_good_text(std::string("[sun]\ndirection = [0, 0, 5]\n") + kSphere + kCamera);
    EXPECT_EQ(s.name, "s");
    EXPECT_EQ(s.epoch_unix_ns, 0);
    EXPECT_EQ(s.sun->direction, (Vec3{0, 0, 1}));
    EXPECT_EQ(s.sun->irradiance_w_m2, 1361.0);
    EXPECT_EQ(s.ambient, Rgb{});
    EXPECT_EQ(s.materials.at(0).diffuse, (Rgb{0.5f, 0.5f, 0.5f}));
    EXPECT_EQ(s.bodies[0].initial.T_world_body, Rigid3{});
    const Camera& c = s.cameras.at(0);
    EXPECT_NEAR(test::pinhole_of(c).fx, 320, 1e-12);  // 90 degrees over 640 px
    EXPECT_EQ(test::pinhole_of(c).cx, 319.5);
    EXPECT_EQ(test::pinhole_of(c).cy, 239.5);
    EXPECT_EQ(c.format, PixelFormat::grey);
    EXPECT_EQ(c.period_ns, 100'000'000);
    EXPECT_FALSE(c.embedded_line);
    EXPECT_EQ(c.late, LatePolicy::late);
    EXPECT_FALSE(c.detector);
    EXPECT_FALSE(c.optics.lens);
    EXPECT_TRUE(s.lights.empty());
    EXPECT_TRUE(s.lidars.empty());
    EXPECT_EQ(s.render.method, RenderSettings::Method::direct);
    EXPECT_EQ(s.render.max_depth, 8);
    EXPECT_EQ(s.render.spp, 1);
    EXPECT_EQ(s.render.stale_after_s, 0.5);
    EXPECT_EQ(s.render.command_ahead_max_s, 60);
}

TEST(SceneFile, WhiteIsTheAmbientWhereThereIsNoSun) {
    const Scene s = read_good_text(std::string("[ambient]\nradiance = [1, 3, 2]\n") + kSphere + kCamera);
    EXPECT_FALSE(s.sun);
    EXPECT_EQ(s.cameras.at(0).white_radiance, 3);
}

TEST(SceneFile, QuaternionNearlyUnitIsMadeUnit) {
    const Scene s = read_good_text(std::string("[ambient]\nradiance = 1\n") + kSphere +
                                   "attitude_wxyz = [0.7071, 0, 0.7071, 0]\n" + kCamera);
    EXPECT_NEAR(norm(s.bodies[0].initial.T_world_body.q), 1, 1e-15);
}

TEST(SceneFile, EpochIsUtcInEveryWriting) {
    const char* const writings[] = {"2026-03-01T12:00:00Z", "2026-03-01T14:00:00+02:00", "2026-03-01T12:00:00",
                                    "2026-03-01 12:00:00",  "\"2026-03-01T12:00:00Z\"",  "\"2026-03-01T12:00:00\"",
                                    "2026-03-01T11:59:60Z"};
    for (const char* writing : writings) {
        const MemoryFolder folder;
        const auto path =
            folder.write("s.toml", std::string("[scene]\nepoch = ") + writing + "\n[sun]\n" + kSphere + kCamera);
        const Result<Scene> s = read_scene(path);
        if (std::string_view(writing).find(":60") != std::string_view::npos) {
            EXPECT_FALSE(s) << "TOML has no leap second";
            continue;
        }
        ASSERT_TRUE(s) << writing << ": " << s.error().text();
        EXPECT_EQ(s->epoch_unix_ns, 1772366400'000'000'000) << writing;
    }
    const Scene early =
        read_good_text(std::string("[scene]\nepoch = 1969-12-31T23:59:59.25Z\n[sun]\n") + kSphere + kCamera);
    EXPECT_EQ(early.epoch_unix_ns, -750'000'000);
}

TEST(SceneFile, OneMeshFileOfTwoBodiesIsReadOnce) {
    const MemoryFolder folder;
    folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const std::string body = "[[body]]\nmesh = \"t.obj\"\n";
    const Scene s =
        read_good(folder.write("s.toml", "[ambient]\nradiance = 1\n" + body + "name = \"a\"\n" + body +
                                             "name = \"b\"\n" + body + "name = \"c\"\nscale = 3\n" + kCamera));
    EXPECT_EQ(s.meshes.size(), 2u);
    EXPECT_EQ(std::get<int>(s.bodies[0].shape), std::get<int>(s.bodies[1].shape));
    EXPECT_EQ(s.meshes[static_cast<std::size_t>(std::get<int>(s.bodies[2].shape))].positions[1].x, 3);
}

TEST(SceneFile, BodiesOfOtherMaterialsShareTheirMesh) {
    const MemoryFolder folder;
    folder.write("t.mtl", "newmtl a\nKd 0.1 0.2 0.3\nnewmtl b\nKd 0.4 0.5 0.6\n");
    folder.write("t.obj",
                 "mtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 2 4 3\n");
    const std::string body = "[[body]]\nmesh = \"t.obj\"\n", grey = "material = {kind = \"lambert\", albedo = 0.";
    const std::string given = body + "name = \"x\"\n" + grey + "8}\n" + body + "name = \"y\"\n" + grey + "9}\n";
    const auto read = [&](const std::string& bodies) {
        return read_good(folder.write("s.toml", "[ambient]\nradiance = 1\n" + bodies + kCamera));
    };
    const Scene two = read(given);
    EXPECT_EQ(two.meshes.size(), 1u);
    EXPECT_EQ(two.materials.size(), 2u) << "not those of the file, which nothing shows";
    EXPECT_EQ(two.bodies[0].mesh_material, 0);
    EXPECT_EQ(two.bodies[1].mesh_material, 1);

    const Scene three = read(given + body + "name = \"own\"\n");
    ASSERT_EQ(three.meshes.size(), 1u);
    EXPECT_FALSE(three.bodies[2].mesh_material);
    const Mesh& mesh = three.meshes[0];
    ASSERT_EQ(mesh.face_material.size(), 2u);
    EXPECT_FLOAT_EQ(three.materials.at(mesh.face_material[0]).diffuse.x, 0.1f);
    EXPECT_FLOAT_EQ(three.materials.at(mesh.face_material[1]).diffuse.x, 0.4f);
}

}  // namespace
}  // namespace narpa
