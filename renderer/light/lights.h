/// renderer/light/lights.h - the emitters of a scene, and sampling of them for next-event estimation.
///
/// Emitters are the Sun, lights and emissive surfaces. A light of `Scene::lights` is only a source: it neither
/// occludes nor reflects. An emissive surface is a body like any other, and emits from both its sides.
///
/// Next-event estimation samples the Sun at every vertex, and one of the other emitters with a probability
/// proportional to its estimated unoccluded irradiance, which is zero only if it can send no light. Positions are
/// taken relative to the vertex, differences first, so that a common offset of the whole scene cancels.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "renderer/geometry/tracer.h"
#include "renderer/light/sun_disc.h"

namespace narpa {

/// The point that receives light: `anchor` + `offset`, metres in the world's axes, kept apart for precision.
struct Receiver {
    Vec3 anchor{}, offset{};
    Vec3 up{};      ///< unit; only light from this hemisphere counts
    int body = -1;  ///< body whose surface it is on; -1: none
    double time = kMidExposure;
};
/// The receiver at the point where rays leave the hit.
[[nodiscard]] Receiver receiver_at(const BodyPoses& at, const Hit& from, const Vec3& up) noexcept;

/// A direction towards an emitter.
struct LightSample {
    Vec3 direction{};
    // Of a light:
    double range_m = 0;      ///< length of the shadow ray
    Rgb radiance_per_pdf{};  ///< for a light without extent: irradiance on a surface that faces it
    double pdf = 0;          ///< per solid angle; infinite for a light without extent, which no BSDF sample hits
    // Of an emissive surface, whose distance the shadow ray finds:
    int body = -1;           ///< -1: a light
    std::uint32_t face = 0;  ///< light counts only if the ray hits this face
};

/// MIS weight of a sample with density `own`, where the other technique's density is `other`: the power heuristic
/// with exponent 2 (Robust Monte Carlo Methods for Light Transport Simulation, 1997, section 9.2). An infinite
/// `own` is a direction that only this technique finds.
[[nodiscard]] double power_heuristic(double own, double other) noexcept;

class Medium;

class Lights {
public:
    /// The tracer's scene must outlive it, the tracer itself need not.
    explicit Lights(const Tracer& tracer);

    /// True if a ray can hit a light.
    [[nodiscard]] bool any_with_extent() const noexcept { return any_with_extent_; }
    /// True if a camera ray can meet an emitter other than the Sun.
    [[nodiscard]] bool any_visible() const noexcept { return any_with_extent_ || emitters_.size() > lights_; }
    [[nodiscard]] const std::optional<SunDisc>& sun() const noexcept { return sun_; }

    /// Emitters besides the Sun to include. Emissive surfaces light nothing in method "direct".
    enum class Group : std::uint8_t { lights, all };
    [[nodiscard]] bool any(Group group) const noexcept { return !emitters(group).empty(); }

    /// Chooses an emitter by `choice` and a point of it by u and v; nullopt if no emitter can send light.
    [[nodiscard]] std::optional<LightSample> sample(const BodyPoses& at, const Receiver& to, Group group,
                                                    double choice, double u, double v) const noexcept;
    /// Density per solid angle with which `sample` chooses the point that a ray from the receiver in this direction
    /// has hit; 0 if it never does.
    [[nodiscard]] double pdf(const BodyPoses& at, const Receiver& to, Group group, const Vec3& direction,
                             const Hit& met) const noexcept;
    /// Radiance of all lights that a ray hits before range_m, each with the MIS weight of BSDF sampling, whose
    /// density is direction_pdf (infinite: `sample` cannot find it). `medium` attenuates each; may be null.
    [[nodiscard]] Rgb radiance_before(double range_m, const BodyPoses& at, const Receiver& to, Group group,
                                      const Vec3& direction, double direction_pdf,
                                      const Medium* medium) const noexcept;

private:
    struct Emitter {
        int light = -1;                            ///< index into Scene::lights
        int body = -1;                             ///< or into Scene::bodies
        const EmissiveSurface* surface = nullptr;  ///< of the body
        int mount = -1;                            ///< body in whose frame the rest is given; -1: the world
        Vec3 centre{};                             ///< centre of its bounding sphere
        double radius_m = 0;
        double power = 0;       ///< mean band of radiance times area, or intensity, or irradiance
        double touching_m = 0;  ///< occluders closer than this are its mounting
    };
    void add_light(std::size_t index);
    void add_body(std::size_t index, const Shape& shape);
    [[nodiscard]] std::span<const Emitter> emitters(Group group) const noexcept;
    /// Unoccluded irradiance at the receiver, W m^-2, as if the whole emitter were at its centre; 0 only if it
    /// sends no light.
    [[nodiscard]] double importance(const BodyPoses& at, const Receiver& to, const Emitter& e) const noexcept;
    /// Probability that `sample` chooses this emitter.
    [[nodiscard]] double probability(const BodyPoses& at, const Receiver& to, Group group,
                                     const Emitter& e) const noexcept;
    [[nodiscard]] LightSample sample_light(const BodyPoses& at, const Receiver& to, const Emitter& e, double u,
                                           double v) const noexcept;

    const Scene* scene_;
    std::optional<SunDisc> sun_;
    std::vector<Emitter> emitters_;  ///< the lights, then the bodies
    std::size_t lights_ = 0;
    bool any_with_extent_ = false;
    std::vector<int> emitter_of_body_;                                                   ///< -1: none
    std::unordered_map<const Shape*, std::unique_ptr<const EmissiveSurface>> surfaces_;  ///< null: none
};

}  // namespace narpa
