#include <atomic>

#include "drivers/lidar/backends.h"

namespace narpa {
namespace {

class NullPacketSink final : public PacketSink {
public:
    bool send(PacketKind, std::span<const std::uint8_t>, std::int64_t) noexcept override {
        sent_.fetch_add(1, std::memory_order_relaxed);
        return true;
    }
    void flush() noexcept override {}
    PacketCounters counters() const noexcept override { return {sent_.load(std::memory_order_relaxed), 0}; }
    std::string description() const override { return "none (packets are counted and thrown away)"; }

private:
    std::atomic<std::uint64_t> sent_{0};
};

}  // namespace

Result<std::unique_ptr<PacketSink>> open_null_packet_sink() {
    return std::unique_ptr<PacketSink>(std::make_unique<NullPacketSink>());
}

}  // namespace narpa
