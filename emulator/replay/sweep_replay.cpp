#include "emulator/replay/sweep_replay.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "emulator/log/ledger_log.h"
#include "emulator/log/run_record.h"

namespace narpa {
namespace {

bool exists(const std::string& file) {
    std::error_code error;
    return std::filesystem::exists(file, error);
}

/// When the last frame or sweep of the log ended; 0: it has none.
Result<std::int64_t> end_of_log(const std::string& folder, const Scene& scene,
                                const std::vector<LoggedSweep>& sweeps) {
    std::int64_t end_ns = sweeps.empty() ? 0 : sweeps.back().ledger.t_complete_ns;
    for (const Camera& c : scene.cameras) {
        const std::string file = folder + "/" + c.name + ".ledger.csv";
        if (!exists(file)) continue;
        const auto frames = read_ledger_log(file);
        if (!frames) return frames.error();
        if (!frames->empty()) end_ns = std::max(end_ns, frames->back().ledger.t_exposure_end_ns);
    }
    return end_ns;
}

}  // namespace

SweepReplay::SweepReplay(std::unique_ptr<World> world, std::size_t lidar)
    : world_(std::move(world)), index_(lidar), unit_(*world_, lidar) {}

Result<std::unique_ptr<SweepReplay>> SweepReplay::open(const std::string& folder, const std::string& lidar,
                                                       const std::string& scene_file) {
    const auto record = read_run_record(folder);
    if (!record) return record.error();
    auto scene = read_run_scene(*record, scene_file);
    if (!scene) return scene.error();
    const auto index = sensor_named(scene->lidars, lidar, "LiDAR", scene->file);
    if (!index) return index.error();
    auto world = World::create_for_lidars(*std::move(scene));
    if (!world) return world.error();
    std::unique_ptr<SweepReplay> replay(new SweepReplay(*std::move(world), *index));
    replay->log_file_ = folder + "/" + replay->lidar().name + ".sweeps.csv";
    if (exists(replay->log_file_)) {
        auto sweeps = read_sweep_log(replay->log_file_);
        if (!sweeps) return sweeps.error();
        replay->logged_ = *std::move(sweeps);
        replay->is_lockstep_ = std::ranges::all_of(replay->logged_, [](const LoggedSweep& s) {
            return s.ledger.hand_over_max_ns == 0 && s.ledger.skipped == 0;
        });
    }
    if (auto opened = replay->open_bus(folder); !opened) return opened.error();
    return replay;
}

Status SweepReplay::open_bus(const std::string& folder) {
    const std::string file = folder + "/can.log";
    if (world_->has_commanded_bodies() && exists(file)) {
        auto bus = open_can_bus("log:" + file, CanRole::hub);
        if (!bus) return bus.error();
        bus_ = *std::move(bus);
        can_ = std::make_unique<CanNode>(*world_, *bus_, nullptr, true);
        return Ok{};
    }
    const auto end_ns = end_of_log(folder, world_->scene(), logged_);
    if (!end_ns) return end_ns.error();
    end_ns_ = *end_ns;
    if (end_ns_ > 0) return Ok{};
    return Error{
        "holds no can.log, frame or sweep: expected one, from which the poses or the end of the run follow",
        folder};
}

bool SweepReplay::advance_to(std::int64_t t_ns) {
    if (!can_) return t_ns < end_ns_;
    while (!can_->commanded() || can_->granted_ns() < t_ns) {
        bool moved = false;
        if (!can_->receive(t_ns_, moved)) return false;  // a recorded bus has all its frames at once
    }
    t_ns_ = t_ns;
    return true;
}

void SweepReplay::fire(std::int64_t first, std::int64_t end, ReplayedSweep& out) {
    out.sweep = unit_.sweep(first);
    out.t_ns = unit_.packet_start_ns(first);
    out.t_end_ns = unit_.t_sent_ns(end - 1);
    out.packets.clear();
    std::uint32_t crc = 0;
    for (std::int64_t p = first; p < end; ++p) {
        unit_.fire(p);
        const std::span<const std::uint8_t> bytes = unit_.bytes();
        crc = static_cast<std::uint32_t>(::crc32(crc, bytes.data(), static_cast<uInt>(bytes.size())));
        if (!bytes.empty()) out.packets.push_back({unit_.packet_start_ns(p), {bytes.begin(), bytes.end()}});
    }
    out.repeats.reset();
    const auto row = std::ranges::lower_bound(logged_, out.sweep, {}, [](const auto& s) { return s.ledger.sweep; });
    if (row == logged_.end() || row->ledger.sweep != out.sweep) return;
    if (row->ledger.packets != static_cast<std::uint64_t>(end - first)) return;  // only a part was sent
    out.repeats = row->ledger.packets_crc32 == crc;
    out.line = row->line;
}

bool SweepReplay::next(std::size_t skip, ReplayedSweep& out) {
    if (next_ < 0) {  // a turn that began before the first pose is not whole
        if (!advance_to(0)) return false;
        next_ = unit_.first_packet_from(can_ ? std::max<std::int64_t>(0, can_->first_ns()) : 0);
        if (next_ > 0 && unit_.sweep(next_ - 1) == unit_.sweep(next_)) ++skip;
    }
    for (;; --skip) {
        std::int64_t end = next_ + 1;
        while (unit_.sweep(end) == unit_.sweep(next_)) ++end;
        if (!advance_to(unit_.t_sent_ns(end - 1) - 1)) return false;
        const std::int64_t first = std::exchange(next_, end);
        if (skip > 0) continue;
        fire(first, end, out);
        return true;
    }
}

}  // namespace narpa
