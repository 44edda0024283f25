#include "emulator/camera/camera_sensor.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <span>

#include "emulator/bus/can_node.h"
#include "emulator/log/ledger_log.h"
#include "emulator/log/mcap_log.h"
#include "renderer/camera/read_out.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa {
namespace {

/// The settings that readers of the camera's frames may change. Their requests are handled like commands on CAN, so
/// without a bus there are none.
std::optional<VideoControls> controls_of(const Camera& c, bool has_bus) {
    if (!c.control || !has_bus) return std::nullopt;
    const CameraSettings s = settings_of(c);
    return VideoControls{c.control->exposure_min_ns,
                         std::min(c.control->exposure_max_ns, c.period_ns - rows_ns(c) - 1),
                         s.exposure_ns,
                         c.control->gain_max_cdb,
                         s.gain_cdb,
                         s.auto_exposure};
}

}  // namespace

Status open_cameras(const World& world, const RunOptions& o, OpenSensors& out) {
    const Scene& scene = world.scene();
    if (!o.video.empty() && scene.cameras.empty()) return Error{"the scene has no camera", scene.file};
    for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
        const Camera& c = scene.cameras[i];
        auto sinks = open_sinks<VideoSink>(
            o.video, i, scene.cameras, "camera", scene.file, out.kept_video, [&](const auto& spec) {
                return open_video_sink(spec, c.video_format(), o.lockstep ? WhenFull::wait : WhenFull::drop,
                                       controls_of(c, !o.bus.empty()));
            });
        if (!sinks) return sinks.error();
        if (sinks->empty()) continue;
        auto camera = std::make_unique<CameraSensor>(world, i, *std::move(sinks), o.late_max);
        out.cameras.push_back(camera.get());
        out.all.push_back(std::move(camera));
    }
    return Ok{};
}

CameraSensor::CameraSensor(const World& world, std::size_t camera, std::vector<std::unique_ptr<VideoSink>> sinks,
                           std::optional<double> late_max)
    : world_(world), index_(camera), unit_(world, camera), sinks_(std::move(sinks)), late_max_(late_max) {
    const LatePolicy late = unit_.camera().late;
    if (late == LatePolicy::repeat || late == LatePolicy::blank) spare_.resize(unit_.bytes().size());
    fill_black(unit_.camera().format, spare_);
    if (unit_.camera().control) control_.emplace(unit_.camera(), static_cast<std::uint8_t>(camera));
    plan();
}

Status CameraSensor::log_to(const std::string& folder, bool wait_when_full) {
    folder_ = folder;
    const std::string stem = folder + "/" + unit_.camera().name;
    auto truth = RowLog::create(stem + ".truth.csv", std::string(kTrajectoryHeader) + "\n", wait_when_full);
    if (!truth) return truth.error();
    auto ledger = RowLog::create(stem + ".ledger.csv", ledger_header() + "\n", wait_when_full);
    if (!ledger) return ledger.error();
    truth_log_ = *std::move(truth);
    ledger_log_ = *std::move(ledger);
    sheet_ = std::make_unique<ContactSheet>(unit_.format());
    return Ok{};
}

void CameraSensor::record_to(McapLog& log) {
    mcap_ = &log.source_of_camera(index_);
}

void CameraSensor::start_at(std::int64_t t_ns) noexcept {
    const std::int64_t period = unit_.camera().period_ns;
    next_ = static_cast<std::uint32_t>(std::max<std::int64_t>(0, (t_ns + period - 1) / period));
    if (control_) control_->start_at(t_ns);
    plan();
}

void CameraSensor::plan() noexcept {
    if (!control_) {
        t_mid_ns_ = unit_.t_mid_ns(next_);
        return;
    }
    control_->plan();
    if (control_->settings() != unit_.settings() || control_->command_counter() != unit_.command_counter())
        unit_.set(control_->settings(), control_->command_counter());
    const std::int64_t t_start_ns = control_->t_start_ns();
    t_mid_ns_ = t_start_ns == Clock::kNever ? t_start_ns : t_start_ns + unit_.exposure_ns() / 2;
}

void CameraSensor::advance(std::optional<double> level) noexcept {
    ++next_;
    if (control_) control_->advance(level);
    plan();
}

void CameraSensor::warm_up() {
    for (int i = 0; i < 2; ++i) unit_.warm_up();
    const FrameLedger ledger = unit_.expose(next_, 0, monotonic_ns() + (deadline_ns() - t_mid_ns_));
    unit_.embed(ledger);
    unit_.handed_over(monotonic_ns());
}

std::int64_t CameraSensor::deadline_ns() const noexcept {
    const std::int64_t budget = world_.scene().render.budget_ns;
    return t_mid_ns_ + (budget > 0 ? unit_.exposure_ns() / 2 + budget : unit_.settings().period_ns);
}

void CameraSensor::make_next(const Clock& clock) {
    const std::int64_t deadline = deadline_ns(), started = clock.now_ns();
    const std::int64_t wall_start = monotonic_ns();

    const bool timed = clock.is_real_time() || world_.scene().render.budget_ns > 0;
    FrameLedger ledger = unit_.expose(next_, t_mid_ns_, timed ? clock.to_monotonic(deadline) : 0);
    ledger.t_render_start_ns = started;
    ledger.t_render_end_ns = clock.now_ns();
    ledger.t_deadline_ns = deadline;
    const RunUtc utc = clock.utc();
    ledger.utc_offset_ns = utc.zero_unix_ns, ledger.utc_error_ns = utc.error_ns;
    if (control_) {
        const TriggerTimes trigger = control_->trigger_times();
        ledger.t_trigger_ns = trigger.t_ns, ledger.t_trigger_taken_ns = trigger.t_taken_ns;
    }
    stats_.render.add(monotonic_ns() - wall_start);
    stats_.wake_late.add(started - due_ns());
    stats_.radiance.add(unit_.durations().radiance_ns);
    stats_.sensor.add(unit_.durations().sensor_ns);

    const std::int64_t wall_ready = monotonic_ns();
    hand_over(ledger, clock);
    stats_.send.add(monotonic_ns() - wall_ready);
    account(ledger);
    log(ledger);
    if (mcap_) mcap_->frame(ledger, unit_.bytes(), unit_.placement());
    if (ledger.delivery == Delivery::frame)
        for (FrameFeed* feed : feeds_) feed->take(ledger, unit_.bytes(), unit_.placement());
    std::optional<double> level;
    if (unit_.settings().auto_exposure) level = mean_level(unit_.format(), unit_.settings().region, unit_.bytes());
    advance(level);
    skip_missed(clock);
}

void CameraSensor::hand_over(FrameLedger& ledger, const Clock& clock) noexcept {
    ledger.deadline_met = clock.now_ns() <= ledger.t_deadline_ns;
    unit_.embed(ledger);
    ledger.delivery = deliver(ledger);
    const std::int64_t out = clock.now_ns();
    unit_.handed_over(clock.to_monotonic(out));
    if (ledger.delivery != Delivery::nothing) ledger.t_hand_over_ns = out;
    ledger.deadline_met = out <= ledger.t_deadline_ns;
    stats_.late.add(out - ledger.t_deadline_ns);
    stats_.hand_over.add(out - ledger.t_exposure_mid_ns);
    if (ledger.deadline_met && unit_.camera().late == LatePolicy::repeat)
        std::copy(unit_.bytes().begin(), unit_.bytes().end(), spare_.begin());
}

Delivery CameraSensor::deliver(const FrameLedger& ledger) noexcept {
    const LatePolicy late = unit_.camera().late;
    const FrameStamp stamp{ledger.t_exposure_mid_ns, ledger.frame};
    if (ledger.deadline_met || late == LatePolicy::late)
        return send(unit_.bytes(), stamp) ? Delivery::frame : Delivery::nothing;
    if (late == LatePolicy::drop) return Delivery::nothing;
    if (!send(spare_, stamp)) return Delivery::nothing;
    return late == LatePolicy::repeat ? Delivery::repeated : Delivery::blank;
}

bool CameraSensor::send(std::span<const std::uint8_t> bytes, const FrameStamp& stamp) noexcept {
    bool taken = false;
    for (const auto& sink : sinks_) taken |= sink->send(bytes, stamp);
    ++(taken ? stats_.handed_over : stats_.not_taken);
    return taken;
}

void CameraSensor::account(const FrameLedger& ledger) noexcept {
    ++stats_.frames;
    stats_.deadline_missed += !ledger.deadline_met;
    shown_.late.store(stats_.deadline_missed, std::memory_order_relaxed);
    shown_.samples_per_pixel.store(ledger.samples_per_pixel, std::memory_order_relaxed);
    shown_.expected_error.store(ledger.expected_error, std::memory_order_relaxed);
    stats_.stale += ledger.pose_stale;
    stats_.repeated += ledger.delivery == Delivery::repeated;
    stats_.blanked += ledger.delivery == Delivery::blank;
    ++stats_.steps[ledger.step];
    stats_.samples_1e3.add(std::llround(1e3 * static_cast<double>(ledger.samples_per_pixel)));
    if (ledger.expected_error >= 0)
        stats_.error_1e9.add(std::llround(1e9 * std::min(1.0, static_cast<double>(ledger.expected_error))));
    if (!keeps_ledgers_) return;
    stats_.ledgers_lost += !ledgers_.push(ledger);
    if (control_)
        stats_.states_lost +=
            !states_.push({ledger.frame, ledger.camera, ledger.command_counter, unit_.settings()});
}

void CameraSensor::skip_missed(const Clock& clock) noexcept {
    // A trigger is not skipped: its frame is late.
    const auto missed = [&] {
        return unit_.settings().trigger == TriggerMode::free_running && last_pose_ns() < clock.end_ns() &&
               due_ns() + unit_.settings().period_ns <= clock.now_ns();
    };
    for (; missed(); advance(std::nullopt)) ++stats_.skipped;
    shown_.skipped.store(stats_.skipped, std::memory_order_relaxed);
}

/// Passes on settings from the readers of sinks as camera commands; the replies go to the CAN bus.
void CameraSensor::take_requests(CanNode& can, std::int64_t t_ns) noexcept {
    for (const auto& sink : sinks_)
        for (VideoRequest r; sink->next_request(r);) {
            CameraCommand c;
            c.counter = ++requests_;
            c.camera = control_->camera();
            c.exposure_ns = r.exposure_ns, c.gain_cdb = r.gain_cdb, c.auto_exposure = r.auto_exposure;
            can.command(c, t_ns);
        }
}

void CameraSensor::connect(CanNode& can) {
    keep_ledgers();
    if (control_) can.operate(*control_);
}

void CameraSensor::send_telemetry(CanNode& can, std::int64_t t_ns, Heartbeat& faults) noexcept {
    if (control_) take_requests(can, t_ns);
    for (FrameLedger ledger; ledgers_.pop(ledger);) {
        faults.stale |= ledger.pose_stale;
        faults.deadline_missed |= !ledger.deadline_met;
        can.send(ledger, t_ns);
    }
    for (CameraState state; states_.pop(state);) can.send(state, t_ns);
}

std::uint64_t CameraSensor::drops() const noexcept {
    std::uint64_t n = 0;
    for (const auto& sink : sinks_) {
        const VideoCounters c = sink->counters();
        n += c.ring_full + c.no_reader + c.failed;
    }
    return n;
}

void CameraSensor::log(const FrameLedger& l) noexcept {
    if (!truth_log_) return;
    std::array<char, RowLog::kMaxLine> row;
    const auto append = [&](std::int64_t t_ns, std::span<const Motion> motions) {
        for (std::size_t i = 0; i < motions.size(); ++i)
            truth_log_->append(
                {row.data(), format_trajectory_row(row, t_ns, world_.scene().bodies[i].name, motions[i])});
    };
    append(l.t_exposure_start_ns, unit_.motions_at_start());
    append(l.t_exposure_mid_ns, unit_.motions());
    append(l.t_exposure_end_ns, unit_.motions_at_end());
    // After the hand-over, which therefore never waits for the log.
    ledger_log_->append({row.data(), format_ledger_row(row, l, image_crc32(unit_.bytes()))});
    sheet_->offer(l.frame, l.t_exposure_mid_ns, unit_.bytes());
}

Status CameraSensor::finish() {
    Status video = finish_all(sinks_);
    if (!sheet_) return video;
    const Status truth = truth_log_->close(), ledger = ledger_log_->close();
    const Status sheet = sheet_->write(folder_ + "/" + unit_.camera().name + ".png");
    for (const Status* s : std::initializer_list<const Status*>{&video, &truth, &ledger, &sheet})
        if (!*s) return s->error();
    return Ok{};
}

}  // namespace narpa
