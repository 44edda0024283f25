// The DEM formats that narpa-dem-reader reads; the first bytes say which. Labels of PDS name their data file, which
// stands beside them as it is. A TIFF may also be the mask or the overviews of a good file, and numbers in six
// lines are its world file.
#include <array>

#include "renderer/assets/dem_process.h"
#include "tests/fuzz/fuzz.h"
#include "tests/support/paths.h"

namespace {

using namespace narpa;

const std::string kData = test::source_path("tests/data/dem/");
constexpr std::array<const char*, 3> kSidecars{"mars.tif.msk", "mars.tif.ovr", "mars.tfw"};

/// Writes the input where the reader will find it; the file to read.
std::string place(const fuzz::InputFolder& folder, std::string_view bytes) {
    for (const char* name : kSidecars) std::filesystem::remove(folder / name);
    if (bytes.starts_with("PDS_") || bytes.starts_with("NJPL") || bytes.starts_with("CCSD"))
        return folder.write("d.lbl", bytes);
    if (bytes.starts_with("<?xml")) return folder.write("d.xml", bytes);
    if (bytes.starts_with("Object")) return folder.write("d.cub", bytes);
    if (bytes.starts_with("\x89PNG")) return folder.write("d.png", bytes);
    const bool is_world_file =
        !bytes.empty() && (bytes.front() == '-' || (bytes.front() >= '0' && bytes.front() <= '9'));
    if (is_world_file || bytes.size() % 8 == 5) {
        folder.write(is_world_file ? "mars.tfw" : bytes.size() % 16 == 5 ? "mars.tif.msk" : "mars.tif.ovr", bytes);
        return folder / "mars.tif";
    }
    return folder.write("d.tif", bytes);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const fuzz::InputFolder folder;
    static const bool data_beside = [] {
        for (const char* name : {"pds3.img", "pds4.img", "mars.tif"})
            std::filesystem::copy_file(std::string(kData) + name, folder / name);
        return true;
    }();
    (void)data_beside;
    DemRequest request;
    request.path = place(folder, fuzz::text_of(data, size));
    request.on = size % 2 == 0 ? DemRequest::On::plane : DemRequest::On::tangent;
    if (size % 5 == 0) request.on = DemRequest::On::ellipsoid;
    if (request.path.ends_with(".png")) request.post_spacing_m = 1, request.on = DemRequest::On::plane;
    request.options.seen_from = {{0, 0, 100}};
    request.options.budget_bytes = std::uint64_t{64} << 20;
    const auto terrain = read_dem_in_process(request, {.seconds = 10});  // and the memory that scenes allow
    if (!fuzz::count(bool(terrain))) {
        const Error& e = terrain.error();
        fuzz::require(e.kind == ErrorKind::bad_input && !e.file.empty() && !e.what.empty(),
                      "an error names its file");
        fuzz::note(e.what);
        return 0;
    }
    fuzz::require(terrain->faces.size() * kTerrainBytesPerTriangle <= request.options.budget_bytes,
                  "the budget holds");
    for (const Vec3f& n : terrain->normals) fuzz::require(std::abs(norm(n) - 1) < 1e-5f, "normals are unit");
    return 0;
}
