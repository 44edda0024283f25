// The mesh formats that narpa-mesh-reader reads; the first bytes say which.
#include "renderer/assets/meshes/mesh_process.h"
#include "tests/fuzz/soundness.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const std::string_view bytes = fuzz::text_of(data, size);
    const char* name = bytes.starts_with("{")      ? "m.gltf"
                       : bytes.starts_with("glTF") ? "m.glb"
                       : bytes.starts_with("ply")  ? "m.ply"
                       : bytes.starts_with("<")    ? "m.dae"
                       : bytes.starts_with("MM")   ? "m.3ds"
                                                   : "m.stl";
    fuzz::check(
        read_mesh(folder.write(name, bytes), 1, 0.5, {.memory_bytes = std::uint64_t{1} << 30, .seconds = 10}));
    return 0;
}
