/// python/module/arrays.h - vectors as NumPy arrays, without a copy, and poses from and to arrays.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <utility>
#include <vector>

#include "base/pose.h"
#include "base/radiance_image.h"
#include "emulator/log/sweep_log.h"
#include "protocols/ledger.h"
#include "renderer/scene/scene.h"

namespace narpa::python {

/// An array that owns the vector's memory. `shape` and `dtype` describe the vector's bytes.
template <class T>
pybind11::array owned_array(std::vector<T>&& values, std::vector<pybind11::ssize_t> shape,
                            const pybind11::dtype& dtype) {
    auto held = std::make_unique<std::vector<T>>(std::move(values));
    void* const data = held->data();
    const pybind11::capsule owner(held.get(), [](void* p) { delete static_cast<std::vector<T>*>(p); });
    (void)held.release();
    return pybind11::array(dtype, std::move(shape), {}, data, owner);
}

/// (h, w, 3) float32, W m^-2 sr^-1 a band.
[[nodiscard]] pybind11::array radiance_array(std::vector<Rgb>&& radiance, const Camera& camera);
/// Digital numbers in the camera's format: (h, w) uint8 or uint16; RGB24 (h, w, 3) and YUYV (h, w, 2) uint8.
[[nodiscard]] pybind11::array dn_array(std::vector<std::uint8_t>&& bytes, const Camera& camera);
/// (n,) structured: the columns of `narpa scan -o FILE.csv`.
[[nodiscard]] pybind11::array shots_array(std::vector<ShotRow>&& shots);
[[nodiscard]] pybind11::dtype shots_dtype();

/// The columns of CAMERA.ledger.csv.
[[nodiscard]] pybind11::dict ledger_dict(const FrameLedger& ledger);

/// (4, 4) float64.
[[nodiscard]] pybind11::array pose_array(const Rigid3& T);
/// From a (4, 4) matrix of a rotation and a translation. Raises narpa.Error where it is none.
[[nodiscard]] Rigid3 pose_of(const pybind11::array_t<double, pybind11::array::forcecast>& matrix);
/// Raises narpa.Error for a quaternion (w, x, y, z) whose norm is not 1 within 1e-3, or numbers that are not
/// finite.
[[nodiscard]] Rigid3 pose_of(const std::array<double, 3>& position_m, const std::array<double, 4>& attitude_wxyz);
[[nodiscard]] inline Vec3 vec_of(const std::array<double, 3>& v) {
    return {v[0], v[1], v[2]};
}

}  // namespace narpa::python
