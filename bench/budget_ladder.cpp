#include "bench/budget_ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>

#include "base/time.h"
#include "renderer/camera/detector.h"

namespace narpa {
namespace {

constexpr int kReferenceImages = 16;  // their scatter gives the reference's own noise

/// Replaces the bands by their mean.
void grey(std::vector<Rgb>& pixels) {
    for (Rgb& p : pixels) {
        const float m = mean_band(p);
        p = {m, m, m};
    }
}

/// One rung while it is measured.
struct Candidate {
    Candidate(Rung rung_, const FrameSettings& settings_, const ImageMean& reference)
        : rung(std::move(rung_)), settings(settings_), error(reference) {}
    Rung rung;
    FrameSettings settings;
    ErrorAgainst error;
    std::unique_ptr<CameraRenderer> renderer{};  ///< null: the plain loop
    double predicted_squares = 0;
    bool predicts = true;  ///< all frames so far
};

struct View {
    const World& world;
    const Camera& camera;
    BodyPoses at;
    Rigid3 T_world_camera;
    RadianceImage image;
    TracingThreads& threads;
    std::vector<std::uint8_t> bytes{};
    std::vector<double> detector_s{};
};

/// Renders frame `number`; returns its account, of the loop the rays alone.
FrameAccount render(View& v, Candidate& c, const ReferenceLoop* loop, std::uint32_t number) {
    c.settings.frame = number;
    FrameAccount account;
    v.threads.arena.execute([&] {
        if (c.renderer)
            account = c.renderer->render(v.at, v.T_world_camera, c.settings, v.image);
        else
            account.rays = loop->render(v.camera, v.T_world_camera, c.settings, v.image);
    });
    return account;
}

/// Of all threads.
double cpu_s() {
    timespec t{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
void expose(View& v, const FrameSettings& s) {
    const std::int64_t start_ns = monotonic_ns();
    v.threads.arena.execute([&] { expose(v.camera, v.image, s.seed, s.frame, v.bytes); });
    v.detector_s.push_back(seconds_since(start_ns));
}

void measure(View& v, Candidate& c, const ReferenceLoop* loop, std::uint32_t number, int frames) {
    const std::int64_t start_ns = monotonic_ns();
    const double cpu_start_s = cpu_s();
    const FrameAccount account = render(v, c, loop, number);
    c.rung.seconds.push_back(seconds_since(start_ns));
    c.rung.cpu_seconds.push_back(cpu_s() - cpu_start_s);
    if (!c.rung.loop) expose(v, c.settings);
    c.rung.step = std::max(c.rung.step, account.step);
    c.rung.rays += static_cast<double>(account.rays) / frames;
    c.rung.samples += static_cast<double>(account.samples) / frames;
    for (std::size_t k = 0; k < kPhases; ++k) c.rung.phase_ns[k] += account.phase_ns[k] / frames;
    c.predicts = c.predicts && account.standard_error >= 0;
    c.predicted_squares += account.standard_error * account.standard_error / frames;
    grey(v.image.pixels);
    c.error.add(v.image.pixels);
}

ImageMean reference_of(View& v, FrameSettings settings, int spp,
                       const std::function<void(const std::string&)>& progress) {
    ImageMean mean(v.image.pixels.size());
    settings.spp = std::max(2, spp / kReferenceImages);
    ++settings.seed;  // shares no random numbers with what is measured
    CameraRenderer renderer(v.world.render_scene(), v.camera);
    for (std::uint32_t k = 0; k < kReferenceImages; ++k) {
        progress(fmt::format("reference {}/{}", k, kReferenceImages));
        settings.frame = k;
        v.threads.arena.execute([&] { renderer.render(v.at, v.T_world_camera, settings, v.image); });
        grey(v.image.pixels);
        mean.add(v.image.pixels);
    }
    return mean;
}

}  // namespace

double median(std::vector<double> values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    if (values.size() % 2 == 1) return *middle;
    return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

double Rung::median_s() const {
    return median(seconds);
}
double Rung::median_cpu_s() const {
    return median(cpu_seconds);
}

Ladder measure_ladder(const World& world, std::size_t camera_index, const LadderSettings& s,
                      const ReferenceLoop* loop, TracingThreads& threads,
                      const std::function<void(const std::string&)>& progress) {
    const Camera& camera = world.scene().cameras[camera_index];
    View v{world, camera, BodyPoses(world.scene().bodies.size()), {}, {camera.width, camera.height}, threads};
    world.place(s.t_ns, camera.mount, v.at);
    v.T_world_camera = world.sensor_pose(camera.mount, camera.T_mount_camera, v.at);
    const RenderSettings& render_settings = world.scene().render;
    FrameSettings base;
    base.seed = render_settings.seed;
    base.method = render_settings.method;
    base.max_depth = render_settings.max_depth;
    const ImageMean reference = reference_of(v, base, s.reference_spp, progress);

    std::vector<Candidate> candidates;
    const auto add = [&](Rung rung, const FrameSettings& settings) {
        candidates.emplace_back(std::move(rung), settings, reference);
        if (!candidates.back().rung.loop)
            candidates.back().renderer = std::make_unique<CameraRenderer>(world.render_scene(), camera);
    };
    const auto named = [](std::string name, bool is_loop, bool adaptive) {
        Rung rung;
        rung.name = std::move(name), rung.loop = is_loop, rung.adaptive = adaptive;
        return rung;
    };
    const auto add_spp = [&](int spp, const NamedMechanism* off = nullptr) {
        Rung rung = named(fmt::format("{} spp", spp), false, false);
        FrameSettings settings = base;
        settings.spp = spp;
        settings.times = true;
        if (off != nullptr) settings.mechanisms.*off->on = false, rung.without = off->name;
        add(std::move(rung), settings);
    };
    const auto add_rays = [&](double per_pixel, const NamedMechanism* off = nullptr) {
        Rung rung = named(fmt::format("{:g} rays/px", per_pixel), false, true);
        FrameSettings settings = base;
        settings.times = true;
        settings.budget.kind = FrameBudget::Kind::rays;
        settings.budget.rays = static_cast<std::uint64_t>(per_pixel * camera.width * camera.height);
        if (off != nullptr) settings.mechanisms.*off->on = false, rung.without = off->name;
        add(std::move(rung), settings);
    };
    for (const int spp : s.spp) add_spp(spp);
    for (const double per_pixel : s.rays_per_pixel) add_rays(per_pixel);
    for (const NamedMechanism& m : kMechanisms)
        if (std::find(s.without.begin(), s.without.end(), m.name) != s.without.end()) {
            if (!s.spp.empty())
                add_spp(s.spp[s.spp.size() / 2], &m);
            else
                add_rays(s.rays_per_pixel[s.rays_per_pixel.size() / 2], &m);
        }
    for (const int spp : loop != nullptr ? s.loop_spp : std::vector<int>{}) {
        FrameSettings settings = base;
        settings.spp = spp;
        add(named(fmt::format("loop {} spp", spp), true, false), settings);
    }

    v.bytes.resize(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    for (Candidate& c : candidates) render(v, c, loop, 0);  // the first frame allocates
    std::uint32_t number = 1;
    for (int k = 0; k < s.frames; ++k)
        for (Candidate& c : candidates) {
            progress(fmt::format("{} {}/{}", c.rung.name, k, s.frames));
            measure(v, c, loop, number++, s.frames);
        }

    Ladder ladder{reference.level().value, std::sqrt(reference.variance_of_mean()), median(v.detector_s), {}};
    for (Candidate& c : candidates) {
        const ErrorRow row = c.error.row(c.settings.spp);
        c.rung.rmse = row.rmse;
        c.rung.bias = row.bias;
        if (c.predicts && !c.rung.loop) c.rung.predicted = std::sqrt(c.predicted_squares);
        ladder.rungs.push_back(std::move(c.rung));
    }
    return ladder;
}

namespace {

/// Logarithms of error and time of some rungs.
using Line = std::vector<std::array<double, 2>>;
double time_at(const Line& line, std::size_t k, double error) {
    const auto& [e0, t0] = line[k - 1];
    const auto& [e1, t1] = line[k];
    return std::exp(t0 + (t1 - t0) * (error - e0) / (e1 - e0));
}

}  // namespace

std::optional<double> speed_up(const Ladder& ladder, const Rung& rung, TimeBy by) {
    const auto seconds = [&](const Rung& r) { return by == TimeBy::wall ? r.median_s() : r.median_cpu_s(); };
    Line line;
    for (const Rung& r : ladder.rungs)
        if (r.loop && r.rmse.value > 0) line.push_back({std::log(r.rmse.value), std::log(seconds(r))});
    if (rung.rmse.value <= 0) return {};
    const double error = std::log(rung.rmse.value);
    for (std::size_t k = 1; k < line.size(); ++k) {
        const double e0 = line[k - 1][0], e1 = line[k][0];
        if ((error > e0) == (error > e1) || e0 == e1) continue;
        return time_at(line, k, error) / seconds(rung);
    }
    return {};
}

std::optional<double> cost_at_equal_error(const Ladder& ladder, const Rung& rung) {
    Line line;
    for (const Rung& r : ladder.rungs)
        if (!r.loop && r.without.empty() && r.rmse.value > 0)
            line.push_back({std::log(r.rmse.value), std::log(r.median_cpu_s())});
    std::sort(line.begin(), line.end(), std::greater<>());
    if (line.size() < 2 || rung.rmse.value <= 0) return {};
    const double error = std::log(rung.rmse.value);
    std::size_t k = 1;
    while (k + 1 < line.size() && error < line[k][0]) ++k;
    if (line[k - 1][0] == line[k][0]) return {};
    return rung.median_cpu_s() / time_at(line, k, error);
}

std::optional<SpeedUps> speed_ups(const Ladder& ladder, bool adaptive, TimeBy by, double rays_least) {
    std::vector<double> all;
    for (const Rung& r : ladder.rungs)
        if (!r.loop && r.adaptive == adaptive && r.estimates_error() && r.rays >= rays_least)
            if (const auto s = speed_up(ladder, r, by)) all.push_back(*s);
    if (all.empty()) return {};
    const auto [least, most] = std::minmax_element(all.begin(), all.end());
    return SpeedUps{median(all), *least, *most, all.size()};
}

}  // namespace narpa
