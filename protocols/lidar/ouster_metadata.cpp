#include "protocols/lidar/ouster_metadata.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

namespace narpa {
namespace {

using nlohmann::json;

constexpr double kMax_mm = 1000;
constexpr int kMaxColumns = 4096, kMaxHz = 100;

int line_at(std::string_view text, std::size_t offset) {
    return 1 + static_cast<int>(std::count(text.begin(), text.begin() + std::min(offset, text.size()), '\n'));
}

/// An error in a file: its key, and what was expected.
struct MetadataFault {
    std::string_view key;
    std::string expected;
};

/// The keys of a metadata document, whatever section holds them.
class MetadataReader {
public:
    explicit MetadataReader(const json& root) : root_(root) {}

    /// Null where there is none.
    [[nodiscard]] const json* find(std::string_view key) const {
        if (const auto at = root_.find(key); at != root_.end()) return &*at;
        for (const json& section : root_)
            if (section.is_object())
                if (const auto at = section.find(key); at != section.end()) return &*at;
        return nullptr;
    }

    void text(std::string_view key, std::string& out) const {
        const json* node = find(key);
        if (!node) return;
        if (!node->is_string()) throw MetadataFault{key, "a text"};
        out = node->get<std::string>();
    }

    template <class Integer>
    void integer(std::string_view key, std::int64_t low, std::int64_t high, Integer& out) const {
        if (const json* node = find(key)) out = static_cast<Integer>(integer_of(key, *node, low, high));
    }

    /// Reads a list of any length.
    void numbers(std::string_view key, double most, std::vector<double>& out) const {
        const json* node = find(key);
        if (!node) return;
        if (!node->is_array()) throw MetadataFault{key, "a list of numbers"};
        for (const json& x : *node) out.push_back(number_of(key, x, most));
    }

    void integers(std::string_view key, std::int64_t low, std::int64_t high, std::vector<int>& out) const {
        const json* node = find(key);
        if (!node) return;
        if (!node->is_array()) throw MetadataFault{key, "a list of whole numbers"};
        for (const json& x : *node) out.push_back(static_cast<int>(integer_of(key, x, low, high)));
    }

    [[nodiscard]] static double number_of(std::string_view key, const json& x, double most) {
        if (!x.is_number() || !(std::abs(x.get<double>()) <= most))
            throw MetadataFault{key, "numbers from " + std::to_string(-most) + " to " + std::to_string(most)};
        return x.get<double>();
    }

private:
    [[nodiscard]] static std::int64_t integer_of(std::string_view key, const json& x, std::int64_t low,
                                                 std::int64_t high) {
        // Compared as a double first: conversion to 64 bits would wrap larger numbers.
        if (!x.is_number_integer() || !(x.get<double>() >= static_cast<double>(low)) ||
            !(x.get<double>() <= static_cast<double>(high)))
            throw MetadataFault{key, "whole numbers from " + std::to_string(low) + " to " + std::to_string(high)};
        return x.get<std::int64_t>();
    }

    const json& root_;
};

/// A rotation and a translation.
void read_transform(const MetadataReader& file, std::string_view key, OusterTransform& out) {
    std::vector<double> m;
    file.numbers(key, kMax_mm, m);
    if (m.empty()) return;
    constexpr double kTolerance = 1e-3;
    const auto is_near = [](double a, double b) { return std::abs(a - b) <= kTolerance; };
    bool good =
        m.size() == out.size() && is_near(m[12], 0) && is_near(m[13], 0) && is_near(m[14], 0) && is_near(m[15], 1);
    for (std::size_t i = 0; good && i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k)
            good = good && is_near(m[4 * i] * m[4 * k] + m[4 * i + 1] * m[4 * k + 1] + m[4 * i + 2] * m[4 * k + 2],
                                   i == k ? 1 : 0);
    if (!good) throw MetadataFault{key, "16 numbers: a rotation, a translation in mm and 0, 0, 0, 1"};
    std::ranges::copy(m, out.begin());
}

/// "1024x10"
void read_mode(const MetadataReader& file, OusterMetadata& out) {
    std::string mode;
    file.text("lidar_mode", mode);
    if (mode.empty()) return;
    const char *begin = mode.data(), *end = begin + mode.size();
    const auto columns = std::from_chars(begin, end, out.columns);
    const char* times = columns.ptr;
    const bool has_times = columns.ec == std::errc{} && times != end && *times == 'x';
    const auto rate = std::from_chars(has_times ? times + 1 : end, end, out.rate_hz);
    if (rate.ec != std::errc{} || rate.ptr != end || out.columns < 1 || out.columns > kMaxColumns ||
        out.rate_hz < 1 || out.rate_hz > kMaxHz)
        throw MetadataFault{"lidar_mode", "columns and turns a second, as 1024x10"};
}

void read_beams(const MetadataReader& file, OusterMetadata& out) {
    file.numbers("beam_altitude_angles", 90, out.altitude_deg);
    file.numbers("beam_azimuth_angles", 360, out.azimuth_deg);
    if (out.altitude_deg.empty()) throw MetadataFault{"beam_altitude_angles", "the angle of each beam in degrees"};
    if (out.azimuth_deg.size() != out.altitude_deg.size())
        throw MetadataFault{"beam_azimuth_angles", "as many angles as beam_altitude_angles has"};
    read_transform(file, "beam_to_lidar_transform", out.beam_to_lidar);
    // Older files state the distance alone.
    if (const json* n = file.find("lidar_origin_to_beam_origin_mm"); n && !file.find("beam_to_lidar_transform"))
        out.beam_to_lidar[3] = MetadataReader::number_of("lidar_origin_to_beam_origin_mm", *n, kMax_mm);
}

/// Columns of a packet, and a check of the beams.
void read_packing(const MetadataReader& file, OusterMetadata& out) {
    constexpr std::size_t kDatagramBytesMax = 65507;
    file.integer("columns_per_packet", 1, kMaxColumns, out.columns_per_packet);
    const bool divides = out.columns == 0 || out.columns % out.columns_per_packet == 0;
    const auto profile = std::ranges::find(kOusterProfiles, out.profile.empty() ? kOusterProfiles[1] : out.profile);
    const OusterFormat format(static_cast<OusterProfile>(profile - kOusterProfiles.begin()),
                              static_cast<int>(out.altitude_deg.size()), out.columns_per_packet);
    if (!divides || format.bytes() > kDatagramBytesMax)
        throw MetadataFault{"columns_per_packet", "a divisor of the columns of a turn, in packets of at most " +
                                                      std::to_string(kDatagramBytesMax) + " bytes"};
    std::size_t beams = out.altitude_deg.size();
    file.integer("pixels_per_column", 1, kMaxColumns, beams);
    if (beams != out.altitude_deg.size())
        throw MetadataFault{"pixels_per_column", "the number of beam_altitude_angles"};
}

void read_format(const MetadataReader& file, OusterMetadata& out) {
    read_mode(file, out);
    file.integer("columns_per_frame", 1, kMaxColumns, out.columns);
    file.text("udp_profile_lidar", out.profile);
    if (!out.profile.empty() && std::ranges::find(kOusterProfiles, out.profile) == kOusterProfiles.end())
        throw MetadataFault{"udp_profile_lidar",
                            std::string(kOusterProfiles[0]) + ", " + std::string(kOusterProfiles[1]) + ", " +
                                std::string(kOusterProfiles[2]) + " or " + std::string(kOusterProfiles[3])};
    read_packing(file, out);
    std::vector<int> window;
    file.integers("column_window", 0, kMaxColumns - 1, window);
    if (!window.empty()) {
        if (window.size() != 2 || std::max(window[0], window[1]) >= out.columns)
            throw MetadataFault{"column_window", "the first and the last column, each below the columns of a turn"};
        out.column_window = {window[0], window[1]};
    }
    file.integers("pixel_shift_by_row", -kMaxColumns, kMaxColumns, out.pixel_shift_by_row);
    if (!out.pixel_shift_by_row.empty() && out.pixel_shift_by_row.size() != out.altitude_deg.size())
        throw MetadataFault{"pixel_shift_by_row", "a number for each beam"};
    file.integer("udp_port_lidar", 1, 65535, out.port_lidar);
    file.integer("udp_port_imu", 1, 65535, out.port_imu);
}

void read_identity(const MetadataReader& file, OusterMetadata& out) {
    file.text("prod_line", out.prod_line);
    file.text("prod_pn", out.prod_pn);
    file.text("prod_sn", out.prod_sn);
    file.text("image_rev", out.image_rev);
    file.text("build_rev", out.build_rev);
    file.text("build_date", out.build_date);
    file.integer("initialization_id", 0, 0xFF'FFFF, out.init_id);
    out.states_init_id = file.find("initialization_id") != nullptr;
    out.states_serial = file.find("prod_sn") != nullptr;
    constexpr std::size_t kMaxDigits = 12;  // packets have 40 bits for it
    if (out.prod_sn.size() > kMaxDigits ||
        !std::ranges::all_of(out.prod_sn, [](char c) { return c >= '0' && c <= '9'; }))
        throw MetadataFault{"prod_sn", "at most 12 digits"};
}

OusterMetadata read_document(const json& root) {
    const MetadataReader file(root);
    OusterMetadata out;
    read_beams(file, out);
    read_transform(file, "lidar_to_sensor_transform", out.lidar_to_sensor);
    read_transform(file, "imu_to_sensor_transform", out.imu_to_sensor);
    read_format(file, out);
    read_identity(file, out);
    return out;
}

Error fault_at(std::string_view text, const MetadataFault& fault) {
    const std::size_t at = text.find('"' + std::string(fault.key) + '"');
    return {.what = std::string(fault.key) + ": expected " + fault.expected,
            .line = line_at(text, at == text.npos ? 0 : at)};
}

}  // namespace

double OusterMetadata::origin_to_beam_mm() const noexcept {
    return std::hypot(beam_to_lidar[3], beam_to_lidar[11]);
}

std::uint64_t OusterMetadata::serial() const noexcept {
    std::uint64_t number = 0;
    std::from_chars(prod_sn.data(), prod_sn.data() + prod_sn.size(), number);
    return number;
}

Result<OusterMetadata> read_ouster_metadata(std::string_view text) {
    constexpr const char* kKind = "expected a sensor's metadata: a JSON object with beam_altitude_angles";
    try {
        const json root = json::parse(text);
        if (!root.is_object()) return Error{.what = kKind, .line = 1};
        return read_document(root);
    } catch (const json::parse_error& e) {
        return Error{.what = std::string("not JSON; ") + kKind, .line = line_at(text, e.byte > 0 ? e.byte - 1 : 0)};
    } catch (const MetadataFault& fault) {
        return fault_at(text, fault);
    }
}

std::string write_ouster_metadata(const OusterMetadata& m) {
    json calibration;
    calibration["reflectivity"] = {{"timestamp", m.build_date}, {"valid", true}};
    const json document{{"beam_intrinsics",
                         {{"beam_altitude_angles", m.altitude_deg},
                          {"beam_azimuth_angles", m.azimuth_deg},
                          {"beam_to_lidar_transform", m.beam_to_lidar},
                          {"lidar_origin_to_beam_origin_mm", m.origin_to_beam_mm()}}},
                        {"calibration_status", calibration},
                        {"config_params",
                         {{"azimuth_window", {0, 360'000}},
                          {"columns_per_packet", m.columns_per_packet},
                          {"lidar_mode", std::to_string(m.columns) + "x" + std::to_string(m.rate_hz)},
                          {"operating_mode", "NORMAL"},
                          {"signal_multiplier", 1},
                          {"timestamp_mode", m.ptp ? "TIME_FROM_PTP_1588" : "TIME_FROM_INTERNAL_OSC"},
                          {"udp_dest", ""},
                          {"udp_port_imu", m.port_imu},
                          {"udp_port_lidar", m.port_lidar},
                          {"udp_profile_imu", "LEGACY"},
                          {"udp_profile_lidar", m.profile}}},
                        {"imu_intrinsics", {{"imu_to_sensor_transform", m.imu_to_sensor}}},
                        {"lidar_data_format",
                         {{"column_window", m.column_window},
                          {"columns_per_frame", m.columns},
                          {"columns_per_packet", m.columns_per_packet},
                          {"pixel_shift_by_row", m.pixel_shift_by_row},
                          {"pixels_per_column", m.altitude_deg.size()},
                          {"udp_profile_imu", "LEGACY"},
                          {"udp_profile_lidar", m.profile}}},
                        {"lidar_intrinsics", {{"lidar_to_sensor_transform", m.lidar_to_sensor}}},
                        {"sensor_info",
                         {{"build_date", m.build_date},
                          {"build_rev", m.build_rev},
                          {"image_rev", m.image_rev},
                          {"initialization_id", m.init_id},
                          {"prod_line", m.prod_line},
                          {"prod_pn", m.prod_pn},
                          {"prod_sn", m.prod_sn},
                          {"status", "RUNNING"}}}};
    return document.dump(1) + "\n";
}

}  // namespace narpa
