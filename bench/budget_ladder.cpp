#include "bench/budget_ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>

#include "emulator/clock.h"
#include "renderer/camera/detector.h"

namespace narpa {
namespace {

constexpr int kReferencePictures = 16;  // their scatter tells the reference's own noise

/// The mean of the bands in each of them: what a monochrome sensor weighs.
void grey(std::vector<Rgb>& pixels) {
    for (Rgb& p : pixels) {
        const float m = mean_band(p);
        p = {m, m, m};
    }
}

/// One rung in the making.
struct Climber {
    Climber(Rung rung_, const FrameSettings& settings_, const PictureMean& reference)
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
FrameAccount render(View& v, Climber& c, const ReferenceLoop* loop, std::uint32_t number) {
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
double seconds_since(std::int64_t start_ns) {
    return static_cast<double>(monotonic_ns() - start_ns) * 1e-9;
}

void expose(View& v, const FrameSettings& s) {
    const std::int64_t start_ns = monotonic_ns();
    v.threads.arena.execute([&] { expose(v.camera, v.image, s.seed, s.frame, v.bytes); });
    v.detector_s.push_back(seconds_since(start_ns));
}

void measure(View& v, Climber& c, const ReferenceLoop* loop, std::uint32_t number, int frames) {
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

PictureMean reference_of(View& v, FrameSettings settings, int spp,
                         const std::function<void(const std::string&)>& tell) {
    PictureMean mean(v.image.pixels.size());
    settings.spp = std::max(2, spp / kReferencePictures);
    ++settings.seed;  // shares no random numbers with what is measured
    CameraRenderer renderer(v.world.render_scene(), v.camera);
    for (std::uint32_t k = 0; k < kReferencePictures; ++k) {
        tell(fmt::format("reference {}/{}", k, kReferencePictures));
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

Ladder climb(const World& world, std::size_t camera_index, const LadderSettings& s, const ReferenceLoop* loop,
             TracingThreads& threads, const std::function<void(const std::string&)>& tell) {
    const Camera& camera = world.scene().cameras[camera_index];
    View v{world, camera, BodyPoses(world.scene().bodies.size()), {}, {camera.width, camera.height}, threads};
    world.place(s.t_ns, camera.mount, v.at);
    v.T_world_camera = world.sensor_pose(camera.mount, camera.T_mount_camera, v.at);
    const RenderSettings& render_settings = world.scene().render;
    FrameSettings base;
    base.seed = render_settings.seed;
    base.method = render_settings.method;
    base.max_depth = render_settings.max_depth;
    const PictureMean reference = reference_of(v, base, s.reference_spp, tell);

    std::vector<Climber> climbers;
    const auto add = [&](Rung rung, const FrameSettings& settings) {
        climbers.emplace_back(std::move(rung), settings, reference);
        if (!climbers.back().rung.loop)
            climbers.back().renderer = std::make_unique<CameraRenderer>(world.render_scene(), camera);
    };
    const auto named = [](std::string name, bool is_loop, bool adaptive) {
        Rung rung;
        rung.name = std::move(name), rung.loop = is_loop, rung.adaptive = adaptive;
        return rung;
    };
    for (const int spp : s.spp) {
        FrameSettings settings = base;
        settings.spp = spp;
        settings.times = true;
        add(named(fmt::format("{} spp", spp), false, false), settings);
    }
    for (const double per_pixel : s.rays_per_pixel) {
        FrameSettings settings = base;
        settings.times = true;
        settings.budget.kind = FrameBudget::Kind::rays;
        settings.budget.rays = static_cast<std::uint64_t>(per_pixel * camera.width * camera.height);
        add(named(fmt::format("{:g} rays/px", per_pixel), false, true), settings);
    }
    for (const int spp : loop != nullptr ? s.loop_spp : std::vector<int>{}) {
        FrameSettings settings = base;
        settings.spp = spp;
        add(named(fmt::format("loop {} spp", spp), true, false), settings);
    }

    v.bytes.resize(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    for (Climber& c : climbers) render(v, c, loop, 0);  // takes its memory
    std::uint32_t number = 1;
    for (int k = 0; k < s.frames; ++k)
        for (Climber& c : climbers) {
            tell(fmt::format("{} {}/{}", c.rung.name, k, s.frames));
            measure(v, c, loop, number++, s.frames);
        }

    Ladder ladder{reference.level().value, std::sqrt(reference.variance_of_mean()), median(v.detector_s), {}};
    for (Climber& c : climbers) {
        const ErrorRow row = c.error.row(c.settings.spp);
        c.rung.rmse = row.rmse;
        c.rung.bias = row.bias;
        if (c.predicts && !c.rung.loop) c.rung.predicted = std::sqrt(c.predicted_squares);
        ladder.rungs.push_back(std::move(c.rung));
    }
    return ladder;
}

std::optional<double> speed_up(const Ladder& ladder, const Rung& rung, TimeBy by) {
    const auto seconds = [&](const Rung& r) { return by == TimeBy::wall ? r.median_s() : r.median_cpu_s(); };
    std::vector<std::array<double, 2>> line;  // of the loop: log error, log time
    for (const Rung& r : ladder.rungs)
        if (r.loop && r.rmse.value > 0) line.push_back({std::log(r.rmse.value), std::log(seconds(r))});
    if (rung.rmse.value <= 0) return {};
    const double wanted = std::log(rung.rmse.value);
    for (std::size_t k = 1; k < line.size(); ++k) {
        const auto& [e0, t0] = line[k - 1];
        const auto& [e1, t1] = line[k];
        if ((wanted > e0) == (wanted > e1) || e0 == e1) continue;
        return std::exp(t0 + (t1 - t0) * (wanted - e0) / (e1 - e0)) / seconds(rung);
    }
    return {};
}

std::optional<SpeedUps> speed_ups(const Ladder& ladder, bool adaptive, TimeBy by, double rays_least) {
    std::vector<double> all;
    for (const Rung& r : ladder.rungs)
        if (!r.loop && r.adaptive == adaptive && r.knows_its_error() && r.rays >= rays_least)
            if (const auto s = speed_up(ladder, r, by)) all.push_back(*s);
    if (all.empty()) return {};
    const auto [least, most] = std::minmax_element(all.begin(), all.end());
    return SpeedUps{median(all), *least, *most, all.size()};
}

}  // namespace narpa
