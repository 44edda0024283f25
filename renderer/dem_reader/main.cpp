// narpa-dem-reader FILE REQUEST MEMORY_BYTES SECONDS - reads a DEM with GDAL, within limits of memory and time, and
// writes the terrain to standard output as a DemMessage. narpa starts it for each DEM of a scene.
#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "renderer/assets/confined_reader.h"
#include "renderer/assets/dem_message.h"
#include "renderer/dem_reader/gdal_source.h"

namespace {

using namespace narpa;

/// Progress on a terminal: a line that is rewritten at each per cent.
class ProgressLine {
public:
    ProgressLine(int terminal, const std::string& path)
        : terminal_(terminal), name_(std::filesystem::path(path).filename().string()) {}
    void operator()(double part) {
        const int percent = static_cast<int>(100 * part);
        if (terminal_ < 0 || percent == told_) return;
        told_ = percent;
        dprintf(terminal_, percent < 100 ? "\r%s: %d %%\x1b[K" : "\r\x1b[K", name_.c_str(), percent);
    }

private:
    int terminal_, told_ = -1;
    std::string name_;
};

/// Distances from the centre taken for heights, or heights for distances.
std::string warning_of_radii(const DemRequest& request, double equatorial_m, const TerrainMesh::Summary& s) {
    if (!request.radii && s.lowest_m > 0.5 * equatorial_m)
        return fmt::format(
            "its heights are from {:.6g} to {:.6g} m, and the radius of its ellipsoid is {:.6g} m: "
            "distances from the centre? They need has = \"radii\"",
            s.lowest_m, s.highest_m, equatorial_m);
    if (request.radii && s.highest_m < -0.5 * equatorial_m)
        return fmt::format(
            "its numbers are up to {:.6g} m, and the radius of its ellipsoid is {:.6g} m: heights? They "
            "need has = \"heights\"",
            s.highest_m + equatorial_m, equatorial_m);
    return "";
}

Result<TerrainMesh> read_terrain(const DemRequest& request, int terminal) {
    auto dem = open_with_gdal(request);
    if (!dem) return dem.error();
    std::unique_ptr<HeightSource> detailed;
    const int finer = request.detail.refinement_factor;
    if (finer > 1) {
        if (dem->heights->columns() > (1 << 20) / finer || dem->heights->rows() > (1 << 20) / finer)
            return Error{"it has too many posts for its detail, expected at most 2^20 along a side with it"};
        if (dem->heights->is_global() && (request.detail.craters > 0 || request.detail.rocks > 0))
            return Error{
                "it goes around the planet, where craters and rocks would break off at the seam and stretch to the "
                "poles: expected no craters_per_m2 and no rocks_share in its detail"};
        detailed = std::make_unique<DetailedSource>(*dem->heights, dem->spacing, request.detail);
        dem->placement.refinement_factor = finer;
    }
    ProgressLine line(terminal, request.path);
    auto terrain = build_terrain(detailed ? *detailed : *dem->heights, dem->placement, request.options,
                                 [&](double part) { line(part); });
    if (!terrain) return terrain;
    terrain->warnings = dem->voids->warnings();
    if (auto text = warning_of_radii(request, dem->placement.equatorial_m, terrain->summary); !text.empty())
        terrain->warnings.push_back(std::move(text));
    terrain->warnings.insert(terrain->warnings.begin(), dem->warnings.begin(), dem->warnings.end());
    return terrain;
}

}  // namespace

int main(int argc, char** argv) {
    DemRequest request;
    if (argc != 5 || !from_argument(argv[2], request)) {
        std::fputs("narpa-dem-reader is started by narpa for each DEM: FILE REQUEST MEMORY_BYTES SECONDS\n",
                   stderr);
        return 2;
    }
    request.path = argv[1];
    const int terminal = isatty(STDERR_FILENO) != 0 ? dup(STDERR_FILENO) : -1;
    confine_reader(std::strtoull(argv[3], nullptr, 10), std::strtoull(argv[4], nullptr, 10));
    DemMessage message;
    if (auto terrain = read_terrain(request, terminal))
        message.terrain = std::move(*terrain);
    else
        message.error = terrain.error().what;
    PipeSender out;
    _exit(mesh_message::transfer(out, message) ? 0 : 1);
}
