#include "protocols/lidar/ouster.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/constants.h"
#include "base/time.h"
#include "protocols/lidar/ouster_metadata.h"
#include "protocols/lidar/ouster_packet.h"
#include "protocols/lidar/reflectivity_code.h"

namespace narpa {
namespace {

constexpr std::array<int, 3> kColumnsOfATurn{512, 1024, 2048};
constexpr int kDesignBeams = 128;

/// Signal photons of a white diffuse surface perpendicular to the beam at 1 m. A recorded OS0-32 has 23,000 to
/// 27,000 (75th to 99th percentile of signal * range^2 / reflectivity).
constexpr double kSignalPhotons_m2 = 25'000;
/// Near-infrared value of a white surface that faces the Sun at 1 au. The maker gives no scale; this one just fits
/// the low-bandwidth profile.
constexpr double kNearIrOfSunlitWhite = 4000;

constexpr LidarNetwork kOusterNetwork{.data_port = 7502,
                                      .mac = {0xBC, 0x0F, 0xA7, 0, 0, 0},  // the maker's prefix
                                      .address = {192, 168, 1, 200}};

/// Angles as designed: README.md, "Beams". Fewer beams than 128 are every second, fourth or eighth of them.
void set_design_beams(OusterMetadata& unit, int beams) {
    constexpr double kHighest_deg = 21.4;
    constexpr std::array<double, 4> kAzimuth_deg{4.21, 1.41, -1.4, -4.21};
    for (int i = 0; i < beams; ++i) {
        const int design = i * kDesignBeams / beams;
        unit.altitude_deg.push_back(kHighest_deg - 2 * kHighest_deg * design / (kDesignBeams - 1));
        unit.azimuth_deg.push_back(kAzimuth_deg[static_cast<std::size_t>(design % 4)]);
    }
}

/// Columns by which a reader shifts (destaggers) each beam, so that a column of its image has one azimuth; the
/// smallest is 0.
std::vector<int> pixel_shifts(const OusterMetadata& unit) {
    std::vector<int> shifts;
    for (const double a : unit.azimuth_deg) shifts.push_back(static_cast<int>(std::lround(a / 360 * unit.columns)));
    const int least = *std::ranges::min_element(shifts);
    for (int& shift : shifts) shift -= least;
    return shifts;
}

/// The unit of the calibration text; without a text, as designed.
Result<OusterMetadata> read_unit(const LidarSettings& settings, int beams) {
    OusterMetadata unit;
    if (settings.calibration.empty()) {
        set_design_beams(unit, beams);
    } else {
        auto read = read_ouster_metadata(settings.calibration);
        if (!read) return read.error();
        unit = *std::move(read);
        if (std::cmp_not_equal(unit.altitude_deg.size(), beams))
            return Error{.what = "beam_altitude_angles: expected " + std::to_string(beams) +
                                 " numbers, one for each beam, found " + std::to_string(unit.altitude_deg.size()),
                         .line = 1};
    }
    if (unit.prod_line.empty()) unit.prod_line = "OS-1-" + std::to_string(beams);
    return unit;
}

/// The unit with the mode of the settings, else of the text, else as delivered.
Result<OusterMetadata> configured_unit(const LidarSettings& settings, int beams) {
    auto read = read_unit(settings, beams);
    if (!read) return read;
    OusterMetadata unit = *std::move(read);
    unit.ptp = settings.ptp;
    const int columns_before = unit.columns;
    if (settings.columns > 0) unit.columns = settings.columns;
    if (unit.columns == 0) unit.columns = 1024;
    const double rate_hz = settings.rate_hz > 0 ? settings.rate_hz : unit.rate_hz > 0 ? unit.rate_hz : 10;
    const bool known = std::ranges::find(kColumnsOfATurn, unit.columns) != kColumnsOfATurn.end();
    if (!known || !(rate_hz == 10 || (rate_hz == 20 && unit.columns < 2048)))
        return Error{.what = "expected columns and rate_hz of one of 512x10, 1024x10, 2048x10, 512x20, 1024x20"};
    unit.rate_hz = static_cast<int>(rate_hz);
    if (!settings.profile.empty()) unit.profile = settings.profile;
    if (unit.profile.empty()) unit.profile = kOusterProfiles[1];

    if (unit.columns != columns_before || unit.pixel_shift_by_row.empty())
        unit.pixel_shift_by_row = pixel_shifts(unit);
    if (unit.columns % unit.columns_per_packet != 0)
        return Error{.what = "columns_per_packet of the metadata is " + std::to_string(unit.columns_per_packet) +
                             ", expected a divisor of the columns of a turn, " + std::to_string(unit.columns)};
    if (unit.column_window[1] < 0) unit.column_window = {0, unit.columns - 1};
    if (columns_before > 0 && columns_before != unit.columns)
        unit.column_window = {unit.column_window[0] * unit.columns / columns_before,
                              (unit.column_window[1] + 1) * unit.columns / columns_before - 1};
    return unit;
}

OusterProfile profile_of(const OusterMetadata& unit) {
    return static_cast<OusterProfile>(std::ranges::find(kOusterProfiles, unit.profile) - kOusterProfiles.begin());
}

class Ouster final : public LidarModel {
public:
    Ouster(std::string_view name, OusterMetadata unit)
        : LidarModel(spec_of(name, unit)), unit_(std::move(unit)), format_(format_of(unit_)) {
        for (std::size_t i = 0; i < unit_.altitude_deg.size(); ++i)
            beams_.push_back({.azimuth_rad = -unit_.azimuth_deg[i] * kRadPerDeg,
                              .elevation_rad = unit_.altitude_deg[i] * kRadPerDeg,
                              .horizontal = std::cos(unit_.altitude_deg[i] * kRadPerDeg),
                              .vertical = std::sin(unit_.altitude_deg[i] * kRadPerDeg)});
    }

    [[nodiscard]] std::int64_t packet_start_ns(std::int64_t packet) const noexcept override {
        return packet / packets_a_turn() * turn_ns() + measurement_ns(measurement_of(packet, 0));
    }
    [[nodiscard]] std::int64_t first_packet_from(std::int64_t t_ns) const noexcept override {
        std::int64_t packet = t_ns / turn_ns() * packets_a_turn() + t_ns % turn_ns() * packets_a_turn() / turn_ns();
        while (packet_start_ns(packet) < t_ns) ++packet;
        return packet;
    }

    void shots(std::int64_t packet, std::span<LidarShot> out) const noexcept override {
        for (std::size_t i = 0; i < out.size(); ++i) {
            const int column = static_cast<int>(i / beams_.size()), measurement = measurement_of(packet, column);
            const std::size_t beam = i % beams_.size();
            LidarShot& shot = out[i];
            shot = along(beam, measurement);
            shot.t_offset_ns = column_offset_ns(packet, column);
            shot.block = column;
            shot.fires = fires(measurement);
        }
    }

    void encode(std::int64_t packet, LidarUtc epoch, std::span<const LidarEchoes> echoes,
                std::span<std::uint8_t> out) const noexcept override {
        std::ranges::fill(out, std::uint8_t{0});
        const auto frame_id = static_cast<std::uint16_t>(packet / packets_a_turn());
        format_.put(
            OusterHeader{
                .frame_id = frame_id, .init_id = unit_.init_id, .serial = unit_.serial(), .rest = {}, .footer = {}},
            out);
        for (int c = 0; c < format_.columns(); ++c) {
            const int measurement = measurement_of(packet, c);
            const bool valid = fires(measurement);
            format_.put(
                OusterColumn{.t_ns = static_cast<std::uint64_t>(epoch.unix_ns + packet_start_ns(packet) +
                                                                column_offset_ns(packet, c)),
                             .measurement_id = static_cast<std::uint16_t>(measurement),
                             .frame_id = frame_id,
                             .encoder = OusterColumn::kEncoderTurn / static_cast<std::uint32_t>(unit_.columns) *
                                        static_cast<std::uint32_t>(measurement),
                             .status = valid ? format_.valid_status() : 0},
                out, c);
            for (std::size_t beam = 0; valid && beam < beams_.size(); ++beam)
                format_.put(to_pixel(echoes[static_cast<std::size_t>(c) * beams_.size() + beam]), out, c,
                            static_cast<int>(beam));
        }
    }

    std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                            std::int64_t) const noexcept override {
        if (mismatch_of(bytes) != Mismatch::none) return std::nullopt;
        return static_cast<std::int64_t>(format_.column(bytes, 0).t_ns);
    }

    std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept override {
        std::size_t count = 0;
        each_pixel(bytes, [&](int shot_number, std::size_t beam, const OusterPixel& pixel, const LidarAxis& axis) {
            for (int echo = 0; echo < 2; ++echo) {
                const OusterReturn& r = pixel.returns[static_cast<std::size_t>(echo)];
                const double range_m = 1e-3 * r.range_mm - origin_to_beam_m();
                if (r.range_mm == 0 || !(range_m > 0)) continue;
                out[count++] = {.origin_m = axis.origin_m,
                                .direction = axis.direction,
                                .range_m = range_m,
                                .t_offset_ns = axis.t_offset_ns,
                                .intensity = r.reflectivity,
                                .beam = static_cast<int>(beam),
                                .shot = shot_number,
                                .echo = echo};
            }
        });
        return count;
    }

    std::size_t empty_shots(std::span<const std::uint8_t> bytes, std::span<LidarAxis> out) const noexcept override {
        std::size_t count = 0;
        each_pixel(bytes, [&](int, std::size_t, const OusterPixel& pixel, const LidarAxis& axis) {
            if (pixel.returns[0].range_mm == 0 && pixel.returns[1].range_mm == 0) out[count++] = axis;
        });
        return count;
    }

    std::string mismatch(std::span<const std::uint8_t> bytes) const override {
        const auto differs = [](const char* what, std::uint64_t found, std::uint64_t expected) {
            return what + (" " + std::to_string(found)) + " in the packets, " + std::to_string(expected) +
                   " in the sensor's metadata";
        };
        switch (mismatch_of(bytes)) {
            case Mismatch::none: break;
            case Mismatch::size:
                return std::to_string(bytes.size()) + " bytes, expected " + std::to_string(format_.bytes());
            case Mismatch::type: return "packet type " + std::to_string(format_.header(bytes).packet_type);
            case Mismatch::init_id: return differs("init id", format_.header(bytes).init_id, unit_.init_id);
            case Mismatch::serial: return differs("serial number", format_.header(bytes).serial, unit_.serial());
            case Mismatch::columns:
                return "measurement ids that are not those of " + std::to_string(format_.columns()) +
                       " successive columns of " + std::to_string(unit_.columns);
            case Mismatch::times: return "column times that are not within one turn";
        }
        return {};
    }

    std::string metadata() const override { return write_ouster_metadata(unit_); }

private:
    /// Calls use(shot's number, beam, pixel, axis) for the shots of the packet's valid columns, in firing order.
    template <class Use>
    void each_pixel(std::span<const std::uint8_t> bytes, const Use& use) const noexcept {
        if (mismatch_of(bytes) != Mismatch::none) return;
        const std::uint64_t start_ns = format_.column(bytes, 0).t_ns;
        for (int c = 0; c < format_.columns(); ++c) {
            const OusterColumn column = format_.column(bytes, c);
            if (!format_.is_valid(column)) continue;
            for (std::size_t beam = 0; beam < beams_.size(); ++beam) {
                const LidarShot shot = along(beam, column.measurement_id);
                use(c * static_cast<int>(beams_.size()) + static_cast<int>(beam), beam,
                    format_.pixel(bytes, c, static_cast<int>(beam)),
                    LidarAxis{shot.origin_m, shot.direction, static_cast<std::int64_t>(column.t_ns - start_ns)});
            }
        }
    }

    struct Beam {
        double azimuth_rad, elevation_rad;  ///< counter-clockwise
        double horizontal, vertical;        ///< cosine and sine of the elevation
    };

    static OusterFormat format_of(const OusterMetadata& unit) {
        return {profile_of(unit), static_cast<int>(unit.altitude_deg.size()), unit.columns_per_packet};
    }

    static LidarSpec spec_of(std::string_view name, const OusterMetadata& unit) {
        const OusterFormat format = format_of(unit);
        const std::size_t shots = static_cast<std::size_t>(format.columns()) * unit.altitude_deg.size();
        const bool dual = format.profile() == OusterProfile::dual;
        LidarNetwork network = kOusterNetwork;
        network.data_port = unit.port_lidar;
        network.datagram_bytes_max = std::max(network.datagram_bytes_max, format.bytes());
        return {.name = name,
                .rate_hz = static_cast<double>(unit.rate_hz),
                .returns = dual ? LidarReturns::strongest_two : LidarReturns::strongest,
                .packet_period_ns = kSecond_ns / unit.rate_hz / (unit.columns / format.columns()),
                .shots_per_packet = shots,
                .points_per_packet = dual ? 2 * shots : shots,
                .data_packet_bytes = format.bytes(),
                .range_m_max = 1e-3 * format.range_mm_max() - 1e-3 * unit.origin_to_beam_mm(),
                .range_resolution_m = 1e-3 * format.range_step_mm(),
                .measures_sunlight = true,
                .network = network};
    }

    [[nodiscard]] int packets_a_turn() const noexcept { return unit_.columns / format_.columns(); }
    [[nodiscard]] int measurement_of(std::int64_t packet, int column) const noexcept {
        return static_cast<int>(packet % packets_a_turn()) * format_.columns() + column;
    }
    /// After the start of its turn.
    [[nodiscard]] std::int64_t measurement_ns(int measurement) const noexcept {
        return measurement * turn_ns() / unit_.columns;
    }
    [[nodiscard]] std::int64_t turn_ns() const noexcept { return kSecond_ns / unit_.rate_hz; }
    [[nodiscard]] std::int64_t column_offset_ns(std::int64_t packet, int column) const noexcept {
        return measurement_ns(measurement_of(packet, column)) - measurement_ns(measurement_of(packet, 0));
    }
    [[nodiscard]] bool fires(int measurement) const noexcept {
        const auto [first, last] = unit_.column_window;
        return first <= last ? measurement >= first && measurement <= last
                             : measurement >= first || measurement <= last;
    }
    [[nodiscard]] double origin_to_beam_m() const noexcept { return 1e-3 * unit_.origin_to_beam_mm(); }

    /// Transforms a point (`translation` 1) or a direction (0) from the maker's lidar frame to ours.
    [[nodiscard]] Vec3 from_lidar(const Vec3& p, double translation) const noexcept {
        const OusterTransform& m = unit_.lidar_to_sensor;
        const auto row = [&](std::size_t i) {
            return m[4 * i] * p.x + m[4 * i + 1] * p.y + m[4 * i + 2] * p.z + translation * 1e-3 * m[4 * i + 3];
        };
        return {-row(1), row(0), row(2)};
    }

    /// Origin, direction, angles and beam.
    [[nodiscard]] LidarShot along(std::size_t index, int measurement) const noexcept {
        const Beam& beam = beams_[index];
        const double encoder = 2 * std::numbers::pi * (1 - static_cast<double>(measurement) / unit_.columns),
                     azimuth = encoder + beam.azimuth_rad;
        const double out_m = 1e-3 * unit_.beam_to_lidar[3], up_m = 1e-3 * unit_.beam_to_lidar[11];
        LidarShot shot;
        shot.origin_m = from_lidar({out_m * std::cos(encoder), out_m * std::sin(encoder), up_m}, 1);
        shot.direction = from_lidar(
            {beam.horizontal * std::cos(azimuth), beam.horizontal * std::sin(azimuth), beam.vertical}, 0);
        shot.azimuth_rad = azimuth;
        shot.elevation_rad = beam.elevation_rad;
        shot.beam = static_cast<int>(index);
        return shot;
    }

    [[nodiscard]] OusterReturn to_return(const LidarEcho& echo) const noexcept {
        if (!(echo.range_m > 0 && echo.range_m <= spec().range_m_max)) return {};  // NaN too
        const double photons =
            kSignalPhotons_m2 * static_cast<double>(echo.reflectivity) / (echo.range_m * echo.range_m);
        return {.range_mm = static_cast<std::uint32_t>(
                                std::lround(1e3 * (echo.range_m + origin_to_beam_m()) / format_.range_step_mm())) *
                            format_.range_step_mm(),
                .reflectivity = reflectivity_code(echo.reflectivity),
                .signal = to_photons(photons)};
    }

    [[nodiscard]] static std::uint16_t to_photons(double photons) noexcept {
        return static_cast<std::uint16_t>(std::lround(std::clamp(photons, 0.0, 65535.0)));
    }

    [[nodiscard]] OusterPixel to_pixel(const LidarEchoes& echoes) const noexcept {
        const auto reported = echoes.reported(spec().returns);
        return {.returns = {to_return(reported[0]), to_return(reported[1])},
                .near_ir = to_photons(kNearIrOfSunlitWhite * static_cast<double>(echoes.sunlight))};
    }

    enum class Mismatch : std::uint8_t { none, size, type, init_id, serial, columns, times };

    /// `none` for packets of this unit whose columns are in order, with times within one turn.
    [[nodiscard]] Mismatch mismatch_of(std::span<const std::uint8_t> bytes) const noexcept {
        if (bytes.size() != format_.bytes()) return Mismatch::size;
        if (format_.profile() != OusterProfile::legacy) {
            const OusterHeader header = format_.header(bytes);
            if (header.packet_type != OusterHeader::kLidar) return Mismatch::type;
            if (unit_.states_init_id && header.init_id != unit_.init_id) return Mismatch::init_id;
            if (unit_.states_serial && header.serial != unit_.serial()) return Mismatch::serial;
        }
        const OusterColumn first = format_.column(bytes, 0);
        if (first.measurement_id % format_.columns() != 0 || first.measurement_id >= unit_.columns)
            return Mismatch::columns;
        if (first.t_ns >> 63 != 0) return Mismatch::times;
        for (int c = 1; c < format_.columns(); ++c) {
            const OusterColumn column = format_.column(bytes, c);
            if (column.measurement_id != first.measurement_id + c) return Mismatch::columns;
            // Unsigned: a time before the first one's is far above.
            if (column.t_ns - first.t_ns > static_cast<std::uint64_t>(turn_ns())) return Mismatch::times;
        }
        return Mismatch::none;
    }

    OusterMetadata unit_;
    OusterFormat format_;
    std::vector<Beam> beams_;
};

Status complete(LidarSettings& settings, int beams) {
    const auto unit = configured_unit(settings, beams);
    if (!unit) return unit.error();
    settings.columns = unit->columns;
    settings.rate_hz = unit->rate_hz;
    settings.profile = unit->profile;
    settings.returns =
        profile_of(*unit) == OusterProfile::dual ? LidarReturns::strongest_two : LidarReturns::strongest;
    return Ok{};
}

LidarMake make_of(std::string_view name, int beams) {
    return {.name = name,
            .rate_hz_min = 10,
            .rate_hz_max = 20,
            .rate_hz_default = 10,
            .range_m_max = 0xF'FFFF * 1e-3,  // LEGACY
            .range_m_default = 120,
            .profiles = kOusterProfiles,
            .columns = kColumnsOfATurn,
            .network = kOusterNetwork,
            .complete = [beams](LidarSettings& settings) { return complete(settings, beams); },
            .configure =
                [name, beams](const LidarSettings& settings) {
                    LidarSettings as_designed = settings;
                    auto unit = configured_unit(settings, beams);
                    if (!unit) {  // settings that `complete` refused
                        as_designed = {};
                        unit = configured_unit(as_designed, beams);
                    }
                    return std::make_shared<const Ouster>(name, *std::move(unit));
                }};
}

}  // namespace

std::span<const LidarMake* const> ouster_makes() noexcept {
    static const std::array<LidarMake, 4> makes{make_of("os1-16", 16), make_of("os1-32", 32), make_of("os1-64", 64),
                                                make_of("os1-128", 128)};
    static const std::array<const LidarMake*, 4> all{&makes[0], &makes[1], &makes[2], &makes[3]};
    return all;
}

}  // namespace narpa
