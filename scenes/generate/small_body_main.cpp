/// make_small_body_scene OUTDIR - writes the mesh of the small body. The same bytes each time.
#include <cstdio>
#include <exception>
#include <string>

#include "scenes/generate/small_body.h"

int main(int argc, char** argv) {
    using namespace narpa::scenes;
    if (argc != 2) {
        std::fputs("usage: make_small_body_scene OUTDIR   (an existing folder)\n", stderr);
        return 2;
    }
    try {
        const std::string directory = argv[1];
        const Mesh body = build_small_body();
        body.write_obj(directory + "/small_body.obj", "small_body.mtl");
        write_mtl(directory + "/small_body.mtl", small_body_materials());
        std::printf("small body %zu triangles\n", body.triangle_count());
    } catch (const std::exception& e) {
        std::fprintf(stderr, "make_small_body_scene: %s\n", e.what());
        return 1;
    }
    return 0;
}
