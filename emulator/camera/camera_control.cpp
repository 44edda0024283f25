#include "emulator/camera/camera_control.h"

#include <algorithm>
#include <cmath>

#include "renderer/camera/read_out.h"
#include "renderer/detector/detector.h"

namespace narpa {
namespace {

constexpr int kMaxBinning = 16;
constexpr std::int64_t kMaxPeriodNs = 1'000'000'000'000;

bool runs_free(const CameraSettings& s) noexcept {
    return s.running && s.trigger == TriggerMode::free_running;
}

template <class Value>
void change(Value& setting, const std::optional<Value>& wanted) noexcept {
    if (wanted) setting = *wanted;
}

CameraSettings changed(CameraSettings s, const CameraCommand& c) noexcept {
    change(s.running, c.running), change(s.trigger, c.trigger), change(s.auto_exposure, c.auto_exposure);
    change(s.exposure_ns, c.exposure_ns), change(s.gain_cdb, c.gain_cdb), change(s.binning, c.binning);
    change(s.region.x, c.region_x), change(s.region.y, c.region_y);
    change(s.region.width, c.region_width), change(s.region.height, c.region_height);
    change(s.period_ns, c.period_ns);
    return s;
}

}  // namespace

std::int64_t rows_ns(const Camera& camera) noexcept {
    return camera.shutter ? camera.shutter->row_time_ns * (camera.height - 1) : 0;
}

std::int64_t exposure_ns(const Camera& camera) noexcept {
    return camera.detector ? std::llround(camera.detector->exposure_s * 1e9) + rows_ns(camera) : 0;
}

CameraSettings settings_of(const Camera& camera) noexcept {
    CameraSettings s;
    if (camera.detector) s.exposure_ns = std::llround(camera.detector->exposure_s * 1e9);
    if (camera.control) s.trigger = camera.control->trigger, s.auto_exposure = camera.control->auto_exposure;
    s.region.width = static_cast<std::uint16_t>(camera.width);
    s.region.height = static_cast<std::uint16_t>(camera.height);
    s.period_ns = camera.period_ns;
    return s;
}

CameraSettings settings_of(const FrameLedger& ledger, const Camera& as_in_the_scene) noexcept {
    CameraSettings s = settings_of(as_in_the_scene);
    s.exposure_ns = ledger.t_exposure_end_ns - ledger.t_exposure_start_ns - rows_ns(as_in_the_scene);
    s.gain_cdb = ledger.gain_cdb;
    s.binning = ledger.binning;
    s.region = {ledger.region_x, ledger.region_y, ledger.region_width, ledger.region_height};
    return s;
}

void apply(const CameraSettings& settings, const Camera& as_in_the_scene, Camera& camera) noexcept {
    camera.detector->exposure_s = static_cast<double>(settings.exposure_ns) * 1e-9;
    camera.detector->gain_e_per_dn =
        gain_e_per_dn(*as_in_the_scene.detector) * std::pow(10.0, -settings.gain_cdb / 2000.0);
}

CameraControl::CameraControl(const Camera& camera, std::uint8_t index)
    : limits_(*camera.control),
      index_(index),
      format_(camera.format),
      width_(camera.width),
      height_(camera.height),
      rows_ns_(rows_ns(camera)),
      min_period_ns_(camera.period_ns),
      latest_(settings_of(camera)),
      t_next_trigger_ns_(0),
      exposure_ns_(latest_.exposure_ns),
      settings_(latest_) {
    plan();
}

// --- From the CAN thread ---------------------------------------------

CameraReply CameraControl::command(const CameraCommand& command, std::int64_t t_now_ns) noexcept {
    if (latest_.auto_exposure) latest_.exposure_ns = exposure_ns_.load(std::memory_order_relaxed);
    CameraSettings wanted = changed(latest_, command);
    if (wanted.auto_exposure && !command.exposure_ns)
        wanted.exposure_ns = std::min(wanted.exposure_ns, longest_ns(wanted));
    CameraReply reply{command.counter, index_, false, check(command, wanted), t_now_ns};
    const std::int64_t t_ns = t_now_ns + limits_.latency_ns;
    const bool changes_mode = wanted.running != latest_.running || wanted.trigger != latest_.trigger;
    if (reply.answer == CameraAnswer::accepted &&
        !orders_.push({t_ns, wanted, command.counter, latest_mode_ + changes_mode}))
        reply.answer = CameraAnswer::overrun;
    if (reply.answer != CameraAnswer::accepted) {
        ++counters_.commands_refused;
        return reply;
    }
    ++counters_.commands;
    if (changes_mode) {  // triggers after t_ns are dropped
        ++latest_mode_;
        t_next_trigger_ns_ = std::min(t_next_trigger_ns_, t_ns + latest_.period_ns);
    }
    latest_ = wanted;
    reply.t_ns = t_ns;
    return reply;
}

CameraAnswer CameraControl::check(const CameraCommand& command, const CameraSettings& wanted) const noexcept {
    using enum CameraAnswer;
    const int right = wanted.region.x + wanted.region.width, bottom = wanted.region.y + wanted.region.height;
    const bool pairs = format_ == PixelFormat::yuyv;
    if (command.exposure_ns && wanted.auto_exposure) return auto_exposure;
    if (wanted.period_ns > kMaxPeriodNs || wanted.period_ns < min_period_ns_) return period_range;
    if (wanted.exposure_ns < limits_.exposure_min_ns || wanted.exposure_ns > longest_ns(wanted))
        return exposure_range;
    if (wanted.gain_cdb < 0 || wanted.gain_cdb > limits_.gain_max_cdb) return gain_range;
    if (wanted.region.width == 0 || wanted.region.height == 0 || right > width_ || bottom > height_ ||
        (pairs && (wanted.region.x % 2 != 0 || wanted.region.width % 2 != 0)))
        return region_range;
    if (wanted.binning < 1 || wanted.binning > (can_bin(format_) ? kMaxBinning : 1)) return binning_range;
    return accepted;
}

CameraReply CameraControl::trigger(const CameraTrigger& trigger, std::int64_t t_now_ns) noexcept {
    const CameraAnswer answer = take_trigger(TriggerMode::command, trigger.t_ns, {t_now_ns, t_now_ns});
    return {trigger.counter, index_, true, answer, answer == CameraAnswer::accepted ? trigger.t_ns : t_now_ns};
}

void CameraControl::expose(TriggerMode mode, std::int64_t t_ns, const TriggerTimes& trigger) noexcept {
    (void)take_trigger(mode, t_ns, trigger);
}

CameraAnswer CameraControl::take_trigger(TriggerMode mode, std::int64_t t_ns, const TriggerTimes& times) noexcept {
    using enum CameraAnswer;
    const CameraAnswer answer = !awaits(mode)                                  ? wrong_mode
                                : t_ns < earliest_trigger_ns(times.t_ns)       ? too_soon
                                : !triggers_.push({t_ns, latest_mode_, times}) ? overrun
                                                                               : accepted;
    ++(answer == accepted ? counters_.triggers : counters_.triggers_refused);
    if (answer == accepted) t_next_trigger_ns_ = t_ns + latest_.period_ns;
    return answer;
}

CameraControlCounters CameraControl::counters() const noexcept {
    CameraControlCounters c = counters_;
    c.triggers_dropped = dropped_.load(std::memory_order_relaxed);
    return c;
}

// --- From the camera's thread ----------------------------------------

void CameraControl::start_at(std::int64_t t_ns) noexcept {
    const std::int64_t period = settings_.period_ns;
    t_mid_ns_ = std::max<std::int64_t>(0, (t_ns + period - 1) / period) * period;
    plan();
}

void CameraControl::plan() noexcept {
    while (adopt_next()) {
    }
    t_start_ns_ = runs_free(settings_) ? t_mid_ns_ - image_ns(settings_) / 2 : t_trigger_ns();
}

/// Adopts an order that takes effect with the next exposure, or drops a trigger of an earlier mode. False: neither.
bool CameraControl::adopt_next() noexcept {
    // Orders first: once an order is visible, so are the triggers that were pushed before it.
    if (Order order; !order_ && orders_.pop(order)) order_ = order;
    if (Trigger trigger; !trigger_ && triggers_.pop(trigger)) trigger_ = trigger;
    if (trigger_ && trigger_->mode < mode_) {
        trigger_.reset();
        dropped_.fetch_add(1, std::memory_order_relaxed);
        return true;
    }
    if (!order_) return false;
    if (settings_.auto_exposure && order_->settings.auto_exposure)
        order_->settings.exposure_ns = std::min(settings_.exposure_ns, longest_ns(order_->settings));
    const bool free = runs_free(settings_);
    if (order_->t_ns > (free ? t_mid_ns_ - image_ns(order_->settings) / 2 : t_trigger_ns())) return false;
    settings_ = order_->settings;
    command_counter_ = order_->counter;
    mode_ = order_->mode;
    if (!free && runs_free(settings_)) t_mid_ns_ = order_->t_ns + image_ns(settings_) / 2;
    order_.reset();
    return true;
}

void CameraControl::advance(std::optional<double> level) noexcept {
    if (runs_free(settings_))
        t_mid_ns_ += settings_.period_ns;
    else
        trigger_.reset();
    if (settings_.auto_exposure && level) {
        const double factor = std::clamp(limits_.level / std::max(*level, 1e-3), 0.5, 2.0);
        const auto wanted_ns = static_cast<std::int64_t>(factor * static_cast<double>(settings_.exposure_ns));
        settings_.exposure_ns = std::clamp(wanted_ns, limits_.exposure_min_ns, longest_ns(settings_));
        exposure_ns_.store(settings_.exposure_ns, std::memory_order_relaxed);
    }
    plan();
}

}  // namespace narpa
