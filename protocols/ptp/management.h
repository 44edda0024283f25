/// protocols/ptp/management.h - the management messages of the Precision Time Protocol by which ptp4l is asked for
/// its state.
///
/// Source: IEEE 1588-2008, 13.3 (header) and clause 15 (management messages, TLVs, data sets); linuxptp, tlv.h
/// (TIME_STATUS_NP). README.md in this folder has the bytes. No sockets, no allocation.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace narpa {

using PtpClockIdentity = std::array<std::uint8_t, 8>;

struct PtpPortIdentity {
    PtpClockIdentity clock{};
    std::uint16_t port = 0;

    friend bool operator==(const PtpPortIdentity&, const PtpPortIdentity&) = default;
};

/// managementId of the data sets that are read here.
enum class PtpDataSet : std::uint16_t {
    current = 0x2001,
    time_properties = 0x2003,
    port = 0x2004,
    time_status_np = 0xC000,  ///< linuxptp's own
};

/// Which PTP network a message belongs to. ptp4l ignores messages of another one.
struct PtpNetwork {
    std::uint8_t domain = 0;
    std::uint8_t transport_specific = 0;  ///< 1: gPTP (IEEE 802.1AS)
};

/// portState of a port. Values of IEEE 1588-2008, table 8; grand_master is linuxptp's own.
enum class PtpPortState : std::uint8_t {
    none = 0,
    initializing,
    faulty,
    disabled,
    listening,
    pre_master,
    master,
    passive,
    uncalibrated,
    slave,
    grand_master,
};
/// "SLAVE"; "unknown" for a value that has no name.
[[nodiscard]] std::string_view name_of(PtpPortState state) noexcept;

/// What ptp4l says of itself. Offsets are its time less the master's.
struct PtpStatus {
    PtpPortState state = PtpPortState::none;  ///< of the port that says most; see add_port
    std::uint16_t ports = 0;
    std::uint16_t steps_removed = 0;  ///< PTP clocks between this one and the grandmaster, and itself
    double offset_ns = 0;             ///< from the master, at the last synchronisation
    double mean_path_delay_ns = 0;
    bool grandmaster_present = false;  ///< another clock is the grandmaster
    PtpClockIdentity grandmaster{};    ///< its own identity while none is present
    std::int16_t tai_less_utc_s = 0;
    bool tai_less_utc_valid = false;
    bool ptp_timescale = false;  ///< the network's time is TAI; else UTC or an arbitrary time

    /// Counts a port. The state is that of the port that follows a master, if any, else of the one that is nearest
    /// to it.
    void add_port(PtpPortState port) noexcept;
};

inline constexpr std::size_t kPtpHeaderBytes = 34,
                             kPtpManagementBytes = kPtpHeaderBytes + 10 + 4;  // target, hops, action
/// A GET: its TLV has a type, a length and an identifier, and no data.
inline constexpr std::size_t kPtpGetBytes = kPtpManagementBytes + 2 + 2 + 2;
/// A UNIX socket carries no answer to the requests here that is longer.
inline constexpr std::size_t kPtpAnswerBytesMax = 1500;

/// A GET of one data set, addressed to all ports of all clocks that get it.
void encode_ptp_get(PtpDataSet set, PtpNetwork network, std::uint16_t sequence, const PtpPortIdentity& source,
                    std::span<std::uint8_t, kPtpGetBytes> out) noexcept;

enum class PtpAnswer : std::uint8_t {
    ok,
    refused,    ///< an error status in place of the data set
    not_mine,   ///< whole, but no response to `source` with this sequence number
    malformed,  ///< truncated, of another protocol, or of lengths that contradict each other
};
/// Adds the data set of a response to `status`, which is left as it was unless the result is ok.
[[nodiscard]] PtpAnswer decode_ptp_answer(std::span<const std::uint8_t> message, PtpDataSet set,
                                          std::uint16_t sequence, const PtpPortIdentity& source,
                                          PtpStatus& status) noexcept;

}  // namespace narpa
