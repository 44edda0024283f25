/// renderer/frame/tuning.h - the constants of this folder that were chosen by measurement.
///
/// Unless a constant says otherwise, it was tuned with `narpa-bench render --scenes` on craft, craft-paths,
/// docking, docking-contact and cornell (docs/performance.md), for the least error at equal cost. craft-and-ball
/// was not used for tuning. None of them changes the mean of an image.
#pragma once

#include <cstddef>
#include <cstdint>

namespace narpa::tuning {

// Passes of a frame within a budget.

/// Samples per pixel that set the footprint for texture filtering. Centres are sampled as in a frame of two
/// samples, so that each takes its own point of the lens and of the Sun, and shows defocus and penumbrae.
inline constexpr int kCentreFootprint_spp = 2, kSampleFootprint_spp = 4;

/// Fractions of the remaining time for the first pass beyond one sample per pixel, short so that there soon is an
/// image to show, and for each later pass. Real-time runs of docking.
inline constexpr double kFirstPassTime = 1.0 / 3, kNextPassTime = 0.85;
/// The same for sunlight samples, whose cost varies more: a pass that is given up loses all of its time.
inline constexpr double kSunlightPassTime = 0.7;
/// Fractions of the remaining rays. With Sun-only direct lighting the number of samples predicts the number of rays
/// almost exactly (docking); with paths it varies by a tenth from one pass to the next (craft-paths, cornell).
inline constexpr double kFirstPassRays = 0.85, kNextPassRays = 0.96, kNextPassRaysOfPaths = 0.9;
/// A frame of a fixed number of samples is expected to take its last time or, after frames that the clock has
/// ended, that of as many of their samples; it may be expected to take this part of the time left.
inline constexpr double kMaxAim = 0.75;
/// A remainder below this fraction of the budget is not worth another pass.
inline constexpr double kMinRemainder = 0.05;

/// Largest fraction of the remaining rays that one sample per pixel may be expected to take; the expectation comes
/// from the pilot pass, a sixteenth of the tiles. craft-paths.
inline constexpr double kMaxPilotPrediction = 0.85;
/// The pilot pass is this part of the tiles.
inline constexpr std::uint64_t kPilotPart = 16;
/// Light by paths with separate direct sunlight is sampled uniformly if this many samples of each pixel fit, by
/// contrast with fewer. RMSE by contrast and uniformly, over that of one sample per pixel, at 3 and 4 times its
/// rays: craft-paths 0.56 and 0.59, 0.47 and 0.47. RMSE of craft-and-ball at 12 rays per pixel: 2.8 and 4.5.
inline constexpr std::uint64_t kUniformSamples = 4;
/// With fewer rays for each pixel, paths for one pixel in 4 x 4 are not expected to fit.
inline constexpr double kMinRaysOfPaths = 0.15;

/// Separate direct sunlight gets samples of its own, with this fraction of the budget, if the budget has this many
/// rays or samples per pixel in view and the sunlight of this fraction of the surfaces is separate. RMSE with 20
/// and with 12 at 13 to 19 rays per pixel: craft-paths 5.5 -> 5.0, 5.2 -> 4.5, 4.5 -> 4.2; craft-and-ball 3.9 ->
/// 3.3, 3.1 -> 2.7; with 10 it rises at 11 rays per pixel of a craft over a globe. A fraction of 0.4 has up to 1.4
/// times the RMSE.
inline constexpr double kSunlightPart = 0.22;
inline constexpr double kMinRaysForSunlight = 12, kMinSamplesForSunlight = 4;
inline constexpr double kMinSeparate = 0.5;
/// The same for emission in view, whose samples take one ray each: its fraction of the budget, and the samples of
/// each pixel that must be expected to fit a time. cornell and the module of bench/peers.py.
inline constexpr double kEmissionPart = 0.1;
inline constexpr std::uint64_t kUniformSamplesBesideEmission = 2;

/// Time reserved for waking the threads and for a preempted one: the larger of kMinSlack_ns and 1/kSlackPart of the
/// budget. Runs of docking on two cores beside other load.
inline constexpr std::int64_t kMinSlack_ns = 300'000, kSlackPart = 40;

// Prediction of a pass's wall time (pass_costs.h), runs of docking beside other load.

/// ns per pixel or sample of each kind of pass before any measurement: centres, centres with
/// paths, plan, samples, sunlight, show, reconstruction of a lattice.
inline constexpr double kInitialCosts_ns[] = {100, 200, 30, 200, 100, 10, 30};
/// After a skipped pass the estimate falls by this factor, to no less than this fraction of the last measurement.
inline constexpr double kSkippedDecay = 0.95, kMinDecayed = 0.25;
/// Weight of a new measurement, which counts as within this factor of the estimate.
inline constexpr double kNewWeight = 0.3, kMaxChange = 2;
/// The time of smaller passes is mostly that of their start and end: an upper bound only.
inline constexpr std::uint64_t kMinPieces = 1000;

// Work of a pass.

/// Tiles per task.
inline constexpr std::size_t kTilesPerTask = 8;
/// Batches between two clock reads.
inline constexpr std::uint32_t kBatchesPerClockRead = 16;
/// With this many tiles or more, the error of a frame of centres is estimated from a tenth of them: on craft at
/// 1024 x 1024 it then differs by 3 % from that of all tiles.
inline constexpr std::size_t kManyTiles = 4096;
/// The same for filled frames, which are made where time is short.
inline constexpr std::size_t kManyFilledTiles = 1024;
/// PathSettings::first_survival if edges cause most of the error: in frames of one sample per pixel, and if paths
/// are traced from all samples. craft-paths.
inline constexpr float kReducedSurvival = 0.5f;

// Adaptive sample plan (sample_plan.h): craft, docking, docking-contact.

/// Edges move by less than a pixel, and centres often miss thin parts: pixels next to an edge get this fraction of
/// its variance, and the next ones that.
inline constexpr float kVarianceBesideEdge = 0.05f, kVarianceTwoFromEdge = 0.01f;
/// Smallest weight of a pixel that differs from its neighbours, relative to a typical edge's. Pixels in completely
/// uniform regions, such as empty space, get an eighth of it.
inline constexpr float kMinWeight = 1.0f / 128;
/// A pixel whose centre hit nothing gets kMinWeight times two to this power: a body's bounds are in view, so thin
/// parts may pass between the centres, and a search costs one ray and no shading.
inline constexpr int kEmptyDoublings = 2;
/// An edge of little contrast may hide a glint that no centre met: this fraction of a typical variance is assumed.
inline constexpr float kHiddenVariance = 0.02f;
/// Exponent of the variance of edges, which falls as n^-1.5, beside that of noise, which falls as 1/n: the weights
/// are the powers 2/5 and 1/2 of the variances of one sample.
inline constexpr float kEdgePower = 0.8f;

// Pixels that are not traced (pixel_fill.h). Where a constant names no scene, it was chosen once and not varied;
// the results were measured on docking at 25 and 50 s and on craft.

/// Hits lie on one side of a silhouette if their depths differ by no more than this part of the nearer one: on one
/// surface, and on two.
inline constexpr float kOneSurfaceGap = 0.05f, kOneSideGap = 0.005f;
/// A silhouette counts as a contrast of at least this part of the largest.
inline constexpr float kSilhouetteContrast = 1.0f / 64;
/// Fewer comparisons than this say nothing about an octave of contrast; then the squared error is this part of the
/// squared contrast.
inline constexpr double kMinComparisons = 30, kFillErrorOfContrast = 0.2;
/// In one of so many tiles, one of so many pixels is traced first, to be compared. Docking at 25 s with 0.5 to 1.5
/// of the rays of one sample per pixel: predicted over measured error 0.9 to 1.0.
inline constexpr std::uint64_t kComparedTiles = 16, kComparedPlaces = 4;
/// In small images, in at least so many tiles.
inline constexpr std::uint64_t kMinComparedTiles = 120;
/// Where samples are noisy, a traced pixel differs from its neighbours by its own noise too: the squared error of
/// reconstruction as a part of the squared difference. craft-paths with 1/14 to 4 times the
/// rays of one sample per pixel: predicted over measured error 1.01 to 1.25, with 0.35 instead 0.88 to 1.25.
inline constexpr double kPartNotNoise = 0.5;
/// This part of what is left after one pixel in 2 x 2 goes to further pixels, the rest to further samples; with
/// this many rays per pixel in Sun-only direct lighting, or half as many samples, all centres are traced instead.
inline constexpr double kSparseFill = 0.5, kAllCentresRays = 3;
/// After one pixel in 4 x 4 the same, if this part of those in 2 x 2 fits. RMSE over that of one sample per pixel,
/// at 1/8, 1/6, 1/4 of its rays: docking at 50 s 1.27, 1.06, 0.85, if those in 2 x 2 are traced
/// first 1.47, 1.46, 1.45; at 1/14, where 5 % fit, 2.28 and 1.89.
inline constexpr double kMinCoarseFill = 0.15;
/// The plans of these samples may take this part of the time that is left. Runs of docking.
inline constexpr double kMaxSparsePlan = 0.4;
/// Up to so many centres of a tile are traced together with those of the next ones. Docking at 50 s, two cores: one
/// pixel in 4 x 4 takes 25 ms instead of 31.
inline constexpr int kFewCentres = 8;
/// A pass is worth its start if it traces this part of a lattice.
inline constexpr double kMinFill = 0.005;
/// Pixels in a batch of 16 while lattices are filled, about, as a part. Time of one sample per pixel that is
/// attempted, as a part of the time left. Runs of docking.
inline constexpr double kFilledLanes = 0.9, kMaxFirstTime = 0.8;
/// Parts of the remaining time for the next pixels, and for those after them.
inline constexpr double kFirstFillTime = 0.6, kNextFillTime = 0.85;
/// The same of the remaining rays, where a sample may take any number of them, and for the first further samples:
/// with 0.9 the first pass of the finest lattice exceeded its limit. craft-paths.
inline constexpr double kFirstFillRays = 0.5, kFirstSparseRays = 0.6;

// Estimates of variance.

/// Variance of a tile: its ratio to that of independent samples counts as if this many more pixels had a ratio of
/// 1, because the steps of a few pixels may be small by chance.
inline constexpr double kPixelsAsIndependent = 4;

}  // namespace narpa::tuning
