#include "estimator/marks/mark_alignment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "base/constants.h"
#include "estimator/marks/mark_fit.h"
#include "estimator/marks/mark_matcher.h"
#include "estimator/marks/tag_finder.h"

namespace narpa {
namespace {

/// Fewest measured numbers: those of four discs, or of one tag.
constexpr int kFewestNumbers = 8;
/// Largest part of the marks that may be left out as wrong.
constexpr double kMostLeftOut = 0.25;
/// Least number of discs used, as a part of those in view that are larger than this and are found almost always. Of
/// 398 right poses by 10 to 13 lamps all used more than 0.6; of three wrong ones, which agreed with other bright
/// spots, at most 0.4.
constexpr double kLeastUsed = 0.5, kSurelyFound_px = 1;
/// Rays that look whether a disc is hidden go to its centre and to this many points this far outside its rim, at
/// most at this multiple of its radius. What they meet hides it, or spoils its rim, if it is nearer by this part of
/// the radius.
constexpr std::size_t kRimRays = 12;
static_assert(kRimRays < kLanes);
constexpr double kClear_px = 1.5, kWidestRim = 1.8, kDiscDepth = 0.5, kSphereDepth = 1.2;

/// A second pose within ten standard deviations belongs to the same answer, which is then less certain; one further
/// away is a rival.
void weigh_second(const PnpSolution& s, MarkEstimate& e, Fit& fit) {
    const double worse = s.second.chi2 - s.fit.chi2;
    if (!s.has_second || worse > kRival_chi2) return;
    const Vector6 apart = error_between(s.fit.T_camera_body, s.second.T_camera_body);
    if (normalised_error_squared(apart, e.covariance) > kDistinctPose_chi2) {
        fit.rivals.push_back({s.second.T_camera_body, worse});
        return;
    }
    const double probability = 1 / (1 + std::exp(worse / 2));
    e.covariance += probability * apart * apart.transpose();
}

}  // namespace

MarkAlignment::MarkAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                             const ModelUncertainty& model)
    : render_scene_(render_scene),
      target_(target),
      at_(render_scene.scene().bodies.size()),
      camera_(camera),
      sensor_(sensor_model(camera)),
      times_(row_times(camera)),
      model_(model),
      marks_(render_scene.scene().bodies[target].marks) {
    at_.set(target, Rigid3{});
}

void MarkAlignment::set_detector(const Detector& detector) {
    camera_.detector = detector;
    sensor_ = sensor_model(camera_);
    times_ = row_times(camera_);
}

MarkEstimate MarkAlignment::align(const MeasuredImage& frame, const Rigid3& guess,
                                  const ApparentMotion& motion) const {
    MarkEstimate e;
    e.T_camera_target = guess;
    Fit fit;
    MarkPoints points = tags_in(frame);
    Rigid3 near = pose_of_tags(points, guess, motion);
    fit.failed = add_discs(frame, near, points);
    std::optional<MarkFit> fitted;
    if (fit.failed.empty()) {
        fitted = without_wrong_marks(std::move(points), near, motion);
        fit.failed = fitted->solution().ok() ? too_few(*fitted) : to_text(fitted->solution().status);
    }
    if (fit.failed.empty()) {
        state(*fitted, motion, e, fit);
        compare_with_guess(e.T_camera_target, guess, fit);
    }
    e.answer = judge(std::move(fit));
    return e;
}

MarkPoints MarkAlignment::tags_in(const MeasuredImage& frame) const {
    MarkPoints points;
    std::set<int> dictionaries;
    for (const Mark& m : marks_)
        if (m.kind == Mark::Kind::tag) dictionaries.insert(m.dictionary);
    for (const int dictionary : dictionaries)
        for (const FoundTag& tag : find_tags(frame, dictionary))
            for (const Mark& m : marks_)
                if (m.kind == Mark::Kind::tag && m.dictionary == dictionary && m.id == tag.id)
                    points.add_tag(m, tag);
    return points;
}

/// Of two poses that fit nearly as well, the one whose attitude is nearer to the guess; the guess without tags.
Rigid3 MarkAlignment::pose_of_tags(const MarkPoints& tags, const Rigid3& guess,
                                   const ApparentMotion& motion) const {
    if (tags.points().empty()) return guess;
    const MarkFit fit(camera_, times_, motion, tags, guess);
    const PnpSolution& s = fit.solution();
    if (!s.ok()) return guess;
    const auto off = [&](const PnpFit& f) { return error_between(guess, f.T_camera_body).head<3>().norm(); };
    return s.ambiguous() && off(s.second) < off(s.fit) ? s.second.T_camera_body : s.fit.T_camera_body;
}

/// Adds the lamps and reflectors that are found near a pose, and sets that to the pose of these. Returns what is
/// missing for a pose; empty: nothing.
std::string MarkAlignment::add_discs(const MeasuredImage& frame, Rigid3& near, MarkPoints& points) const {
    std::vector<const Mark*> discs;
    for (const Mark& m : marks_)
        if (m.kind != Mark::Kind::tag) discs.push_back(&m);
    if (discs.empty()) return points.points().empty() ? "no tag of the target was found" : "";
    const bool has_tags = !points.points().empty();
    const MarkMatches matches = match_marks(discs, frame, sensor_, *camera_.model, near);
    for (std::size_t i = 0; i < discs.size() && (matches.reliable || has_tags); ++i) {
        if (!matches.blobs[i]) continue;
        const auto view = disc_view(*discs[i], matches.T_camera_body, *camera_.model);
        if (view && is_clear(*discs[i], *view, matches.T_camera_body))
            points.add_disc(*discs[i], *matches.blobs[i], *view);
    }
    if (matches.reliable) near = matches.T_camera_body;
    if (points.numbers() >= kFewestNumbers) return "";
    return fmt::format(
        "{} of {} marks in view were found near the guess, expected at least four that chance would "
        "not put there",
        matches.matched, matches.in_view);
}

bool MarkAlignment::is_clear(const Mark& mark, const DiscView& view, const Rigid3& T_camera_target) const {
    const Vec3 camera = inverse(T_camera_target).t, centre = mark.T_body_mark.t;
    const Vec3 x = mark.T_body_mark.q * Vec3{1, 0, 0}, y = mark.T_body_mark.q * Vec3{0, 1, 0};
    const auto body = static_cast<std::uint32_t>(target_);
    const double in_front = (mark.is_spherical ? kSphereDepth : kDiscDepth) * mark.radius_m;
    const double rim_m = mark.radius_m * std::min(kWidestRim, 1 + kClear_px / view.radius_px);
    RayBatch rays;
    rays.n = kRimRays + 1;
    Lanes<double> farthest;
    for (std::size_t k = 0; k < rays.n; ++k) {
        const double angle = 2 * kPi * static_cast<double>(k) / kRimRays, r = k < kRimRays ? rim_m : 0;
        const Vec3 to = centre + r * (std::cos(angle) * x + std::sin(angle) * y) - camera;
        rays.put(k, {camera, normalized(to)});
        farthest[k] = norm(to) - in_front;
    }
    HitBatch hits;
    render_scene_.tracer().intersect(at_, rays, {&body, 1}, hits);
    for (std::size_t k = 0; k < rays.n; ++k)
        if (is_set(hits.met, k) && hits.range_m[k] < farthest[k]) return false;
    return true;
}

/// While the residuals are too large: the fit without the mark whose absence helps most.
MarkFit MarkAlignment::without_wrong_marks(MarkPoints points, const Rigid3& near,
                                           const ApparentMotion& motion) const {
    MarkFit fit(camera_, times_, motion, std::move(points), near);
    const auto marks = static_cast<double>(fit.marks().marks().size());
    for (int left = static_cast<int>(kMostLeftOut * marks); left > 0 && fit.solution().ok() && !fit.fits();
         --left) {
        std::optional<MarkFit> best;
        for (const Mark* mark : fit.marks().marks()) {
            MarkPoints fewer = fit.marks();
            fewer.remove(*mark);
            if (fewer.numbers() < kFewestNumbers) continue;
            const MarkFit without(camera_, times_, motion, std::move(fewer), near);
            if (without.solution().ok() &&
                (!best || without.chi2() - without.freedom() < best->chi2() - best->freedom()))
                best.emplace(without);
        }
        if (!best) break;
        fit = *std::move(best);
    }
    return fit;
}

std::string MarkAlignment::too_few(const MarkFit& fitted) const {
    int used = 0, expected = 0;
    for (const Mark* m : fitted.marks().marks()) {
        if (m->kind == Mark::Kind::tag) return "";  // which identifies itself
        ++used;
    }
    const Rigid3& T = fitted.solution().fit.T_camera_body;
    for (const Mark& m : marks_) {
        const auto view = disc_view(m, T, *camera_.model);
        const bool is_expected = view && view->radius_px > kSurelyFound_px &&
                                 is_in_view(*view, camera_.width, camera_.height) && is_clear(m, *view, T);
        if (is_expected) ++expected;
    }
    if (used >= kLeastUsed * expected) return "";
    return fmt::format("{} marks agree, expected at least half of the {} in view: other bright spots?", used,
                       expected);
}

/// Sets the answer of a fit that has a pose.
void MarkAlignment::state(const MarkFit& fitted, const ApparentMotion& motion, MarkEstimate& e, Fit& fit) const {
    const PnpSolution& s = fitted.solution();
    e.T_camera_target = s.fit.T_camera_body;
    e.covariance = fitted.covariance();
    e.marks = static_cast<int>(fitted.marks().marks().size());
    e.scatter = fitted.scatter();
    e.points = fitted.observations();
    weigh_second(s, e, fit);
    const Vector6 by_focal = shift_by_focal(fitted.input(fitted.covariances()), e.T_camera_target);
    e.covariance_of_model = covariance_by(image_shifts(model_, e.T_camera_target, motion, by_focal));
    e.covariance += e.covariance_of_model;
    const auto noise = fitted.marks().covariances(0);
    if (const auto bound = pnp_bound(fitted.input(noise), e.T_camera_target))
        e.bound = *bound + e.covariance_of_model;
    const double freedom = std::max(1, fitted.freedom());
    fit.residual = std::sqrt(fitted.chi2() / freedom);
    fit.residual_max = std::sqrt(1 + kMaxChi2Sigmas * std::sqrt(2 / freedom));
    observe(e.T_camera_target, e.covariance, fit);
}

}  // namespace narpa
