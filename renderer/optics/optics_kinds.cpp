#include <algorithm>
#include <array>

#include "renderer/optics/lens.h"
#include "renderer/optics/optical_effect.h"
#include "renderer/optics/point_spread.h"
#include "renderer/optics/sun_ghost.h"
#include "renderer/optics/veiling_glare.h"
#include "renderer/optics/vignetting.h"

namespace narpa {

std::span<const OpticsKind* const> optics_kinds() {
    static constexpr std::array all{&kThinLens, &kPointSpread, &kVignetting, &kVeilingGlare, &kSunGhost};
    return all;
}

constinit const TableKeys kOpticsKeys{.listed = keys_of<optics_kinds>};

Optics read_optics(TableReader& camera, const OpticsContext& context, std::span<const OpticsKind* const> kinds) {
    Optics optics;
    for (const OpticsKind* kind : kinds) kind->read(camera, context, optics);
    return optics;
}

std::unique_ptr<ImageEffect> OpticalEffect::make(const ImagePlane&) const {
    return nullptr;
}
std::shared_ptr<const OpticalEffect> OpticalEffect::scaled(double) const {
    return nullptr;
}

bool Optics::spreads_light() const noexcept {
    return point_spread || std::ranges::any_of(effects, [](const auto& effect) { return effect->spreads_light(); });
}

Optics scaled(const Optics& optics, double factor) {
    Optics out = optics;
    if (out.point_spread) {
        out.point_spread->sigma_px *= factor, out.point_spread->cutoff_per_px /= factor;
        out.point_spread->samples_per_px /= factor;
    }
    for (auto& effect : out.effects)
        if (auto other = effect->scaled(factor)) effect = std::move(other);
    return out;
}

}  // namespace narpa
