/// make_craft_scene OUTDIR - writes the mesh of the craft. The same bytes each time.
#include <cstdio>
#include <exception>
#include <string>

#include "scenes/generate/craft.h"

int main(int argc, char** argv) {
    using namespace narpa::scenes;
    if (argc != 2) {
        std::fputs("usage: make_craft_scene OUTDIR   (an existing folder)\n", stderr);
        return 2;
    }
    try {
        const std::string directory = argv[1];
        const Mesh craft = build_craft();
        craft.write_obj(directory + "/craft.obj", "craft.mtl", ObjParts::positions);
        write_mtl(directory + "/craft.mtl", craft_materials());
        std::printf("craft %zu triangles\n", craft.triangle_count());
    } catch (const std::exception& e) {
        std::fprintf(stderr, "make_craft_scene: %s\n", e.what());
        return 1;
    }
    return 0;
}
