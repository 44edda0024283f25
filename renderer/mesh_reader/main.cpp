// narpa-mesh-reader FILE MEMORY_BYTES SECONDS - reads a mesh file within limits of memory and time, and
// writes the triangles and materials to standard output as a MeshMessage. narpa starts it for each mesh file of
// a scene.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "renderer/assets/confined_reader.h"
#include "renderer/mesh_reader/mesh_reader.h"

int main(int argc, char** argv) {
    if (argc != 4) {
        std::fputs("narpa-mesh-reader is started by narpa for each mesh file: FILE MEMORY_BYTES SECONDS\n", stderr);
        return 2;
    }
    narpa::confine_reader(std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10));
    narpa::MeshMessage message = narpa::read_mesh_file(argv[1]);
    narpa::PipeSender out;
    // Without destructors: Assimp's may crash on what a damaged file left behind.
    _exit(narpa::mesh_message::transfer(out, message) ? 0 : 1);
}
