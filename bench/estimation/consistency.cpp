#include "bench/estimation/consistency.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <random>

#include "bench/estimation/consistency_scenes.h"
#include "bench/estimation/untold_errors.h"
#include "estimator/cloud/cloud_icp.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/features/feature_alignment.h"
#include "estimator/pnp/pnp.h"
#include "estimator/search/cloud_search.h"
#include "estimator/search/template_matcher.h"
#include "protocols/lidar/velodyne.h"
#include "renderer/detector/detector.h"
#include "renderer/projection/brown_conrady.h"
#include "tracking/estimate_report.h"

namespace narpa {
namespace {

constexpr double kRadius_m = 2;  ///< of the targets made in code, about
constexpr RangeNoise kRangeNoise{0.02, 5.1e-5};
constexpr std::string_view kWrong = "wrong";  ///< the condition that needs another target
constexpr std::string_view kPlain = "plain", kNothing = "none", kAll = "all";

/// Return model of a VLP-16 with 100 m of range, as the estimator assumes it: its detection limit is not stated.
CertainReturn vlp16_returns() {
    Lidar lidar;
    lidar.range_max_m = vlp16().range_m_default;
    return certain_return_of(lidar, {});
}

/// An answer beside the truth.
struct TrialResult {
    Answer answer;
    Rigid3 T{};
    Matrix6 covariance = Matrix6::Zero();
};

struct Draw {
    std::mt19937_64 random;
    double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
    double normal() { return std::normal_distribution<double>()(random); }
    Quat attitude() { return normalized(Quat{normal(), normal(), normal(), normal()}); }
    std::size_t index(std::size_t n) { return static_cast<std::size_t>(random() % n); }
};

/// Differences of a trial's world from the estimators' model.
struct WorldErrors {
    double scale = 1, brightness = 1, focal = 1, range_bias_m = 0, clock_s = 0, distortion = 0;
    Vec3 mesh_m{}, sun_rad{}, boresight_rad{};

    static WorldErrors draw(const ModelUncertainty& u, double distortion, Draw& d) {
        const auto vector = [&](double sigma) {
            const double x = d.normal(), y = d.normal(), z = d.normal();
            return sigma * Vec3{x, y, z};
        };
        WorldErrors e;
        e.scale = 1 + u.scale * d.normal();
        e.brightness = std::max(0.2, 1 + u.albedo * d.normal());
        e.focal = 1 + u.focal * d.normal();
        e.range_bias_m = u.range_bias_m * d.normal();
        e.clock_s = u.clock_s * d.normal();
        e.mesh_m = vector(u.mesh_m);
        e.sun_rad = vector(u.light_rad);
        e.boresight_rad = vector(u.boresight_rad);
        e.distortion = distortion;
        return e;
    }
    [[nodiscard]] Scene applied(Scene s) const {
        for (Mesh& mesh : s.meshes)
            for (Vec3f& p : mesh.positions) p = vec_cast<float>(scale * vec_cast<double>(p) + mesh_m);
        for (Material& m : s.materials) m.diffuse = static_cast<float>(brightness) * m.diffuse;
        if (s.sun) s.sun->direction = exp_rotation(sun_rad) * s.sun->direction;
        Camera& c = s.cameras.front();
        const Pinhole p = paraxial_pinhole(*c.model);
        c.model = std::make_shared<const Pinhole>(p.fx * focal, p.fy * focal, p.cx, p.cy);
        return s;
    }
    /// The pose in the true sensor axes at the true time, for a target whose pose in the assumed axes at the
    /// reported time is T.
    [[nodiscard]] Rigid3 seen(const Rigid3& T, const ApparentMotion& motion) const {
        return Rigid3{exp_rotation(-boresight_rad), {}} * moved(T, motion, -clock_s);
    }
    [[nodiscard]] bool any_of_scene() const {
        return scale != 1 || brightness != 1 || focal != 1 || mesh_m != Vec3{} || sun_rad != Vec3{};
    }
};

/// A target, and the estimators that know it.
struct KnownTarget {
    Scene scene;
    RenderScene render_scene;
    std::unique_ptr<DenseAlignment> dense;
    std::unique_ptr<FeatureAlignment> features;
    std::unique_ptr<CloudIcp> icp;
    std::unique_ptr<CloudSearch> icp_search;
    double radius_m;

    KnownTarget(Scene s, const ModelUncertainty& told)
        : scene(std::move(s)),
          render_scene(*RenderScene::create(scene)),
          radius_m(scene.file.empty() ? kRadius_m : apparent_radius_m(render_scene.tracer(), 0)) {
        FeatureSettings f;
        f.model = told;
        dense = std::make_unique<DenseAlignment>(render_scene, camera(), 0);
        features = std::make_unique<FeatureAlignment>(render_scene, camera(), 0, BodyPoses(1), f);
        const IcpSettings lidar{.noise = kRangeNoise, .certain = vlp16_returns(), .model = told};
        icp = std::make_unique<CloudIcp>(render_scene.tracer(), 0, lidar);
        icp_search = std::make_unique<CloudSearch>(render_scene.tracer(), 0, lidar);
    }
    [[nodiscard]] const Camera& camera() const { return scene.cameras.front(); }
};

using Targets = std::vector<std::unique_ptr<KnownTarget>>;

Result<Targets> known_targets(const ConsistencyOptions& o) {
    Targets targets;
    std::vector<std::string> names = o.targets;
    if (names.empty())
        for (const std::string_view name : consistency_targets()) names.emplace_back(name);
    for (const std::string& name : names) {
        auto scene = consistency_scene(name, o.size);
        if (!scene) return scene.error();
        targets.push_back(std::make_unique<KnownTarget>(*std::move(scene), o.told));
    }
    return targets;
}

class Campaign {
public:
    Campaign(const ConsistencyOptions& o, Targets targets) : o_(o), targets_(std::move(targets)) {
        for (const std::string_view c : kConsistencyConditions)
            if (std::ranges::find(o.conditions, c) != o.conditions.end() ||
                (o.conditions.empty() && (c != kWrong || targets_.size() > 1)))
                conditions_.push_back(c);
        for (const UntoldError& e : untold_errors())
            if (std::ranges::find(o.untold, e.name) != o.untold.end() ||
                (e.name != kNothing && std::ranges::find(o.untold, kAll) != o.untold.end()))
                untold_.push_back(&e);
    }

    ConsistencyRow trial(const std::string& method, int number) {
        Draw d{std::mt19937_64(o_.seed * 1'000'003 + static_cast<std::uint64_t>(number))};
        d.random.discard(16);
        ConsistencyRow row;
        row.method = method;
        KnownTarget& target = *targets_[d.index(targets_.size())];
        row.condition = conditions_[d.index(conditions_.size())];
        row.target = method == "points" ? "random points" : target.scene.name;
        const bool lidar = method == "icp" || method == "icp-search";
        Untold untold;
        if (!untold_.empty()) {
            untold = {untold_[d.index(untold_.size())], d.index(3)};
            row.condition = kPlain;
        }
        const Rigid3 truth = pose(target.radius_m, row.condition, lidar, d);
        const TrialResult out = method == "points" ? points(row.condition, d)
                                : lidar            ? sweep(target, method, row.condition, truth, d)
                                                   : frame(target, method, row.condition, untold, truth, d);
        if (untold.error) row.condition = untold.name();
        ++row.answers[static_cast<std::size_t>(out.answer.kind)];
        if (out.answer.kind != AnswerKind::good) return row;
        const Vector6 error = error_between(out.T, method == "points" ? points_truth_ : truth);
        row.nees.push_back(normalised_error_squared(error, out.covariance));
        row.rotation_rad.push_back(error.head<3>().norm());
        row.position_of_range.push_back(error.tail<3>().norm() / norm(out.T.t));
        if (!(row.nees.back() <= kSixSigmaNees)) ++row.beyond, row.beyond_trials.push_back(number);
        return row;
    }

private:
    /// An error in one of its sizes; none without one.
    struct Untold {
        const UntoldError* error = nullptr;
        std::size_t size = 0;

        [[nodiscard]] double amount() const { return error->sizes[size]; }
        [[nodiscard]] std::string name() const {
            return amount() == 0 ? std::string(error->name)
                                 : fmt::format("{} {:g} {}", error->name, amount(), error->unit);
        }
    };
    /// Aimed nearly at the target, from 3 to 8 radii; `far`: from 15 to 40; `beside`: half of it is outside the
    /// image.
    [[nodiscard]] Rigid3 pose(double radius_m, std::string_view condition, bool lidar, Draw& d) const {
        const double range_m = condition == "far" ? d.uniform(15, 40) * radius_m : d.uniform(3, 8) * radius_m;
        const double half_view = 0.5 / 1.6;
        double right = d.uniform(-0.05, 0.05), down = d.uniform(-0.05, 0.05);
        if (condition == "beside") right += half_view;
        const Vec3 aim = lidar ? Vec3{right, 1, down} : Vec3{right, down, 1};
        return {d.attitude(), range_m * normalized(aim)};
    }
    [[nodiscard]] Rigid3 start(const Rigid3& truth, Draw& d) const {
        return displaced(truth, random_error(d.uniform(0, o_.start_deg) * kDegree,
                                             d.uniform(0, 0.01 * o_.start_percent) * norm(truth.t), d.random));
    }
    [[nodiscard]] ApparentMotion motion(Draw& d) const {
        const auto within = [&](double most) {
            const double x = d.uniform(-most, most), y = d.uniform(-most, most), z = d.uniform(-most, most);
            return Vec3{x, y, z};
        };
        return {within(0.1), within(0.02)};
    }
    KnownTarget& another(const KnownTarget& target, Draw& d) {
        std::size_t index = 0;
        while (targets_[index].get() != &target) ++index;
        return *targets_[(index + 1 + d.index(targets_.size() - 1)) % targets_.size()];
    }

    TrialResult frame(KnownTarget& target, const std::string& method, std::string_view condition,
                      const Untold& untold, const Rigid3& truth, Draw& d) {
        const WorldErrors errors = WorldErrors::draw(o_.world, o_.distortion, d);
        const ApparentMotion moving = motion(d);
        const KnownTarget& shown = condition == kWrong ? another(target, d) : target;
        TrueWorld world{.scene = errors.applied(shown.scene),
                        .camera = {},
                        .T_camera_target = errors.seen(truth, moving),
                        .target_radius_m = shown.radius_m};
        Camera camera = world.scene.cameras.front();
        if (condition == "bright") camera.detector->exposure_s *= d.uniform(5, 40);
        if (condition == "dark") camera.detector->exposure_s /= d.uniform(5, 40);
        world.camera = camera;
        if (condition == "blurred")
            world.camera.optics.point_spread = PointSpreadFunction{.sigma_px = d.uniform(0.5, 2)};
        if (errors.distortion != 0)
            world.camera.model =
                make_projection({&kBrownConrady, paraxial_pinhole(*camera.model), {errors.distortion, 0, 0, 0}});
        if (untold.error) untold.error->apply(world, untold.amount(), d.random);
        std::optional<RenderScene> differs;
        if (errors.any_of_scene() || untold.error) differs.emplace(*RenderScene::create(world.scene));
        ModelView view(differs ? *differs : shown.render_scene, world.camera, 0, BodyPoses(1));
        view.begin_frame(BodyPoses(1), world.motion, row_times(world.camera));
        world.settings.seed = d.random();
        world.settings.spp = 64;
        view.render(world.T_camera_target, world.settings, false);
        RadianceImage light = view.radiance();
        world.apply_gain(light);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(world.camera, light, d.random(), 0, bytes);
        const auto image = measured_image(camera, bytes);
        const Rigid3 guess = start(truth, d);
        if (method == "features") {
            target.features->set_detector(*camera.detector);
            const FeatureEstimate e = target.features->align(*image, BodyPoses(1), guess, moving);
            return {e.answer, e.T_camera_target, e.covariance};
        }
        std::vector<float> variance;  // unknown with an untold error, as in `narpa estimate`
        DenseOptions dense;
        if (!untold.error) {
            variance = sampling_variance(view, world.T_camera_target, world.settings, d.random);
            dense.samples_per_pixel = 32;
        }
        dense.fineness = 4;
        dense.model = o_.told;
        dense.guess_error = {o_.start_deg * kDegree, 0.01 * o_.start_percent};
        dense.motion = moving;
        target.dense->set_detector(*camera.detector);
        const auto e = target.dense->align(*image, BodyPoses(1), guess, dense, variance);
        return {e->answer, e->T_camera_body, e->covariance};
    }

    /// A VLP-16 at 10 turns a second. `bright`: a tenth of the points are on another object in front; `dark`: most
    /// are not returned; `blurred`: twice the noise that the estimator is told; `beside`: half of the target is cut
    /// off.
    TrialResult sweep(KnownTarget& target, const std::string& method, std::string_view condition,
                      const Rigid3& truth, Draw& d) {
        const WorldErrors world = WorldErrors::draw(o_.world, 0, d);
        const ApparentMotion moving = motion(d);
        const KnownTarget& shown = condition == kWrong ? another(target, d) : target;
        std::optional<RenderScene> differs;
        const Scene scene = world.applied(shown.scene);
        if (world.any_of_scene()) differs.emplace(*RenderScene::create(scene));
        const Tracer& tracer = differs ? differs->tracer() : shown.render_scene.tracer();
        const Rigid3 middle = world.seen(truth, moving);
        constexpr double kStep = 0.2 * kDegree;
        const double distance_m = norm(truth.t), reach_m = tracer.bounding_radius_m(0);
        const int columns = static_cast<int>((std::asin(std::min(0.9, reach_m / distance_m)) + 0.1) / kStep);
        const double sigma_m = condition == "blurred" ? 2 * kRangeNoise.range_m : kRangeNoise.range_m;
        LidarSweep seen;
        BodyPoses at(1);
        for (int column = -columns; column <= (condition == "beside" ? 0 : columns); ++column)
            for (int line = 0; line < 16; ++line) {
                const double t_s = 0.2 * column / 3600, w = (2 * line - 15) * kDegree;
                const double a = std::atan2(truth.t.x, truth.t.y) + kStep * column;
                const Vec3 beam{std::cos(w) * std::sin(a), std::cos(w) * std::cos(a), std::sin(w)};
                at.set(0, moved(middle, moving, t_s));
                const Hit hit = tracer.intersect(at, {{}, beam}, 200);
                if (hit.body < 0 || (condition == "dark" && d.uniform(0, 1) < 0.8)) {
                    seen.empty.push_back({{}, beam, t_s});
                    continue;
                }
                double range_m = hit.range_m + world.range_bias_m + sigma_m * d.normal();
                if (condition == "bright" && d.uniform(0, 1) < 0.1) range_m *= d.uniform(0.5, 0.95);
                seen.points.push_back({{}, beam, range_m, t_s});
            }
        const double search_m = 0.01 * o_.start_percent * distance_m + o_.start_deg * kDegree * reach_m;
        const auto e = method == "icp-search"
                           ? target.icp_search->find(seen.points, moving, seen.empty)
                           : target.icp->align(seen.points, moving, start(truth, d), search_m, seen.empty);
        if (!e) return {};
        return {e->answer, e->T_lidar_target, e->covariance};
    }

    /// 4 to 30 points of a random body. `bright`: a fifth belong to other pixels, which RANSAC is asked to find;
    /// `dark`: 4 points; `blurred`: twice the noise that is told; `beside`: all in a plane; `wrong`: pixels of
    /// another body.
    TrialResult points(std::string_view condition, Draw& d) {
        const WorldErrors world = WorldErrors::draw(o_.world, 0, d);
        const std::size_t n = condition == "dark" ? 4 : 5 + d.index(26);
        const double sigma_px = std::pow(10, d.uniform(-9, 0.5));
        const Pinhole believed{1300, 1300, 249.5, 249.5};
        const double range_m = condition == "far" ? d.uniform(30, 80) : d.uniform(4, 20);
        points_truth_ = {d.attitude(), range_m * normalized(Vec3{d.uniform(-0.1, 0.1), d.uniform(-0.1, 0.1), 1})};
        const ApparentMotion moving = motion(d);
        const Rigid3 seen = world.seen(points_truth_, moving);
        std::vector<Vec3> body;
        std::vector<Pixel> pixels;
        for (std::size_t i = 0; i < n; ++i) {
            const double z = condition == "beside" ? 0 : d.uniform(-1, 1);
            body.push_back({d.uniform(-1, 1), d.uniform(-1, 1), z});
            Vec3 there = world.scale * body.back() + world.mesh_m;
            if (condition == kWrong) there = {d.uniform(-1, 1), d.uniform(-1, 1), d.uniform(-1, 1)};
            const Vec3 p = seen * there;
            const double noise = condition == "blurred" ? 2 * sigma_px : sigma_px;
            pixels.push_back({world.focal * believed.fx * p.x / p.z + believed.cx + noise * d.normal(),
                              world.focal * believed.fy * p.y / p.z + believed.cy + noise * d.normal()});
            if (condition == "bright" && i % 5 == 4) pixels.back() = {d.uniform(0, 500), d.uniform(0, 500)};
        }
        const PnpInput input{&believed, body, pixels, sigma_px};
        const PnpSolution& s = solver_.solve(input, condition == "bright");
        if (!s.ok()) return {s.answer()};
        const Matrix6 by_model = covariance_by(
            image_shifts(o_.told, s.fit.T_camera_body, moving, shift_by_focal(input, s.fit.T_camera_body)));
        return {s.answer(), s.fit.T_camera_body, s.fit.covariance + by_model};
    }

    const ConsistencyOptions& o_;
    Targets targets_;
    std::vector<std::string_view> conditions_;
    std::vector<const UntoldError*> untold_;
    PnpSolver solver_{64};
    Rigid3 points_truth_{};
};

}  // namespace

void ConsistencyRow::add(const ConsistencyRow& other) {
    for (std::size_t i = 0; i < answers.size(); ++i) answers[i] += other.answers[i];
    beyond += other.beyond;
    nees.insert(nees.end(), other.nees.begin(), other.nees.end());
    rotation_rad.insert(rotation_rad.end(), other.rotation_rad.begin(), other.rotation_rad.end());
    position_of_range.insert(position_of_range.end(), other.position_of_range.begin(),
                             other.position_of_range.end());
    beyond_trials.insert(beyond_trials.end(), other.beyond_trials.begin(), other.beyond_trials.end());
}

Result<std::vector<ConsistencyRow>> run_consistency(const ConsistencyOptions& o, int first, TracingThreads& threads,
                                                    const std::function<void(const std::string&)>& progress,
                                                    const StopFlag& stop) {
    auto targets = known_targets(o);
    if (!targets) return targets.error();
    if (targets->size() < 2 && std::ranges::find(o.conditions, kWrong) != o.conditions.end())
        return Error{"condition \"wrong\" shows another target, expected at least two targets"};
    for (const std::string& method : o.methods)
        if (!o.untold.empty() && method != "dense" && method != "features")
            return Error{
                fmt::format("untold errors are those of frames, expected dense or features, not \"{}\"", method)};
    Campaign campaign(o, *std::move(targets));
    std::map<std::array<std::string, 3>, ConsistencyRow> rows;
    for (const std::string& method : o.methods)
        for (int k = first; k < first + o.trials && !stop; ++k) {
            progress(method + ": trial " + std::to_string(k));
            ConsistencyRow row;
            threads.arena.execute([&] { row = campaign.trial(method, k); });
            ConsistencyRow& to = rows[{row.method, row.target, row.condition}];
            to.method = row.method, to.target = row.target, to.condition = row.condition;
            to.add(row);
        }
    std::vector<ConsistencyRow> out;
    for (auto& [key, row] : rows) out.push_back(std::move(row));
    return out;
}

}  // namespace narpa
