#include "estimator/dense/model_suspects.h"

#include <array>

#include "estimator/dense/border_points.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/untold.h"

namespace narpa {
namespace {

using Column = std::vector<float>;

/// Rows of a frame that are exposed one after the other: each sees another pose.
/// `unknowns`: components of the motion, from the first one on.
NuisanceColumns rows_of_motion(const SuspectScene& s, int first, std::size_t unknowns) {
    // A rolling shutter that is told is in the renders, with the error of few moments for each row.
    if (s.view.row_times().row_s != 0) return {};
    NuisanceColumns columns(unknowns, Column(s.images.signal.size()));
    const double middle = 0.5 * (s.images.height - 1);
    for (std::size_t p = 0; p < s.images.signal.size(); ++p) {
        const auto row = static_cast<double>(p / static_cast<std::size_t>(s.images.width));
        const auto time = static_cast<float>((row - middle) / s.images.height);
        for (std::size_t i = 0; i < columns.size(); ++i)
            columns[i][p] = time * s.images.derivative[p][first + static_cast<Eigen::Index>(i)];
    }
    return columns;
}
/// A target that moves across the image, or a camera that turns.
NuisanceColumns rows_shifted(const SuspectScene& s) {
    return rows_of_motion(s, 3, 2);
}
/// Any motion.
NuisanceColumns rows_moved(const SuspectScene& s) {
    return rows_of_motion(s, 0, 6);
}

/// Half of the image's second derivatives along both axes and across: motion or defocus. The amounts of the first
/// two are variances of the blur, px^2. From the derivative by the pose, whose noise is not that of the residuals.
NuisanceColumns wider_edges(const SuspectScene& s) {
    NuisanceColumns columns(3, Column(s.images.signal.size()));
    const auto& J = s.images.derivative;
    constexpr int kRight = 3, kDown = 4;  // translations
    const auto unit = static_cast<float>(0.25 * s.T_camera_target.t.z / s.pixels_per_radian);
    for (int y = 1; y < s.images.height - 1; ++y)
        for (int x = 1; x < s.images.width - 1; ++x) {
            const std::size_t p = index_in(s.images.width, x, y);
            const auto width = static_cast<std::size_t>(s.images.width);
            columns[0][p] = unit * (J[p - 1][kRight] - J[p + 1][kRight]);
            columns[1][p] = unit * (J[p - width][kDown] - J[p + width][kDown]);
            columns[2][p] = unit * (J[p - width][kRight] - J[p + width][kRight]);
        }
    return columns;
}

NuisanceColumns turned_light(const SuspectScene& s) {
    if (s.model.light_rad > 0) return {};
    return s.view.changes_with_light(s.T_camera_target, s.settings);
}

NuisanceColumns ambient_light(const SuspectScene& s) {
    return {s.view.ambient_light()};
}

/// Gain that changes linearly over the image.
NuisanceColumns gain_gradient(const SuspectScene& s) {
    NuisanceColumns columns(2, Column(s.images.signal.size()));
    const double cx = 0.5 * (s.images.width - 1), cy = 0.5 * (s.images.height - 1);
    for (int y = 0; y < s.images.height; ++y)
        for (int x = 0; x < s.images.width; ++x) {
            const std::size_t p = index_in(s.images.width, x, y);
            columns[0][p] = static_cast<float>((x - cx) / s.images.width) * s.images.signal[p];
            columns[1][p] = static_cast<float>((y - cy) / s.images.height) * s.images.signal[p];
        }
    return columns;
}

/// Light from the target's own surfaces.
NuisanceColumns interreflection(const SuspectScene& s) {
    if (s.settings.method == RenderSettings::Method::path) return {};
    return {s.view.indirect_light(s.T_camera_target, s.settings)};
}

/// Shading alone shows the roll of a smooth body, and cannot tell it from a turn of the light. Half of an observed
/// rotation's largest standard deviation, so that the roll counts as observed.
constexpr double kUntoldLight_rad = 0.5 * kMaxRotation_rad;

/// The second derivative describes a blur of about a pixel.
constexpr double kMostBlur_px2 = 2;

using Solved = Suspect::Solved;
constexpr std::array<Suspect, 7> kSuspects{{
    {"rows", kProgressiveRows, 0, Solved::never, 0, rows_shifted},
    {"rows of a motion", kProgressiveRows, 0, Solved::never, 0, rows_moved},
    {"blur", "edges are wider or sharper than the model's: motion during the exposure, or defocus?", 0,
     Solved::if_details_lack, kMostBlur_px2, wider_edges},
    {"light", "surfaces are lit from elsewhere: another direction of the light?", kUntoldLight_rad, Solved::always,
     0, turned_light},
    {"ambient", "surfaces have more or less light than the model's everywhere: ambient light?", 0, Solved::always,
     0, ambient_light},
    {"gain", "the gain changes across the image: vignetting?", 0, Solved::always, 0, gain_gradient},
    {"indirect", "surfaces light each other: interreflection, method path?", 0, Solved::always, 0, interreflection},
}};

}  // namespace

std::span<const Suspect> model_suspects() noexcept {
    return kSuspects;
}

std::vector<Suspicion> suspicions(const SuspectScene& scene, const Exposure& exposure, const Robustness& robust,
                                  double overconfidence) {
    std::vector<Suspicion> out;
    for (const Suspect& suspect : kSuspects) {
        const NuisanceColumns columns = suspect.columns(scene);
        if (columns.empty()) continue;
        out.push_back({&suspect,
                       fit_nuisance(scene.images, exposure, robust, columns, suspect.prior, overconfidence),
                       false});
    }
    return out;
}

}  // namespace narpa
