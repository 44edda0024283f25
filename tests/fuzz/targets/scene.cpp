// A scene file, beside the meshes and images that the tests' complete scene names.
#include "renderer/scene_file/scene_file.h"
#include "tests/fuzz/soundness.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    static const bool copied = (folder.copy_scene_data(), true);
    (void)copied;
    const Result<Scene> scene = read_scene(folder.write("s.toml", fuzz::text_of(data, size)));
    if (!fuzz::count(bool(scene))) {
        fuzz::check(scene.error());
        fuzz::require(scene.error().line >= 1, "an error names its line");
        return 0;
    }
    for (const Mesh& m : scene->meshes) fuzz::check(m, scene->materials.size());
    for (const Material& m : scene->materials) fuzz::check(m, static_cast<int>(scene->textures.size()));
    const auto bodies = static_cast<int>(scene->bodies.size());
    const auto is_unit = [](const Quat& q) { return std::abs(norm(q) - 1) < 1e-12; };
    for (const Light& l : scene->lights) {
        fuzz::require(l.mount < bodies && is_unit(l.T_mount_light.q), "a light is mounted");
        fuzz::require(l.width_m > 0 && l.height_m > 0 && l.radius_m > 0, "a light has a size");
        fuzz::require(is_finite(l.emission) && std::max({l.emission.x, l.emission.y, l.emission.z}) > 0,
                      "a light shines");
    }
    for (const Camera& c : scene->cameras) {
        fuzz::require(c.mount < bodies && is_unit(c.T_mount_camera.q), "a camera is mounted");
        fuzz::require(c.model && c.model->is_valid() && c.period_ns > 0, "a camera has a field of view");
        fuzz::require(
            !c.optics.lens || (c.optics.lens->aperture_diameter_m > 0 && c.optics.lens->focus_distance_m > 0),
            "a lens");
    }
    for (const Body& b : scene->bodies) fuzz::require(is_unit(b.initial.T_world_body.q), "an attitude is unit");
    if (scene->sun) fuzz::require(std::abs(norm(scene->sun->direction) - 1) < 1e-12, "the Sun's direction is unit");
    if (scene->stars)
        for (const Star& star : scene->stars->stars)
            fuzz::require(std::abs(norm(star.direction) - 1) < 1e-12, "a star's direction is unit");
    return 0;
}
