// DEM files, each format the same 40 x 30 posts: heights, places, holes; scenes with a dem; damaged files.
#include "renderer/assets/dem_process.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <set>

#include "base/constants.h"
#include "base/program_beside.h"
#include "renderer/geometry/tracer.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/image_bytes.h"
#include "tests/support/paths.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using test::MemoryFolder;

std::string dem_file(const std::string& name) {
    return test::source_path("tests/data/dem/") + name;
}

/// The heights of tests/data/dem.
double height(int c, int r) {
    return std::round(4 * (10 * std::sin(c / 5.0) + 6 * std::cos(r / 4.0) + 0.3 * c)) / 4;
}

#define NEEDS_GDAL()                                                     \
    if (!std::filesystem::exists(program_folder() / "narpa-dem-reader")) \
    GTEST_SKIP() << "built without GDAL (NARPA_WITH_GDAL)"

DemRequest request_of(const std::string& path) {
    DemRequest r;
    r.path = path;
    r.options.error_px = 1e-3;
    r.options.seen_from = {{0, 0, 0}};
    return r;
}

struct Format {
    const char* name;
    const char* file;
};
void PrintTo(const Format& f, std::ostream* out) {
    *out << f.name;
}
class DemFormats : public testing::TestWithParam<Format> {};

TEST_P(DemFormats, GiveEveryPostItsHeightAndPlace) {
    NEEDS_GDAL();
    DemRequest r = request_of(dem_file(GetParam().file));
    if (r.path.ends_with(".png")) r.post_spacing_m = 10, r.scale = 0.25, r.offset_m = -100;
    const auto t = read_dem_in_process(r);
    ASSERT_TRUE(t) << t.error().text();
    EXPECT_EQ(t->positions.size(), 40u * 30);
    for (const Vec3f& p : t->positions) {
        const Vec3 at = t->origin_m + vec_cast<double>(p);
        const int c = static_cast<int>(std::lround(at.x / 10 + 19.5)),
                  row = static_cast<int>(std::lround(14.5 - at.y / 10));
        EXPECT_NEAR(at.x, 10 * (c - 19.5), 1e-4);
        EXPECT_NEAR(at.y, 10 * (14.5 - row), 1e-4);
        EXPECT_EQ(at.z, height(c, row));
    }
}

INSTANTIATE_TEST_SUITE_P(All, DemFormats,
                         testing::Values(Format{"GeoTiff", "mars.tif"}, Format{"GeoTiffInTiles", "tiled.tif"},
                                         Format{"GeoTiffScaled", "i16.tif"}, Format{"Isis", "cube.cub"},
                                         Format{"Pds3", "pds3.lbl"}, Format{"Pds4", "pds4.xml"},
                                         Format{"Png", "heights.png"}),
                         [](const auto& f) { return f.param.name; });

TEST(Dem, APaletteGivesItsGreysAndNoColours) {
    NEEDS_GDAL();
    const MemoryFolder folder;
    std::string greys, colours;
    for (int i = 0; i < 3; ++i) greys += std::string(3, static_cast<char>(50 * (i + 1))), colours += "\x0a\x14\x1e";
    const auto heights_of = [&](const std::string& path) {
        DemRequest r = request_of(path);
        r.post_spacing_m = 10;
        const auto t = read_dem_in_process(r);
        EXPECT_TRUE(t) << t.error().text();
        std::set<double> heights;
        for (std::size_t i = 0; t && i < t->positions.size(); ++i)
            heights.insert(t->origin_m.z + static_cast<double>(t->positions[i].z));
        return heights;
    };
    test::TiffFile tiff{.width = 3, .height = 3, .bits = 8, .photometric = 3, .palette = {}};
    tiff.palette.resize(3 * 256);
    for (std::size_t i = 0; i < tiff.palette.size(); ++i)
        tiff.palette[i] = i % 256 < 3 ? 257 * 50 * (i % 256 + 1) : 0;
    const auto index = [](int x, int y, int) { return static_cast<std::uint64_t>((x + y) % 3); };
    const std::string indices("\0\1\2\1\2\0\2\0\1", 9);
    const std::set<double> expected{50, 100, 150};
    EXPECT_EQ(heights_of(folder.write("d.png", test::palette_png(3, 3, indices, greys))), expected);
    EXPECT_EQ(heights_of(folder.write("d.tif", tiff.bytes(index))), expected);

    tiff.palette[256] = 0;
    for (const std::string& path : {folder.write("c.png", test::palette_png(3, 3, indices, colours)),
                                    folder.write("c.tif", tiff.bytes(index))}) {
        DemRequest r = request_of(path);
        r.post_spacing_m = 10;
        const auto t = read_dem_in_process(r);
        ASSERT_FALSE(t) << path;
        EXPECT_EQ(t.error().file, path);
        EXPECT_NE(t.error().what.find("its numbers are indices of a palette"), std::string::npos) << t.error().what;
    }
}

TEST(Dem, NoDataIsAHole) {
    NEEDS_GDAL();
    const auto t = read_dem_in_process(request_of(dem_file("holes.tif")));
    ASSERT_TRUE(t) << t.error().text();
    EXPECT_EQ(t->faces.size(), 2u * (39 * 29 - 5 * 4) + 2);
    DemRequest other = request_of(dem_file("mars.tif"));
    other.no_data = height(0, 0);
    EXPECT_LT(read_dem_in_process(other)->faces.size(), 2u * 39 * 29);
}

TEST(Dem, StandsOnTheEllipsoidOfItsMap) {
    NEEDS_GDAL();
    DemRequest r = request_of(dem_file("mars.tif"));
    r.on = DemRequest::On::ellipsoid;
    constexpr double kRadius = 3396190;
    r.options.seen_from = {{kRadius, 1200, 2150}};
    const auto t = read_dem_in_process(r);
    ASSERT_TRUE(t) << t.error().text();
    for (const Vec3f& p : t->positions) {
        const Vec3 at = t->origin_m + vec_cast<double>(p);
        // Equidistant cylindrical about (0, 0): metres are radians of longitude and latitude times the radius.
        const double x = std::atan2(at.y, at.x) * kRadius, y = std::asin(at.z / norm(at)) * kRadius;
        const int c = static_cast<int>(std::lround((x - 1005) / 10)),
                  row = static_cast<int>(std::lround((2295 - y) / 10));
        EXPECT_NEAR(x, 1005 + 10 * c, 1e-4);
        EXPECT_NEAR(y, 2295 - 10 * row, 1e-4);
        EXPECT_NEAR(norm(at) - kRadius, height(c, row), 1e-4);
    }
    r.on = DemRequest::On::tangent;
    r.options.seen_from = {{0, 0, 0}};
    const auto tangent = read_dem_in_process(r);
    ASSERT_TRUE(tangent) << tangent.error().text();
    ASSERT_EQ(tangent->positions.size(), 40u * 30);
    for (const Vec3f& p : tangent->positions) {
        const Vec3 at = tangent->origin_m + vec_cast<double>(p);
        EXPECT_NEAR(norm(at + Vec3{0, 0, kRadius}) - kRadius,
                    height(static_cast<int>(std::lround(at.x / 10 + 19.5)),
                           static_cast<int>(std::lround(14.5 - at.y / 10))),
                    1e-4);
    }
}

TEST(Dem, AWholePlanetFromAMapOfIt) {
    NEEDS_GDAL();
    const std::string path = test::source_path("../shared/assets/dem/moon_lola/LDEM_4.LBL");
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "needs ../shared/assets/dem/moon_lola";
    DemRequest r = request_of(path);
    r.on = DemRequest::On::ellipsoid;
    r.radii = true;
    r.options.error_px = 0.5;
    r.options.seen_from = {{1e7, 0, 0}};
    const auto t = read_dem_in_process(r);
    ASSERT_TRUE(t) << t.error().text();
    EXPECT_NEAR(t->summary.lowest_m, -0.5 * 17757, 0.5);
    EXPECT_NEAR(t->summary.highest_m, 0.5 * 21008, 0.5);
}

TEST(Dem, ARayMeetsTheTriangleBetweenThePosts) {
    NEEDS_GDAL();
    const MemoryFolder folder;
    const auto scene = read_scene(
        folder.write("s.toml", "[sun]\ndirection = [1, 1, 1]\n[[body]]\nname = \"mars\"\ndem = {file = \"" +
                                   dem_file("mars.tif") +
                                   R"(", error_px = 0.001}
position_m = [3e8, 0, 0]
[[camera]]
name = "nav"
position_m = [3e8, 0, 1000]
look_at = [3e8, 0, 0]
up = [0, 1, 0]
resolution = [64, 48]
fov_horizontal_deg = 20
)"));
    ASSERT_TRUE(scene) << scene.error().text();
    const auto tracer = Tracer::create(*scene, 1);
    ASSERT_TRUE(tracer) << tracer.error().text();
    const BodyPoses at = test::placed(*scene);
    std::mt19937_64 random(4);
    std::uniform_real_distribution<double> u(0, 1);
    for (int k = 0; k < 2000; ++k) {
        const double c = 39 * u(random), r = 29 * u(random);
        const Ray down{{3e8 + 10 * (c - 19.5), 10 * (14.5 - r), 1000}, {0, 0, -1}};
        const Hit hit = tracer->intersect(at, down, 1e9);
        ASSERT_EQ(hit.body, 0);
        const int i = static_cast<int>(c), j = static_cast<int>(r);
        const double f = c - i, g = r - j, nw = height(i, j), ne = height(i + 1, j), se = height(i + 1, j + 1),
                     sw = height(i, j + 1);
        const double h = f >= g ? nw + f * (ne - nw) + g * (se - ne) : nw + g * (sw - nw) + f * (se - sw);
        EXPECT_NEAR(1000 - hit.range_m, h,
                    5e-5);  // of the ray's origin at 3e8 m: 6e-8 m times the slope, and float
    }
}

TEST(Dem, ErrorsSayWhatToDo) {
    NEEDS_GDAL();
    const auto error_of = [](const DemRequest& r) {
        const auto t = read_dem_in_process(r);
        EXPECT_FALSE(t);
        return t ? "" : t.error().text();
    };
    EXPECT_EQ(error_of(request_of(dem_file("heights.png"))),
              dem_file("heights.png") + ": it has no geo-reference, expected post_spacing_m");
    DemRequest png = request_of(dem_file("heights.png"));
    png.post_spacing_m = 1, png.on = DemRequest::On::tangent;
    EXPECT_NE(error_of(png).find("it names no ellipsoid"), std::string::npos);
    EXPECT_NE(
        error_of(request_of(test::source_path("README.md"))).find("not a DEM that can be read, expected GeoTIFF"),
        std::string::npos);
    DemRequest small = request_of(dem_file("mars.tif"));
    small.options.budget_bytes = 100;
    EXPECT_NE(error_of(small).find("expected a larger budget_mib"), std::string::npos);
    DemRequest plain = request_of(dem_file("mars.tif"));
    plain.options.budget_bytes = 1 << 20;
    const auto limited = read_dem_in_process(plain, {.memory_bytes = 1 << 20});
    if (!NARPA_SANITIZED) {
        ASSERT_FALSE(limited);
        EXPECT_NE(limited.error().what.find("the DEM reader"), std::string::npos);
    }
}

/// A map, in 40 x 20 posts of this number, of a sphere of 1000 km.
std::string globe(const MemoryFolder& folder, float number) {
    const std::vector<float> posts(40 * 20, number);
    folder.write("globe.img", {reinterpret_cast<const char*>(posts.data()), posts.size() * sizeof(float)});
    return folder.write("globe.lbl", fmt::format(R"(PDS_VERSION_ID = PDS3
RECORD_TYPE = FIXED_LENGTH
RECORD_BYTES = 160
FILE_RECORDS = 20
^IMAGE = "globe.img"
OBJECT = IMAGE
  LINES = 20
  LINE_SAMPLES = 40
  SAMPLE_TYPE = PC_REAL
  SAMPLE_BITS = 32
END_OBJECT = IMAGE
OBJECT = IMAGE_MAP_PROJECTION
  MAP_PROJECTION_TYPE = "SIMPLE CYLINDRICAL"
  A_AXIS_RADIUS = 1000 <KM>
  B_AXIS_RADIUS = 1000 <KM>
  C_AXIS_RADIUS = 1000 <KM>
  COORDINATE_SYSTEM_NAME = "PLANETOCENTRIC"
  POSITIVE_LONGITUDE_DIRECTION = "EAST"
  CENTER_LATITUDE = 0.0 <DEGREE>
  CENTER_LONGITUDE = 180.0 <DEGREE>
  LINE_PROJECTION_OFFSET = 9.5
  SAMPLE_PROJECTION_OFFSET = 19.5
  MAP_SCALE = {:.9f} <KM/PIXEL>
  MAP_RESOLUTION = {:.9f} <PIXEL/DEGREE>
END_OBJECT = IMAGE_MAP_PROJECTION
END
)",
                                                 2 * kPi * 1000 / 40, 40 / 360.0));
}

TEST(Dem, RadiiAreOfASphere) {
    NEEDS_GDAL();
    const MemoryFolder folder;
    DemRequest r = request_of(globe(folder, 1e6f));
    r.on = DemRequest::On::ellipsoid;
    r.radii = true;
    for (const double given_m : {DemRequest::kFromFile, 0.95e6}) {
        r.equatorial_m = r.polar_m = given_m;
        const auto sphere = read_dem_in_process(r);
        ASSERT_TRUE(sphere) << sphere.error().text();
        for (const Vec3f& p : sphere->positions)
            EXPECT_NEAR(norm(sphere->origin_m + vec_cast<double>(p)), 1e6, 0.2);
    }
    r.polar_m = 0.9e6;
    const auto flattened = read_dem_in_process(r);
    ASSERT_FALSE(flattened);
    EXPECT_NE(flattened.error().what.find("expected ellipsoid_m = [radius, radius]"), std::string::npos)
        << flattened.error().text();
}

TEST(Dem, NoCratersAndRocksAboutAWholePlanet) {
    NEEDS_GDAL();
    const MemoryFolder folder;
    DemRequest r = request_of(globe(folder, 0));
    r.on = DemRequest::On::ellipsoid;
    r.detail.refinement_factor = 2;
    EXPECT_TRUE(read_dem_in_process(r));
    for (const bool rocks : {false, true}) {
        (rocks ? r.detail.rocks : r.detail.craters) = 0.1;
        const auto t = read_dem_in_process(r);
        ASSERT_FALSE(t);
        EXPECT_NE(t.error().what.find("it goes around the planet"), std::string::npos) << t.error().text();
        r.detail.craters = 0;
    }
    DemRequest part = request_of(dem_file("mars.tif"));
    part.detail = {.refinement_factor = 2, .craters = 0.01};
    EXPECT_TRUE(read_dem_in_process(part));
}

TEST(Dem, ATruncatedFileIsAnError) {
    NEEDS_GDAL();
    const MemoryFolder folder;
    const std::string whole = test::read_text(dem_file("mars.tif"));
    for (const std::size_t size : {8u, 100u, 400u, 700u, 3000u}) {
        const auto t =
            read_dem_in_process(request_of(folder.write("t.tif", std::string_view(whole).substr(0, size))));
        EXPECT_FALSE(t) << size;
    }
}

/// A label may name the data file beside it, and nothing elsewhere: neither a file outside of its folder nor one of
/// GDAL's own file systems, which include the network. A FIFO, which would be waited for, is no file either.
TEST(Dem, ALabelOpensNoFileOutsideOfItsFolder) {
    NEEDS_GDAL();
    const MemoryFolder folder;
    const std::string inside = folder / "dem";
    std::filesystem::create_directory(inside);
    for (const std::string& data : {folder / "pds3.img", inside + "/pds3.img"})
        std::filesystem::copy_file(dem_file("pds3.img"), data);
    ASSERT_EQ(::mkfifo((inside + "/fifo").c_str(), 0600), 0);
    const std::string label = test::read_text(dem_file("pds3.lbl"));
    const auto read_with = [&](const std::string& data) {
        std::string named = label;
        named.replace(named.find("pds3.img"), 8, data);
        return read_dem_in_process(request_of(folder.write("dem/d.lbl", named)), {.seconds = 20});
    };
    EXPECT_TRUE(read_with("pds3.img"));
    const std::vector<std::string> elsewhere{"../pds3.img",
                                             folder / "pds3.img",
                                             "/vsicurl/http://127.0.0.1:9/pds3.img",
                                             "/vsisubfile/0_2400," + (folder / "pds3.img"),
                                             "/vsistdin/",
                                             "fifo"};
    for (const std::string& data : elsewhere) {
        const auto t = read_with(data);
        ASSERT_FALSE(t) << data;
        EXPECT_NE(t.error().what.find("Failed to open " + data), std::string::npos) << t.error().text();
    }
}

TEST(DemRequest, CrossesTheCommandLine) {
    DemRequest r = request_of("x"), back;
    r.on = DemRequest::On::tangent, r.radii = true, r.scale = 0.1, r.polar_m = 1.0 / 3;
    r.detail = {8, 0.079, 0.1, 123456789};
    r.options = {
        .error_px = 0.3, .pixels_per_rad = 812.5, .seen_from = {{1, 2, 3}, {1e-9, -1e9, 0.1}}, .budget_bytes = 77};
    ASSERT_TRUE(from_argument(to_argument(r), back));
    EXPECT_EQ(to_argument(back), to_argument(r));
    EXPECT_EQ(back.options.seen_from, r.options.seen_from);
    EXPECT_FALSE(from_argument("1 2 3", back));
    EXPECT_FALSE(from_argument("", back));
}

}  // namespace
}  // namespace narpa
