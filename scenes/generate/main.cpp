/// make_docking_scene OUTDIR - writes the meshes, textures and approach of the docking scene. The same bytes each
/// time.
#include <cstdio>
#include <exception>
#include <string>

#include "scenes/generate/approach.h"
#include "scenes/generate/chaser.h"
#include "scenes/generate/station.h"
#include "scenes/generate/textures.h"

int main(int argc, char** argv) {
    using namespace narpa::scenes;
    if (argc != 2) {
        std::fputs("usage: make_docking_scene OUTDIR   (an existing folder)\n", stderr);
        return 2;
    }
    try {
        const std::string directory = argv[1];
        const Mesh station = build_station(), chaser = build_chaser();
        station.write_obj(directory + "/station.obj", "station.mtl");
        chaser.write_obj(directory + "/chaser.obj", "chaser.mtl");
        write_mtl(directory + "/station.mtl", scene_materials());
        write_mtl(directory + "/chaser.mtl", scene_materials());
        write_textures(directory);
        write_approach(directory + "/approach.csv");
        std::printf("station %zu triangles, chaser %zu triangles\n", station.triangle_count(),
                    chaser.triangle_count());
    } catch (const std::exception& e) {
        std::fprintf(stderr, "make_docking_scene: %s\n", e.what());
        return 1;
    }
    return 0;
}
