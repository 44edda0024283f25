#include "bench/estimation/cold.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "bench/estimation/consistency_scenes.h"
#include "bench/statistics.h"
#include "estimator/search/pose_search.h"
#include "estimator/search/template_matcher.h"
#include "estimator/uncertainty/observed_error.h"
#include "renderer/detector/detector.h"
#include "tracking/estimate_report.h"

namespace narpa {
namespace {

constexpr double kNearest_radii = 3, kFurthest_radii = 8;
constexpr double kOffAxis = 0.05;  ///< tangent of the direction to the target, at most
constexpr int kFrameSpp = 64;

struct ColdDraw {
    std::mt19937_64 random;
    double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }
    double normal() { return std::normal_distribution<double>()(random); }
    Quat attitude() {
        const double w = normal(), x = normal(), y = normal(), z = normal();
        return normalized(Quat{w, x, y, z});
    }
};

/// A target and the search that knows it.
struct ColdTarget {
    Scene scene;
    RenderScene render_scene;
    std::size_t body;
    PoseSearch search;

    ColdTarget(Scene s, std::size_t target)
        : scene(std::move(s)),
          render_scene(*RenderScene::create(scene)),
          body(target),
          search(render_scene, scene.cameras.front(), body) {}
};

Result<std::unique_ptr<ColdTarget>> cold_target(const std::string& name, const Scene& docking, int size) {
    for (std::size_t i = 0; i < docking.bodies.size(); ++i) {
        if (docking.bodies[i].name != name) continue;
        Scene scene = docking;
        Camera& c = scene.cameras.front();
        const double factor = static_cast<double>(size) / std::max(c.width, c.height);
        c = scaled(c, factor, factor);
        return std::make_unique<ColdTarget>(std::move(scene), i);
    }
    auto scene = consistency_scene(name, size);
    if (!scene) return scene.error();
    return std::make_unique<ColdTarget>(*std::move(scene), 0);
}

/// The shortest rotation from one unit vector to another.
Quat turn_between(const Vec3& from, const Vec3& to) {
    const Vec3 axis = cross(from, to);
    const double sine = norm(axis), angle = std::atan2(sine, dot(from, to));
    if (sine < 1e-12)
        return angle < 1 ? Quat{} : exp_rotation(std::numbers::pi * normalized(cross(from, {1, 0.3, 0.2})));
    return exp_rotation(angle / sine * axis);
}

ColdTrial cold_trial(ColdTarget& target, const ColdOptions& o, ColdDraw& d) {
    ColdTrial out;
    out.target = target.scene.bodies[target.body].name;
    const Camera& camera = target.scene.cameras.front();
    out.range_in_radii = d.uniform(kNearest_radii, kFurthest_radii);
    const double right = d.uniform(-kOffAxis, kOffAxis), down = d.uniform(-kOffAxis, kOffAxis);
    const Tracer& tracer = target.render_scene.tracer();
    const double distance_m = out.range_in_radii * apparent_radius_m(tracer, target.body);
    Rigid3 truth{d.attitude(), {}};
    truth.t = distance_m * normalized(Vec3{right, down, 1}) - truth.q * tracer.bounds(target.body).centre_m;
    const double range_m = norm(truth.t);
    // The direction to the Sun is uniform over a cap about the direction from the target to the camera.
    const double cosine = d.uniform(std::cos(o.phase_deg * kDegree), 1),
                 around = d.uniform(0, 2 * std::numbers::pi);
    out.phase_deg = std::acos(cosine) / kDegree;
    const double sine = std::sqrt(1 - cosine * cosine);
    const Vec3 sun = turn_between({0, 0, -1}, -normalized(truth.t)) *
                     Vec3{sine * std::cos(around), sine * std::sin(around), -cosine};
    const Rigid3 T_world_camera{turn_between(sun, target.scene.sun->direction), {}};
    BodyPoses at(target.scene.bodies.size());
    at.set(target.body, T_world_camera * truth);
    const double guess_m = range_m * (1 + o.range_part * d.uniform(-1, 1));

    ModelView view(target.render_scene, camera, target.body, at);
    FrameSettings settings;
    settings.seed = d.random();
    settings.spp = kFrameSpp;
    view.render(truth, settings, false);
    std::vector<std::uint8_t> bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    expose(camera, view.radiance(), d.random(), 0, bytes);
    const auto image = measured_image(camera, bytes);
    std::vector<float> variance;
    if (o.noise_known) variance = sampling_variance(view, truth, settings, d.random);

    SearchOptions search;
    // A guess of (1 - p) times the truth has the truth at 1 / (1 - p) = 1 + p / (1 - p) times itself.
    search.range_m = guess_m;
    search.range_part = o.range_part / (1 - o.range_part);
    search.dense.samples_per_pixel = 12, search.dense.fineness = 4;
    BodyPoses unknown = at;
    unknown.set(target.body, {});
    const double before_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID);
    const auto e = target.search.find(*image, unknown, T_world_camera, search, variance);
    out.cpu_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID) - before_s;
    if (!e) {
        out.why = e.error().what;
        return out;
    }
    out.answer = e->answer.kind, out.why = e->answer.why;
    out.templates = e->templates, out.renders = e->renders;
    const Vector6 error = error_between(e->T_camera_target, truth);
    out.nees = observed_error(e->T_camera_target, e->covariance, e->answer, truth).squared;
    out.rotation_rad = error.head<3>().norm(), out.position_of_range = error.tail<3>().norm() / range_m;
    return out;
}

}  // namespace

bool ColdTrial::wrong() const {
    return answer == AnswerKind::good && !(nees <= kSixSigmaNees);
}

Result<std::vector<ColdTrial>> run_cold(const ColdOptions& o, const Scene& docking, int first,
                                        TracingThreads& threads,
                                        const std::function<void(const ColdTrial&)>& progress,
                                        const StopFlag& stop) {
    std::vector<std::unique_ptr<ColdTarget>> targets;
    for (const std::string& name : o.targets) {
        auto target = cold_target(name, docking, o.size);
        if (!target) return target.error();
        targets.push_back(*std::move(target));
    }
    std::vector<ColdTrial> trials;
    for (int k = first; k < first + o.trials && !stop; ++k) {
        ColdDraw d{std::mt19937_64(o.seed * 1'000'003 + static_cast<std::uint64_t>(k))};
        d.random.discard(16);
        ColdTarget& target = *targets[static_cast<std::size_t>(k) % targets.size()];
        threads.arena.execute([&] { trials.push_back(cold_trial(target, o, d)); });
        trials.back().number = k;
        progress(trials.back());
    }
    return trials;
}

nlohmann::json to_json(const std::vector<ColdTrial>& trials) {
    nlohmann::json all = nlohmann::json::array();
    for (const ColdTrial& t : trials)
        all.push_back({{"trial", t.number},
                       {"target", t.target},
                       {"answer", kAnswerKinds[static_cast<std::size_t>(t.answer)]},
                       {"why", t.why},
                       {"wrong", t.wrong()},
                       {"range_in_radii", t.range_in_radii},
                       {"phase_deg", t.phase_deg},
                       {"nees", std::isfinite(t.nees) ? nlohmann::json(t.nees) : nlohmann::json(nullptr)},
                       {"error_rotation_rad", t.rotation_rad},
                       {"error_position_of_range", t.position_of_range},
                       {"cpu_s", t.cpu_s},
                       {"templates", t.templates},
                       {"renders", t.renders}});
    return all;
}

std::string to_text(const std::vector<ColdTrial>& trials) {
    std::string out = fmt::format("{:<12} {:>7} {:>9} {:>7} {:>7} {:>8} {:>6} {:>6} {:>7} {:>9} {:>9} {:>14}\n",
                                  "cold start", "trials", "acquired", "ambig.", "unobs.", "refused", "wrong",
                                  "NEES", "median", "RMS deg", "% range", "CPU s: median");
    std::map<std::string, std::vector<const ColdTrial*>> by_target;
    for (const ColdTrial& t : trials) by_target[t.target].push_back(&t), by_target["all"].push_back(&t);
    for (const auto& [name, rows] : by_target) {
        std::array<int, kAnswerKinds.size()> answers{};
        int wrong = 0;
        Mean nees, turn, shift;
        std::vector<double> all_nees, times;
        for (const ColdTrial* t : rows) {
            ++answers[static_cast<std::size_t>(t->answer)];
            wrong += t->wrong();
            times.push_back(t->cpu_s);
            if (t->answer != AnswerKind::good) continue;
            nees.add(std::min(t->nees, kSixSigmaNees)), all_nees.push_back(t->nees);
            turn.add(t->rotation_rad), shift.add(t->position_of_range);
        }
        out += fmt::format(
            "{:<12} {:>7} {:>9} {:>7} {:>7} {:>8} {:>6} {:>6.2f} {:>7.2f} {:>9.4f} {:>9.4f} {:>14.2f}\n", name,
            rows.size(), answers[0] - wrong, answers[1], answers[2], answers[3], wrong, nees.mean(),
            quantile(all_nees, 0.5), turn.rms() / kDegree, 100 * shift.rms(), quantile(times, 0.5));
    }
    return out;
}

}  // namespace narpa
