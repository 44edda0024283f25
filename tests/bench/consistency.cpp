// The campaign of consistency: faults that it found stay found, and of a few trials of each method none lies.
#include "bench/estimation/consistency.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <vector>

#include "base/stop.h"
#include "bench/estimation/consistency_scenes.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "tests/support/campaign.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

std::vector<ConsistencyRow> run(const ConsistencyOptions& o, int first) {
    static TracingThreads threads(0);
    const StopFlag stop{};
    auto rows = run_consistency(
        o, first, threads, [](const std::string&) {}, stop);
    EXPECT_TRUE(rows) << rows.error().what;
    return *std::move(rows);
}

/// Trials whose good answers were beyond 6 sigma: valleys in which steps ended early, frames blurred by what the
/// model does not know, and another target; from 10000 on other minima along a weak motion, and images that are not
/// linear over its standard deviation; from 100000 on a false minimum to which coarse levels led both starts, and
/// Jacobians that said too much of weak motions; from 140000 on a weak motion beside which no descent converged,
/// and another minimum along the second weakest motion; from 151000 on pixels of which few samples were bright, and
/// poses further from the guess than that can be off; 162387: a loss that hardly rises over 8 sigma to one side;
/// 168894: a bent valley. The guards are two of each kind at most.
TEST(Consistency, DenseTrialsThatLied) {
    ConsistencyOptions o;
    o.methods = {"dense"};
    o.trials = 1;
    const std::vector<int> lied{25,     146,    4,      11704,  10139,  100022, 105170, 140667, 150014,
                                151256, 153478, 162387, 168894, 32,     55,     38,     10,     10799,
                                11543,  10026,  10296,  10653,  11764,  11229,  10001,  100450, 101152,
                                105816, 151000, 151758, 151863, 151918, 153136, 153441, 153674};
    for (const int trial : test::guards_or_all(lied, 13))
        for (const ConsistencyRow& row : run(o, trial))
            EXPECT_EQ(row.beyond, 0) << trial << ": " << row.target << ", " << row.condition;
}

/// The loss rises as the image says, however much wider an error of the model makes the covariance (nearly all were
/// refused).
TEST(Consistency, DenseAnswersWhereTheSizeIsUncertain) {
    ConsistencyOptions o;
    o.methods = {"dense"}, o.conditions = {"plain"};
    o.trials = 8;
    o.world.scale = o.told.scale = 0.01;
    int good = 0, beyond = 0;
    for (const ConsistencyRow& row : run(o, 0)) good += row.answers[0], beyond += row.beyond;
    EXPECT_GE(good, 5);
    EXPECT_EQ(beyond, 0);
}

/// A cylinder's matches turn with the light: untold, its roll is wrong by far more than is said; told, it
/// is held to be unobserved.
TEST(Consistency, FeaturesKnowWhatTheLightMoves) {
    ConsistencyOptions o;
    o.methods = {"features"}, o.conditions = {"plain"};
    o.size = 240, o.trials = 1;
    o.world.light_rad = 2 * kDegree;
    constexpr int kTrial = 415;
    const ConsistencyRow untold = run(o, kTrial).front();
    EXPECT_EQ(untold.beyond, 1) << untold.target;
    o.told = o.world;
    const ConsistencyRow told = run(o, kTrial).front();
    EXPECT_EQ(told.beyond, 0) << told.target;
    EXPECT_EQ(told.answers[static_cast<std::size_t>(AnswerKind::refused)], 0) << "it is answered";
}

/// The third start is held against the answer where the second has left the view of another window, without a
/// Jacobian (it crashed).
TEST(Consistency, DenseThirdStartAfterAWholeSecondDescent) {
    ConsistencyOptions o;
    o.methods = {"dense"};
    o.trials = 1;
    const auto rows = run(o, 142147);
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows[0].trials(), 1);
    EXPECT_EQ(rows[0].beyond, 0);
}

/// What the second start leaves is not the noise of fewer samples than the answer's.
TEST(Consistency, ASecondStartThatAgreesAddsLittleToDenseCovariances) {
    const auto scene = consistency_scene("craft", 96);
    ASSERT_TRUE(scene) << scene.error().text();
    const auto render_scene = RenderScene::create(*scene);
    ASSERT_TRUE(render_scene);
    const Camera& camera = scene->cameras.front();
    const BodyPoses at(1);
    const double range_m = 5 * render_scene->tracer().bounding_radius_m(0);
    const Rigid3 truth{exp_rotation({0.5, -0.8, 0.3}), {0, 0, range_m}};
    ModelView view(*render_scene, camera, 0, at);
    FrameSettings s;
    s.spp = 64;
    view.render(truth, s, false);
    std::vector<std::uint8_t> bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    expose(camera, view.radiance(), 3, 0, bytes);
    const auto frame = measured_image(camera, bytes);
    ASSERT_TRUE(frame);
    Vector6 off;
    off << 0.03, -0.02, 0.02, 0, 0.01 * range_m, -0.02 * range_m;
    DenseAlignment dense(*render_scene, camera, 0);
    std::vector<double> added;
    for (std::uint64_t seed = 1; seed <= 9; ++seed) {
        DenseOptions o;
        o.seed = seed;
        const auto with = dense.align(*frame, at, displaced(truth, off), o);
        o.rivals = 0;
        const auto without = dense.align(*frame, at, displaced(truth, off), o);
        ASSERT_TRUE(with && without);
        ASSERT_EQ(with->answer.kind, AnswerKind::good) << with->answer.why;
        added.push_back((without->covariance.inverse() * (with->covariance - without->covariance)).trace());
    }
    std::ranges::nth_element(added, added.begin() + 4);
    EXPECT_LT(added[4], 3);  // variances; measured 0.75, with the samples of the steps before 24
}

/// Matches of outlines, of shading and along edges, which end where the start left them; from 30000 on too few of
/// them; the last with a weak motion that is no turn across the line of sight.
TEST(Consistency, FeatureTrialsThatLied) {
    ConsistencyOptions o;
    o.methods = {"features"};
    o.trials = 1;
    o.size = 240;
    const std::vector<int> lied{20467, 20191, 20769, 30272, 31595, 40416, 63168, 21232, 20275, 20277,
                                20292, 20829, 21163, 20132, 20757, 21300, 20691, 21083, 30583, 41019};
    for (const int trial : test::guards_or_all(lied, 7))
        for (const ConsistencyRow& row : run(o, trial))
            EXPECT_EQ(row.beyond, 0) << trial << ": " << row.target << ", " << row.condition;
}

/// Sweeps in which one or two points held a motion, lay on the wrong face, or were explained by a symmetry far from
/// the start; the last with a false minimum that is only left by way of another.
TEST(Consistency, LidarTrialsThatLied) {
    ConsistencyOptions o;
    o.methods = {"icp"};
    o.trials = 1;
    for (const int trial :
         {12962, 18467, 15863, 16627, 18451, 11711, 16469, 19868, 13506, 12260, 15364, 18501, 16350, 22109})
        for (const ConsistencyRow& row : run(o, trial))
            EXPECT_EQ(row.beyond, 0) << trial << ": " << row.target << ", " << row.condition;
}

/// A false minimum of a prism, well held, whose points are further from the model than noise explains.
TEST(Consistency, LidarTrialOfAnotherSizeThatLied) {
    ConsistencyOptions o;
    o.methods = {"icp"};
    o.conditions = {"plain"};
    o.world.scale = o.told.scale = 0.01;
    o.trials = 1;
    for (const ConsistencyRow& row : run(o, 200024)) EXPECT_EQ(row.beyond, 0) << row.target;
}

/// A craft is taken for the same one with details, whose pose it has: beams without return pass through the
/// details.
TEST(Consistency, LidarTellsACraftFromOneWithDetails) {
    ConsistencyOptions o;
    o.methods = {"icp"};
    o.trials = 1;
    const auto rows = run(o, 28449);
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows.front().target + " " + rows.front().condition, "detailed wrong");
    EXPECT_EQ(rows.front().answers[static_cast<std::size_t>(AnswerKind::refused)], 1);
}

TEST(Consistency, FewTrialsOfEach) {
    ConsistencyOptions o;
    o.conditions = {"plain", "dark", "beside", "far", "wrong"};
    for (const auto& [method, trials] : {std::pair{"points", 500},
                                         {"icp", test::trials(50, 200)},
                                         {"icp-search", 12},
                                         {"features", 8},
                                         {"dense", 8}}) {
        o.methods = {method};
        o.trials = trials;
        int good = 0;
        for (const ConsistencyRow& row : run(o, 0)) {
            EXPECT_EQ(row.beyond, 0) << method << ", " << row.target << ", " << row.condition;
            good += row.answers[0];
        }
        EXPECT_GE(good, std::string_view(method) == "features" ? 0 : trials / 10) << method;
    }
}

TEST(Consistency, ATargetFromASceneFile) {
    ConsistencyOptions o;
    o.methods = {"icp"};
    o.conditions = {"plain"};
    o.targets = {test::build_path("scenes/docking/docking.toml")};
    o.trials = 5;
    const auto rows = run(o, 0);
    ASSERT_EQ(rows.size(), 1);
    EXPECT_EQ(rows.front().target, "docking");
    EXPECT_GE(rows.front().answers[0], 1);
    EXPECT_EQ(rows.front().beyond, 0);
}

TEST(Consistency, ATargetThatIsNone) {
    static TracingThreads threads(0);
    const StopFlag stop{};
    ConsistencyOptions o;
    for (const auto& [name, what] :
         {std::pair{"teapot", "expected one of the names"}, {"teapot.toml", "no such file"}}) {
        o.targets = {name};
        const auto rows = run_consistency(
            o, 0, threads, [](const std::string&) {}, stop);
        ASSERT_FALSE(rows);
        EXPECT_NE(rows.error().what.find(what), std::string::npos) << rows.error().what;
    }
}

TEST(Consistency, AWrongTargetNeedsAnother) {
    static TracingThreads threads(0);
    const StopFlag stop{};
    ConsistencyOptions o;
    o.methods = {"icp"};
    o.targets = {"craft"};
    o.trials = 40;
    for (const ConsistencyRow& row : run(o, 0)) EXPECT_NE(row.condition, "wrong");
    o.conditions = {"wrong"};
    const auto rows = run_consistency(
        o, 0, threads, [](const std::string&) {}, stop);
    ASSERT_FALSE(rows);
    EXPECT_NE(rows.error().what.find("at least two targets"), std::string::npos) << rows.error().what;
}

/// A model that is wrong and told so: the answers are as far off, and say it.
TEST(Consistency, ToldErrorsOfTheModelAreInTheCovariance) {
    ConsistencyOptions o;
    o.methods = {"points"};
    o.conditions = {"plain"};
    o.trials = 400;
    o.world = {.scale = 0.01, .mesh_m = 0.003, .boresight_rad = 1e-3};
    int lies = 0, good = 0;
    for (const ConsistencyRow& row : run(o, 0)) lies += row.beyond, good += row.answers[0];
    EXPECT_GT(lies, 0.3 * good) << "untold";
    o.told = o.world;
    lies = 0;
    for (const ConsistencyRow& row : run(o, 0)) lies += row.beyond;
    EXPECT_EQ(lies, 0);
}

}  // namespace
}  // namespace narpa
