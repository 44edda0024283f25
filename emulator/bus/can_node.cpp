#include "emulator/bus/can_node.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <utility>

#include "base/time.h"
#include "protocols/can/candump.h"

namespace narpa {

CanNode::CanNode(World& world, CanBus& bus, RowLog* log, bool lockstep)
    : bus_(bus),
      hub_(bus.clients()),
      log_(log),
      lockstep_(lockstep),
      pace_(!lockstep && bus.recorded()),
      ahead_max_ns_(std::llround(world.scene().render.command_ahead_max_s * 1e9)),
      new_runs_(world.scene().time.on_restart == TimeSettings::OnRestart::new_run) {
    for (std::size_t i = 0; i < world.scene().bodies.size(); ++i)
        if (PoseTrack* track = world.track(i)) {
            const Body& body = world.scene().bodies[i];
            Listener& listener = listeners_.emplace_back(track, PoseDecoder(*body.can_id));
            if (body.can_map) listener.mapped.emplace(body.can_map);
        }
}

void CanNode::wait(std::int64_t t_now_ns, std::int64_t timeout_ns) noexcept {
    if (!waiting_) return bus_.wait(timeout_ns);
    // A recorded bus always has its next frame, so it would not wait for the frame's time.
    const std::int64_t ns = std::clamp<std::int64_t>(received_.t_received_ns - t_now_ns, 0, timeout_ns);
    const timespec time{ns / kSecond_ns, ns % kSecond_ns};
    ::clock_nanosleep(CLOCK_MONOTONIC, 0, &time, nullptr);
}

bool CanNode::receive(std::int64_t t_now_ns, bool& moved) noexcept {
    moved = false;
    if (!next_frame(t_now_ns)) return false;
    const PoseStatus status = take(received_.frame, t_now_ns, moved);
    const bool commands = status == PoseStatus::partial || status == PoseStatus::complete;
    if (commands || (!received_.frame.extended && is_closed_loop(received_.frame.id)))
        log_frame(received_.frame, t_now_ns);
    else
        log_other(received_.frame, t_now_ns);
    return true;
}

bool CanNode::next_frame(std::int64_t t_now_ns) noexcept {
    if (!waiting_ && !bus_.receive(received_)) return false;
    waiting_ = pace_ && received_.t_received_ns > t_now_ns;
    return !waiting_;
}

/// Returns the status of the body or camera to which the frame belongs.
PoseStatus CanNode::take(const CanFrame& frame, std::int64_t t_now_ns, bool& moved) noexcept {
    if (!cameras_.empty())
        if (const DecodeStatus status = take_camera_message(frame, t_now_ns); status != DecodeStatus::not_mine)
            return status;
    for (Listener& l : listeners_) {
        PoseCommand command;
        PoseStatus status = l.decoder.accept(frame, t_now_ns, command);
        if (status == PoseStatus::not_mine && l.mapped) status = l.mapped->accept(frame, t_now_ns, command);
        if (status == PoseStatus::not_mine) continue;
        if (status != PoseStatus::complete) return status;
        if (new_runs_ && begins_again(*l.track, command)) {
            if (!restart_) restart_ = {l.decoder.base_id(), command};
            return status;
        }
        if (command.t_valid_ns > latest_ns(*l.track, t_now_ns)) {
            ++counters_.too_far_ahead;
            return status;
        }
        if (const TrackStatus pushed = l.track->push(command, t_now_ns); pushed != TrackStatus::taken) {
            note_refusal(l, pushed);
            return status;
        }
        l.refused_in_a_row = 0;
        if (l.last_counter >= 0)
            counters_.missed += static_cast<std::uint8_t>(command.counter - l.last_counter - 1);
        l.last_counter = command.counter;
        ++counters_.taken;
        if (hub_) hub_->note_commander();
        moved = true;
        return status;
    }
    ++counters_.foreign;
    return PoseStatus::not_mine;
}

bool CanNode::begins_again(const PoseTrack& track, const PoseCommand& command) const noexcept {
    if (!track.commanded() || command.t_valid_ns >= track.newest_ns()) return false;
    return command.t_valid_ns <= track.first_ns() || command.t_valid_ns < track.newest_ns() - kRestart_ns;
}

void CanNode::begin_with(const Restart& restart) noexcept {
    const auto l =
        std::ranges::find(listeners_, restart.can_id, [](const Listener& each) { return each.decoder.base_id(); });
    if (l == listeners_.end() || l->track->push(restart.command, restart.command.t_valid_ns) != TrackStatus::taken)
        return;
    l->last_counter = restart.command.counter;
    ++counters_.taken;
    if (hub_) hub_->note_commander();
}

void CanNode::note_refusal(Listener& l, TrackStatus status) noexcept {
    const bool past = status == TrackStatus::past;
    ++(past ? counters_.past : counters_.overrun);
    ++(past ? l.refused.past : l.refused.overrun);
    if (++l.refused_in_a_row >= kManyRefused) l.many_refused = many_refused_ = true;
}

void CanNode::refusals(PoseRefusals& out) const {
    out.too_far_ahead = counters_.too_far_ahead;
    out.bodies.clear();
    for (const Listener& l : listeners_) {
        if (!l.many_refused) continue;
        out.bodies.push_back(l.refused);
        out.bodies.back().can_id = l.decoder.base_id();
        out.bodies.back().newest_ns = l.track->newest_ns();
    }
}

DecodeStatus CanNode::take_camera_message(const CanFrame& frame, std::int64_t t_now_ns) noexcept {
    const bool plain = !frame.extended && !frame.remote && !frame.error && !frame.fd;
    if (frame.id == kSyncId && plain && frame.size <= 1) {  // CiA 301: empty, or a counter
        expose(TriggerMode::sync, {t_now_ns, t_now_ns});
        return DecodeStatus::complete;
    }
    CameraCommand c;
    if (const auto status = camera_commands_.accept(frame, t_now_ns, c); status != DecodeStatus::not_mine) {
        if (status == DecodeStatus::complete) command(c, t_now_ns);
        if (status == DecodeStatus::not_a_number) refuse(c.counter, c.camera, false, t_now_ns);
        return status;
    }
    CameraTrigger t;
    const auto status = camera_triggers_.accept(frame, t_now_ns, t);
    if (status == DecodeStatus::complete) trigger(t, t_now_ns);
    for (std::uint8_t i = 0; status == DecodeStatus::not_a_number && i < 16; ++i)
        if ((t.cameras >> i & 1) != 0) refuse(t.counter, i, true, t_now_ns);
    return status;
}

void CanNode::command(const CameraCommand& command, std::int64_t t_now_ns) noexcept {
    for (CameraControl* camera : cameras_)
        if (camera->camera() == command.camera) return send(camera->command(command, t_now_ns), t_now_ns);
    send(CameraReply{command.counter, command.camera, false, CameraAnswer::not_controllable, t_now_ns}, t_now_ns);
}

void CanNode::refuse(std::uint8_t counter, std::uint8_t camera, bool to_trigger, std::int64_t t_now_ns) noexcept {
    const bool operated = std::ranges::find(cameras_, camera, &CameraControl::camera) != cameras_.end();
    const CameraAnswer answer = operated ? CameraAnswer::wrong_mode : CameraAnswer::not_controllable;
    send(CameraReply{counter, camera, to_trigger, answer, t_now_ns}, t_now_ns);
}

/// All cameras that it names start at the same time.
void CanNode::trigger(CameraTrigger trigger, std::int64_t t_now_ns) noexcept {
    const auto named = [&](std::uint8_t camera) { return camera < 16 && (trigger.cameras >> camera & 1) != 0; };
    if (trigger.at_once) {
        trigger.t_ns = t_now_ns;
        for (const CameraControl* camera : cameras_)
            if (named(camera->camera()) && camera->awaits(TriggerMode::command))
                trigger.t_ns = std::max(trigger.t_ns, camera->earliest_trigger_ns(t_now_ns));
    }
    for (std::uint8_t i = 0; i < 16; ++i) {
        if (!named(i)) continue;
        const auto camera = std::ranges::find(cameras_, i, &CameraControl::camera);
        send(camera != cameras_.end()
                 ? (*camera)->trigger(trigger, t_now_ns)
                 : CameraReply{trigger.counter, i, true, CameraAnswer::not_controllable, t_now_ns},
             t_now_ns);
    }
}

void CanNode::expose(TriggerMode mode, const TriggerTimes& trigger) noexcept {
    std::int64_t latency_ns = 0;
    for (const CameraControl* camera : cameras_)
        if (camera->awaits(mode)) latency_ns = std::max(latency_ns, camera->latency_ns());
    for (CameraControl* camera : cameras_)
        if (camera->awaits(mode)) camera->expose(mode, trigger.t_ns + latency_ns, trigger);
}

/// The latest time that the body's next command may have. In lockstep the clock follows the commands: its first one
/// may have any time, and a recorded one may follow a pause of the recording.
std::int64_t CanNode::latest_ns(const PoseTrack& track, std::int64_t t_now_ns) const noexcept {
    if (!lockstep_) return t_now_ns + ahead_max_ns_;
    if (!track.commanded()) return std::numeric_limits<std::int64_t>::max();
    const std::int64_t t_recorded_ns = bus_.recorded() ? received_.t_received_ns : t_now_ns;
    return std::max({t_now_ns, t_recorded_ns, track.newest_ns()}) + ahead_max_ns_;
}

void CanNode::send(Heartbeat heartbeat, std::int64_t t_now_ns) noexcept {
    heartbeat.counter = counter(kHeartbeatId)++;
    heartbeat_ = encode(heartbeat);
    put(heartbeat_, t_now_ns);
    log_left_out(t_now_ns);
}

void CanNode::send_sync(std::int64_t t_now_ns) noexcept {
    put({.id = kSyncId}, t_now_ns);
    expose(TriggerMode::sync, {t_now_ns, t_now_ns});
}

void CanNode::repeat_heartbeat() noexcept {
    if (!bus_.recorded() && (!hub_ || hub_->has_clients())) bus_.send(heartbeat_);
}

void CanNode::put(const CanFrame& frame, std::int64_t t_now_ns) noexcept {
    if (bus_.recorded() || bus_.send(frame)) log_frame(frame, t_now_ns);  // a recorded bus has no receivers
}

void CanNode::log_frame(const CanFrame& frame, std::int64_t t_ns, std::string_view interface) noexcept {
    if (!log_) return;
    std::array<char, kCandumpMaxLine> line;
    const std::size_t n = format_candump({t_ns, frame}, interface, line);
    log_->append({line.data(), n});
}

void CanNode::log_other(const CanFrame& frame, std::int64_t t_ns) noexcept {
    if (!log_) return;
    if (const std::int64_t second = t_ns / kSecond_ns; second != log_second_)
        log_second_ = second, logged_others_ = 0;
    if (logged_others_ < kOtherFramesPerSecond && !log_->crowded()) {
        ++logged_others_;
        log_frame(frame, t_ns);
    } else {
        ++left_out_;
        ++counters_.not_logged;
    }
}

void CanNode::log_left_out(std::int64_t t_ns) noexcept {
    if (left_out_ > 0) log_frame(lost_frames(std::exchange(left_out_, 0)), t_ns, "not_logged");
}

bool CanNode::commanded() const noexcept {
    return !listeners_.empty() && std::all_of(listeners_.begin(), listeners_.end(),
                                              [](const Listener& l) { return l.track->commanded(); });
}

std::int64_t CanNode::granted_ns() const noexcept {
    std::int64_t t = std::numeric_limits<std::int64_t>::max();
    for (const Listener& l : listeners_) t = std::min(t, l.track->newest_ns());
    return t;
}

std::int64_t CanNode::first_ns() const noexcept {
    std::int64_t t = std::numeric_limits<std::int64_t>::min();
    for (const Listener& l : listeners_) t = std::max(t, l.track->first_ns());
    return t;
}

std::vector<std::pair<std::string_view, std::uint64_t>> CommandCounters::rejected() const {
    std::vector<std::pair<std::string_view, std::uint64_t>> causes{
        {"past", past}, {"overrun", overrun}, {"too_far_ahead", too_far_ahead}};
    for (std::size_t i = 0; i < kDecodeStatusCount; ++i) {
        const auto status = static_cast<DecodeStatus>(i);
        const bool good =
            status == DecodeStatus::not_mine || status == DecodeStatus::partial || status == DecodeStatus::complete;
        if (!good) causes.emplace_back(name(status), by_status[i]);
    }
    return causes;
}

CommandCounters CanNode::counters() const noexcept {
    CommandCounters c = counters_;
    const auto add = [&](const auto& decoder) {
        for (std::size_t s = 0; s < kDecodeStatusCount; ++s)
            c.by_status[s] += decoder.count(static_cast<DecodeStatus>(s));
    };
    for (const Listener& l : listeners_) {
        add(l.decoder);
        if (l.mapped) add(*l.mapped);
    }
    add(camera_commands_);
    add(camera_triggers_);
    c.by_status[static_cast<std::size_t>(DecodeStatus::not_mine)] = 0;  // counted once for all in `foreign`
    return c;
}

}  // namespace narpa
