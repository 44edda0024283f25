#include "renderer/dem_reader/gdal_source.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <fmt/format.h>
#include <gdal.h>
#include <gdal_frmts.h>
#include <ogr_srs_api.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "renderer/dem_reader/height_declaration.h"
#include "renderer/dem_reader/one_folder.h"

namespace narpa {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kHighest_m = 1e9;  // of a height or radius; above, it is taken for no-data

std::string gdal_words() {
    std::string words = CPLGetLastErrorMsg();
    for (char& c : words)
        if (c == '\n' || c == '\r') c = ' ';
    for (std::size_t at; (at = words.find(kOneFolder)) != std::string::npos;)
        words.erase(at, std::string_view(kOneFolder).size());
    return words.empty() ? "no reason given" : words;
}

class GdalSource final : public HeightSource {
public:
    GdalSource(GDALDatasetH file, HeightDeclaration declared, std::shared_ptr<VoidDetector> voids)
        : file_(file),
          band_(GDALGetRasterBand(file, 1)),
          columns_(GDALGetRasterXSize(file)),
          rows_(GDALGetRasterYSize(file)),
          declared_(std::move(declared)),
          voids_(std::move(voids)),
          masked_((GDALGetMaskFlags(band_) & GMF_ALL_VALID) == 0) {}
    ~GdalSource() override { GDALClose(file_); }

    [[nodiscard]] int columns() const override { return columns_; }
    [[nodiscard]] int rows() const override { return rows_; }
    [[nodiscard]] bool read_rows(int row, int count, double* heights) override {
        const std::size_t n = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(count);
        if (GDALRasterIO(band_, GF_Read, 0, row, columns_, count, heights, columns_, count, GDT_Float64, 0, 0) !=
            CE_None)
            return false;
        if (masked_) {
            mask_.resize(n);
            if (GDALRasterIO(GDALGetMaskBand(band_), GF_Read, 0, row, columns_, count, mask_.data(), columns_,
                             count, GDT_Byte, 0, 0) != CE_None)
                return false;
        }
        numbers_.resize(n);
        std::uint64_t unusable = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const double number = numbers_[i] = in_palette(heights[i]);
            const double h = declared_.metres_per_number * number + declared_.offset_m;
            const bool known = (!masked_ || mask_[i] != 0) && is_valid(number), usable = std::abs(h) <= kHighest_m;
            unusable += known && !usable;
            heights[i] = known && usable ? h : kNoHeight;
        }
        detect_voids(row, count, heights, unusable);
        return true;
    }

private:
    /// NaN beyond the palette.
    [[nodiscard]] double in_palette(double number) const {
        if (declared_.palette.empty()) return number;
        const bool is_entry = number >= 0 && number < static_cast<double>(declared_.palette.size());
        return is_entry ? declared_.palette[static_cast<std::size_t>(number)] : kNoHeight;
    }

    [[nodiscard]] bool is_valid(double number) const {
        const bool in_range = number >= declared_.lowest && number <= declared_.highest;  // false for NaN
        return in_range && std::ranges::find(declared_.no_data, number) == declared_.no_data.end();
    }

    void detect_voids(int row, int count, const double* heights, std::uint64_t unusable) {
        if (row == voids_->next_row()) voids_->count_unusable(unusable);
        const auto width = static_cast<std::size_t>(columns_);
        for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
            voids_->add_row(row + static_cast<int>(i), {numbers_.data() + i * width, width},
                            {heights + i * width, width});
    }

    GDALDatasetH file_;
    GDALRasterBandH band_;
    int columns_, rows_;
    HeightDeclaration declared_;
    std::shared_ptr<VoidDetector> voids_;
    bool masked_;
    std::vector<unsigned char> mask_;
    std::vector<double> numbers_;
};

/// A grid that goes around the planet: repeats the first column as the last, and adds a row at each pole from which
/// it ends half a post, with the mean of the row beside it.
class WholePlanet final : public HeightSource {
public:
    WholePlanet(std::unique_ptr<HeightSource> map, bool first_pole, bool last_pole)
        : map_(std::move(map)), first_(first_pole), last_(last_pole) {}

    [[nodiscard]] int columns() const override { return map_->columns() + 1; }
    [[nodiscard]] int rows() const override { return map_->rows() + first_ + last_; }
    [[nodiscard]] bool is_global() const override { return true; }
    [[nodiscard]] bool read_rows(int row, int count, double* heights) override {
        const auto width = static_cast<std::size_t>(columns());
        row_.resize(width - 1);
        for (int i = 0; i < count; ++i, heights += width) {
            const int wanted = row + i - first_;
            const bool pole = wanted < 0 || wanted >= map_->rows();
            if (!map_->read_rows(std::clamp(wanted, 0, map_->rows() - 1), 1, row_.data())) return false;
            double sum = 0;
            int known = 0;
            for (const double h : row_)
                if (h == h) sum += h, ++known;
            const double mean = known > 0 ? sum / known : kNoHeight;
            for (std::size_t c = 0; c < width; ++c) heights[c] = pole ? mean : row_[c % (width - 1)];
        }
        return true;
    }

private:
    std::unique_ptr<HeightSource> map_;
    int first_, last_;
    std::vector<double> row_;
};

/// Ellipsoid and map projection of a DEM.
class Georeference {
public:
    Status read(GDALDatasetH file, const DemRequest& r) {
        columns_ = GDALGetRasterXSize(file), rows_ = GDALGetRasterYSize(file);
        std::array<double, 6> g{};
        const bool has_map = GDALGetGeoTransform(file, g.data()) == CE_None;
        if (std::isfinite(r.post_spacing_m)) {
            place_.map = {0, r.post_spacing_m, 0, 0, 0, -r.post_spacing_m};
        } else if (!has_map) {
            return Error{"it has no geo-reference, expected post_spacing_m"};
        } else {
            // GDAL's geotransform refers to corners of pixels; posts are at their centres.
            place_.map = {g[0] + 0.5 * (g[1] + g[2]), g[1], g[2], g[3] + 0.5 * (g[4] + g[5]), g[4], g[5]};
        }
        const double area = place_.map[1] * place_.map[5] - place_.map[2] * place_.map[4];
        for (const double x : place_.map)
            if (!std::isfinite(x) || std::abs(x) > 1e12) return Error{"its geo-reference is not finite"};
        if (!(std::abs(area) > 1e-18)) return Error{"its posts lie on a line: the geo-reference has no area"};
        srs_ = GDALGetSpatialRef(file);
        geographic_ = !std::isfinite(r.post_spacing_m) && srs_ != nullptr && OSRIsGeographic(srs_) != 0;
        if (const Status good = read_ellipsoid(r); !good) return good.error();
        return r.on == DemRequest::On::plane ? on_plane(r) : on_ellipsoid(r);
    }
    [[nodiscard]] const Placement& placement() const { return place_; }
    [[nodiscard]] bool around() const { return place_.around > 0; }

private:
    Status read_ellipsoid(const DemRequest& r) {
        double a = r.equatorial_m, b = r.polar_m;
        if (!std::isfinite(a) && srs_ != nullptr) {
            OGRErr bad = OGRERR_NONE;
            a = OSRGetSemiMajor(srs_, &bad);
            if (bad != OGRERR_NONE) a = DemRequest::kFromFile;
            const double inverse_flattening = OSRGetInvFlattening(srs_, &bad);
            b = bad != OGRERR_NONE || inverse_flattening == 0 ? a : a * (1 - 1 / inverse_flattening);
        }
        const bool needed = geographic_ || r.on != DemRequest::On::plane || r.radii;
        if (needed && !(a > 0 && b > 0 && a < 1e12 && b < 1e12 && b > 0.1 * a && b < 10 * a))
            return Error{"it names no ellipsoid, expected ellipsoid_m = [equatorial, polar]"};
        // Heights are above the ellipsoid at geodetic latitudes; for distances from the centre neither holds.
        if (r.radii && a != b)
            return Error{fmt::format(
                "its ellipsoid is flattened, of {:.10g} and {:.10g} m, and radii are those of a sphere: "
                "expected ellipsoid_m = [radius, radius]",
                a, b)};
        place_.equatorial_m = a, place_.polar_m = b;
        return Ok{};
    }

    Status on_plane(const DemRequest& r) {
        const double c = 0.5 * (columns_ - 1), w = 0.5 * (rows_ - 1);
        place_.x0 = place_.map[0] + c * place_.map[1] + w * place_.map[2];
        place_.y0 = place_.map[3] + c * place_.map[4] + w * place_.map[5];
        if (geographic_) {
            place_.metres_per_y = place_.equatorial_m * kDegree;
            place_.metres_per_x = place_.metres_per_y * std::cos(place_.y0 * kDegree);
            if (!(place_.metres_per_x > 1e-3 * place_.metres_per_y))
                return Error{"it is about a pole, in degrees: expected on = \"tangent\" or \"ellipsoid\""};
        } else if (srs_ != nullptr && !std::isfinite(r.post_spacing_m)) {
            place_.metres_per_x = place_.metres_per_y = OSRGetLinearUnits(srs_, nullptr);
        }
        return Ok{};
    }

    Status on_ellipsoid(const DemRequest& r) {
        if (std::isfinite(r.post_spacing_m))
            return Error{"post_spacing_m places it on a plane, expected on = \"plane\""};
        place_.on_ellipsoid = true;
        if (srs_ != nullptr && !geographic_) {
            if (OSRIsProjected(srs_) == 0) return Error{"its geo-reference is no map projection that is known"};
            transform_ = make_transform();
            if (transform_ == nullptr)
                return Error{fmt::format("its map projection cannot be undone: {}", gdal_words())};
            place_.to_lon_lat = [this](std::span<double> x, std::span<double> y) {
                if (OCTTransform(transform_, static_cast<int>(x.size()), x.data(), y.data(), nullptr) == 0)
                    return false;
                for (std::size_t i = 0; i < x.size(); ++i) {
                    if (!std::isfinite(x[i]) || !std::isfinite(y[i]) || std::abs(y[i]) > 90.001) return false;
                    x[i] *= kDegree, y[i] *= kDegree;
                }
                return true;
            };
        }
        find_wrap_and_poles();
        return r.on == DemRequest::On::tangent ? stand_at_middle() : Ok{};
    }

    OGRCoordinateTransformationH make_transform() const {
        const OGRSpatialReferenceH from = OSRClone(srs_), to = OSRCloneGeogCS(srs_);
        if (to == nullptr) return nullptr;
        OSRSetAxisMappingStrategy(from, OAMS_TRADITIONAL_GIS_ORDER);
        OSRSetAxisMappingStrategy(to, OAMS_TRADITIONAL_GIS_ORDER);
        return OCTNewCoordinateTransformation(from, to);
    }

    /// Longitude and latitude of a place of the map, degrees.
    bool lon_lat(double column, double row, double& lon, double& lat) const {
        const auto& m = place_.map;
        std::array<double, 1> x{m[0] + column * m[1] + row * m[2]}, y{m[3] + column * m[4] + row * m[5]};
        if (place_.to_lon_lat) {
            if (!place_.to_lon_lat(x, y)) return false;
            x[0] /= kDegree, y[0] /= kDegree;
        }
        lon = x[0], lat = y[0];
        return true;
    }

    /// Finds whether the grid goes around the planet, and whether it ends at the poles.
    void find_wrap_and_poles() {
        double lon0 = 0, lat0 = 0, lon1 = 0, lat1 = 0;
        const double middle = 0.5 * (rows_ - 1);
        const int column = columns_ / 2;
        if (!lon_lat(column, middle, lon0, lat0) || !lon_lat(column - 1, middle, lon1, lat1)) return;
        double step = std::fmod(std::abs(lon1 - lon0), 360.0);
        step = std::min(step, 360 - step);
        if (std::abs(lat1 - lat0) > 1e-6 || std::abs(step * columns_ - 360) > 0.5 * step) return;
        place_.around = columns_;
        const auto pole_beyond = [&](double row, double next) {
            double lon = 0, lat = 0, lat_next = 0;
            if (!lon_lat(column, row, lon, lat) || !lon_lat(column, next, lon, lat_next)) return 0;
            const double left = 90 - std::abs(lat);
            return left > 1e-6 && left < 0.6 * std::abs(lat - lat_next) ? (lat > 0 ? 1 : -1) : 0;
        };
        place_.first_pole = pole_beyond(0, 1);
        place_.last_pole = pole_beyond(rows_ - 1, rows_ - 2);
        place_.last_row = rows_ - 1 + (place_.first_pole != 0) + (place_.last_pole != 0);
    }

    Status stand_at_middle() {
        const double c = 0.5 * (columns_ - 1), w = 0.5 * (rows_ - 1);
        double lon = 0, lat = 0;
        if (!lon_lat(c, w, lon, lat)) return Error{"its middle has no longitude and latitude"};
        lon *= kDegree, lat *= kDegree;
        const Vec3 east{-std::sin(lon), std::cos(lon), 0},
            up{std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat)};
        const double e2 = 1 - std::pow(place_.polar_m / place_.equatorial_m, 2);
        const double n = place_.equatorial_m / std::sqrt(1 - e2 * std::pow(std::sin(lat), 2));
        const Vec3 middle{n * std::cos(lat) * std::cos(lon), n * std::cos(lat) * std::sin(lon),
                          n * (1 - e2) * std::sin(lat)};
        place_.T_body_planet = inverse(Rigid3{quat_from_columns(east, cross(up, east), up), middle});
        return Ok{};
    }

    Placement place_;
    int columns_ = 0, rows_ = 0;
    OGRSpatialReferenceH srs_ = nullptr;
    bool geographic_ = false;
    OGRCoordinateTransformationH transform_ = nullptr;
};

/// Looks for the limits of the numbers' type. Those of bytes and floats are no usual marks, nor is an unsigned 0.
std::shared_ptr<VoidDetector> void_detector(GDALDataType type) {
    switch (type) {
        case GDT_Int16: return std::make_shared<VoidDetector>(-32768, 32767);
        case GDT_UInt16: return std::make_shared<VoidDetector>(kNoHeight, 65535);
        case GDT_Int32: return std::make_shared<VoidDetector>(-2147483648.0, 2147483647.0);
        case GDT_UInt32: return std::make_shared<VoidDetector>(kNoHeight, 4294967295.0);
        default: return std::make_shared<VoidDetector>(kNoHeight, kNoHeight);
    }
}

void start_gdal() {
    CPLSetErrorHandler(CPLQuietErrorHandler);
    CPLSetConfigOption("GDAL_CACHEMAX", "64");  // MiB
    CPLSetConfigOption("GDAL_NUM_THREADS", "1");
    OSRSetPROJEnableNetwork(FALSE);  // whatever the environment says
    GDALRegister_GTiff(), GDALRegister_PDS(), GDALRegister_PDS4(), GDALRegister_ISIS3(), GDALRegister_PNG();
}

}  // namespace

Result<OpenDem> open_with_gdal(const DemRequest& request) {
    start_gdal();
    const GDALDatasetH file = GDALOpenEx(open_in_one_folder(request.path).c_str(),
                                         GDAL_OF_RASTER | GDAL_OF_READONLY, nullptr, nullptr, nullptr);
    if (file == nullptr)
        return Error{fmt::format("not a DEM that can be read, expected GeoTIFF, PDS3, PDS4, ISIS3 or PNG: {}",
                                 gdal_words())};
    auto declared = read_height_declaration(file, request);
    if (!declared) return declared.error();
    auto* geo = new Georeference;  // lives as long as this process, as the placement calls it
    if (const Status good = geo->read(file, request); !good) return good.error();
    OpenDem dem;
    dem.placement = geo->placement();
    dem.warnings = std::move(declared->warnings);
    if (request.radii) declared->offset_m -= dem.placement.equatorial_m;
    dem.voids = void_detector(GDALGetRasterDataType(GDALGetRasterBand(file, 1)));
    dem.heights = std::make_unique<GdalSource>(file, std::move(*declared), dem.voids);
    if (geo->around())
        dem.heights = std::make_unique<WholePlanet>(std::move(dem.heights), dem.placement.first_pole != 0,
                                                    dem.placement.last_pole != 0);
    const double c = 0.5 * (dem.heights->columns() - 1), w = 0.5 * (dem.heights->rows() - 1);
    std::array<Vec3, 4> p{Vec3{c - 0.25, w, 0}, Vec3{c + 0.25, w, 0}, Vec3{c, w - 0.25, 0}, Vec3{c, w + 0.25, 0}};
    if (dem.heights->columns() < 2 || dem.heights->rows() < 2 || !dem.placement.place(p)) return dem;
    dem.spacing = {2 * norm(p[1] - p[0]), 2 * norm(p[3] - p[2])};
    dem.voids->set_spacing(std::max(dem.spacing.x_m, dem.spacing.y_m));
    return dem;
}

}  // namespace narpa
