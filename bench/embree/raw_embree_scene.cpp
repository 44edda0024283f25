#include "bench/embree/raw_embree_scene.h"

#include "renderer/camera/scene_camera.h"

namespace narpa {

Result<RawScene> RawScene::build(const Scene& scene, const BodyPoses& at) {
    std::size_t vertices = 0, faces = 0;
    for (const Body& body : scene.bodies) {
        const int* mesh = std::get_if<int>(&body.shape);
        if (mesh == nullptr)
            return Error{"body \"" + body.name + "\" is no mesh, expected triangles alone", scene.file};
        vertices += scene.meshes[static_cast<std::size_t>(*mesh)].positions.size();
        faces += scene.meshes[static_cast<std::size_t>(*mesh)].faces.size();
    }
    RawScene raw;
    raw.device.reset(rtcNewDevice(nullptr));
    if (!raw.device) return Error{"Embree cannot be started", {}, 0, 0, ErrorKind::failed};
    const embree::Owned<RTCGeometry> geometry(rtcNewGeometry(raw.device.get(), RTC_GEOMETRY_TYPE_TRIANGLE));
    auto* v = static_cast<Vec3f*>(rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0,
                                                          RTC_FORMAT_FLOAT3, sizeof(Vec3f), vertices));
    auto* f = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
        geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), faces));
    if (v == nullptr || f == nullptr)
        return Error{"Embree has no memory for the scene", scene.file, 0, 0, ErrorKind::failed};
    raw.vertices = v;
    raw.corners = f;
    raw.face_material.reserve(faces);
    std::uint32_t first = 0;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
        const Mesh& mesh = scene.meshes[static_cast<std::size_t>(std::get<int>(scene.bodies[b].shape))];
        for (const Vec3f& p : mesh.positions)
            *v++ = vec_cast<float>(at.T_world_body[b] * (mesh.origin_m + vec_cast<double>(p)));
        for (const auto& face : mesh.faces)
            for (const std::uint32_t corner : face) *f++ = first + corner;
        if (const auto own = scene.bodies[b].mesh_material)
            raw.face_material.insert(raw.face_material.end(), mesh.faces.size(), static_cast<std::uint16_t>(*own));
        else
            raw.face_material.insert(raw.face_material.end(), mesh.face_material.begin(), mesh.face_material.end());
        first += static_cast<std::uint32_t>(mesh.positions.size());
    }
    rtcCommitGeometry(geometry.get());
    raw.scene.reset(rtcNewScene(raw.device.get()));
    rtcAttachGeometry(raw.scene.get(), geometry.get());
    rtcCommitScene(raw.scene.get());
    if (rtcGetDeviceError(raw.device.get()) != RTC_ERROR_NONE)
        return Error{"Embree cannot build the scene", scene.file, 0, 0, ErrorKind::failed};
    return raw;
}

RawAim::RawAim(const Camera& c, const Rigid3& T) : origin(vec_cast<float>(T.t)) {
    const auto [at_zero, per_x, per_y] = paraxial_pinhole(*c.model).rays(T.q);
    across = vec_cast<float>(per_x), down = vec_cast<float>(per_y), ahead = vec_cast<float>(at_zero);
}

}  // namespace narpa
