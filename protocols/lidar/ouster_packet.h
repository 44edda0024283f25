/// protocols/lidar/ouster_packet.h - the lidar packets of Ouster's sensors, field by field, in each profile.
///
/// A packet has 16 columns, or as many as the metadata state, which are the shots of all beams at one instant. Any
/// packet that is read field by field and written again is the same byte for byte, unused bits included. Source:
/// Ouster, Firmware User Manual, "Lidar Data Packet Format"; README.md has the offsets.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace narpa {

enum class OusterProfile : std::uint8_t { legacy, single, dual, low_bandwidth };

/// The maker's names in `udp_profile_lidar`, in the order of OusterProfile.
inline constexpr std::array<std::string_view, 4> kOusterProfiles{"LEGACY", "RNG19_RFL8_SIG16_NIR16",
                                                                 "RNG19_RFL8_SIG16_NIR16_DUAL", "RNG15_RFL8_NIR8"};

/// Packet header of all profiles but LEGACY.
struct OusterHeader {
    static constexpr std::uint16_t kLidar = 1;

    std::uint16_t packet_type = kLidar;
    std::uint16_t frame_id = 0;         ///< counts turns
    std::uint32_t init_id = 0;          ///< 24 bits; changes at each restart of the sensor
    std::uint64_t serial = 0;           ///< 40 bits
    std::array<std::uint8_t, 20> rest;  ///< countdowns and status of shot limiting and thermal shutdown, then 0
    std::array<std::uint8_t, 32> footer;
};

struct OusterColumn {
    std::uint64_t t_ns = 0;
    std::uint16_t measurement_id = 0;  ///< columns are numbered from 0 in each turn
    std::uint16_t frame_id = 0;        ///< LEGACY alone
    std::uint32_t encoder = 0;         ///< LEGACY alone: 90112 counts a turn
    std::uint32_t status = 0;          ///< LEGACY: 0xFFFFFFFF where the column is valid; else bit 0, of 16

    static constexpr std::uint32_t kEncoderTurn = 90'112;
};

struct OusterReturn {
    std::uint32_t range_mm = 0;  ///< 0: none
    std::uint8_t flags = 0;
    std::uint8_t reflectivity = 0;
    std::uint16_t signal = 0;  ///< photons
};

struct OusterPixel {
    std::array<OusterReturn, 2> returns{};  ///< the second one in the dual profile alone
    std::uint16_t near_ir = 0;              ///< photons of ambient light
    std::array<std::uint64_t, 2> unused{};  ///< bits outside of all fields, kept as in the packet
};

/// Reads and writes packets of one profile from a sensor with this number of beams.
class OusterFormat {
public:
    static constexpr int kColumns = 16;  ///< of a packet, as delivered

    OusterFormat(OusterProfile profile, int beams, int columns = kColumns) noexcept
        : profile_(profile), beams_(beams), columns_(columns) {}

    [[nodiscard]] OusterProfile profile() const noexcept { return profile_; }
    [[nodiscard]] int columns() const noexcept { return columns_; }
    [[nodiscard]] std::size_t bytes() const noexcept;
    [[nodiscard]] std::uint32_t range_mm_max() const noexcept;
    [[nodiscard]] std::uint32_t range_step_mm() const noexcept;
    [[nodiscard]] bool is_valid(const OusterColumn& column) const noexcept;
    [[nodiscard]] std::uint32_t valid_status() const noexcept;

    /// All spans have bytes(); columns are counted from 0 to columns() - 1, beams from 0. Values that a field
    /// cannot hold lose their high bits. LEGACY has no header.
    [[nodiscard]] OusterHeader header(std::span<const std::uint8_t> packet) const noexcept;
    [[nodiscard]] OusterColumn column(std::span<const std::uint8_t> packet, int column) const noexcept;
    [[nodiscard]] OusterPixel pixel(std::span<const std::uint8_t> packet, int column, int beam) const noexcept;
    void put(const OusterHeader& header, std::span<std::uint8_t> packet) const noexcept;
    void put(const OusterColumn& value, std::span<std::uint8_t> packet, int column) const noexcept;
    void put(const OusterPixel& value, std::span<std::uint8_t> packet, int column, int beam) const noexcept;

private:
    [[nodiscard]] std::size_t column_at(int column) const noexcept;
    [[nodiscard]] std::size_t pixel_at(int column, int beam) const noexcept;

    OusterProfile profile_;
    int beams_, columns_;
};

}  // namespace narpa
