// narpa.Emulator: the emulator in lockstep.
#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "python/module/arrays.h"
#include "python/module/emulator_session.h"
#include "python/module/module.h"
#include "python/module/raise.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::python {
namespace {

namespace py = pybind11;
using Names = std::vector<std::string>;

struct FrameOfRun {
    std::string camera;
    std::uint32_t number = 0;
    double time_s = 0;
    py::object dn;
    py::dict ledger, poses;
};
struct SweepOfRun {
    std::string lidar;
    std::int64_t number = 0;
    py::object shots;
    py::list packets;
};
struct Step {
    py::list frames, sweeps, can_frames;
};

Step step_of(EmulatorOutput&& made, const Scene& scene) {
    Step step;
    for (EmulatedFrame& f : made.frames) {
        const Camera& camera = scene.cameras[f.camera];
        py::dict poses;
        for (std::size_t i = 0; i < scene.bodies.size(); ++i)
            poses[py::str(scene.bodies[i].name)] = pose_array(f.T_world_body[i]);
        step.frames.append(
            FrameOfRun{camera.name, f.ledger.frame, static_cast<double>(f.ledger.t_exposure_mid_ns) * 1e-9,
                       dn_array(std::move(f.bytes), camera), ledger_dict(f.ledger), std::move(poses)});
    }
    for (EmulatedSweep& s : made.sweeps) {
        py::list packets;
        for (const auto& p : s.packets)
            packets.append(py::bytes(reinterpret_cast<const char*>(p.data()), p.size()));
        step.sweeps.append(SweepOfRun{s.lidar, s.number, shots_array(std::move(s.shots)), std::move(packets)});
    }
    for (const CanFrame& f : made.can_frames)
        step.can_frames.append(
            py::make_tuple(f.id, py::bytes(reinterpret_cast<const char*>(f.data.data()), f.size)));
    return step;
}

/// `file_or_name`: used where `text` is absent, else the name of the text.
std::unique_ptr<EmulatorSession> open(const std::string& file_or_name, const std::optional<std::string>& text,
                                      const Names& overrides, const std::optional<Names>& cameras,
                                      const std::optional<Names>& lidars, const std::string& log, int threads) {
    auto scene = without_gil([&]() -> Result<Scene> {
        if (text) return parse_scene(*text, file_or_name, overrides);
        const auto file = find_file(FileKind::scene, file_or_name);
        if (!file) return file.error();
        return read_scene(*file, overrides);
    });
    if (!scene) raise_scene_error(scene.error());
    EmulatorSettings settings{.cameras = {}, .lidars = {}, .log_folder = log, .threads = threads};
    for (const Camera& c : scene->cameras) settings.cameras.push_back(c.name);
    for (const Lidar& l : scene->lidars) settings.lidars.push_back(l.name);
    settings.cameras = cameras.value_or(settings.cameras);
    settings.lidars = lidars.value_or(settings.lidars);
    return value_of(without_gil([&] { return EmulatorSession::create(*std::move(scene), settings); }));
}

Step step(EmulatorSession& session, double to_s) {
    bool interrupted = false;
    auto made = without_gil([&] {
        return session.step(to_s, [&] {
            const py::gil_scoped_acquire acquire;
            return interrupted = PyErr_CheckSignals() != 0;
        });
    });
    if (interrupted) throw py::error_already_set();
    return step_of(value_of(std::move(made)), session.scene());
}

py::tuple finish(EmulatorSession& session) {
    std::string report;
    auto made = without_gil([&] { return session.finish(report); });
    Step rest = step_of(value_of(std::move(made)), session.scene());
    return py::make_tuple(std::move(rest), py::module_::import("json").attr("loads")(report));
}

void command(EmulatorSession& session, const std::string& body, double time_s, const std::array<double, 3>& p,
             const std::array<double, 4>& q, const std::array<double, 3>& v, const std::array<double, 3>& w) {
    const Motion motion{pose_of(p, q), vec_of(v), vec_of(w)};
    (void)value_of(without_gil([&] { return session.command(body, time_s, motion); }));
}

void send(EmulatorSession& session, std::uint32_t identifier, const py::bytes& data) {
    const std::string_view bytes(data);
    CanFrame frame;
    frame.id = identifier;
    frame.fd = bytes.size() > 8;
    if (bytes.size() > frame.data.size()) raise({"data: expected at most 64 bytes"});
    frame.size = static_cast<std::uint8_t>(bytes.size());
    std::copy(bytes.begin(), bytes.end(), frame.data.begin());
    (void)value_of(without_gil([&] { return session.send(frame); }));
}

}  // namespace

void bind_emulator(py::module_& m) {
    using py::arg;
    const std::array<double, 4> identity{1, 0, 0, 0};
    const std::array<double, 3> at_rest{};
    py::class_<FrameOfRun>(m, "EmulatedFrame", "A frame that the emulator has handed over.")
        .def_readonly("camera", &FrameOfRun::camera, "Name of the camera.")
        .def_readonly("number", &FrameOfRun::number)
        .def_readonly("time_s", &FrameOfRun::time_s, "Middle of the exposure, s of simulation time.")
        .def_readonly("dn", &FrameOfRun::dn, "As Frame.dn.")
        .def_readonly("ledger", &FrameOfRun::ledger, "The columns of CAMERA.ledger.csv (docs/replay.md).")
        .def_readonly("poses", &FrameOfRun::poses,
                      "The truth: T_world_body of every body at mid-exposure, {name: (4, 4) float64}.");
    py::class_<SweepOfRun>(m, "EmulatedSweep", "A turn of a LiDAR.")
        .def_readonly("lidar", &SweepOfRun::lidar, "Name of the LiDAR.")
        .def_readonly("number", &SweepOfRun::number, "Whole turns since simulation time 0.")
        .def_readonly("shots", &SweepOfRun::shots, "(n,) structured, as of Scene.scan.")
        .def_readonly("packets", &SweepOfRun::packets, "The data packets, as sent: a list of bytes.");
    py::class_<Step>(m, "Step", "What the emulator has made since the last step.")
        .def_readonly("frames", &Step::frames, "list of EmulatedFrame, in the order of time.")
        .def_readonly("sweeps", &Step::sweeps, "list of EmulatedSweep that are complete.")
        .def_readonly("can_frames", &Step::can_frames,
                      "list of (identifier, data): what narpa has sent, CAN FD; narpa.can.Decoder reads it.");
    py::class_<EmulatorSession>(m, "EmulatorSession")
        .def(py::init(&open), arg("file_or_name"), arg("text"), arg("overrides"), arg("cameras"), arg("lidars"),
             arg("log"), arg("threads"))
        .def_property_readonly("time_s",
                               [](const EmulatorSession& s) { return static_cast<double>(s.t_ns()) * 1e-9; })
        .def("command", &command, arg("body"), arg("time_s"), arg("position_m"), arg("attitude_wxyz") = identity,
             arg("velocity_m_s") = at_rest, arg("rate_rad_s") = at_rest)
        .def("send", &send, arg("identifier"), arg("data"))
        .def("step", &step, arg("to_s"))
        .def("finish", &finish);
}

}  // namespace narpa::python
