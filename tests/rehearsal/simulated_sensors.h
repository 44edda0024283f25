/// tests/rehearsal/simulated_sensors.h - the sensors of the chaser as the renderer sees what truly is: frames with
/// the detector's noise, packets of a turn.
#pragma once

#include "estimator/view/model_view.h"
#include "protocols/lidar/lidar_model.h"
#include "rehearsal/navigation/estimation/scene_model.h"
#include "renderer/detector/detector.h"
#include "renderer/lidar/lidar_shot.h"
#include "tests/rehearsal/navigation_plant.h"

namespace narpa::rehearsal {

/// Target's body axes from the chaser's.
inline Rigid3 chaser_target(const Plant& plant) {
    const RelativeMotion& m = plant.motion;
    const Rigid3 T_world_target{m.q_world_target, -(m.q_world_target * plant.scenario.target.centre_of_mass_m)};
    const Rigid3 T_world_chaser{m.q_world_chaser,
                                m.position_m - m.q_world_chaser * plant.scenario.chaser.centre_of_mass_m};
    return inverse(T_world_chaser) * T_world_target;
}

/// `spp`: samples of a pixel.
inline std::vector<std::uint8_t> frame(SceneModel& model, const Plant& plant, std::uint32_t number, int spp = 4) {
    const Camera& camera = model.scene().cameras[model.cameras()[0]];
    const Rigid3 T_chaser_target = chaser_target(plant);
    const BodyPoses at = model.place(plant.t_s, plant.motion.q_world_target, inverse(T_chaser_target));
    FrameSettings settings;
    settings.seed = 77;
    settings.frame = number;
    settings.spp = spp;
    RadianceImage image(camera.width, camera.height);
    render_radiance(model.render_scene(), at, camera, at.T_world_body[model.chaser()] * camera.T_mount_camera,
                    settings, image);
    std::vector<std::uint8_t> bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    expose(camera, image, 5, number, bytes);
    return bytes;
}

/// Packets of the turn that ends at the plant's time, which it flies to freely from where it was a turn before.
/// `packet` is the number of the first.
inline std::vector<std::vector<std::uint8_t>> turn(SceneModel& model, Plant& plant, std::int64_t epoch_unix_ns) {
    const Lidar& lidar = model.scene().lidars[model.lidars()[0]];
    const LidarModel& lidar_model = *lidar.model;
    const auto from_ns = std::llround(1e9 * plant.t_s), turn_ns = std::llround(1e9 / lidar_model.spec().rate_hz);
    std::vector<std::vector<std::uint8_t>> out;
    std::vector<LidarShot> shots(lidar_model.spec().shots_per_packet);
    std::vector<LidarEchoes> echoes(shots.size());
    const auto start_ns = [&](std::int64_t packet) { return lidar_model.packet_start_ns(packet); };
    const std::int64_t first = lidar_model.first_packet_from(from_ns);
    for (std::int64_t packet = first; start_ns(packet + 1) <= from_ns + turn_ns; ++packet) {
        lidar_model.shots(packet, shots);
        for (std::size_t i = 0; i < shots.size(); ++i) {
            const double t_s = 1e-9 * static_cast<double>(start_ns(packet) + shots[i].t_offset_ns);
            if (t_s > plant.t_s) plant.step({}, {}, t_s - plant.t_s);
            const BodyPoses& at =
                model.place(plant.t_s, plant.motion.q_world_target, inverse(chaser_target(plant)));
            const Rigid3 T = at.T_world_body[model.chaser()] * lidar.T_mount_lidar;
            echoes[i].strongest.range_m =
                shoot(model.tracer(), at, {T * shots[i].origin_m, T.q * shots[i].direction},
                      {.range_max_m = lidar.range_max_m})
                    .range_m;
        }
        std::vector<std::uint8_t> bytes(lidar_model.spec().data_packet_bytes);
        lidar_model.encode(packet, epoch_unix_ns, echoes, bytes);
        out.push_back(std::move(bytes));
    }
    plant.step({}, {}, 1e-9 * static_cast<double>(from_ns + turn_ns) - plant.t_s);
    return out;
}

}  // namespace narpa::rehearsal
