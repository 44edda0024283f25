// An MTL file, beside an OBJ file that uses its materials.
#include "tests/fuzz/soundness.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    static const bool copied = (folder.copy_scene_data(), true);
    (void)copied;
    folder.write("cube.mtl", fuzz::text_of(data, size));
    fuzz::check(read_mesh(folder / "cube.obj", 1));
    return 0;
}
