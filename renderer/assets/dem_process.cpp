#include "renderer/assets/dem_process.h"

#include <fmt/format.h>

#include <cstdlib>
#include <cstring>

#include "renderer/assets/dem_message.h"
#include "renderer/assets/reader_process.h"

namespace narpa {

namespace {

constexpr std::uint64_t kWorkingMemory = std::uint64_t{1} << 30;  // GDAL and its libraries, rows, tiles

/// Calls `f` with each number of a request, in order.
template <class Request, class F>
void for_each_number(Request& r, const F& f) {
    f(r.on), f(r.radii), f(r.scale), f(r.offset_m), f(r.no_data), f(r.post_spacing_m), f(r.equatorial_m);
    f(r.polar_m), f(r.detail.refinement_factor), f(r.detail.craters), f(r.detail.rocks), f(r.detail.seed);
    f(r.options.error_px), f(r.options.pixels_per_rad), f(r.options.error_m), f(r.options.budget_bytes);
}

bool is_sound(const TerrainMesh& t) {
    const std::size_t n = t.positions.size();
    if (t.normals.size() != n || t.uvs.size() != n || !is_finite(t.origin_m)) return false;
    for (std::size_t i = 0; i < n; ++i)
        if (!is_finite(t.positions[i]) || !is_finite(t.normals[i])) return false;
    for (const auto& face : t.faces)
        for (const std::uint32_t vertex : face)
            if (vertex >= n) return false;
    return !t.faces.empty();
}

}  // namespace

std::string to_argument(const DemRequest& request) {
    std::string text;
    const auto put = [&](auto x) { text += fmt::format("{:.17g} ", static_cast<double>(x)); };
    for_each_number(request, put);
    for (const Vec3& p : request.options.seen_from) put(p.x), put(p.y), put(p.z);
    return text;
}

bool from_argument(const std::string& argument, DemRequest& request) {
    const char* at = argument.c_str();
    bool whole = true;
    const auto next = [&] {
        char* end = nullptr;
        const double x = std::strtod(at, &end);
        whole &= end != at;
        at = end;
        return x;
    };
    const auto take = [&](auto& x) { x = static_cast<std::remove_reference_t<decltype(x)>>(next()); };
    for_each_number(request, take);
    while (whole && *at != '\0' && std::strcmp(at, " ") != 0) {
        Vec3 p;
        take(p.x), take(p.y), take(p.z);
        request.options.seen_from.push_back(p);
    }
    return whole && !request.options.seen_from.empty();
}

Result<TerrainMesh> read_dem_in_process(const DemRequest& request, const DemReaderLimits& limits) {
    const std::uint64_t memory_bytes =
        (limits.memory_bytes > 0 ? limits.memory_bytes : kWorkingMemory) + request.options.budget_bytes;
    ReaderProcess process;
    if (const int failed = process.start(
            "narpa-dem-reader",
            {request.path, to_argument(request), std::to_string(memory_bytes), std::to_string(limits.seconds)});
        failed != 0)
        return Error{
            .what = fmt::format("cannot start narpa-dem-reader, which reads DEMs: {}, expected it beside the "
                                "program or on PATH. It is built where GDAL is installed (libgdal-dev), "
                                "unless NARPA_WITH_GDAL is off",
                                std::strerror(failed)),
            .file = request.path,
            .kind = ErrorKind::missing};
    DemMessage message;
    PipeReceiver receiver(process.output(), memory_bytes, limits.seconds);
    const bool whole = mesh_message::transfer(receiver, message);
    const int status = process.end();
    const auto broken = [&](const std::string& what) {
        return Error{.what = what + "; the file is damaged or too large", .file = request.path};
    };
    if (receiver.timed_out()) return broken(fmt::format("the DEM reader took longer than {} s", limits.seconds));
    if (!whole) return broken(why_it_ended("the DEM reader", status, memory_bytes));
    if (!message.error.empty()) return Error{.what = message.error, .file = request.path};
    if (!is_sound(message.terrain)) return broken("the DEM reader returned what is not a terrain");
    return std::move(message.terrain);
}

}  // namespace narpa
