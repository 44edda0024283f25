#include "emulator/log/calibration_document.h"

#include <nlohmann/json.hpp>

#include "protocols/lidar/lidar_model.h"
#include "renderer/assets/calibration_file.h"

namespace narpa {
namespace {

nlohmann::json mounting(const Scene& scene, int mount, const Rigid3& T) {
    return {{"mount", mount < 0 ? "world" : scene.bodies[static_cast<std::size_t>(mount)].name},
            {"position_m", {T.t.x, T.t.y, T.t.z}},
            {"attitude_wxyz", {T.q.w, T.q.x, T.q.y, T.q.z}}};
}

nlohmann::json describe(const Scene& scene, const Camera& c) {
    nlohmann::json camera{{"name", c.name},
                          {"width", c.width},
                          {"height", c.height},
                          {"rate_hz", 1e9 / static_cast<double>(c.period_ns)},
                          {"format", std::string(name(c.format))}};
    if (const auto [kind, p, coefficients] = opencv_parameters(*c.model); kind != nullptr && !kind->ros.empty())
        camera.update({{"camera_matrix", {{p.fx, 0, p.cx}, {0, p.fy, p.cy}, {0, 0, 1}}},
                       {"distortion_model", std::string(kind->opencv)},
                       {"distortion_coefficients", coefficients}});
    camera.update(mounting(scene, c.mount, c.T_mount_camera));
    return camera;
}

nlohmann::json describe(const Scene& scene, const Lidar& l) {
    nlohmann::json lidar{{"name", l.name},
                         {"model", std::string(l.model->spec().name)},
                         {"rate_hz", l.model->spec().rate_hz},
                         {"range_max_m", l.range_max_m}};
    lidar.update(mounting(scene, l.mount, l.T_mount_lidar));
    return lidar;
}

nlohmann::json describe(const Body& body, const Mark& m) {
    const Vec3 &p = m.T_body_mark.t, z = m.T_body_mark.q * Vec3{0, 0, 1};
    const Quat& q = m.T_body_mark.q;
    nlohmann::json mark{{"name", m.name},
                        {"body", body.name},
                        {"kind", std::string(Mark::kKindNames[static_cast<std::size_t>(m.kind)])},
                        {"position_m", {p.x, p.y, p.z}}};
    if (m.kind == Mark::Kind::tag) {
        const std::string_view dictionary = kTagDictionaries[static_cast<std::size_t>(m.dictionary)].name;
        mark.update({{"dictionary", std::string(dictionary)},
                     {"id", m.id},
                     {"side_m", m.side_m},
                     {"attitude_wxyz", {q.w, q.x, q.y, q.z}}});
    } else {
        mark["radius_m"] = m.radius_m;
        if (!m.is_spherical) mark["normal"] = {z.x, z.y, z.z};
    }
    return mark;
}

}  // namespace

std::string calibration_document(const Scene& scene) {
    nlohmann::json document{
        {"conventions",
         "camera: x right, y down, z forward, centre of the top-left pixel (0, 0); LiDAR: x right, y forward, "
         "z up; position and attitude take sensor coordinates to the mount's; quaternions w, x, y, z; "
         "marks: position, normal and attitude in their body's axes, of a tag x right, y up, z out of its image"},
        {"cameras", nlohmann::json::array()},
        {"lidars", nlohmann::json::array()},
        {"marks", nlohmann::json::array()}};
    for (const Camera& c : scene.cameras) document["cameras"].push_back(describe(scene, c));
    for (const Lidar& l : scene.lidars) document["lidars"].push_back(describe(scene, l));
    for (const Body& body : scene.bodies)
        for (const Mark& mark : body.marks) document["marks"].push_back(describe(body, mark));
    return document.dump(2) + '\n';
}

}  // namespace narpa
