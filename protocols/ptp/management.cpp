#include "protocols/ptp/management.h"

#include <algorithm>

#include "protocols/big_endian.h"

namespace narpa {
namespace {

constexpr std::uint8_t kMessageManagement = 0xD, kPtpVersion = 2, kControlManagement = 4, kNoInterval = 0x7F;
constexpr std::uint8_t kActionGet = 0, kActionResponse = 2;
constexpr std::uint16_t kTlvManagement = 1, kTlvErrorStatus = 2;
constexpr std::size_t kPtpIdentityBytes = 8 + 2;

/// Bytes of the header and of the management message.
struct PtpAt {
    static constexpr std::size_t kType = 0, kVersion = 1, kLength = 2, kDomain = 4, kSource = 20, kSequence = 30,
                                 kControl = 32, kInterval = 33, kTarget = 34, kAction = 46, kTlvType = 48,
                                 kTlvLength = 50, kTlvId = 52, kTlvData = 54;
};

/// Bytes of each data set, of which the members that are read stand at the offsets of `read_data_set`.
std::size_t data_bytes(PtpDataSet set) noexcept {
    switch (set) {
        case PtpDataSet::current: return 2 + 8 + 8;
        case PtpDataSet::time_properties: return 2 + 1 + 1;
        case PtpDataSet::port: return kPtpIdentityBytes + 1 + 1 + 8 + 1 + 1 + 1 + 1 + 1 + 1;
        case PtpDataSet::time_status_np: return 8 + 8 + 4 + 4 + 2 + 12 + 4 + 8;
    }
    return 0;
}

void put_identity(std::uint8_t* at, const PtpPortIdentity& identity) noexcept {
    std::ranges::copy(identity.clock, at);
    put_be<std::uint16_t>(at + 8, identity.port);
}

/// TimeInterval: ns times 2^16.
double time_interval_ns(const std::uint8_t* at) noexcept {
    return static_cast<double>(static_cast<std::int64_t>(get_be<std::uint64_t>(at))) / 65536;
}

void read_data_set(PtpDataSet set, const std::uint8_t* data, PtpStatus& status) noexcept {
    constexpr std::uint8_t kUtcOffsetValid = 0x04, kPtpTimescale = 0x08;
    switch (set) {
        case PtpDataSet::current:
            status.steps_removed = get_be<std::uint16_t>(data);
            status.offset_ns = time_interval_ns(data + 2);
            status.mean_path_delay_ns = time_interval_ns(data + 10);
            break;
        case PtpDataSet::time_properties:
            status.tai_less_utc_s = static_cast<std::int16_t>(get_be<std::uint16_t>(data));
            status.tai_less_utc_valid = (data[2] & kUtcOffsetValid) != 0;
            status.ptp_timescale = (data[2] & kPtpTimescale) != 0;
            break;
        case PtpDataSet::port: status.add_port(static_cast<PtpPortState>(data[kPtpIdentityBytes])); break;
        case PtpDataSet::time_status_np:
            status.grandmaster_present = get_be<std::uint32_t>(data + 38) != 0;
            std::copy_n(data + 42, status.grandmaster.size(), status.grandmaster.begin());
            break;
    }
}

/// The states in which a port says more of the clock than in the one before.
constexpr std::array kByImportance{PtpPortState::none,         PtpPortState::disabled,  PtpPortState::faulty,
                                   PtpPortState::initializing, PtpPortState::listening, PtpPortState::passive,
                                   PtpPortState::pre_master,   PtpPortState::master,    PtpPortState::grand_master,
                                   PtpPortState::uncalibrated, PtpPortState::slave};

}  // namespace

std::string_view name_of(PtpPortState state) noexcept {
    constexpr std::array<std::string_view, 11> kNames{"NONE",         "INITIALIZING", "FAULTY",      "DISABLED",
                                                      "LISTENING",    "PRE_MASTER",   "MASTER",      "PASSIVE",
                                                      "UNCALIBRATED", "SLAVE",        "GRAND_MASTER"};
    const auto value = static_cast<std::size_t>(state);
    return value < kNames.size() ? kNames[value] : "unknown";
}

void PtpStatus::add_port(PtpPortState port) noexcept {
    ++ports;
    if (ports == 1 || std::ranges::find(kByImportance, port) - kByImportance.begin() >
                          std::ranges::find(kByImportance, state) - kByImportance.begin())
        state = port;
}

void encode_ptp_get(PtpDataSet set, PtpNetwork network, std::uint16_t sequence, const PtpPortIdentity& source,
                    std::span<std::uint8_t, kPtpGetBytes> out) noexcept {
    std::ranges::fill(out, std::uint8_t{0});
    out[PtpAt::kType] = static_cast<std::uint8_t>(network.transport_specific << 4 | kMessageManagement);
    out[PtpAt::kVersion] = kPtpVersion;
    put_be<std::uint16_t>(&out[PtpAt::kLength], kPtpGetBytes);
    out[PtpAt::kDomain] = network.domain;
    put_identity(&out[PtpAt::kSource], source);
    put_be<std::uint16_t>(&out[PtpAt::kSequence], sequence);
    out[PtpAt::kControl] = kControlManagement;
    out[PtpAt::kInterval] = kNoInterval;
    std::fill_n(&out[PtpAt::kTarget], kPtpIdentityBytes, std::uint8_t{0xFF});  // all clocks, all ports
    out[PtpAt::kAction] = kActionGet;
    put_be<std::uint16_t>(&out[PtpAt::kTlvType], kTlvManagement);
    put_be<std::uint16_t>(&out[PtpAt::kTlvLength], 2);  // of what follows: the identifier
    put_be<std::uint16_t>(&out[PtpAt::kTlvId], static_cast<std::uint16_t>(set));
}

PtpAnswer decode_ptp_answer(std::span<const std::uint8_t> message, PtpDataSet set, std::uint16_t sequence,
                            const PtpPortIdentity& source, PtpStatus& status) noexcept {
    if (message.size() < kPtpGetBytes || (message[PtpAt::kType] & 0xF) != kMessageManagement ||
        (message[PtpAt::kVersion] & 0xF) != kPtpVersion)
        return PtpAnswer::malformed;
    const std::size_t length = get_be<std::uint16_t>(&message[PtpAt::kLength]);
    const std::size_t tlv_bytes = get_be<std::uint16_t>(&message[PtpAt::kTlvLength]);
    if (length < kPtpGetBytes || length > message.size() || tlv_bytes < 2 ||
        kPtpManagementBytes + 4 + tlv_bytes > length)
        return PtpAnswer::malformed;
    std::array<std::uint8_t, kPtpIdentityBytes> target{};
    put_identity(target.data(), source);
    if ((message[PtpAt::kAction] & 0xF) != kActionResponse ||
        get_be<std::uint16_t>(&message[PtpAt::kSequence]) != sequence ||
        !std::ranges::equal(target, message.subspan(PtpAt::kTarget, kPtpIdentityBytes)))
        return PtpAnswer::not_mine;
    const auto id = [&](std::size_t at) { return get_be<std::uint16_t>(&message[at]); };
    const std::uint16_t type = id(PtpAt::kTlvType), wanted = static_cast<std::uint16_t>(set);
    // An error status has its own code before the identifier of what was asked.
    if (type == kTlvErrorStatus)
        return tlv_bytes >= 8 && id(PtpAt::kTlvData) == wanted ? PtpAnswer::refused : PtpAnswer::malformed;
    if (type != kTlvManagement || id(PtpAt::kTlvId) != wanted) return PtpAnswer::not_mine;
    if (tlv_bytes != 2 + data_bytes(set)) return PtpAnswer::malformed;
    read_data_set(set, &message[PtpAt::kTlvData], status);
    return PtpAnswer::ok;
}

}  // namespace narpa
