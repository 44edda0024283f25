// narpa.Scene and narpa.Frame.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <vector>

#include "python/module/arrays.h"
#include "python/module/module.h"
#include "python/module/raise.h"
#include "python/module/scene_session.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::python {
namespace {

namespace py = pybind11;
using Names = std::vector<std::string>;
using Matrix = py::array_t<double, py::array::forcecast>;

struct Frame {
    std::string camera;
    std::uint32_t number = 0;
    double time_s = 0;
    py::object radiance, dn;
    py::dict aovs, ledger;
};

struct CameraInfo {
    std::string name, format, mount;
    int width = 0, height = 0;
    double rate_hz = 0, exposure_s = 0;
};

/// An AOV by its name on the command line: takes its values out.
struct AovKind {
    const char* name;
    py::array (*take)(Aovs& values, const Camera& camera);
};

py::array scalars(auto&& values, const Camera& c) {
    using Value = typename std::remove_reference_t<decltype(values)>::value_type;
    return owned_array(std::move(values), {c.height, c.width}, py::dtype::of<Value>());
}
py::array vectors(auto&& values, const Camera& c) {
    using Value = typename std::remove_reference_t<decltype(values)>::value_type;
    using Number = std::remove_cvref_t<decltype(Value{}.x)>;
    return owned_array(std::move(values), {c.height, c.width, 3}, py::dtype::of<Number>());
}

const std::array<AovKind, 7> kAovs{{
    {"depth", [](Aovs& a, const Camera& c) { return scalars(std::move(a.depth_m), c); }},
    {"range", [](Aovs& a, const Camera& c) { return scalars(std::move(a.range_m), c); }},
    {"normal", [](Aovs& a, const Camera& c) { return vectors(std::move(a.normal), c); }},
    {"position", [](Aovs& a, const Camera& c) { return vectors(std::move(a.position), c); }},
    {"body", [](Aovs& a, const Camera& c) { return scalars(std::move(a.body), c); }},
    {"albedo", [](Aovs& a, const Camera& c) { return vectors(std::move(a.albedo), c); }},
    {"variance", [](Aovs& a, const Camera& c) { return scalars(std::move(a.variance), c); }},
}};

std::vector<const AovKind*> chosen_aovs(const Names& names) {
    std::vector<const AovKind*> chosen;
    for (const std::string& name : names) {
        const auto found = std::ranges::find(kAovs, name, &AovKind::name);
        if (found == kAovs.end()) {
            Names known;
            for (const AovKind& kind : kAovs) known.emplace_back(kind.name);
            raise({fmt::format("aovs: \"{}\", expected some of {}", name, fmt::join(known, ", "))});
        }
        chosen.push_back(&*found);
    }
    return chosen;
}

using Session = std::shared_ptr<SceneSession>;

/// `make_scene` reads it, without the GIL.
Session session_of(const auto& make_scene, int threads) {
    auto session = without_gil([&]() -> Result<std::unique_ptr<SceneSession>> {
        auto scene = make_scene();
        if (!scene) return scene.error();
        return SceneSession::create(*std::move(scene), threads);
    });
    if (!session) raise_scene_error(session.error());
    return *std::move(session);
}

Session load(const std::string& file_or_name, const Names& overrides, int threads) {
    return session_of(
        [&]() -> Result<Scene> {
            const auto file = find_file(FileKind::scene, file_or_name);
            if (!file) return file.error();
            return read_scene(*file, overrides);
        },
        threads);
}

Session parse(const std::string& text, const std::string& path, const Names& overrides, int threads) {
    return session_of([&] { return parse_scene(text, path, overrides); }, threads);
}

Names names_of(const auto& things) {
    Names names;
    for (const auto& thing : things) names.push_back(thing.name);
    return names;
}

CameraInfo camera_info(SceneSession& s, const std::string& name) {
    return value_of(without_gil([&] {
        return s.with_world([&](const World& world) -> Result<CameraInfo> {
            const Scene& scene = world.scene();
            const auto index = sensor_named(scene.cameras, name, "camera", scene.file);
            if (!index) return index.error();
            const Camera& c = scene.cameras[*index];
            return CameraInfo{.name = c.name,
                              .format = std::string(narpa::name(c.format)),
                              .mount = c.mount < 0 ? "" : scene.bodies[static_cast<std::size_t>(c.mount)].name,
                              .width = c.width,
                              .height = c.height,
                              .rate_hz = 1e9 / static_cast<double>(c.period_ns),
                              .exposure_s = static_cast<double>(exposure_ns(c)) * 1e-9};
        });
    }));
}

Frame render(SceneSession& session, const std::string& camera, double time_s, std::optional<std::uint32_t> frame,
             std::optional<int> spp, std::optional<std::uint64_t> seed, const Names& aovs) {
    const std::vector<const AovKind*> chosen = chosen_aovs(aovs);
    auto image = without_gil([&] { return session.render({camera, time_s, frame, spp, seed, !chosen.empty()}); });
    if (!image) raise(image.error());
    const Camera& c = image->camera;
    Frame out{.camera = c.name,
              .number = image->ledger.frame,
              .time_s = static_cast<double>(image->ledger.t_exposure_mid_ns) * 1e-9,
              .radiance = radiance_array(std::move(image->radiance), c),
              .dn = dn_array(std::move(image->bytes), c),
              .aovs = {},
              .ledger = ledger_dict(image->ledger)};
    for (const AovKind* kind : chosen)
        if (!out.aovs.contains(kind->name)) out.aovs[kind->name] = kind->take(image->aovs, c);
    return out;
}

py::array scan(SceneSession& session, const std::string& lidar, double time_s, double duration_s) {
    return shots_array(value_of(without_gil([&] { return session.scan(lidar, time_s, duration_s); })));
}

void place(SceneSession& s, const std::string& body, const Rigid3& T, const std::array<double, 3>& velocity_m_s,
           const std::array<double, 3>& rate_rad_s) {
    const Vec3 v = vec_of(velocity_m_s), w = vec_of(rate_rad_s);
    if (!is_finite(v) || !is_finite(w)) raise({"velocity_m_s, rate_rad_s: expected finite numbers"});
    (void)value_of(without_gil([&] { return s.place(body, {T, v, w}); }));
}

void place_camera(SceneSession& s, const std::string& camera, const Rigid3& T, const std::string& mount) {
    (void)value_of(without_gil([&] { return s.place_camera(camera, mount, T); }));
}

void bind_frame(py::module_& m) {
    py::class_<Frame>(m, "Frame", "A rendered frame.")
        .def_readonly("camera", &Frame::camera, "Name of the camera.")
        .def_readonly("number", &Frame::number, "Frame number, which seeds the noise.")
        .def_readonly("time_s", &Frame::time_s, "Middle of the exposure, s of simulation time.")
        .def_readonly("radiance", &Frame::radiance,
                      "(h, w, 3) float32: linear radiance in three bands, W m^-2 sr^-1, before the detector.")
        .def_readonly(
            "dn", &Frame::dn,
            "Digital numbers in the camera's format: (h, w) uint8 or uint16 (the ADC's bits left-justified); "
            "RGB24 (h, w, 3) and YUYV (h, w, 2) uint8.")
        .def_readonly("aovs", &Frame::aovs, "The AOVs that were asked for, by name (Scene.render).")
        .def_readonly("ledger", &Frame::ledger, "The columns of CAMERA.ledger.csv (docs/replay.md).")
        .def("__getitem__", [](const Frame& f, const py::str& name) { return f.aovs[name]; });
    py::class_<CameraInfo>(m, "CameraInfo", "What a scene states of a camera.")
        .def_readonly("name", &CameraInfo::name)
        .def_readonly("format", &CameraInfo::format, "GREY, Y16, RGB24, ... (docs/scene.md).")
        .def_readonly("mount", &CameraInfo::mount, "Body that carries it; empty: the world.")
        .def_readonly("width", &CameraInfo::width, "Pixels.")
        .def_readonly("height", &CameraInfo::height, "Pixels.")
        .def_readonly("rate_hz", &CameraInfo::rate_hz)
        .def_readonly("exposure_s", &CameraInfo::exposure_s,
                      "With the read-out of all rows; 0 without a detector.");
}

}  // namespace

void bind_scene(py::module_& m) {
    using py::arg;
    const std::array<double, 4> identity{1, 0, 0, 0};
    const std::array<double, 3> at_rest{};
    bind_frame(m);
    py::class_<SceneSession, Session>(m, "Scene",
                                      "A scene with its renderer: narpa.load_scene makes it. Methods may be called "
                                      "from any threads; they take turns, and "
                                      "release the GIL. Errors are narpa.Error.")
        .def_static("load", &load, arg("file_or_name"), arg("overrides"), arg("threads"))
        .def_static("parse", &parse, arg("text"), arg("path"), arg("overrides"), arg("threads"))
        .def_property_readonly("name", [](const SceneSession& s) { return s.scene().name; })
        .def_property_readonly("file", [](const SceneSession& s) { return s.scene().file; })
        .def_property_readonly(
            "warnings", [](const SceneSession& s) { return s.scene().warnings; },
            "Sentences of the scene's reader, as the commands print them.")
        .def("__repr__",
             [](const SceneSession& s) {
                 const Scene& scene = s.scene();
                 return fmt::format("<narpa.Scene \"{}\": bodies [{}], cameras [{}], lidars [{}]>", scene.name,
                                    fmt::join(names_of(scene.bodies), ", "),
                                    fmt::join(names_of(scene.cameras), ", "),
                                    fmt::join(names_of(scene.lidars), ", "));
             })
        .def_property_readonly(
            "bodies", [](const SceneSession& s) { return names_of(s.scene().bodies); },
            "Names, in the order of the AOV `body`.")
        .def_property_readonly(
            "cameras", [](const SceneSession& s) { return names_of(s.scene().cameras); }, "Names.")
        .def_property_readonly(
            "lidars", [](const SceneSession& s) { return names_of(s.scene().lidars); }, "Names.")
        .def("camera", &camera_info, arg("camera") = "", "What the scene states of a camera; default: the first.")
        .def(
            "place",
            [](SceneSession& s, const std::string& body, const std::array<double, 3>& p,
               const std::array<double, 4>& q, const std::array<double, 3>& v,
               const std::array<double, 3>& w) { place(s, body, pose_of(p, q), v, w); },
            arg("body"), arg("position_m"), arg("attitude_wxyz") = identity, arg("velocity_m_s") = at_rest,
            arg("rate_rad_s") = at_rest,
            "Places a body: its motion from simulation time 0 on. position_m: (3,) in world axes; attitude_wxyz: "
            "Hamilton quaternion, body to world; velocity_m_s: (3,) world axes; rate_rad_s: (3,) body axes.")
        .def(
            "place",
            [](SceneSession& s, const std::string& body, const Matrix& pose, const std::array<double, 3>& v,
               const std::array<double, 3>& w) { place(s, body, pose_of(pose), v, w); },
            arg("body"), arg("pose"), arg("velocity_m_s") = at_rest, arg("rate_rad_s") = at_rest,
            "The same with T_world_body as a (4, 4) matrix.")
        .def(
            "place_camera",
            [](SceneSession& s, const std::string& camera, const std::array<double, 3>& p,
               const std::array<double, 4>& q,
               const std::string& mount) { place_camera(s, camera, pose_of(p, q), mount); },
            arg("camera"), arg("position_m"), arg("attitude_wxyz") = identity, arg("mount") = "",
            "Mounts a camera on the body `mount`, or on the world (\"\"). Camera axes: x right, y down, z forward.")
        .def(
            "place_camera",
            [](SceneSession& s, const std::string& camera, const Matrix& pose, const std::string& mount) {
                place_camera(s, camera, pose_of(pose), mount);
            },
            arg("camera"), arg("pose"), arg("mount") = "", "The same with T_mount_camera as a (4, 4) matrix.")
        .def(
            "pose",
            [](SceneSession& s, const std::string& body, double time_s) {
                return pose_array(value_of(without_gil([&] { return s.T_world_body(body, time_s); })));
            },
            arg("body"), arg("time_s") = 0.0, "T_world_body as (4, 4) float64, metres.")
        .def(
            "camera_pose",
            [](SceneSession& s, const std::string& camera, double time_s) {
                return pose_array(value_of(without_gil([&] { return s.T_world_camera(camera, time_s); })));
            },
            arg("camera") = "", arg("time_s") = 0.0, "T_world_camera as (4, 4) float64, metres.")
        .def("render", &render, arg("camera") = "", arg("time_s") = 0.0, py::kw_only(), arg("frame") = py::none(),
             arg("spp") = py::none(), arg("seed") = py::none(), arg("aovs") = Names{},
             "Renders the frame that `narpa render` writes, as a narpa.Frame.\n\n"
             "camera: name; default: the first. time_s: middle of the exposure. frame: number, which seeds the "
             "noise; "
             "default: the one nearest to the time. spp: samples per pixel, in place of the scene's samples or "
             "budget. "
             "seed: in place of the scene's. aovs: some of \"depth\" and \"range\" (h, w) float64 in m, infinite "
             "where "
             "nothing is met; \"normal\" and \"position\" (h, w, 3) float64, world axes, m; \"body\" (h, w) int32, "
             "index "
             "into Scene.bodies, -1: none; \"albedo\" (h, w, 3) float32; \"variance\" (h, w) float32, W^2 m^-4 "
             "sr^-2.")
        .def("scan", &scan, arg("lidar") = "", arg("time_s") = 0.0, arg("duration_s") = 0.0,
             "Fires a LiDAR from time_s on, for duration_s (0: one turn). Returns an (n,) structured array, a row "
             "for each "
             "shot, with the columns of `narpa scan -o FILE.csv`.");
}

}  // namespace narpa::python
