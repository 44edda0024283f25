// From a scene file to an image file.
#include <narpa/renderer/frame/camera_image.h>
#include <narpa/renderer/image/image_file.h>
#include <narpa/renderer/scene_file/scene_file.h>
#include <cstdio>
#include <string>

int main(int, char** argv) {
    const auto scene = narpa::read_scene(argv[1] + std::string("/cornell/cornell.toml"));
    if (!scene) return std::puts(scene.error().text().c_str()), 2;
    const auto world = narpa::RenderScene::create(*scene);
    if (!world) return std::puts(world.error().text().c_str()), 2;
    const narpa::Camera& camera = scene->cameras.front();
    narpa::RadianceImage image(camera.width, camera.height);
    narpa::render_radiance(*world, narpa::BodyPoses(scene->bodies.size()), camera, camera.T_mount_camera, {},
                           image);
    const auto written = narpa::write_image("cornell.exr", {camera, image});
    return written ? 0 : (std::puts(written.error().text().c_str()), 2);
}
