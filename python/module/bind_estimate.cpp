// The estimators behind narpa.estimate: frames and sweeps as arrays in, the JSON document of `narpa estimate` out.
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "python/module/arrays.h"
#include "python/module/module.h"
#include "python/module/raise.h"
#include "python/module/scene_session.h"
#include "python/module/sweeps.h"
#include "tracking/single_estimate.h"

namespace narpa::python {
namespace {

namespace py = pybind11;
using Matrix = py::array_t<double, py::array::forcecast>;

/// Arguments of narpa.estimate, as in `narpa estimate`.
struct EstimateArguments {
    std::string method, target;
    std::optional<Matrix> guess;  ///< T_sensor_target
    bool search = false;
    double start_deg = 2, start_percent = 2, range_guess_m = 0, range_noise_m = 0;
    std::map<std::string, double> uncertainty;
    std::optional<double> frame_noise_dn;
    std::uint64_t seed = 1;
};

ModelUncertainty uncertainty_of(const std::map<std::string, double>& values) {
    std::vector<ModelErrorName> known(kModelErrors.begin(), kModelErrors.end());
    known.insert(known.end(), kToldErrors.begin(), kToldErrors.end());
    ModelUncertainty out;
    for (const auto& [name, value] : values) {
        const auto field = std::ranges::find(known, name, &ModelErrorName::name);
        std::string names;
        for (const ModelErrorName& n : known) names += (names.empty() ? "" : ", ") + std::string(n.name);
        if (field == known.end()) raise({fmt::format("uncertainty: \"{}\", expected one of {}", name, names)});
        if (!(value >= 0)) raise({fmt::format("uncertainty: {} = {}, expected 0 or more", name, value)});
        out.*(field->field) = field->unit * value;
    }
    return out;
}

TrackerOptions options_of(const EstimateArguments& a) {
    TrackerOptions o;
    o.method = find_camera_method(a.method);
    if (o.method == nullptr) {
        std::string names;
        for (const CameraMethod& m : camera_methods()) names += (names.empty() ? "" : ", ") + std::string(m.name);
        raise({fmt::format("method \"{}\", expected one of {}", a.method, names)});
    }
    if (!(a.start_deg >= 0 && a.start_deg <= 180 && a.start_percent >= 0 && a.start_percent <= 100))
        raise({"start: expected (degrees, percent) from (0, 0) to (180, 100)"});
    if (a.frame_noise_dn && !o.method->takes_frame_noise && !a.search)
        raise({"frame_noise_dn is for method " + camera_methods_that_take_noise() + ", or a start by search"});
    o.target = a.target;
    o.search = a.search;
    o.start_deg = a.start_deg, o.start_percent = a.start_percent;
    o.range_guess_m = a.range_guess_m;
    o.range_noise_m = a.range_noise_m;
    o.model = uncertainty_of(a.uncertainty);
    o.frame_noise_dn = a.frame_noise_dn;
    o.seed = a.seed;
    return o;
}

/// The bytes of an array that is a frame of this camera.
std::vector<std::uint8_t> frame_bytes_of(const py::array& dn, const Camera& camera) {
    const py::array expected =
        dn_array(std::vector<std::uint8_t>(frame_bytes({camera.width, camera.height, camera.format})), camera);
    const bool same_shape =
        dn.ndim() == expected.ndim() && std::equal(dn.shape(), dn.shape() + dn.ndim(), expected.shape());
    if (!same_shape || !dn.dtype().is(expected.dtype()))
        raise({fmt::format("the frame is {} {}, expected {} {}, as camera \"{}\" puts it out",
                           std::string(py::str(dn.attr("shape"))), std::string(py::str(dn.dtype())),
                           std::string(py::str(expected.attr("shape"))), std::string(py::str(expected.dtype())),
                           camera.name)});
    const py::array plain = py::module_::import("numpy").attr("ascontiguousarray")(dn);
    const auto* const data = static_cast<const std::uint8_t*>(plain.data());
    return {data, data + plain.nbytes()};
}

/// `estimate(world)`, without the GIL; raises its error, or returns its document.
py::object document_of(SceneSession& session, const auto& estimate) {
    const std::string text = value_of(without_gil([&] {
        return session.with_world([&](const World& world) -> Result<std::string> {
            const auto found = estimate(world);
            if (!found) return found.error();
            return document(*found).dump();
        });
    }));
    return py::module_::import("json").attr("loads")(text);
}

std::optional<Rigid3> guess_of(const EstimateArguments& a) {
    if (!a.guess) return std::nullopt;
    return pose_of(*a.guess);
}

py::object estimate_frame(SceneSession& session, const std::string& name, double time_s, const py::array& dn,
                          const EstimateArguments& arguments) {
    const Scene& scene = session.scene();
    const std::size_t camera = value_of(sensor_named(scene.cameras, name, "camera", scene.file));
    const std::vector<std::uint8_t> bytes = frame_bytes_of(dn, scene.cameras[camera]);
    const std::int64_t t_ns = value_of(to_ns(time_s));
    const TrackerOptions options = options_of(arguments);
    const auto guess = guess_of(arguments);
    return document_of(session, [&](const World& world) {
        return estimate_one_frame(world, {camera, t_ns, bytes, false, guess}, options);
    });
}

py::object estimate_sweep(SceneSession& session, const std::string& name, double time_s, const py::object& sweep,
                          const EstimateArguments& arguments) {
    const Scene& scene = session.scene();
    const std::size_t index = value_of(sensor_named(scene.lidars, name, "LiDAR", scene.file));
    const LidarModel& model = *scene.lidars[index].model;
    const std::int64_t t_ns = value_of(to_ns(time_s));
    LidarSweep points = py::isinstance<py::array>(sweep)
                            ? sweep_of_shots(sweep.cast<py::array>(), model, t_ns)
                            : sweep_of_packets(sweep.cast<std::vector<std::string>>(), model);
    const TrackerOptions options = options_of(arguments);
    const auto guess = guess_of(arguments);
    return document_of(session, [&](const World& world) {
        return estimate_one_sweep(world, {index, t_ns, std::move(points), false, guess}, options);
    });
}

}  // namespace

void bind_estimate(py::module_& m) {
    py::class_<EstimateArguments>(m, "EstimateArguments")
        .def(py::init<>())
        .def_readwrite("method", &EstimateArguments::method)
        .def_readwrite("target", &EstimateArguments::target)
        .def_readwrite("guess", &EstimateArguments::guess)
        .def_readwrite("search", &EstimateArguments::search)
        .def_readwrite("start_deg", &EstimateArguments::start_deg)
        .def_readwrite("start_percent", &EstimateArguments::start_percent)
        .def_readwrite("range_guess_m", &EstimateArguments::range_guess_m)
        .def_readwrite("range_noise_m", &EstimateArguments::range_noise_m)
        .def_readwrite("uncertainty", &EstimateArguments::uncertainty)
        .def_readwrite("frame_noise_dn", &EstimateArguments::frame_noise_dn)
        .def_readwrite("seed", &EstimateArguments::seed);
    m.def("estimate_frame", &estimate_frame);
    m.def("estimate_sweep", &estimate_sweep);
}

}  // namespace narpa::python
