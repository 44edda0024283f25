// What DEM files declare about their numbers (unit, direction, scale, offset, missing data), in files that GDAL
// writes: used, or named in a warning or an error.
#include <cpl_conv.h>
#include <cpl_error.h>
#include <fmt/format.h>
#include <gdal.h>
#include <gtest/gtest.h>
#include <ogr_srs_api.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <random>

#include "renderer/assets/dem_process.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/campaign.h"
#include "tests/support/expect_has.h"

namespace narpa {
namespace {

using test::MemoryFolder;

constexpr int kColumns = 5, kRows = 4;
constexpr double kSpacing_m = 1000;
constexpr double kUsFoot_m = 1200.0 / 3937;

/// A DEM as GDAL writes it: metres of the map at (1000 c, -1000 r).
struct DemFile {
    GDALDataType type = GDT_Int16;
    std::vector<double> numbers = std::vector<double>(kColumns * kRows);
    const char* unit = "";
    int horizontal = 32633, vertical = 0;  ///< EPSG
    double scale = 1, offset = 0, no_data = kNoHeight;

    std::string write(const std::string& path, const char* driver = "GTiff") const {
        GDALAllRegister();
        CPLSetErrorHandler(CPLQuietErrorHandler);
        const GDALDriverH memory = GDALGetDriverByName("MEM");
        const GDALDatasetH image = GDALCreate(memory, "", kColumns, kRows, 1, type, nullptr);
        std::array<double, 6> corner{500'000 - 0.5 * kSpacing_m, kSpacing_m, 0,
                                     4e6 + 0.5 * kSpacing_m,     0,          -kSpacing_m};
        GDALSetGeoTransform(image, corner.data());
        const OGRSpatialReferenceH srs = OSRNewSpatialReference(nullptr);
        OSRSetFromUserInput(srs, vertical == 0 ? fmt::format("EPSG:{}", horizontal).c_str()
                                               : fmt::format("EPSG:{}+{}", horizontal, vertical).c_str());
        GDALSetSpatialRef(image, srs);
        OSRDestroySpatialReference(srs);
        const GDALRasterBandH band = GDALGetRasterBand(image, 1);
        if (*unit != '\0') GDALSetRasterUnitType(band, unit);
        if (scale != 1) GDALSetRasterScale(band, scale);
        if (offset != 0) GDALSetRasterOffset(band, offset);
        if (no_data == no_data) GDALSetRasterNoDataValue(band, no_data);
        auto copy = numbers;
        EXPECT_EQ(
            GDALRasterIO(band, GF_Write, 0, 0, kColumns, kRows, copy.data(), kColumns, kRows, GDT_Float64, 0, 0),
            CE_None);
        const GDALDatasetH file =
            GDALCreateCopy(GDALGetDriverByName(driver), path.c_str(), image, FALSE, nullptr, nullptr, nullptr);
        EXPECT_NE(file, nullptr) << driver << ": " << CPLGetLastErrorMsg();
        if (file != nullptr) GDALClose(file);
        GDALClose(image);
        return path;
    }
};

DemRequest request_of(const std::string& path) {
    DemRequest r;
    r.path = path;
    r.options.error_px = 1e-6;
    r.options.seen_from = {{0, 0, 0}};
    return r;
}

/// Heights by post, which the terrain has for those that are in a triangle.
std::map<int, double> heights_of(const TerrainMesh& t) {
    std::map<int, double> heights;
    for (const Vec3f& p : t.positions) {
        const Vec3 at = t.origin_m + vec_cast<double>(p);
        const auto c = static_cast<int>(std::lround(at.x / kSpacing_m + 0.5 * (kColumns - 1))),
                   r = static_cast<int>(std::lround(0.5 * (kRows - 1) - at.y / kSpacing_m));
        heights[r * kColumns + c] = at.z;
    }
    return heights;
}

std::string joined(const std::vector<std::string>& texts) {
    std::string all;
    for (const std::string& text : texts) all += text + "\n";
    return all;
}

/// The height of post 7, and the warnings or the error.
struct Read {
    double height_m = kNoHeight;
    std::string words;
};
Read read(const DemRequest& request) {
    const auto t = read_dem_in_process(request);
    if (!t) return {.words = t.error().what};
    auto heights = heights_of(*t);
    return {heights.contains(7) ? heights[7] : kNoHeight, joined(t->warnings)};
}

class DemDeclarations : public testing::Test {
protected:
    /// Post 7 has the number 100, its neighbours differ by a few.
    static DemFile plain() {
        DemFile f;
        for (int i = 0; i < kColumns * kRows; ++i)
            f.numbers[static_cast<std::size_t>(i)] = static_cast<double>(100 + (i - 7) * (i * 5 % 7));
        return f;
    }
    Read read_file(const DemFile& f, const char* driver = "GTiff", const char* name = "d.tif") const {
        return read(request_of(f.write(folder / name, driver)));
    }
    const MemoryFolder folder;
};

TEST_F(DemDeclarations, UnitsOfTheBandAndOfTheVerticalAxis) {
    DemFile f = plain();
    f.unit = "km";
    f.scale = 0.001;
    EXPECT_NEAR(read_file(f).height_m, 100, 1e-4);
    f = plain();
    for (const char* feet : {"ft", "foot", "Feet", "international foot"}) {
        f.unit = feet;
        EXPECT_NEAR(read_file(f).height_m, 30.48, 1e-4) << feet;
    }
    f.unit = "US survey foot";
    EXPECT_NEAR(read_file(f).height_m, 100 * kUsFoot_m, 1e-5);
    f.unit = "", f.vertical = 6360;
    EXPECT_NEAR(read_file(f).height_m, 100 * kUsFoot_m, 1e-5);
    f.vertical = 5715;  // depth below mean sea level
    EXPECT_NEAR(read_file(f).height_m, -100, 1e-4);
    f.vertical = 6360, f.unit = "metre";
    const Read both = read_file(f);
    EXPECT_NEAR(both.height_m, 100, 1e-4);
    EXPECT_HAS(both.words, "the unit of its band is \"metre\", and that of its vertical axis \"US survey foot\"");
    f.vertical = 0, f.unit = "kelvin";
    EXPECT_HAS(read_file(f).words, "its heights have the unit \"kelvin\", which is no length known here");
    DemRequest scaled = request_of(f.write(folder / "d.tif"));
    scaled.scale = 2;
    EXPECT_NEAR(read(scaled).height_m, 200, 1e-4);
}

TEST_F(DemDeclarations, AVerticalDatumIsNamedOnTheEllipsoid) {
    DemFile f = plain();
    f.vertical = 5773;
    DemRequest r = request_of(f.write(folder / "d.tif"));
    EXPECT_EQ(read(r).words, "");
    r.on = DemRequest::On::tangent;
    EXPECT_HAS(read(r).words, "its vertical coordinate system is \"EGM96 height\"; heights are taken as above");
}

TEST_F(DemDeclarations, VoidsThatAreNotMarkedAreNamed) {
    DemFile f = plain();
    f.numbers[3] = -32768;
    EXPECT_HAS(read_file(f).words, "the number -32768 of 1 of its posts, the lowest of its type, is not marked");
    f.no_data = -32768;
    EXPECT_EQ(read_file(f).words, "");
    f = plain();
    f.numbers[3] = f.numbers[4] = -9999;
    EXPECT_HAS(read_file(f).words, "the number -9999 of 2 of its posts, a usual mark of voids");
    f.type = GDT_Float32;
    f.numbers[3] = f.numbers[4] = -3.4e38;
    EXPECT_HAS(read_file(f).words, "2 of its posts have no finite height within 1e9 m, and are holes");
    f.numbers[3] = f.numbers[4] = -30123.5;
    EXPECT_HAS(read_file(f).words,
               "steeper than 87 degrees, the highest from -30123.5 to 106 m at column 4, row 1");
    f = plain();
    f.type = GDT_UInt16, f.scale = 0.01;
    f.numbers = {0, 9000, 30000, 45000, 65535, 0, 8000, 31000, 44000, 65001,
                 0, 8000, 31000, 44000, 65001, 0, 8000, 31000, 44000, 64000};
    EXPECT_EQ(read_file(f).words, "") << "summits of a map that is stretched over all numbers";
}

TEST_F(DemDeclarations, AuxiliaryFilesAreRead) {
    DemFile f = plain();
    f.numbers[0] = -9999;
    const std::string path = f.write(folder / "d.tif");
    const std::string band = "<NoDataValue>-9999</NoDataValue><UnitType>ft</UnitType><Scale>10</Scale>";
    folder.write("d.tif.aux.xml",
                 "<PAMDataset><PAMRasterBand band=\"1\">" + band + "</PAMRasterBand></PAMDataset>");
    const Read read_back = read(request_of(path));
    EXPECT_NEAR(read_back.height_m, 304.8, 1e-4);
    EXPECT_EQ(read_back.words, "");
}

TEST_F(DemDeclarations, MasksInTheFileAndBesideItAreHoles) {
    for (const char* place : {"YES", "NO"}) {
        const std::string path = plain().write(folder / fmt::format("{}.tif", place));
        CPLSetConfigOption("GDAL_TIFF_INTERNAL_MASK", place);
        const GDALDatasetH file = GDALOpen(path.c_str(), GA_Update);
        ASSERT_EQ(GDALCreateDatasetMaskBand(file, GMF_PER_DATASET), CE_None);
        std::array<unsigned char, kColumns * kRows> mask;
        mask.fill(255), mask[5] = 0;
        const GDALRasterBandH band = GDALGetMaskBand(GDALGetRasterBand(file, 1));
        ASSERT_EQ(GDALRasterIO(band, GF_Write, 0, 0, kColumns, kRows, mask.data(), kColumns, kRows, GDT_Byte, 0, 0),
                  CE_None);
        GDALClose(file);
        EXPECT_EQ(std::filesystem::exists(path + ".msk"), place == std::string("NO"));
        const auto t = read_dem_in_process(request_of(path));
        ASSERT_TRUE(t) << t.error().text();
        EXPECT_FALSE(heights_of(*t).contains(5));
        EXPECT_TRUE(heights_of(*t).contains(6));
    }
}

std::string pds3_label(const std::string& image_keys) {
    return fmt::format(R"(PDS_VERSION_ID = PDS3
RECORD_TYPE = FIXED_LENGTH
RECORD_BYTES = {0}
FILE_RECORDS = {1}
^IMAGE = "d.img"
OBJECT = IMAGE
  LINES = {1}
  LINE_SAMPLES = {2}
  SAMPLE_TYPE = PC_REAL
  SAMPLE_BITS = 32
{3}END_OBJECT = IMAGE
OBJECT = IMAGE_MAP_PROJECTION
  MAP_PROJECTION_TYPE = "SIMPLE CYLINDRICAL"
  A_AXIS_RADIUS = 1737.4 <KM>
  B_AXIS_RADIUS = 1737.4 <KM>
  C_AXIS_RADIUS = 1737.4 <KM>
  POSITIVE_LONGITUDE_DIRECTION = "EAST"
  CENTER_LATITUDE = 0.0 <DEG>
  CENTER_LONGITUDE = 0.0 <DEG>
  MAP_SCALE = 1 <KM/PIXEL>
  MAP_RESOLUTION = 30.323 <PIXEL/DEG>
  LINE_PROJECTION_OFFSET = 1.5
  SAMPLE_PROJECTION_OFFSET = 2
END_OBJECT = IMAGE_MAP_PROJECTION
END
)",
                       4 * kColumns, kRows, kColumns, image_keys);
}

TEST_F(DemDeclarations, LabelsOfPds3) {
    std::vector<float> numbers;
    for (const double n : plain().numbers) numbers.push_back(static_cast<float>(n));
    numbers[0] = -1234, numbers[5] = 5000;
    folder.write("d.img", {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float)});
    const auto read_label = [&](const std::string& keys) {
        return read(request_of(folder.write("d.lbl", pds3_label(keys))));
    };
    const Read km = read_label("  UNIT = KILOMETER\n  SCALING_FACTOR = 0.001\n  OFFSET = 1.0\n");
    EXPECT_NEAR(km.height_m, 1100, 1e-3);
    EXPECT_HAS(read_label("  UNIT = VOLT\n").words, "unit \"VOLT\", which is no length");
    DemRequest r =
        request_of(folder.write("d.lbl", pds3_label("  MISSING_CONSTANT = -1234.0\n  VALID_MAXIMUM = 4000\n")));
    const auto t = read_dem_in_process(r);
    ASSERT_TRUE(t) << t.error().text();
    const auto heights = heights_of(*t);
    EXPECT_FALSE(heights.contains(0));
    EXPECT_FALSE(heights.contains(5));
    EXPECT_TRUE(heights.contains(7));
}

TEST_F(DemDeclarations, SpecialPixelsOfIsisAreHoles) {
    DemFile f = plain();
    f.numbers[0] = -32768, f.numbers[4] = -32767, f.numbers[15] = -32764;
    f.scale = 0.5;
    const auto t = read_dem_in_process(request_of(f.write(folder / "d.cub", "ISIS3")));
    ASSERT_TRUE(t) << t.error().text();
    const auto heights = heights_of(*t);
    EXPECT_EQ(joined(t->warnings), "");
    for (const int hole : {0, 4, 15}) EXPECT_FALSE(heights.contains(hole)) << hole;
    EXPECT_NEAR(heights.at(7), 50, 1e-4);
}

TEST_F(DemDeclarations, RadiiTakenForHeightsAreNamed) {
    DemFile f = plain();
    f.type = GDT_Float32;
    for (double& n : f.numbers) n += 6'378'000;
    EXPECT_HAS(read_file(f).words, "distances from the centre? They need has = \"radii\"");
}

/// Random declarations, and the height of each post that follows from them.
class Trial {
public:
    explicit Trial(unsigned seed) : random_(seed) {}

    void run(const MemoryFolder& folder) {
        generate();
        DemRequest r = request_of(file_.write(folder / kNames[format_], kDrivers[format_]));
        if (whole(0, 9) == 0) r.scale = metres_ = 0.5, sign_ = 1;
        if (whole(0, 9) == 0) r.offset_m = offset_m_ = 12.5;
        const auto t = read_dem_in_process(r);
        const std::string words = fmt::format(
            "{} type {}, unit \"{}\", vertical {}, scale {}, offset {}, no data {}", kDrivers[format_],
            static_cast<int>(file_.type), file_.unit, file_.vertical, file_.scale, file_.offset, file_.no_data);
        if (std::string_view(file_.unit) == "mmHg" && !std::isfinite(r.scale)) {
            ASSERT_FALSE(t) << words;
            EXPECT_HAS(t.error().what, "the unit \"mmHg\"");
            return;
        }
        ASSERT_TRUE(t) << words << ": " << t.error().text();
        const auto heights = heights_of(*t);
        const double metres = std::isfinite(r.scale) ? r.scale : sign_ * metres_ * file_.scale;
        const double offset = std::isfinite(r.offset_m) || std::isfinite(r.scale)
                                  ? (std::isfinite(r.offset_m) ? r.offset_m : file_.offset)
                                  : sign_ * metres_ * file_.offset;
        double largest = 1e3;  // positions are floats
        for (const double number : file_.numbers) largest = std::max(largest, std::abs(metres * number + offset));
        for (int i = 0; i < kColumns * kRows; ++i) {
            const double number = file_.numbers[static_cast<std::size_t>(i)], expected = metres * number + offset;
            if (i == hole_ && file_.no_data == file_.no_data) {
                EXPECT_FALSE(heights.contains(i)) << words;
            } else if (heights.contains(i) || hole_ < 0) {
                EXPECT_NEAR(heights.at(i), expected, 2e-7 * largest) << words << ", post " << i;
            }
        }
        if (hole_ >= 0 && file_.no_data != file_.no_data) {
            EXPECT_FALSE(t->warnings.empty()) << words;
        }
    }

private:
    static constexpr std::array kDrivers{"GTiff", "PNG", "PDS4", "ISIS3"};
    static constexpr std::array kNames{"d.tif", "d.png", "d.xml", "d.cub"};

    int whole(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }

    void generate() {
        format_ = static_cast<std::size_t>(std::max(0, whole(-3, 3)));
        static constexpr std::array kTypes{GDT_Int16, GDT_UInt16, GDT_Float32, GDT_Int32, GDT_UInt32, GDT_Float64};
        const bool is_png = format_ == 1, is_isis = format_ == 3;
        file_.type = is_png ? GDT_UInt16 : kTypes[static_cast<std::size_t>(whole(0, is_isis ? 2 : 5))];
        struct Unit {
            const char* name;
            double metres;
        };
        static constexpr std::array kUnits{Unit{"", 1},
                                           Unit{"m", 1},
                                           Unit{"metre", 1},
                                           Unit{"Meters", 1},
                                           Unit{"km", 1e3},
                                           Unit{"KILOMETRES", 1e3},
                                           Unit{"cm", 0.01},
                                           Unit{"ft", 0.3048},
                                           Unit{"feet", 0.3048},
                                           Unit{"US survey foot", kUsFoot_m},
                                           Unit{"us-ft", kUsFoot_m},
                                           Unit{"fathom", 1.8288},
                                           Unit{"mmHg", 0}};
        const Unit unit = kUnits[static_cast<std::size_t>(whole(0, static_cast<int>(kUnits.size()) - 1))];
        file_.unit = is_isis ? "" : unit.name, metres_ = is_isis ? 1 : unit.metres;
        if (format_ == 0 && whole(0, 2) == 0) {
            static constexpr std::array kAxes{std::pair{6360, kUsFoot_m}, std::pair{8228, 0.3048},
                                              std::pair{5773, 1.0}, std::pair{5715, -1.0},
                                              std::pair{6358, -kUsFoot_m}};
            const auto [vertical, axis_metres] = kAxes[static_cast<std::size_t>(whole(0, 4))];
            file_.vertical = vertical, sign_ = axis_metres < 0 ? -1 : 1;
            if (*file_.unit == '\0') metres_ = std::abs(axis_metres);
        }
        if (whole(0, 1) == 0) file_.scale = 0.01 * whole(1, 300), file_.offset = whole(-2000, 2000);
        const bool is_signed = file_.type != GDT_UInt16 && file_.type != GDT_UInt32;
        for (double& n : file_.numbers) n = whole(is_signed ? -20 : 5, 200);
        if (whole(0, 1) == 0) {
            hole_ = whole(0, kColumns * kRows - 1);
            const double mark = file_.type == GDT_Int16    ? -32768
                                : file_.type == GDT_UInt16 ? (is_isis ? 0 : 65535)
                                : file_.type == GDT_UInt32 ? 4294967295.0
                                                           : -9999;
            file_.numbers[static_cast<std::size_t>(hole_)] = mark;
            if (whole(0, 3) != 0 || is_isis) file_.no_data = mark;
        }
    }

    std::mt19937 random_;
    DemFile file_;
    std::size_t format_ = 0;
    double metres_ = 1, sign_ = 1, offset_m_ = 0;
    int hole_ = -1;
};

TEST(DemTrials, HeightsFollowFromRandomDeclarations) {
    for (int seed = 0; seed < test::trials(200, 10'000) && !testing::Test::HasFailure(); ++seed) {
        SCOPED_TRACE(fmt::format("seed {}", seed));
        const MemoryFolder folder;
        Trial(static_cast<unsigned>(seed)).run(folder);
    }
}

}  // namespace
}  // namespace narpa
