#include "python/module/emulator_session.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <nlohmann/json.hpp>
#include <utility>

#include "drivers/can/buses.h"
#include "emulator/report.h"
#include "python/module/scene_session.h"

namespace narpa::python {

/// Keeps the frames of a camera.
class EmulatorSession::Observer final : public FrameObserver {
public:
    Observer(EmulatorOutput& out, std::size_t camera)
        : out_(out), camera_(camera), name_(fmt::format("array{}", camera)) {}
    [[nodiscard]] std::string_view name() const noexcept override { return name_; }
    [[nodiscard]] std::string description() const override { return "frames as arrays"; }
    [[nodiscard]] std::size_t camera() const noexcept override { return camera_; }
    void observe(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) override {
        out_.frames.push_back({camera_, ledger, {bytes.begin(), bytes.end()}, at.T_world_body});
    }
    [[nodiscard]] nlohmann::json report(std::uint64_t) const override { return nullptr; }
    [[nodiscard]] std::string to_text(std::uint64_t) const override { return {}; }

private:
    EmulatorOutput& out_;
    std::size_t camera_;
    std::string name_;
};

EmulatorSession::~EmulatorSession() = default;

Result<std::unique_ptr<EmulatorSession>> EmulatorSession::create(Scene scene, const EmulatorSettings& settings) {
    static std::atomic<int> sessions{0};
    const std::string bus_name = fmt::format("memory:python-{}", sessions++);
    auto bus = open_can_bus(bus_name, CanRole::client);
    if (!bus) return bus.error();
    std::unique_ptr<EmulatorSession> session(new EmulatorSession(*std::move(bus)));
    EmulatorSession* const self = session.get();

    RunOptions options;
    options.bus = bus_name;
    options.lockstep = true;
    options.log_folder = settings.log_folder;
    options.threads = settings.threads;
    for (const std::string& name : settings.cameras) {
        const auto index = sensor_named(scene.cameras, name, "camera", scene.file);
        if (!index) return index.error();
        options.video.emplace_back(name, "none");
        options.observers.push_back([self, camera = *index](const World&, std::span<const std::size_t>, bool) {
            return Result<std::unique_ptr<FrameObserver>>(std::make_unique<Observer>(self->made_, camera));
        });
    }
    for (const std::string& name : settings.lidars) options.lidar.emplace_back(name, "none");
    if (!settings.lidars.empty())
        options.on_packet = [self](const LidarUnit& unit, std::int64_t packet) { self->take_packet(unit, packet); };
    options.on_refusal = [self](const std::string& why) { self->refusals_.push_back(why); };
    for (const Body& b : scene.bodies)
        if (b.can_id) session->bodies_.push_back({.name = b.name, .can_id = *b.can_id, .waiting = {}});

    auto emulator = Emulator::create(std::move(scene), options);
    if (!emulator) return emulator.error();
    session->emulator_ = *std::move(emulator);
    session->emulator_->begin();
    return session;
}

Status EmulatorSession::command(const std::string& name, double time_s, const Motion& motion) {
    const std::scoped_lock lock(mutex_);
    const auto body = std::ranges::find(bodies_, name, &CommandedBody::name);
    if (body == bodies_.end()) {
        std::vector<std::string> names;
        for (const CommandedBody& b : bodies_) names.push_back(b.name);
        return Error{fmt::format("no body named \"{}\" that is commanded (can_id), expected one of {}", name,
                                 fmt::join(names, ", ")),
                     scene().file};
    }
    const auto t_ns = to_ns(time_s);
    if (!t_ns) return t_ns.error();
    if (body->any && *t_ns <= body->newest_ns)
        return Error{fmt::format("body \"{}\": a command for {} s after one for {} s, expected times that increase",
                                 name, time_s, static_cast<double>(body->newest_ns) * 1e-9)};
    const PoseCommand command{body->counter, *t_ns, motion};
    FrameSet frames;
    if (const EncodeStatus encoded = encode(command, body->can_id, bus_->carries_fd(), frames); !encoded)
        return Error{fmt::format("body \"{}\", pose at {} s: {}", name, time_s, encoded.text())};
    body->waiting.push_back(command);
    ++body->counter;
    body->any = true;
    body->newest_ns = *t_ns;
    return Ok{};
}

Status EmulatorSession::send(const CanFrame& frame) {
    const std::scoped_lock lock(mutex_);
    if (!sendable(frame)) return Error{"a CAN frame has at most 64 bytes and an identifier of 11 or 29 bits"};
    if (!bus_->send(frame)) return Error{"too many CAN frames before a step"};
    return Ok{};
}

Status EmulatorSession::reaches(std::int64_t to_ns) const {
    if (ended_) return Error{"the emulator has finished"};
    for (const CommandedBody& b : bodies_)
        if (!b.any || b.newest_ns < to_ns)
            return Error{
                fmt::format("body \"{}\" {}, expected commands up to {} s", b.name,
                            b.any ? fmt::format("is commanded up to {} s", static_cast<double>(b.newest_ns) * 1e-9)
                                  : "has no command",
                            static_cast<double>(to_ns) * 1e-9)};
    return Ok{};
}

EmulatorSession::CommandedBody* EmulatorSession::next_to_send(std::int64_t to_ns) {
    CommandedBody* next = nullptr;
    for (CommandedBody& b : bodies_)
        if (b.sent_ns < to_ns && !b.waiting.empty() && (next == nullptr || b.sent_ns < next->sent_ns)) next = &b;
    return next;
}

void EmulatorSession::send_next(CommandedBody& body) {
    FrameSet frames;
    (void)encode(body.waiting.front(), body.can_id, bus_->carries_fd(), frames);
    for (const CanFrame& frame : frames) bus_->send(frame);
    body.sent_ns = body.waiting.front().t_valid_ns;
    body.waiting.pop_front();
}

/// In slices, so that the bus's queue never fills and the caller can interrupt.
void EmulatorSession::advance(std::int64_t to_ns, const std::function<bool()>& interrupted) {
    constexpr std::int64_t kSlice_ns = 500'000'000;
    do {
        emulator_->advance(std::min(to_ns, std::max<std::int64_t>(t_ns(), 0) + kSlice_ns), stop_);
        for (ReceivedFrame received; bus_->receive(received);) made_.can_frames.push_back(received.frame);
        if (interrupted()) stop_ = true;
    } while (!stop_ && emulator_->can()->commanded() && t_ns() < std::min(to_ns, emulator_->can()->granted_ns()));
}

Result<EmulatorOutput> EmulatorSession::step(double to_s, const std::function<bool()>& interrupted) {
    const std::scoped_lock lock(mutex_);
    const auto end_ns = to_ns(to_s);
    if (!end_ns) return end_ns.error();
    if (auto good = reaches(*end_ns); !good) return good.error();
    stop_ = false;
    while (CommandedBody* const body = next_to_send(*end_ns)) {
        send_next(*body);
        advance(*end_ns, interrupted);
        if (stop_) return EmulatorOutput{};
    }
    advance(*end_ns, interrupted);
    if (stop_) return EmulatorOutput{};
    if (t_ns() < *end_ns)
        return Error{fmt::format("the clock stands at {} s, before {} s: {}", static_cast<double>(t_ns()) * 1e-9,
                                 to_s, refusals_.empty() ? "a command was refused" : refusals_.back())};
    return take_output();
}

Result<EmulatorOutput> EmulatorSession::finish(std::string& report) {
    const std::scoped_lock lock(mutex_);
    if (std::exchange(ended_, true)) return Error{"the emulator has finished"};
    const Status ended = emulator_->end();
    for (auto& [lidar, sweep] : sweeps_) made_.sweeps.push_back(std::move(sweep));
    sweeps_.clear();
    for (ReceivedFrame received; bus_->receive(received);) made_.can_frames.push_back(received.frame);
    if (!ended) return ended.error();
    report = narpa::report(*emulator_).dump();
    return take_output();
}

void EmulatorSession::take_packet(const LidarUnit& unit, std::int64_t packet) {
    EmulatedSweep& sweep = sweeps_[unit.lidar().name];
    const std::int64_t number = unit.sweep(packet);
    if (sweep.lidar.empty() || sweep.number != number) {
        if (!sweep.lidar.empty()) made_.sweeps.push_back(std::move(sweep));
        sweep = {unit.lidar().name, number, {}, {}};
    }
    for (std::size_t i = 0; i < unit.shots().size(); ++i) sweep.shots.push_back(shot_row(unit, packet, i));
    if (!unit.bytes().empty()) sweep.packets.emplace_back(unit.bytes().begin(), unit.bytes().end());
}

EmulatorOutput EmulatorSession::take_output() {
    return std::exchange(made_, {});
}

}  // namespace narpa::python
