/// renderer/light/lights.h - the emitters of a scene, and sampling of them for next-event estimation.
///
/// Emitters are the Sun, lights and emissive surfaces. A light of `Scene::lights` is a source and nothing else: it
/// neither occludes nor reflects. An emissive surface is a body like any other, and emits from both its sides.
///
/// Next-event estimation samples the Sun at every vertex, and one of the other emitters, with a probability that
/// follows its unoccluded irradiance and is zero only where it can send nothing. Everything is measured from the
/// vertex itself, differences of positions first, so that a common offset of the whole scene cancels.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "renderer/geometry/tracer.h"
#include "renderer/light/sun_disc.h"

namespace narpa {

/// The point that receives light: `anchor` + `offset`, metres in the world's axes, kept apart for precision.
struct Receiver {
    Vec3 anchor{}, offset{};
    Vec3 up{};      ///< unit: only light from directions with a positive part along it counts
    int body = -1;  ///< whose surface it is on; -1: none
    double time = kMidExposure;
};
/// Where rays leave the hit.
[[nodiscard]] Receiver receiver_at(const BodyPoses& at, const Hit& from, const Vec3& up) noexcept;

/// A direction towards an emitter.
struct LightSample {
    Vec3 direction{};
    // Of a light:
    double range_m = 0;      ///< length of the shadow ray
    Rgb radiance_per_pdf{};  ///< or the irradiance on a surface that faces it, of a light without extent
    double pdf = 0;          ///< per solid angle; infinite for a light without extent, which no BSDF sample meets
    // Of an emissive surface, whose distance the shadow ray finds:
    int body = -1;           ///< -1: a light
    std::uint32_t face = 0;  ///< light counts only from this one
};

/// MIS weight of a sample whose density is `own` where the other technique's is `other`: the power heuristic with
/// exponent 2 (Robust Monte Carlo Methods for Light Transport Simulation, 1997, section 9.2). An infinite `own` is
/// a direction that only this technique finds.
[[nodiscard]] double power_heuristic(double own, double other) noexcept;

class Medium;

class Lights {
public:
    /// The tracer's scene must outlive it, the tracer itself need not.
    explicit Lights(const Tracer& tracer);

    /// True where a ray can meet a light.
    [[nodiscard]] bool any_with_extent() const noexcept { return any_with_extent_; }
    [[nodiscard]] const std::optional<SunDisc>& sun() const noexcept { return sun_; }

    /// Which emitters beside the Sun take part. Emissive surfaces light nothing in method "direct".
    enum class Group : std::uint8_t { lights, all };
    [[nodiscard]] bool any(Group group) const noexcept { return !emitters(group).empty(); }

    /// Chooses an emitter by the first number and a point of it by the others; none where no light can come from
    /// any.
    [[nodiscard]] std::optional<LightSample> sample(const BodyPoses& at, const Receiver& to, Group group,
                                                    double choice, double u, double v) const noexcept;
    /// Density per solid angle with which `sample` finds the point of a body that a ray from the receiver met, at
    /// range_m in this direction; 0 where it never does.
    [[nodiscard]] double pdf(const BodyPoses& at, const Receiver& to, Group group, const Vec3& direction,
                             const Hit& met) const noexcept;
    /// Radiance of all lights that a ray meets before range_m, each with the MIS weight of BSDF sampling, whose
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
        Vec3 centre{};                             ///< of a sphere that holds it
        double radius_m = 0;
        double power = 0;       ///< mean band of radiance times area, or intensity, or irradiance
        double touching_m = 0;  ///< occluders closer than this are its mounting
    };
    void add_light(std::size_t index);
    void add_body(std::size_t index, const Shape& shape);
    [[nodiscard]] std::span<const Emitter> emitters(Group group) const noexcept;
    /// Unoccluded irradiance at the receiver, W m^-2, if all of the emitter stood at its centre; 0 only where it
    /// sends nothing.
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
    std::vector<int> emitter_of_body_;  ///< -1: none
    std::vector<std::unique_ptr<const EmissiveSurface>> surfaces_;
};

}  // namespace narpa
