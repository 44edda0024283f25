/// renderer/integrator/mechanisms.h - switches for what makes frames faster without changing their mean.
#pragma once

namespace narpa {

/// All on in the product. `narpa bench render --ablation` switches them off one at a time and measures what each
/// earns (docs/performance.md). They are read once per frame, when the frame or its plan is made.
struct Mechanisms {
    bool sample_plan = true;   ///< adaptive sampling; off: the same number of samples for every pixel
    bool edge_classes = true;  ///< pixels next to an edge share its weight; off: each pixel's own contrast alone
    bool path_reuse = true;    ///< path_reuse.h; off: each path serves its own pixel
    bool small_body_sampling = true;  ///< small_body_sampling.h; off: BSDF sampling alone
    bool sun_first = true;        ///< sunlight on first surfaces as in Sun-only direct lighting, for every sample
    bool shared_variance = true;  ///< the variance of reused paths enters plan and error estimate
    bool tile_culling = true;     ///< tile_culling.h; off: every tile is traced against every body
    bool coarse_steps = true;     ///< frames from coarse to fine where time is short; off: full resolution at once
};

}  // namespace narpa
