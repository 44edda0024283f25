#include "renderer/integrator/path.h"

#include <algorithm>
#include <cassert>

#include "renderer/integrator/wavefront.h"

namespace narpa {

std::uint64_t path_radiance(const Transport& t, std::span<const PathStart> starts,
                            std::span<Rgb> radiance) noexcept {
    assert(radiance.size() == starts.size() && t.path.max_depth >= 0);
    std::uint64_t traced = 0;
    for (std::size_t k = 0; k < starts.size(); k += kWavefront) {
        const std::size_t n = std::min(kWavefront, starts.size() - k);
        Wavefront wavefront(t);
        wavefront.run(starts.subspan(k, n), radiance.subspan(k, n));
        traced += wavefront.rays_traced();
    }
    return traced;
}

std::uint64_t reused_path_radiance(const Transport& t, std::span<const PathStart> starts, std::span<Rgb> radiance,
                                   std::span<float> variance) noexcept {
    assert(starts.size() <= kReuseGroup && radiance.size() == starts.size() && variance.size() == starts.size());
    if (starts.empty()) return 0;
    Wavefront wavefront(t);
    wavefront.run_reused(starts, radiance, variance);
    return wavefront.rays_traced();
}

}  // namespace narpa
