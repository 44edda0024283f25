#include "estimator/marks/mark_matcher.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/constants.h"
#include "estimator/marks/mark_view.h"

namespace narpa {
namespace {

/// Distances from the guess's image points at which blobs are searched, px.
constexpr std::array<double, 5> kGates_px{4, 12, 36, 108, 324};
/// Width of the border around these that is searched too, for the density of blobs.
constexpr double kBorder_px = 40;
constexpr std::size_t kMostBlobs = 60;  ///< of a size
constexpr std::size_t kMostPairs = 20;  ///< of marks
constexpr int kFewestMatches = 4;
constexpr double kMostByChance = 1e-3;
/// The guess as a prior: its standard deviations, of attitude and as a part of the range.
constexpr double kPriorRotation_rad = 0.15, kPriorPosition = 0.1;
/// Distance at which a blob may be a mark's: for poses from two blobs px, for poses fitted to all standard
/// deviations of its centroid, and at least px.
constexpr double kFirstTolerance_px = 3, kTolerance_sigmas = 4.5, kLeastTolerance_px = 0.7;
constexpr int kRefits = 4;
constexpr double kSameSize = 1.4;  ///< ratio of radii of marks that are searched as one size
/// Ratio of the areas of a blob and of a disc's image, both with the pixels that it covers in part.
constexpr double kSameArea = 2, kPartialPixels_px2 = 2;

struct Correspondence {
    std::size_t mark, blob;
};

/// A pose and the blob of each mark at it, -1: none.
struct Assignment {
    std::vector<int> blob;
    int matched = 0;
    double squares_px2 = 0;  ///< sum of the squared distances
    Rigid3 T_camera_body{};
};

double distance(const Pixel& a, const Pixel& b) {
    return std::hypot(a.u - b.u, a.v - b.v);
}

/// Probability that at least k of n independent events of probability p happen.
double at_least(int k, int n, double p) {
    double sum = 0;
    for (int i = k; i <= n; ++i)
        sum += std::exp(std::lgamma(n + 1) - std::lgamma(i + 1) - std::lgamma(n - i + 1) + i * std::log(p) +
                        (n - i) * std::log1p(-p));
    return sum;
}

class Matcher {
public:
    Matcher(std::span<const Mark* const> marks, const MeasuredImage& image, const SensorModel& sensor,
            const CameraModel& model, const Rigid3& guess)
        : marks_(marks), image_(image), sensor_(sensor), model_(model), guess_(guess) {
        for (const Mark* mark : marks) {
            auto view = disc_view(*mark, guess, model);
            const bool is_seen = view && is_in_view(*view, image.width, image.height);
            if (is_seen) ++in_view_;
            views_.push_back(is_seen ? view : std::nullopt);
        }
        choose_pairs();
    }

    MarkMatches match() {
        MarkMatches out{
            .blobs = std::vector<std::optional<Blob>>(marks_.size()), .in_view = in_view_, .T_camera_body = guess_};
        for (const double gate : kGates_px) {
            find(gate);
            const Assignment found = match_within(gate);
            const bool reliable = found.matched >= kFewestMatches && by_chance(found) < kMostByChance;
            if (found.matched > out.matched || (reliable && !out.reliable)) {
                out.reliable = reliable;
                out.matched = found.matched, out.T_camera_body = found.T_camera_body;
                for (std::size_t m = 0; m < marks_.size(); ++m) {
                    out.blobs[m].reset();
                    if (found.blob[m] >= 0) out.blobs[m] = blobs_[static_cast<std::size_t>(found.blob[m])];
                }
            }
            if (out.reliable && 2 * out.matched >= in_view_) break;
        }
        return out;
    }

private:
    /// Pairs of large marks that lie far apart: these determine a pose best.
    void choose_pairs() {
        std::vector<std::pair<double, std::array<std::size_t, 2>>> pairs;
        for (std::size_t i = 0; i < views_.size(); ++i)
            for (std::size_t j = i + 1; j < views_.size(); ++j)
                if (views_[i] && views_[j])
                    pairs.push_back({distance(views_[i]->centroid, views_[j]->centroid) *
                                         std::min(views_[i]->radius_px, views_[j]->radius_px),
                                     {i, j}});
        std::ranges::stable_sort(pairs, std::ranges::greater{}, [](const auto& p) { return p.first; });
        // Each mark in few of them, as one that is hidden spoils all of its pairs.
        std::vector<int> uses(views_.size(), 0);
        const int most_uses = 1 + static_cast<int>(4 * kMostPairs / std::max<std::size_t>(1, views_.size()));
        for (const auto& [quality, pair] : pairs) {
            if (pairs_.size() == kMostPairs) break;
            if (uses[pair[0]] >= most_uses || uses[pair[1]] >= most_uses) continue;
            ++uses[pair[0]], ++uses[pair[1]];
            pairs_.push_back(pair);
        }
    }

    /// Blobs near the marks, for each size of marks.
    void find(double gate) {
        blobs_.clear(), sizes_px_.clear();
        searched_px2_ = 0;
        std::vector<double> radii;
        for (const auto& view : views_)
            if (view) radii.push_back(view->radius_px);
        std::ranges::sort(radii);
        for (std::size_t i = 0, end = 0; i < radii.size(); i = end) {
            while (end < radii.size() && radii[end] <= kSameSize * radii[i]) ++end;
            ImageRect within{1e9, 1e9, -1e9, -1e9};
            for (const auto& view : views_) {
                if (!view || view->radius_px < radii[i] || view->radius_px > radii[end - 1]) continue;
                const Pixel& p = view->centroid;
                within = {std::min(within.x_low, p.u), std::min(within.y_low, p.v), std::max(within.x_high, p.u),
                          std::max(within.y_high, p.v)};
            }
            const double around = gate + kBorder_px;
            within = {std::max(0.0, within.x_low - around), std::max(0.0, within.y_low - around),
                      std::min<double>(image_.width, within.x_high + around),
                      std::min<double>(image_.height, within.y_high + around)};
            if (within.x_low >= within.x_high || within.y_low >= within.y_high) continue;
            const double radius = std::sqrt(radii[i] * radii[end - 1]);
            for (const Blob& blob : find_blobs(image_, sensor_, within, radius, kMostBlobs))
                blobs_.push_back(blob), sizes_px_.push_back(radius);
            searched_px2_ += (within.x_high - within.x_low) * (within.y_high - within.y_low);
        }
    }

    [[nodiscard]] bool fits(const DiscView& view, std::size_t blob) const {
        const double radii = view.radius_px / sizes_px_[blob];
        const double areas = (blobs_[blob].area_px2 + kPartialPixels_px2) / (view.area_px2 + kPartialPixels_px2);
        const auto within = [](double ratio, double most) { return ratio < most && ratio > 1 / most; };
        return within(radii, kSameSize) && within(areas, kSameArea);
    }
    [[nodiscard]] static double tolerance_px(const DiscView& view) {
        return std::max(kLeastTolerance_px, kTolerance_sigmas * std::sqrt(variance_of_disc(view.radius_px)));
    }

    /// Number of agreements as good as this one that blobs at random places would give.
    [[nodiscard]] double by_chance(const Assignment& found) const {
        double widest = 0;
        for (const auto& view : views_)
            if (view) widest = std::max(widest, tolerance_px(*view));
        const double density = static_cast<double>(blobs_.size()) / std::max(1.0, searched_px2_);
        const double p = std::min(0.5, density * kPi * widest * widest);
        // Two blobs agree by construction.
        return static_cast<double>(std::max<std::size_t>(1, tried_)) *
               at_least(found.matched - 2, std::max(found.matched, in_view_) - 2, p);
    }

    Assignment match_within(double gate) {
        std::vector<std::vector<std::size_t>> near(marks_.size());
        for (std::size_t m = 0; m < marks_.size(); ++m)
            for (std::size_t b = 0; views_[m] && b < blobs_.size(); ++b)
                if (fits(*views_[m], b) && distance(views_[m]->centroid, blobs_[b].at) < gate) near[m].push_back(b);
        Assignment best{.blob = std::vector<int>(marks_.size(), -1), .T_camera_body = guess_};
        tried_ = 0;
        for (const auto& [i, j] : pairs_)
            for (const std::size_t a : near[i])
                for (const std::size_t b : near[j]) {
                    if (a == b) continue;
                    ++tried_;
                    Assignment found =
                        assign(fitted(std::array<Correspondence, 2>{{{i, a}, {j, b}}}), kFirstTolerance_px);
                    if (found.matched > best.matched ||
                        (found.matched == best.matched && found.squares_px2 < best.squares_px2))
                        best = std::move(found);
                }
        for (int round = 0; round < kRefits && best.matched > 0; ++round) {  // to all that agree
            std::vector<Correspondence> agree;
            for (std::size_t m = 0; m < marks_.size(); ++m)
                if (best.blob[m] >= 0) agree.push_back({m, static_cast<std::size_t>(best.blob[m])});
            Assignment next = assign(fitted(agree), 0);
            const bool same = next.blob == best.blob;
            best = std::move(next);
            if (same) break;
        }
        return best;
    }

    /// Gauss-Newton from the guess, with pixels of one standard deviation and the guess as a prior.
    [[nodiscard]] Rigid3 fitted(std::span<const Correspondence> from) const {
        Rigid3 T = guess_;
        Vector6 prior;
        prior << Eigen::Vector3d::Constant(1 / (kPriorRotation_rad * kPriorRotation_rad)),
            Eigen::Vector3d::Constant(1 / std::pow(kPriorPosition * norm(guess_.t), 2));
        constexpr int kSteps = 3;
        for (int step = 0; step < kSteps; ++step) {
            Matrix6 A = prior.asDiagonal();
            Vector6 g = prior.cwiseProduct(error_between(T, guess_));
            for (const Correspondence& c : from) {
                const Vec3 at = marks_[c.mark]->T_body_mark.t;
                const auto p = model_.project(T * at);
                if (!p) return guess_;
                const Matrix26 J = reprojection_jacobian(model_, T, at);
                const Eigen::Vector2d r{blobs_[c.blob].at.u - p->x, blobs_[c.blob].at.v - p->y};
                A += J.transpose() * J, g += J.transpose() * r;
            }
            T = displaced(T, Vector6(A.ldlt().solve(g)));
        }
        return T;
    }

    /// The nearest blob of each mark within a tolerance (at least `tolerance`, px); each blob once.
    [[nodiscard]] Assignment assign(const Rigid3& T, double tolerance) const {
        Assignment out{.blob = std::vector<int>(marks_.size(), -1), .T_camera_body = T};
        std::vector<std::pair<double, Correspondence>> near;
        for (std::size_t m = 0; m < marks_.size(); ++m) {
            const auto view = views_[m] ? disc_view(*marks_[m], T, model_) : std::nullopt;
            if (!view) continue;
            const double most = std::max(tolerance, tolerance_px(*view));
            for (std::size_t b = 0; b < blobs_.size(); ++b)
                if (const double d = distance(view->centroid, blobs_[b].at); d < most && fits(*view, b))
                    near.push_back({d, {m, b}});
        }
        std::ranges::stable_sort(near, {}, [](const auto& n) { return n.first; });
        std::vector<std::uint8_t> used(blobs_.size(), 0);
        for (const auto& [d, c] : near) {
            if (out.blob[c.mark] >= 0 || used[c.blob]) continue;
            out.blob[c.mark] = static_cast<int>(c.blob), used[c.blob] = 1;
            ++out.matched, out.squares_px2 += d * d;
        }
        return out;
    }

    std::span<const Mark* const> marks_;
    const MeasuredImage& image_;
    const SensorModel& sensor_;
    const CameraModel& model_;
    const Rigid3 guess_;
    std::vector<std::optional<DiscView>> views_;  ///< at the guess; none: not in view
    int in_view_ = 0;
    std::vector<std::array<std::size_t, 2>> pairs_;  ///< of marks
    std::vector<Blob> blobs_;
    std::vector<double> sizes_px_;  ///< radii of the discs that the blobs were searched for
    double searched_px2_ = 0;       ///< area that was searched, for all sizes
    std::size_t tried_ = 0;         ///< poses from two blobs
};

}  // namespace

double variance_of_disc(double radius_px) {
    // About 2 pi r pixels of the rim have a variance of 1/6 at a mean square distance of r^2 / 2 along each axis.
    // Of a disc smaller than a pixel: a pixel's own variance and that of the disc about its centre.
    return std::min(1 / (6 * kPi * radius_px), 1.0 / 12 + radius_px * radius_px / 4);
}

MarkMatches match_marks(std::span<const Mark* const> marks, const MeasuredImage& image, const SensorModel& sensor,
                        const CameraModel& model, const Rigid3& guess) {
    return Matcher(marks, image, sensor, model, guess).match();
}

}  // namespace narpa
