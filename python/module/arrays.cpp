#include "python/module/arrays.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <type_traits>

#include "base/pixel_format.h"
#include "protocols/ledger_fields.h"
#include "python/module/raise.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa::python {
namespace {

namespace py = pybind11;

struct Column {
    const char* name;
    const char* format;
    std::size_t offset;
};

// As kShotHeader.
constexpr std::array kColumns{
    Column{"t_ns", "<i8", offsetof(ShotRow, t_ns)},
    Column{"packet", "<i8", offsetof(ShotRow, packet)},
    Column{"block", "<i4", offsetof(ShotRow, block)},
    Column{"laser", "<i4", offsetof(ShotRow, laser)},
    Column{"azimuth_rad", "<f8", offsetof(ShotRow, azimuth_rad)},
    Column{"elevation_rad", "<f8", offsetof(ShotRow, elevation_rad)},
    Column{"range_m", "<f8", offsetof(ShotRow, range_m)},
    Column{"x_m", "<f8", offsetof(ShotRow, position_m) + offsetof(Vec3, x)},
    Column{"y_m", "<f8", offsetof(ShotRow, position_m) + offsetof(Vec3, y)},
    Column{"z_m", "<f8", offsetof(ShotRow, position_m) + offsetof(Vec3, z)},
    Column{"reflectivity", "<f4", offsetof(ShotRow, reflectivity)},
    Column{"body", "<i4", offsetof(ShotRow, body)},
    Column{"incidence_rad", "<f8", offsetof(ShotRow, incidence_rad)},
    Column{"velocity_m_s", "<f8", offsetof(ShotRow, velocity_m_s)},
    Column{"reported_range_m", "<f8", offsetof(ShotRow, reported_range_m)},
    Column{"reported_reflectivity", "<f4", offsetof(ShotRow, reported_reflectivity)},
    Column{"reported_velocity_m_s", "<f8", offsetof(ShotRow, reported_velocity_m_s)},
    Column{"second_range_m", "<f8", offsetof(ShotRow, second_range_m)},
    Column{"second_reflectivity", "<f4", offsetof(ShotRow, second_reflectivity)},
};

py::object cell(const LedgerField& field, auto value) {
    using Value = decltype(value);
    if constexpr (std::is_enum_v<Value>)
        return py::str(std::string(field.signal.choices[static_cast<std::size_t>(value)].name));
    else if constexpr (std::is_same_v<Value, FrameLedger::Passes>)
        return py::cast(std::vector<std::uint32_t>(value.begin(), value.end()));
    else if constexpr (std::is_same_v<Value, bool>)
        return py::bool_(value);
    else if constexpr (std::is_floating_point_v<Value>)
        return py::float_(value);
    else
        return py::int_(value);
}

}  // namespace

py::array radiance_array(std::vector<Rgb>&& radiance, const Camera& camera) {
    return owned_array(std::move(radiance), {camera.height, camera.width, 3}, py::dtype::of<float>());
}

py::array dn_array(std::vector<std::uint8_t>&& bytes, const Camera& camera) {
    const PixelFormatRow& row = row_of(camera.format);
    std::vector<py::ssize_t> shape{camera.height, camera.width};
    if (!row.is_16_bit && row.bytes > 1) shape.push_back(static_cast<py::ssize_t>(row.bytes));
    const auto dtype = row.is_16_bit ? py::dtype::of<std::uint16_t>() : py::dtype::of<std::uint8_t>();
    return owned_array(std::move(bytes), std::move(shape), dtype);
}

py::dtype shots_dtype() {
    py::list names, formats, offsets;
    for (const Column& c : kColumns) names.append(c.name), formats.append(c.format), offsets.append(c.offset);
    return py::dtype(names, formats, offsets, sizeof(ShotRow));
}

py::array shots_array(std::vector<ShotRow>&& shots) {
    const auto n = static_cast<py::ssize_t>(shots.size());
    return owned_array(std::move(shots), {n}, shots_dtype());
}

py::dict ledger_dict(const FrameLedger& ledger) {
    py::dict columns;
    for (const LedgerField& field : kLedgerColumns)
        visit_field(field, ledger,
                    [&](auto value) { columns[py::str(std::string(field.name))] = cell(field, value); });
    return columns;
}

py::array pose_array(const Rigid3& T) {
    py::array_t<double> matrix({4, 4});
    auto m = matrix.mutable_unchecked<2>();
    const std::array<Vec3, 3> axes = columns(T.q);
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) m(row, column) = axes[static_cast<std::size_t>(column)][row];
        m(row, 3) = T.t[row];
        m(3, row) = 0;
    }
    m(3, 3) = 1;
    return matrix;
}

Rigid3 pose_of(const py::array_t<double, py::array::forcecast>& matrix) {
    constexpr double kTolerance = 1e-6;
    if (matrix.ndim() != 2 || matrix.shape(0) != 4 || matrix.shape(1) != 4)
        raise({"pose: expected a matrix (4, 4), [R t; 0 0 0 1]"});
    const auto m = matrix.unchecked<2>();
    const auto column = [&](int k) { return Vec3{m(0, k), m(1, k), m(2, k)}; };
    const Vec3 x = column(0), y = column(1), z = column(2), t = column(3);
    const double off =
        std::max({std::abs(dot(x, x) - 1), std::abs(dot(y, y) - 1), std::abs(dot(x, y)), norm(cross(x, y) - z),
                  std::abs(m(3, 0)) + std::abs(m(3, 1)) + std::abs(m(3, 2)), std::abs(m(3, 3) - 1)});
    if (!(off <= kTolerance) || !is_finite(t))
        raise(
            {fmt::format("pose: expected a rotation and a translation in metres, [R t; 0 0 0 1]; the matrix is off "
                         "one by {:.3g}, expected at most {:g}",
                         off, kTolerance)});
    return {quat_from_columns(x, y, z), t};
}

Rigid3 pose_of(const std::array<double, 3>& p, const std::array<double, 4>& q) {
    Rigid3 T{{q[0], q[1], q[2], q[3]}, {p[0], p[1], p[2]}};
    if (!is_finite(T.t)) raise({"position_m: expected three finite numbers"});
    if (!accept_attitude(T.q))
        raise({fmt::format("attitude_wxyz ({}, {}, {}, {}): expected a quaternion of norm 1", q[0], q[1], q[2],
                           q[3])});
    return T;
}

}  // namespace narpa::python
