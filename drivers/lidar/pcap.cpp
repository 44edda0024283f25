#include "base/time.h"
#include "base/write_file.h"
#include "drivers/lidar/backends.h"

#ifdef NARPA_WITH_PCAP

#include <pcap/pcap.h>
#include <stdio_ext.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string_view>

#include "drivers/descriptor.h"
#include "drivers/write_queue.h"

namespace narpa {
namespace {

constexpr std::size_t kEthernetBytes = 14, kIpBytes = 20, kUdpBytes = 8;
constexpr std::uint8_t kUdpProtocol = 17;
constexpr std::size_t kIpv4 = 0x0800;                                        // of Ethernet
constexpr std::size_t kHeaderBytes = kEthernetBytes + kIpBytes + kUdpBytes;  // 42
constexpr std::size_t kEthernetPayload = 1500 - kIpBytes - kUdpBytes;
// A disk may pause: 2.7 s of a VLP-16's data packets, 0.8 s of the longest ones of an OS1-128.
constexpr std::size_t kRecordSlotsMost = 2048, kQueueBytes = 32 << 20;

// A record of the ring: when, then the Ethernet frame.
constexpr std::size_t kStampBytes = sizeof(std::int64_t);

void put_be16(std::uint8_t* at, std::size_t value) noexcept {
    at[0] = static_cast<std::uint8_t>(value >> 8);
    at[1] = static_cast<std::uint8_t>(value);
}

// One's complement sum of 16-bit words (RFC 1071), not yet complemented.
std::uint32_t add_words(const std::uint8_t* at, std::size_t size, std::uint32_t sum) noexcept {
    for (std::size_t i = 0; i < size; ++i) sum += i % 2 == 0 ? std::uint32_t{at[i]} << 8 : at[i];
    return sum;
}
std::uint16_t checksum(std::uint32_t sum) noexcept {
    while (sum >> 16) sum = (sum & 0xFFFF) + (sum >> 16);
    return static_cast<std::uint16_t>(~sum);
}

// Ethernet, IPv4 and UDP headers of a broadcast by the instrument; source port = destination port.
std::size_t put_frame(std::uint8_t* frame, const LidarNetwork& from, int port,
                      std::span<const std::uint8_t> payload) noexcept {
    constexpr std::array<std::uint8_t, 6> broadcast{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
    const auto& a = from.address;
    const std::array<std::uint8_t, 8> addresses{a[0], a[1], a[2], a[3], 255, 255, 255, 255};
    const std::size_t udp_length = kUdpBytes + payload.size();

    std::memcpy(frame, broadcast.data(), broadcast.size());
    std::memcpy(frame + broadcast.size(), from.mac.data(), from.mac.size());
    put_be16(frame + kEthernetBytes - 2, kIpv4);
    std::uint8_t* ip = frame + kEthernetBytes;
    std::memset(ip, 0, kIpBytes);
    ip[0] = 0x45;  // version 4, five words
    put_be16(ip + 2, kIpBytes + udp_length);
    if (payload.size() <= kEthernetPayload) put_be16(ip + 6, 0x4000);  // do not fragment
    ip[8] = 255;                                                       // time to live
    ip[9] = kUdpProtocol;
    std::memcpy(ip + 12, addresses.data(), addresses.size());
    put_be16(ip + 10, checksum(add_words(ip, kIpBytes, 0)));

    std::uint8_t* udp = ip + kIpBytes;
    put_be16(udp, static_cast<std::size_t>(port));
    put_be16(udp + 2, static_cast<std::size_t>(port));
    put_be16(udp + 4, udp_length);
    put_be16(udp + 6, 0);
    std::memcpy(udp + kUdpBytes, payload.data(), payload.size());
    const std::uint32_t pseudo_header =
        add_words(addresses.data(), addresses.size(), static_cast<std::uint32_t>(kUdpProtocol + udp_length));
    const std::uint16_t sum = checksum(add_words(udp, udp_length, pseudo_header));
    put_be16(udp + 6, sum == 0 ? 0xFFFF : sum);  // RFC 768: 0 would mean "no checksum"
    return kHeaderBytes + payload.size();
}

// The file always ends with a whole record: one that a full disk cut short is removed.
class PcapWriter final : public QueueWriter {
public:
    /// The file's header is already written.
    PcapWriter(pcap_t* pcap, pcap_dumper_t* dumper)
        : pcap_(pcap), dumper_(dumper), file_(pcap_dump_file(dumper)), end_of_last_record_(::ftello(file_)) {}
    ~PcapWriter() override {
        ::pcap_dump_close(dumper_);
        ::pcap_close(pcap_);
    }

    void write(std::span<const std::uint8_t> record, const WriteQueue&) noexcept override {
        std::int64_t unix_ns = 0;
        std::memcpy(&unix_ns, record.data(), kStampBytes);
        const auto length = static_cast<bpf_u_int32>(record.size() - kStampBytes);
        // With nanosecond precision libpcap keeps nanoseconds in tv_usec.
        const pcap_pkthdr header{{unix_ns / kSecond_ns, unix_ns % kSecond_ns}, length, length};
        ::pcap_dump(reinterpret_cast<u_char*>(dumper_), &header, record.data() + kStampBytes);
        if (::pcap_dump_flush(dumper_) != 0 || std::ferror(file_) != 0) return take_back();
        end_of_last_record_ = ::ftello(file_);
        ++sent;
    }
    void abandon(std::span<const std::uint8_t>) noexcept override { ++lost; }

    std::atomic<std::uint64_t> sent{0}, lost{0};
    std::atomic<int> error{0};  // errno of the file

private:
    void take_back() noexcept {
        error = errno;
        abandon({});
        ::__fpurge(file_);
        std::clearerr(file_);
        if (::ftruncate(::fileno(file_), end_of_last_record_) == 0) ::fseeko(file_, end_of_last_record_, SEEK_SET);
    }

    pcap_t* pcap_;
    pcap_dumper_t* dumper_;
    std::FILE* file_;
    off_t end_of_last_record_;
};

class PcapSink final : public PacketSink {
public:
    PcapSink(const std::string& path, const LidarNetwork& network, bool wait_when_full, pcap_t* pcap,
             pcap_dumper_t* dumper)
        : description_("capture " + path),
          network_(network),
          record_(kStampBytes + kHeaderBytes + network.datagram_bytes_max),
          writer_(pcap, dumper),
          queue_(writer_, std::min(kRecordSlotsMost, kQueueBytes / record_.size()), record_.size(),
                 wait_when_full) {}

    bool send(PacketKind kind, std::span<const std::uint8_t> payload, std::int64_t unix_ns) noexcept override {
        if (payload.size() > network_.datagram_bytes_max) {
            writer_.abandon(payload);
            return false;
        }
        std::memcpy(record_.data(), &unix_ns, kStampBytes);
        const int port = kind == PacketKind::data ? network_.data_port : network_.position_port;
        const std::size_t size = kStampBytes + put_frame(record_.data() + kStampBytes, network_, port, payload);
        return queue_.push(std::span(record_).first(size));
    }
    void flush() noexcept override { queue_.flush(); }
    PacketCounters counters() const noexcept override { return {writer_.sent, queue_.dropped() + writer_.lost}; }
    std::string description() const override { return description_; }
    std::string_view fate() const override { return "written"; }
    Status failure() const override {
        const int reason = writer_.error;
        if (reason == 0) return Ok{};
        return Error{description_ + ": " + std::to_string(writer_.lost) +
                         " packets could not be written: " + std::strerror(reason),
                     {},
                     0,
                     0,
                     ErrorKind::failed};
    }

private:
    std::string description_;
    LidarNetwork network_;
    std::vector<std::uint8_t> record_;  ///< the one being made
    PcapWriter writer_;
    WriteQueue queue_;
};

}  // namespace

PacketSinkResult open_pcap_sink(const std::string& path, const PacketSinkOptions& o) {
    constexpr int snapshot_bytes = 65535;
    pcap_t* pcap = ::pcap_open_dead_with_tstamp_precision(DLT_EN10MB, snapshot_bytes, PCAP_TSTAMP_PRECISION_NANO);
    if (pcap == nullptr) return Error{"libpcap gave no handle", path, 0, 0, ErrorKind::missing};
    pcap_dumper_t* dumper = ::pcap_dump_open(pcap, path.c_str());
    if (dumper == nullptr || ::pcap_dump_flush(dumper) != 0) {
        Error error{std::string("cannot write the capture: ") + std::strerror(errno), path, 0, 0,
                    ErrorKind::missing};
        if (dumper != nullptr) ::pcap_dump_close(dumper);
        ::pcap_close(pcap);
        return error;
    }
    auto sink = std::make_unique<PcapSink>(path, o.network, o.wait_when_full, pcap, dumper);
    if (!o.metadata.empty())
        if (auto written = write_file(document_beside(path), o.metadata); !written) return written.error();
    return std::unique_ptr<PacketSink>(std::move(sink));
}

}  // namespace narpa

#else

namespace narpa {

PacketSinkResult open_pcap_sink(const std::string& path, const PacketSinkOptions&) {
    return built_without_captures(path);
}

}  // namespace narpa

#endif
