#include "apps/frame_renderer.h"

#include <fmt/format.h>

#include <atomic>
#include <utility>

#include "apps/commands/exposure_advice.h"
#include "apps/warnings.h"
#include "emulator/clock.h"
#include "emulator/log/statistics.h"
#include "renderer/image/image_file.h"
#include "renderer/integrator/integrator.h"

namespace narpa::cli {
namespace {

/// The image file contains the outputs that are not empty.
void keep_only(const std::set<std::string>& names, Aovs& a) {
    if (!names.contains("depth")) a.depth_m.clear();
    if (!names.contains("range")) a.range_m.clear();
    if (!names.contains("normal")) a.normal.clear();
    if (!names.contains("position")) a.position.clear();
    if (!names.contains("body")) a.body.clear();
    if (!names.contains("albedo")) a.albedo.clear();
    if (!names.contains("variance")) a.variance.clear();
}

std::string_view name(RenderSettings::Method m) {
    return integrator_kind(m).name;
}

}  // namespace

Result<std::unique_ptr<FrameRenderer>> FrameRenderer::create(Scene scene, std::size_t camera,
                                                             std::set<std::string> outputs,
                                                             TracingThreads& threads) {
    auto world = World::create(std::move(scene));
    if (!world) return world.error();
    return std::unique_ptr<FrameRenderer>(
        new FrameRenderer(*std::move(world), camera, std::move(outputs), threads));
}

FrameRenderer::FrameRenderer(std::unique_ptr<World> world, std::size_t camera, std::set<std::string> outputs,
                             TracingThreads& threads)
    : world_(std::move(world)), unit_(*world_, camera), outputs_(std::move(outputs)), threads_(threads) {}

Outcome FrameRenderer::render(const FrameRequest& request) {
    Aovs values;
    Aovs* const aovs = outputs_.empty() ? nullptr : &values;
    const std::int64_t start_ns = prepare(request);
    FrameLedger ledger;
    {
        std::atomic<std::size_t> pixels_done{0};
        const auto pixels = static_cast<double>(unit_.radiance().pixels.size());
        const Progress progress("rendering " + request.out, [&] {
            return Step{static_cast<double>(pixels_done) / pixels, {}};
        });
        threads_.arena.execute([&] {
            ledger = unit_.expose(request.frame, request.t_ns, budget_ns() > 0 ? start_ns + budget_ns() : 0, aovs,
                                  &pixels_done);
            unit_.embed(ledger);
        });
    }
    const double seconds = static_cast<double>(monotonic_ns() - start_ns) * 1e-9;
    keep_only(outputs_, values);
    auto written = write_image(request.out, {unit_.camera(), unit_.radiance(), aovs, unit_.bytes()});
    if (!written) return written.error();
    const SignalLevels levels = signal_levels(unit_.camera(), unit_.radiance());
    warn_of(levels);
    print(request, ledger, seconds);
    return document(request, ledger, levels, seconds);
}

/// In a run, earlier frames calibrate the renderer and the time for the hand-over. Returns the time now.
std::int64_t FrameRenderer::prepare(const FrameRequest& request) {
    if (budget_ns() > 0 && !std::exchange(calibrated_, true))
        threads_.arena.execute([&] {
            unit_.embed(unit_.expose(request.frame, request.t_ns, monotonic_ns() + budget_ns()));
            unit_.handed_over(monotonic_ns());
        });
    return monotonic_ns();
}

void FrameRenderer::warn_of(const SignalLevels& levels) const {
    if (const std::string advice = exposure_advice(unit_.camera(), levels); !advice.empty())
        warn(fmt::format("camera {}: {}", unit_.camera().name, advice));
    if (!(levels.brightest > 0))
        warn(fmt::format(
            "every pixel is black: camera {} sees no lit surface from where it is; see its position_m, look_at "
            "or attitude_wxyz, its mount, --pose, --time and the light",
            unit_.camera().name));
}

void FrameRenderer::print(const FrameRequest& request, const FrameLedger& ledger, double seconds) const {
    say(
        fmt::format("wrote {}: {} x {}, {}, {:.6g} samples per pixel on average ({}), {}, frame {} at {:.6f} s, {} "
                    "triangles, {:.1f} ms",
                    request.out, unit_.camera().width, unit_.camera().height, name(settings().method),
                    ledger.samples_per_pixel, kSamplesPerPixelNote, kStepNames[ledger.step], request.frame,
                    static_cast<double>(request.t_ns) * 1e-9, world_->tracer().triangle_count(), 1e3 * seconds));
}

nlohmann::json FrameRenderer::document(const FrameRequest& request, const FrameLedger& ledger,
                                       const SignalLevels& levels, double seconds) const {
    nlohmann::json document{{"file", request.out},
                            {"camera", unit_.camera().name},
                            {"frame", request.frame},
                            {"t_ns", request.t_ns},
                            {"width", unit_.camera().width},
                            {"height", unit_.camera().height},
                            {"method", name(settings().method)},
                            {"samples_per_pixel", ledger.samples_per_pixel},
                            {"samples", ledger.samples},
                            {"rays", ledger.rays},
                            {"passes", ledger.passes},
                            {"step", kStepNames[ledger.step]},
                            {"triangles", world_->tracer().triangle_count()},
                            {"render_s", seconds},
                            {"signal", signal_json(levels)}};
    if (ledger.expected_error >= 0) document["expected_error"] = ledger.expected_error;
    if (settings().method == RenderSettings::Method::path) document["max_depth"] = settings().max_depth;
    if (!world_->scene().overrides.empty()) document["set"] = world_->scene().overrides;
    return document;
}

}  // namespace narpa::cli
