// An OBJ file beside the MTL file that the tests' cube has.
#include "tests/fuzz/soundness.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    static const bool copied = (folder.copy_scene_data(), true);
    (void)copied;
    fuzz::check(read_mesh(folder.write("m.obj", fuzz::text_of(data, size)), 3));
    return 0;
}
