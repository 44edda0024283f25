#include "python/module/sweeps.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "python/module/arrays.h"
#include "python/module/raise.h"

namespace narpa::python {
namespace {

namespace py = pybind11;

std::span<const std::uint8_t> bytes_of(const std::string& packet) {
    return {reinterpret_cast<const std::uint8_t*>(packet.data()), packet.size()};
}

/// The rows of an array of shots, in one piece.
std::vector<ShotRow> rows_of_array(const py::array& shots) {
    if (shots.ndim() != 1 || !shots.dtype().equal(shots_dtype()))
        raise({"a sweep: expected the array of Scene.scan, or a list of data packets (bytes)"});
    const py::array plain = py::module_::import("numpy").attr("ascontiguousarray")(shots);
    const auto* const rows = static_cast<const ShotRow*>(plain.data());
    return {rows, rows + plain.shape(0)};
}

}  // namespace

LidarSweep sweep_of_shots(const py::array& array, const LidarModel& model, std::int64_t t_ns) {
    const std::vector<ShotRow> rows = rows_of_array(array);
    LidarSweep sweep;
    std::vector<LidarShot> shots(model.spec().shots_per_packet);
    std::size_t shot = shots.size();
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const ShotRow& row = rows[i];
        if (i == 0 || row.packet != rows[i - 1].packet) {
            model.shots(row.packet, shots);
            shot = 0;
        }
        const auto fired =
            std::find_if(shots.begin() + static_cast<std::ptrdiff_t>(shot), shots.end(),
                         [&](const LidarShot& s) { return s.block == row.block && s.beam == row.laser; });
        if (fired == shots.end())
            raise({fmt::format(
                "row {} of the sweep: packet {} has no shot of laser {} in block {} there, expected the rows "
                "of Scene.scan of this LiDAR in their order",
                i, row.packet, row.laser, row.block)});
        shot = static_cast<std::size_t>(fired - shots.begin()) + 1;
        const double t_s = 1e-9 * static_cast<double>(row.t_ns - t_ns);
        for (const double range_m : {row.reported_range_m, row.second_range_m})
            if (range_m > 0) sweep.points.push_back({fired->origin_m, fired->direction, range_m, t_s});
        if (!(row.reported_range_m > 0) && fired->fires)
            sweep.empty.push_back({fired->origin_m, fired->direction, t_s});
    }
    return sweep;
}

LidarSweep sweep_of_packets(const std::vector<std::string>& packets, const LidarModel& model) {
    std::vector<std::pair<std::int64_t, std::size_t>> times;
    for (std::size_t i = 0; i < packets.size(); ++i) {
        const auto bytes = bytes_of(packets[i]);
        const bool right_size = bytes.size() == model.spec().data_packet_bytes;
        const auto t_ns =
            right_size ? model.packet_time(bytes, times.empty() ? 0 : times.front().first) : std::nullopt;
        if (!t_ns)
            raise({fmt::format("packet {} of the sweep, {} bytes: {}", i, bytes.size(),
                               right_size ? model.mismatch(bytes)
                                          : fmt::format("expected the {} bytes of a data packet of {}",
                                                        model.spec().data_packet_bytes, model.spec().name))});
        times.emplace_back(*t_ns, i);
    }
    std::ranges::stable_sort(times);
    LidarSweep sweep;
    SweepReader reader(model);
    for (const auto& [t_ns, i] : times) reader.append(bytes_of(packets[i]), t_ns - times.front().first, sweep);
    return sweep;
}

}  // namespace narpa::python
