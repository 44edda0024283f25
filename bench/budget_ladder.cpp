#include "bench/budget_ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/time.h"
#include "bench/statistics.h"
#include "renderer/detector/detector.h"

namespace narpa {
namespace {

/// One rung while it is measured.
struct Candidate {
    Rung rung;
    FrameSettings settings;
    ErrorAgainst error;
    std::unique_ptr<CameraRenderer> renderer{};  ///< null: the plain loop
    double predicted_squares = 0;
    bool predicts = true;  ///< all frames so far
};

/// The camera at one moment, and the image that every candidate renders into.
struct View {
    View(const World& world_, std::size_t index, const LadderSettings& settings, TracingThreads& threads_)
        : world(world_),
          camera(world.scene().cameras[index]),
          bands(settings.bands),
          threads(threads_),
          at(world.scene().bodies.size()),
          image(camera.width, camera.height),
          bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns})) {
        world.place(settings.t_ns, camera.mount, at);
        T_world_camera = world.camera_pose(camera, 1e-9 * static_cast<double>(settings.t_ns), at);
    }
    const World& world;
    const Camera& camera;
    const bool bands;
    TracingThreads& threads;
    BodyPoses at;
    Rigid3 T_world_camera{};
    RadianceImage image;
    std::vector<std::uint8_t> bytes;
    std::vector<double> detector_s{};

    FrameAccount render(CameraRenderer& renderer, const FrameSettings& settings) {
        return threads.arena.execute([&] { return renderer.render(at, T_world_camera, settings, image); });
    }
    /// The last frame as compared with the reference: averaged over bands, unless errors are per band.
    std::span<const Rgb> pixels() {
        for (Rgb& p : image.pixels)
            if (!bands) p = Rgb{1, 1, 1} * mean_band(p);
        return image.pixels;
    }
};

/// Renders frame `number` and returns its account; for the plain loop it holds the rays alone.
FrameAccount render(View& v, Candidate& c, const ReferenceLoop& loop, std::uint32_t number) {
    c.settings.frame = number;
    if (c.renderer) return v.render(*c.renderer, c.settings);
    FrameAccount account;
    v.threads.arena.execute([&] { account.rays = loop(v.camera, v.T_world_camera, c.settings, v.image); });
    return account;
}

void measure(View& v, Candidate& c, const ReferenceLoop& loop, std::uint32_t number, int frames) {
    const std::int64_t start_ns = monotonic_ns();
    const double cpu_start_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID);
    const FrameAccount account = render(v, c, loop, number);
    c.rung.seconds.push_back(seconds_since(start_ns));
    c.rung.cpu_seconds.push_back(cpu_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_start_s);
    if (!c.rung.loop) {
        const std::int64_t detector_start_ns = monotonic_ns();
        v.threads.arena.execute([&] { expose(v.camera, v.image, c.settings.seed, number, v.bytes); });
        v.detector_s.push_back(seconds_since(detector_start_ns));
    }
    if (is_worse(account.step, c.rung.step)) c.rung.step = account.step;
    c.rung.rays += static_cast<double>(account.rays) / frames;
    c.rung.samples += static_cast<double>(account.samples) / frames;
    for (std::size_t k = 0; k < kPhases; ++k) c.rung.phase_ns[k] += account.phase_ns[k] / frames;
    c.predicts = c.predicts && account.standard_error >= 0;
    c.predicted_squares += account.standard_error * account.standard_error / frames;
    c.error.add(v.pixels());
}

ImageMean reference_of(View& v, FrameSettings settings, int spp,
                       const std::function<void(const std::string&)>& progress) {
    ImageMean mean(v.image.pixels.size());
    settings.spp = std::max(2, spp / kReferenceImages);
    ++settings.seed;  // shares no random numbers with what is measured
    CameraRenderer renderer(v.world.render_scene(), v.camera);
    for (int k = 0; k < kReferenceImages; ++k) {
        progress(fmt::format("reference {}/{}", k, kReferenceImages));
        settings.frame = static_cast<std::uint32_t>(k);
        v.render(renderer, settings);
        mean.add(v.pixels());
    }
    return mean;
}

/// Every rung that is to be measured, and how it is rendered.
std::vector<std::pair<Rung, FrameSettings>> planned(const LadderSettings& s, const FrameSettings& base,
                                                    const Camera& camera, bool with_loop) {
    std::vector<std::pair<Rung, FrameSettings>> all;
    const auto add = [&](std::string name) -> auto& {
        all.emplace_back(Rung{}, base).first.name = std::move(name);
        return all.back();
    };
    for (const int spp : s.spp) add(fmt::format("{} spp", spp)).second.spp = spp;
    for (const double per_pixel : s.rays_per_pixel) {
        auto& [rung, settings] = add(fmt::format("{:g} rays/px", per_pixel));
        rung.adaptive = true;
        settings.budget.kind = FrameBudget::Kind::rays;
        settings.budget.rays = static_cast<std::uint64_t>(per_pixel * camera.width * camera.height);
    }
    for (auto& [rung, settings] : all) rung.spp = settings.spp, settings.times = true;
    if (s.ablation) {
        const auto middle = all[all.size() / 2];
        for (const NamedMechanism& m : kMechanisms) {
            auto& [rung, settings] = all.emplace_back(middle);
            rung.without = m.name;
            settings.mechanisms.*m.on = false;
        }
    }
    for (const int spp : with_loop ? s.loop_spp : std::vector<int>{}) {
        auto& [rung, settings] = add(fmt::format("loop {} spp", spp));
        rung.loop = true;
        settings.spp = spp;
    }
    return all;
}

}  // namespace

double Rung::median_s() const {
    return median(seconds);
}
double Rung::median_cpu_s() const {
    return median(cpu_seconds);
}

Ladder measure_ladder(const World& world, std::size_t camera, const LadderSettings& s, const ReferenceLoop& loop,
                      TracingThreads& threads, const std::function<void(const std::string&)>& progress) {
    View v(world, camera, s, threads);
    FrameSettings base;
    base.seed = world.scene().render.seed;
    base.method = world.scene().render.method;
    base.max_depth = world.scene().render.max_depth;
    const std::int64_t start_ns = monotonic_ns();
    const ImageMean reference = reference_of(v, base, s.reference_spp, progress);
    Ladder ladder;
    ladder.level = reference.level().value;
    ladder.reference_noise = std::sqrt(reference.variance_of_mean());
    ladder.reference_s = seconds_since(start_ns);

    std::vector<Candidate> candidates;
    for (auto& [rung, settings] : planned(s, base, v.camera, static_cast<bool>(loop))) {
        Candidate& c = candidates.emplace_back(Candidate{std::move(rung), settings, ErrorAgainst(reference)});
        if (!c.rung.loop) c.renderer = std::make_unique<CameraRenderer>(world.render_scene(), v.camera);
        render(v, c, loop, 0);  // the first frame allocates
    }
    std::uint32_t number = 1;
    for (int k = 0; k < s.frames; ++k)
        for (Candidate& c : candidates) {
            progress(fmt::format("{} {}/{}", c.rung.name, k, s.frames));
            measure(v, c, loop, number++, s.frames);
        }
    ladder.detector_s = median(v.detector_s);
    for (Candidate& c : candidates) {
        static_cast<ErrorRow&>(c.rung) = c.error.row(c.rung.spp);
        if (c.predicts && !c.rung.loop) c.rung.predicted = std::sqrt(c.predicted_squares);
        ladder.rungs.push_back(std::move(c.rung));
    }
    return ladder;
}

namespace {

/// Seconds to an error, by linear interpolation between these rungs in the logarithms of time and error. None where
/// their errors do not enclose it; `beyond`: extrapolated there.
std::optional<double> time_to_error(double error, const std::vector<const Rung*>& rungs,
                                    double (Rung::*seconds)() const, bool beyond) {
    std::vector<std::array<double, 2>> line;
    for (const Rung* r : rungs)
        if (r->rmse.value > 0) line.push_back({std::log(r->rmse.value), std::log((r->*seconds)())});
    std::sort(line.begin(), line.end(), std::greater<>());
    if (line.size() < 2 || error <= 0) return {};
    const double x = std::log(error);
    if (!beyond && (x > line.front()[0] || x < line.back()[0])) return {};
    std::size_t k = 1;
    while (k + 1 < line.size() && x < line[k][0]) ++k;
    const auto [x0, y0] = line[k - 1];
    const auto [x1, y1] = line[k];
    if (x0 == x1) return {};
    return std::exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0));
}

}  // namespace

std::optional<double> speed_up(const Ladder& ladder, const Rung& rung, TimeBy by) {
    const auto seconds = by == TimeBy::wall ? &Rung::median_s : &Rung::median_cpu_s;
    std::vector<const Rung*> loop;
    for (const Rung& r : ladder.rungs)
        if (r.loop) loop.push_back(&r);
    const auto s = time_to_error(rung.rmse.value, loop, seconds, false);
    return s ? std::optional(*s / (rung.*seconds)()) : std::nullopt;
}

std::optional<double> cost_at_equal_error(const Ladder& ladder, const Rung& rung) {
    std::vector<const Rung*> full;
    for (const Rung& r : ladder.rungs)
        if (!r.loop && r.without.empty()) full.push_back(&r);
    const auto s = time_to_error(rung.rmse.value, full, &Rung::median_cpu_s, true);
    return s ? std::optional(rung.median_cpu_s() / *s) : std::nullopt;
}

std::optional<SpeedUps> speed_ups(const Ladder& ladder, bool adaptive, TimeBy by, double rays_min) {
    std::vector<double> all;
    for (const Rung& r : ladder.rungs)
        if (!r.loop && r.adaptive == adaptive && r.estimates_error() && r.rays >= rays_min)
            if (const auto s = speed_up(ladder, r, by)) all.push_back(*s);
    if (all.empty()) return {};
    const auto [least, most] = std::minmax_element(all.begin(), all.end());
    return SpeedUps{median(all), *least, *most, all.size()};
}

}  // namespace narpa
