#include "estimator/search/hypotheses.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/pose/pose_estimate.h"
#include "estimator/search/attitude_grid.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

/// Extent of the target in the renders of the attitude grid and of the refinement steps, px, and their samples per
/// pixel.
constexpr double kGridExtent_px = 20, kStepExtent_px = 36;
constexpr int kGridSpp = 1, kStepSpp = 4;
/// Renders whose position is refined by a second render, per one that is kept.
constexpr int kSecondLook = 4;
/// Steps of attitude: each size is repeated while it improves the fit, at most kMaxSteps times.
constexpr std::array<double, 3> kSteps_deg{8, 4, 2};
constexpr int kMaxSteps = 4;
/// Hypotheses closer than this count as the same.
constexpr double kApart_deg = 8;
/// Hypotheses with a larger misfit than kWorse * best + kWorseLeast are dropped at the end.
constexpr double kWorse = 4, kWorseLeast = 0.03;
/// Renders per parallel task.
constexpr std::size_t kBatch = 64;

bool fits_better(const Hypothesis& a, const Hypothesis& b) {
    return a.misfit < b.misfit;
}

void keep_best(std::vector<Hypothesis>& all, std::size_t most) {
    std::stable_sort(all.begin(), all.end(), fits_better);
    if (all.size() > most) all.resize(most);
}

void compare_all(const TemplateMatcher& matcher, std::vector<Hypothesis>& all) {
    tbb::parallel_for(std::size_t{0}, (all.size() + kBatch - 1) / kBatch, [&](std::size_t batch) {
        TemplateMatcher::Worker worker(matcher);
        for (std::size_t i = batch * kBatch; i < std::min(all.size(), (batch + 1) * kBatch); ++i)
            all[i] = worker.compare(all[i].T_camera_target);
    });
}

/// Pattern search over attitudes (R. Hooke, T. Jeeves, J. ACM 8, 1961). Returns the number of renders.
int improve(TemplateMatcher::Worker& worker, Hypothesis& h) {
    h = worker.compare(h.T_camera_target);
    h = worker.compare(h.T_camera_target);
    int renders = 2;
    for (const double step_deg : kSteps_deg)
        for (int k = 0; k < kMaxSteps; ++k) {
            Hypothesis best = h;
            for (int side = 0; side < 6; ++side) {
                Vector6 step = Vector6::Zero();
                step[side / 2] = (side % 2 == 0 ? 1 : -1) * step_deg * kDegree;
                const Hypothesis there = worker.compare(displaced(h.T_camera_target, step));
                ++renders;
                if (fits_better(there, best)) best = there;
            }
            if (!fits_better(best, h)) break;
            h = best;
        }
    return renders;
}

}  // namespace

std::vector<Hypothesis> find_hypotheses(const SearchView& known, const MeasuredImage& frame,
                                        const BrightRegion& region, int attitudes, int kept, int most,
                                        int& renders) {
    const FrameView view(frame);
    const Vec3 direction = normalized(known.camera.model->direction({region.x, region.y}));
    std::vector<Hypothesis> all;
    for (const Quat& q : attitude_grid(attitudes)) all.push_back({known.aimed(q, direction, known.range_m), 1});
    const TemplateMatcher coarse(known, view, region, kGridExtent_px, kGridSpp);
    compare_all(coarse, all);
    renders += static_cast<int>(all.size());
    keep_best(all, static_cast<std::size_t>(kSecondLook * kept));
    compare_all(coarse, all);
    renders += static_cast<int>(all.size());
    keep_best(all, static_cast<std::size_t>(kept));

    const TemplateMatcher fine(known, view, region, kStepExtent_px, kStepSpp);
    std::vector<int> counts(all.size());
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
        TemplateMatcher::Worker worker(fine);
        counts[i] = improve(worker, all[i]);
    });
    for (const int n : counts) renders += n;

    keep_best(all, all.size());
    std::vector<Hypothesis> apart;
    for (const Hypothesis& h : all) {
        const bool far = std::ranges::all_of(apart, [&](const Hypothesis& other) {
            return angle_between(h.T_camera_target.q, other.T_camera_target.q) > kApart_deg * kDegree;
        });
        const bool near_best = h.misfit < kWorse * all.front().misfit + kWorseLeast;
        if (far && near_best && apart.size() < static_cast<std::size_t>(most)) apart.push_back(h);
    }
    return apart;
}

}  // namespace narpa
