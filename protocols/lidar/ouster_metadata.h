/// protocols/lidar/ouster_metadata.h - the metadata of an Ouster sensor, in the maker's JSON format.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "protocols/lidar/ouster_packet.h"

namespace narpa {

/// A row-major 4 x 4 transform of the maker; its translation is in mm.
using OusterTransform = std::array<double, 16>;

/// One sensor and its mode. Members that a file does not have keep these values.
struct OusterMetadata {
    std::string prod_line{}, prod_pn = "840-103575-06", prod_sn = "992400000000";
    std::string image_rev = "ousteros-image-prod-narpa-v2.4.0", build_rev = "v2.4.0",
                build_date = "2022-12-02T00:00:00Z";
    std::uint32_t init_id = 0x4E'4152;
    bool states_init_id = true, states_serial = true;  ///< false: packets with any are those of the sensor

    std::vector<double> altitude_deg{}, azimuth_deg{};  ///< of each beam, from the highest to the lowest
    OusterTransform beam_to_lidar{1, 0, 0, 15.806, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    OusterTransform lidar_to_sensor{-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 36.18, 0, 0, 0, 1};
    OusterTransform imu_to_sensor{1, 0, 0, 6.253, 0, 1, 0, -11.775, 0, 0, 1, 7.645, 0, 0, 0, 1};

    int columns = 0;        ///< of a turn; 0: not stated
    int rate_hz = 0;        ///< turns a second; 0: not stated
    std::string profile{};  ///< one of kOusterProfiles; empty: not stated
    bool ptp = false;       ///< its clock follows a PTP master; else it runs freely
    int columns_per_packet = OusterFormat::kColumns;
    /// First and last that fire, by way of column 0 where the first is above the last; last below 0: all do.
    std::array<int, 2> column_window{0, -1};
    std::vector<int> pixel_shift_by_row{};  ///< for `columns`; empty: not stated
    std::uint16_t port_lidar = 7502, port_imu = 7503;

    /// Distance along a beam from the lidar's axis to the origin of its ranges; the maker's n.
    [[nodiscard]] double origin_to_beam_mm() const noexcept;
    [[nodiscard]] std::uint64_t serial() const noexcept;
};

/// Reads both the nested form (firmware 2.4 and later) and the flat one (before). Errors have a line: no JSON, no
/// beam angles, lists whose lengths differ, values that no sensor has.
[[nodiscard]] Result<OusterMetadata> read_ouster_metadata(std::string_view json);

/// The nested form, as the sensor's HTTP server gives it. columns, rate_hz, profile and pixel_shift_by_row are
/// stated.
[[nodiscard]] std::string write_ouster_metadata(const OusterMetadata& metadata);

}  // namespace narpa
