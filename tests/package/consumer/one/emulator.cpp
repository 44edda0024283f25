// From a scene file to a range.
#include <narpa/emulator/world.h>
#include <narpa/renderer/scene_file/scene_file.h>
#include <cstdio>
#include <string>

int main(int, char** argv) {
    auto scene = narpa::read_scene(argv[1] + std::string("/docking/docking.toml"));
    if (!scene) return std::puts(scene.error().text().c_str()), 2;
    auto world = narpa::World::create(*std::move(scene));
    if (!world) return std::puts(world.error().text().c_str()), 2;
    narpa::BodyPoses at((*world)->scene().bodies.size());
    (*world)->place(0, -1, at);
    const narpa::Hit hit = (*world)->tracer().intersect(at, {{50, 0, 0}, {-1, 0, 0}}, 1e3);
    std::printf("%zu triangles; along the port's axis from 50 m: %.3f m\n", (*world)->tracer().triangle_count(),
                hit.range_m);
    return hit.body >= 0 ? 0 : 1;
}
