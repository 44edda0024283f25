/// make_descent_scene OUTDIR - writes the ground of the descent and its picture. The same bytes each time.
#include <cstdio>
#include <exception>
#include <string>

#include "scenes/generate/terrain.h"
#include "scenes/generate/textures.h"

int main(int argc, char** argv) {
    using namespace narpa::scenes;
    if (argc != 2) {
        std::fputs("usage: make_descent_scene OUTDIR   (an existing folder)\n", stderr);
        return 2;
    }
    try {
        const std::string directory = argv[1];
        const Mesh terrain = build_terrain();
        terrain.write_obj(directory + "/terrain.obj", "terrain.mtl");
        write_mtl(directory + "/terrain.mtl", terrain_materials());
        write_ground_texture(directory);
        std::printf("terrain %zu triangles\n", terrain.triangle_count());
    } catch (const std::exception& e) {
        std::fprintf(stderr, "make_descent_scene: %s\n", e.what());
        return 1;
    }
    return 0;
}
