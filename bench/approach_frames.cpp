#include "bench/approach_frames.h"

#include <cmath>
#include <random>

#include "renderer/camera/detector.h"

namespace narpa {
namespace {

BodyPoses at_time_0(const World& world) {
    BodyPoses at(world.scene().bodies.size());
    world.place(0, -1, at);
    return at;
}

}  // namespace

ApproachFrames::ApproachFrames(const World& world, const Camera& camera, std::size_t target,
                               const ApproachOptions& options)
    : options_(options),
      camera_(camera),
      at_(at_time_0(world)),
      sensor_(sensor_model(camera)),
      view_(world.render_scene(), camera_, target, at_),
      bytes_(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns})),
      made_{{}, at_, {}, {}} {}

/// Near the line of approach, looking nearly at the target's origin.
Rigid3 ApproachFrames::pose(double range_m, std::uint32_t number) const {
    std::mt19937_64 random(options_.seed * 1'000'003 + number);
    std::normal_distribution<double> normal;
    const auto some = [&](double sigma) {
        const double x = sigma * normal(random), y = sigma * normal(random), z = sigma * normal(random);
        return Vec3{x, y, z};
    };
    const Vec3 position = range_m * (normalized(options_.along) + some(options_.offset_of_range));
    const Vec3 z = normalized(-position);  // the camera looks along its z, its y is down
    const Vec3 x = normalized(cross(z, options_.up));
    const Quat aimed = quat_from_columns(x, cross(z, x), z);
    return inverse({aimed * exp_rotation(some(options_.offset_of_range)), position});
}

const ApproachView& ApproachFrames::make(int k, int n) {
    const double part = n > 1 ? static_cast<double>(k) / (n - 1) : 0;
    return make_at(options_.from_m * std::pow(options_.to_m / options_.from_m, part),
                   static_cast<std::uint32_t>(k));
}

const ApproachView& ApproachFrames::make_at(double range_m, std::uint32_t number) {
    made_.truth = pose(range_m, number);
    FrameSettings settings;
    settings.spp = options_.frame_spp;
    settings.seed = ~options_.seed;  // not that of the renders that it is compared with
    settings.frame = number;
    view_.render(made_.truth, settings, true);
    expose(camera_, view_.radiance(), settings.seed, number, bytes_);
    made_.at.T_world_body = view_.placement().T_world_body;
    made_.image = *measured_image(camera_, bytes_);  // of the camera's own size
    const auto& [r, g, b] = sensor_.dn_per_radiance;
    const auto dn_per_mean = static_cast<float>(r + g + b);
    made_.variance_dn2.clear();
    for (const float v : view_.aovs().variance) made_.variance_dn2.push_back(v * dn_per_mean * dn_per_mean);
    made_.variance_dn2.resize(made_.image.dn.size());  // without the embedded line
    return made_;
}

}  // namespace narpa
