// The DEM formats that narpa-dem-reader reads; the first bytes say which. Labels of PDS name their data file, which
// stands beside them as it is.
#include "renderer/scene/dem_process.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    static const bool data_beside = [] {
        for (const char* name : {"pds3.img", "pds4.img"})
            std::filesystem::copy_file(std::string(NARPA_SOURCE_DIR "/tests/data/dem/") + name, folder / name);
        return true;
    }();
    (void)data_beside;
    const std::string_view bytes = fuzz::text_of(data, size);
    const char* name = bytes.starts_with("PDS_")      ? "d.lbl"
                       : bytes.starts_with("<?xml")   ? "d.xml"
                       : bytes.starts_with("Object")  ? "d.cub"
                       : bytes.starts_with("\x89PNG") ? "d.png"
                                                      : "d.tif";
    DemRequest request;
    request.path = folder.write(name, bytes);
    request.on = size % 2 == 0 ? DemRequest::On::plane : DemRequest::On::tangent;
    if (name[2] == 'p') request.post_spacing_m = 1, request.on = DemRequest::On::plane;
    request.options.seen_from = {{0, 0, 100}};
    request.options.budget_bytes = std::uint64_t{64} << 20;
    const auto terrain = read_dem_in_process(request, {.memory_bytes = std::uint64_t{1} << 30, .seconds = 10});
    if (!fuzz::count(bool(terrain))) {
        const Error& e = terrain.error();
        fuzz::require(e.kind == ErrorKind::bad_input && !e.file.empty() && !e.what.empty(),
                      "an error names its file");
        return 0;
    }
    fuzz::require(terrain->faces.size() * kTerrainBytesPerTriangle <= request.options.budget_bytes,
                  "the budget holds");
    for (const Vec3f& n : terrain->normals) fuzz::require(std::abs(norm(n) - 1) < 1e-5f, "normals are unit");
    return 0;
}
