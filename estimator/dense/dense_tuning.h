/// estimator/dense/dense_tuning.h - the tuned constants of dense alignment, and what they were tuned on.
///
/// Data sets:
/// - random frames: `narpa bench estimate --only consistency` (bench/estimation/consistency.h), tuned for NEES near
/// 6 and no
///   answer beyond six sigma;
/// - docking frames: the docking scene at 10 and 16.6 m, 640 x 480 pixels, guesses 3 degrees and 3 % off, tuned for
///   time at equal errors over the bound.
/// Where neither is named, the project's history does not record what the value was tuned on.
///
/// Each alone taken away, in 100 random frames of unknown noise, trials from 5000 on (88 good answers, NEES 6.6, in
/// 20 to 22 CPU seconds with all of them; 30 November 2026): kTrustCoarse_px and kTrustFine_px 80 good,
/// kCoarseSamples 80, kExtentMin_px 8 instead of 16 84, kSameMinimumSteps and kShiftMax_px 85, kShrinking,
/// kCostSlack, kCoarseProgress and kFewestSamplesOfFrame 86, kParallelCosine with kStrideMax, kSameMinimum_chi2,
/// kRendered_sigmas and kWeakMotion 87; kResponseMax 88 with NEES 6.9; kLinesDivisor 89 and kThirdStart_rad 88, at
/// 25 CPU seconds. No difference in these frames: kNoiseSteps, kExtentBeforeFarStep_px, kFarStep and
/// kConvergedBeforeFarStep_px, which are for docking frames; kSameMinimumPart, kRenderedLimits, kLightsSolved.
/// kCoarseModelPart 91, but of the first 12 frames of rehearsal docking-dense 4 had two starts that lead to
/// different poses, instead of none.
#pragma once

#include <array>
#include <cstddef>

namespace narpa::dense_tuning {

// --- Levels of the pyramid

/// The coarsest level shows the target no smaller than this.
inline constexpr double kExtentMin_px = 16;
/// A level's target may be followed by pixels a quarter as wide at least from this extent on, in its own pixels.
inline constexpr double kExtentBeforeFarStep_px = 64;
inline constexpr int kFarStep = 4;
/// The first level searches shifts of up to this many of its pixels.
inline constexpr int kShiftMax_px = 12;

// --- Steps on a level

/// A level converges when a step moves the target by less than kConverged_px (its own pixels), or by less than
/// kConvergedBeforeFarStep_px if the next level's pixels are a quarter as wide. The finest level also converges
/// when a step is shorter than kConverged_sigmas standard deviations of the pose.
inline constexpr double kConverged_px = 0.1, kConvergedBeforeFarStep_px = 0.05, kConverged_sigmas = 0.2;
/// Levenberg-Marquardt's damping: first value, smallest value, factor after each step, refusals in a row.
inline constexpr double kDampingFirst = 1e-3, kDampingMin = 1e-7, kDampingFactor = 10;
inline constexpr int kRefusedMax = 4;
/// Steps that move the target by less are accepted without testing the cost, whose change is below its sampling
/// noise.
inline constexpr double kTrustCoarse_px = 0.5, kTrustFine_px = 0.1;
/// A level ends after kStalledMax consecutive steps that are not shorter than kShrinking times the shortest before.
inline constexpr int kStalledMax = 2;
inline constexpr double kShrinking = 0.9;
/// Steps of up to this many times the convergence threshold are also attributed to sampling noise.
inline constexpr double kNoiseSteps = 10;
/// Least relative decrease of a coarse level's cost per step that counts as progress.
inline constexpr double kCoarseProgress = 0.01;
/// Consecutive steps of a coarse level with a larger cosine between them are parallel and are lengthened, up to
/// this factor: details smaller than a pixel make steps too short.
inline constexpr double kParallelCosine = 0.7, kStrideMax = 8;
/// Sampling noise may increase the cost of a good step by this part.
inline constexpr double kCostSlack = 1e-3;
inline constexpr std::size_t kPixelsMin = 12;
/// Samples on coarse levels, over those of the finest: their pixels are few, with more details and less noise.
inline constexpr int kCoarseSamples = 2;
/// Divisor of the derivative's lines for all steps but the last of the finest level. Docking frames: 1.19 s with
/// four lines, 0.66 s with two.
inline constexpr int kLinesDivisor = 2;
/// Model error on coarse levels: this part of the signal power.
inline constexpr double kCoarseModelPart = 0.1;
inline constexpr double kGainMin = 0.05;
/// The Jacobian is reused for poses within this motion.
inline constexpr double kJacobianValid_px = 0.2;

// --- Choice of the pixels that determine the pose: docking frames

/// Pixels are chosen if the target covers at least this many: fewer take little time anyway.
inline constexpr std::size_t kPixelsOfLargeTarget = 10'000;
/// For the image and the derivative that they are chosen from: divisor of the number of samples, and the number of
/// lines. 13 % of the image then hold 0.81 of the information; 16 % and 0.89 with two lines and all samples, at
/// 1.6 of 4.2 s.
inline constexpr int kChoiceSamplesDivisor = 4, kChoiceLines = 1;
/// Part of the information that the chosen pixels hold together.
inline constexpr double kChosenInformation = 0.8;
/// Pixels are chosen when a step is shorter than this: those that determine the pose show details smaller than a
/// pixel, whose Jacobian is valid only nearby. After kStepsBeforeChoice steps, when one is shorter than
/// kJacobianValid_px.
inline constexpr double kChooseBelow_px = 0.1;
inline constexpr int kStepsBeforeChoice = 2;

// --- Last steps: docking frames (error over bound 1.45), random frames (NEES 5.7 with 6 times the samples)

/// In a curved valley steps end early, and the derivative leaves about a tenth of a step.
struct LastSteps {
    int first_samples, samples;  ///< sample factors: before and after a step shorter than before_sigmas
    double before_sigmas;
    double sigmas, px;         ///< the last step is shorter than one of these: in standard deviations, in pixels
    double jacobian_valid_px;  ///< the Jacobian is reused for poses within this motion
};
/// Chosen pixels show fine details and are limited by sampling noise. Low-discrepancy samples are best in powers of
/// two: the stated variance is 0.52 of the frame's with 64 samples, 1.26 with 48.
inline constexpr LastSteps kLastStepsOfAllPixels{6, 6, 0, 1, 0.02, 0.02},
    kLastStepsOfChosenPixels{4, 8, 20, 3, 0, 0.1};
inline constexpr int kLastStepsMax = 5;

// --- Tests of an answer: random frames

/// Sample factor of the images that answers of large targets are tested with. Docking frames of 40,000 to 300,000
/// pixels: with 6, as for small targets, the same answers, at 9.8 instead of 8.1 CPU seconds.
inline constexpr int kTestSamplesOfLargeTarget = 2;
/// Two poses at most kSameMinimum_px apart count as one minimum if kSameMinimumSteps steps from one leave at most
/// the part kSameMinimumPart of the distance to the other, or a squared Mahalanobis distance below
/// kSameMinimum_chi2.
inline constexpr double kSameMinimum_px = 1, kSameMinimumPart = 0.5, kSameMinimum_chi2 = 25;
inline constexpr int kSameMinimumSteps = 2;
/// Two answers agree if their squared Mahalanobis distance is below this: five sigma.
inline constexpr double kAgree_chi2 = 25;
/// A motion is weak if its standard deviation exceeds this part of the limit of observed motions: the image may not
/// be linear over it.
inline constexpr double kWeakMotion = 0.2;
/// Test of linearity along the `motions` least observed motions. At `sigmas` standard deviations the loss must rise
/// by at least the part `rise_min` of a linear image's (smaller further away, where a robust loss rises less). Of
/// 500 frames none that was good is refused. It must rise by less than in a valley that bends by one standard
/// deviation of another motion over one of this motion: a cube seen along a face rose to 346 times a linear
/// image's.
struct LinearityTest {
    int motions;
    double sigmas, rise_min;
    [[nodiscard]] constexpr double rise_max() const { return 1 + sigmas * sigmas; }
};
inline constexpr std::array kLinearityTests{LinearityTest{1, 4, 0.5}, LinearityTest{3, 8, 0.35}};
/// An answer rotated by more than this from the guess is tested with a third start. Without the limit the test took
/// a fifth more time and refused one of 193 good answers.
inline constexpr double kThirdStart_rad = 0.07;
/// Other minima are searched from starts at this distance.
inline constexpr double kSearchedBeside_sigmas = 8;
/// The model does not fit if the gain is off its prior by more than this many standard deviations.
inline constexpr double kPriorSigmas = 4;
/// The weakest motions are rendered to both sides: by kRendered_sigmas standard deviations, at most kRenderedLimits
/// times the limit of observed motions. With at least 0.2 px, three of four answers beyond six sigma were not seen,
/// as the response is not linear over that: NEES 6.6 instead of 5.7 in 100 random frames of unknown noise.
inline constexpr double kRendered_sigmas = 2, kRenderedLimits = 2;
/// Largest number of steps in which light that the model lacks is solved: each is linear in it.
inline constexpr int kLightsSolved = 3;
/// A pose that turns by more than this part of the light's turn is not solved with it: 0.8 to 1.4 of cylinders and
/// ellipsoids, 0.01 to 0.25 of bodies with flat faces (random frames).
inline constexpr double kTurnsWithLight = 0.5;
/// Scale of Cauchy's weights that has 95 % efficiency for normal noise (P. W. Holland, R. E. Welsch, Commun.
/// Statist. A6, 1977), and the RMS of normal residuals so weighted.
inline constexpr double kResidualCauchy = 2.385, kResidualOfNormal = 0.764;
/// If a frame's own sampling noise is not known, it has at most that of this many samples a pixel: dense needs 16,
/// and with one, a skew of 3 px passed as noise.
inline constexpr double kFewestSamplesOfFrame = 8;
/// Upper limit of the measured response to a motion over the Jacobian's. Without it the 75 answers of largest
/// response had NEES 7.1; with it 620 answers have 5.9.
inline constexpr double kResponseMax = 1.3;

}  // namespace narpa::dense_tuning
