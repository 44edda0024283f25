#include "emulator/log/mcap_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "emulator/log/ledger_log.h"
#include "emulator/log/zstd_frame.h"
#include "protocols/foxglove/ledger_message.h"

namespace narpa {
namespace {

static_assert(std::is_trivially_copyable_v<Rigid3> && std::is_trivially_copyable_v<FrameLedger>);

constexpr std::size_t kRingBytes = 64 << 20;
constexpr std::size_t kSlotsMin = 4, kSlotsMax = 256;

/// Why a frame was not handed over as it is; empty: it was.
std::string delivery_text(const FrameLedger& l) {
    if (l.delivery == Delivery::frame)
        return l.deadline_met ? "" : fmt::format("frame {} was handed over after its deadline", l.frame);
    if (l.delivery == Delivery::nothing) return fmt::format("frame {} was not handed over", l.frame);
    return fmt::format("frame {} was late, in its place: {}", l.frame,
                       kDeliveries[static_cast<std::size_t>(l.delivery)]);
}

}  // namespace

// --- Sources ------------------------------------------------------------

McapSource::McapSource(McapLog& log, std::size_t slot_bytes, bool lockstep)
    : log_(log), head_(sizeof(Head) + log.bodies_ * sizeof(Rigid3)), at_(log.bodies_) {
    const std::size_t slot = head_.size() + slot_bytes;
    if (!lockstep)
        queue_ =
            std::make_unique<WriteQueue>(*this, std::clamp(kRingBytes / slot, kSlotsMin, kSlotsMax), slot, false);
}

McapSource::~McapSource() = default;

void McapSource::give(const Head& head, std::span<const Rigid3> bodies,
                      std::span<const std::uint8_t> bytes) noexcept {
    assert(bodies.empty() || bodies.size() == log_.bodies_);
    std::memcpy(head_.data(), &head, sizeof head);
    if (!bodies.empty()) std::memcpy(head_.data() + sizeof head, bodies.data(), bodies.size_bytes());
    if (queue_) {
        dropped_ += queue_->push(head_, bytes) ? 0 : 1;
        return;
    }
    std::vector<std::uint8_t> item(head_);
    item.insert(item.end(), bytes.begin(), bytes.end());
    log_.take(item);
}

void McapSource::frame(const FrameLedger& ledger, std::span<const std::uint8_t> bytes,
                       const BodyPoses& at) noexcept {
    give({.kind = Kind::frame, .ledger = ledger}, at.T_world_body, bytes);
}

void McapSource::packet(const World& world, std::size_t lidar, const LidarUnit& unit, std::int64_t packet,
                        std::int64_t t_sent_ns) noexcept {
    const std::int64_t start_ns = unit.packet_start_ns(packet), sweep = unit.sweep(packet);
    Head head{.kind = Kind::packet,
              .begins_sweep = sweep != sweep_,
              .index = static_cast<std::uint16_t>(lidar),
              .t_ns = start_ns,
              .t_first_ns = start_ns + unit.shots().front().t_offset_ns,
              .t_publish_ns = t_sent_ns,
              .packet = packet};
    if (head.begins_sweep) world.place(std::max<std::int64_t>(0, head.t_first_ns), -1, at_);
    sweep_ = sweep;
    give(head, at_.T_world_body, unit.bytes());
}

void McapSource::message(std::uint16_t channel, std::int64_t t_ns, std::int64_t t_publish_ns,
                         std::span<const std::uint8_t> encoded) noexcept {
    give({.kind = Kind::message, .index = channel, .t_ns = t_ns, .t_publish_ns = t_publish_ns}, {}, encoded);
}

void McapSource::write(std::span<const std::uint8_t> item, const WriteQueue&) noexcept {
    log_.take(item);
}

std::uint64_t McapSource::dropped() const noexcept {
    return dropped_ + abandoned_;
}

void McapSource::end() noexcept {
    queue_.reset();
}

// --- The file -----------------------------------------------------------

Result<std::unique_ptr<McapLog>> McapLog::create(const std::string& path, const Scene& scene,
                                                 std::span<const std::size_t> cameras,
                                                 std::span<const std::size_t> lidars, bool lockstep) {
    std::FILE* file = std::fopen(path.c_str(), "we");
    if (!file) return Error{fmt::format("cannot be written: {}", std::strerror(errno)), path};
    std::unique_ptr<McapLog> log(new McapLog(path, file, scene, lockstep));
    for (const std::size_t i : cameras) {
        const Camera& c = scene.cameras[i];
        const std::string topic = "/camera/" + c.name;
        log->cameras_[i].reset(
            new CameraChannels{c, log->add_channel<foxglove::RawImage>(topic + "/image"),
                               log->add_channel<foxglove::CameraCalibration>(topic + "/calibration"),
                               log->channel(topic + "/ledger", kLedgerMessage, &ledger_message_descriptors)});
    }
    for (const std::size_t i : lidars) {
        const Lidar& l = scene.lidars[i];
        log->lidars_[i].reset(new LidarChannel{
            l.name, SweepPoints(l), log->add_channel<foxglove::PointCloud>("/lidar/" + l.name + "/points")});
    }
    return log;
}

McapLog::McapLog(std::string path, std::FILE* file, const Scene& scene, bool lockstep)
    : path_(std::move(path)),
      file_(file),
      lockstep_(lockstep),
      bodies_(scene.bodies.size()),
      transforms_(scene),
      cameras_(scene.cameras.size()),
      lidars_(scene.lidars.size()),
      placed_(scene.bodies.size()) {
    writer_ = std::make_unique<McapWriter>(
        [this](McapWriter::Bytes bytes) {
            if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size() && reason_ == 0) reason_ = errno;
        },
        McapOptions{.zstd = zstd_frames(1)});
    writer_->add_metadata("narpa", {{"scene", scene.name},
                                    {"clock", "simulation time, ns"},
                                    {"epoch_unix_ns", std::to_string(scene.epoch_unix_ns)},
                                    {"mode", lockstep ? "lockstep" : "real time"},
                                    {"seed", std::to_string(scene.render.seed)}});
    tf_ = add_channel<foxglove::FrameTransforms>("/tf");
    log_ = add_channel<foxglove::Log>("/log");
}

McapLog::~McapLog() {
    (void)close();
}

std::uint16_t McapLog::channel(const std::string& topic, std::string_view schema,
                               std::vector<std::uint8_t> (*descriptors)()) {
    auto known = std::ranges::find(schemas_, schema, &std::pair<std::string, std::uint16_t>::first);
    if (known == schemas_.end())
        known = schemas_.insert(known, {std::string(schema), writer_->add_schema(schema, descriptors())});
    return writer_->add_channel(topic, known->second);
}

McapSource& McapLog::source(std::size_t slot_bytes) {
    return *sources_.emplace_back(std::make_unique<McapSource>(*this, slot_bytes, lockstep_));
}
McapSource& McapLog::source_of_camera(std::size_t camera) {
    const Camera& c = cameras_[camera]->camera;
    return source(frame_bytes({c.width, c.height, c.format, c.period_ns}));
}
McapSource& McapLog::source_of_lidar(std::size_t lidar) {
    return source(lidars_[lidar]->points.packet_bytes());
}

// --- On the thread that writes ----------------------------------------------

template <ProtoMessage Message>
void McapLog::put(std::uint16_t channel, std::int64_t t_ns, std::int64_t t_publish_ns, const Message& message) {
    encoded_.clear();
    encode_proto(message, encoded_);
    writer_->add_message(channel, t_ns, t_publish_ns, encoded_);
}

void McapLog::note(std::int64_t t_ns, std::int64_t t_publish_ns, const std::string& name, std::string text) {
    put(log_, t_ns, t_publish_ns,
        foxglove::Log{foxglove::timestamp(t_ns), foxglove::Log::Level::warning, std::move(text), name});
}

void McapLog::take(std::span<const std::uint8_t> item) noexcept {
    const std::scoped_lock lock(writing_);
    McapSource::Head head;
    std::memcpy(&head, item.data(), sizeof head);
    std::memcpy(placed_.data(), item.data() + sizeof head, placed_.size() * sizeof(Rigid3));
    const auto bytes = item.subspan(sizeof head + placed_.size() * sizeof(Rigid3));
    t_newest_ns_ = std::max({t_newest_ns_, head.t_ns, head.ledger.t_exposure_mid_ns});
    switch (head.kind) {
        case McapSource::Kind::frame: return take_frame(head.ledger, placed_, bytes);
        case McapSource::Kind::packet: return take_packet(head, placed_, bytes);
        case McapSource::Kind::message:
            return writer_->add_message(head.index, head.t_ns, head.t_publish_ns, bytes);
    }
}

void McapLog::take_frame(const FrameLedger& l, std::span<const Rigid3> bodies,
                         std::span<const std::uint8_t> bytes) {
    CameraChannels& c = *cameras_[l.camera];
    const std::int64_t t = l.t_exposure_mid_ns;
    const std::int64_t out = l.t_hand_over_ns != 0 ? l.t_hand_over_ns : l.t_render_end_ns;
    const std::string frame = frame_of(c.camera);
    put(tf_, t, out, transforms_.at(t, bodies));
    put(c.calibration, t, out, camera_calibration(c.camera, t));
    if (l.delivery == Delivery::frame) put(c.image, t, out, raw_image(c.camera, t, bytes));
    encoded_.clear();
    encode_ledger_message(l, image_crc32(bytes), encoded_);
    writer_->add_message(c.ledger, t, out, encoded_);

    if (c.next_frame >= 0 && l.frame > c.next_frame)
        note(t, out, frame,
             fmt::format("frames {} to {} are not here: skipped or dropped", c.next_frame, l.frame - 1));
    c.next_frame = std::int64_t{l.frame} + 1;
    if (const std::string text = delivery_text(l); !text.empty()) note(t, out, frame, text);
    if (l.pose_stale && !c.stale) note(t, out, frame, fmt::format("the poses are stale from frame {} on", l.frame));
    c.stale = l.pose_stale;
}

void McapLog::take_packet(const McapSource::Head& head, std::span<const Rigid3> bodies,
                          std::span<const std::uint8_t> bytes) {
    LidarChannel& l = *lidars_[head.index];
    if (l.next_packet >= 0 && head.packet > l.next_packet)
        note(head.t_ns, head.t_publish_ns, "lidar/" + l.name,
             fmt::format("packets {} to {} are not here: skipped or dropped", l.next_packet, head.packet - 1));
    l.next_packet = head.packet + 1;
    if (head.begins_sweep || !l.open) {
        end_sweep(l);
        l.points.begin(head.t_first_ns);
        l.open = true;
        put(tf_, head.t_first_ns, head.t_publish_ns, transforms_.at(head.t_first_ns, bodies));
    }
    l.points.add(head.t_ns, bytes);
    l.t_sent_ns = head.t_publish_ns;
}

void McapLog::end_sweep(LidarChannel& l) {
    if (!std::exchange(l.open, false)) return;
    put(l.cloud, l.points.t_first_ns(), l.t_sent_ns, l.points.message());
}

// --- The end ------------------------------------------------------------

Status McapLog::close() {
    if (!file_) return closed_;
    for (const auto& source : sources_) source->end();
    for (const auto& lidar : lidars_)
        if (lidar) end_sweep(*lidar);
    if (const std::uint64_t n = dropped(); n > 0)
        note(t_newest_ns_, t_newest_ns_, path_, fmt::format("{} frames or packets were dropped", n));
    writer_->finish();
    if (std::fclose(file_) != 0 && reason_ == 0) reason_ = errno;
    file_ = nullptr;
    if (reason_ != 0)
        closed_ =
            Error{fmt::format("cannot be written: {}", std::strerror(reason_)), path_, 0, 0, ErrorKind::failed};
    return closed_;
}

std::uint64_t McapLog::dropped() const noexcept {
    std::uint64_t n = 0;
    for (const auto& source : sources_) n += source->dropped();
    return n;
}

nlohmann::json McapLog::report() const {
    return {
        {"file", path_}, {"messages", writer_->messages()}, {"bytes", writer_->bytes()}, {"dropped", dropped()}};
}

std::string McapLog::to_text() const {
    return fmt::format("  mcap: {}: {} messages, {:.1f} MB, {} frames or packets dropped\n", path_,
                       writer_->messages(), 1e-6 * static_cast<double>(writer_->bytes()), dropped());
}

}  // namespace narpa
