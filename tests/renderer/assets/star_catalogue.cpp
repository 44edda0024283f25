// Star catalogues, and the [stars] of scene files.
#include "renderer/assets/star_catalogue.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "base/constants.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kDeg = kPi / 180;
const std::string kHeader = std::string(kStarHeader) + "\n";

double separation_deg(const Vec3& a, const Vec3& b) {
    return std::atan2(norm(cross(a, b)), dot(a, b)) / kDeg;
}

TEST(StarCatalogue, ReadsNumbersCommentsAndEmptyColumns) {
    const MemoryFolder folder;
    const auto stars = read_star_catalogue(folder.write(
        "s.csv",
        "# brightest\r\n\n" + kHeader + "Sirius, 101.25, -16.5 ,-1.44,0.01,-546,-1223\r\nHR 2,0,90,6,,,\n"));
    ASSERT_TRUE(stars) << stars.error().text();
    ASSERT_EQ(stars->size(), 2u);
    EXPECT_EQ((*stars)[0].name, "Sirius");
    EXPECT_EQ((*stars)[0].dec_deg, -16.5);
    EXPECT_EQ((*stars)[0].pm_dec_mas_yr, -1223);
    EXPECT_EQ((*stars)[1].b_v, 0.65);
    EXPECT_EQ((*stars)[1].pm_ra_mas_yr, 0);
}

class StarCatalogueRefuses : public testing::TestWithParam<BadFile> {};

TEST_P(StarCatalogueRefuses, WithPlaceAndReason) {
    const BadFile& bad = GetParam();
    const MemoryFolder folder;
    const std::string file = folder.write("s.csv", bad.text);
    const auto stars = read_star_catalogue(file);
    ASSERT_FALSE(stars);
    expect_error_of(bad, file, stars.error());
}

#define HEADER "name,ra_deg,dec_deg,v_mag,b_v,pm_ra_mas_yr,pm_dec_mas_yr\n"
INSTANTIATE_TEST_SUITE_P(
    All, StarCatalogueRefuses,
    testing::Values(BadFile{"NoHeader", "Sirius,101,-16,-1.44,0,0,0\n", 1, 1, "expected the header line"},
                    BadFile{"Empty", "", 0, 0, "no stars"}, BadFile{"HeaderOnly", HEADER, 0, 0, "no stars"},
                    BadFile{"FewColumns", HEADER "a,1,2,3\n", 2, 1, "4 columns, expected 7"},
                    BadFile{"ManyColumns", HEADER "a,1,2,3,4,5,6,7\n", 2, 1, "8 columns, expected 7"},
                    BadFile{"RightAscension", HEADER "a,360.5,2,3,,,\n", 2, 3, "0 to 360"},
                    BadFile{"Declination", HEADER "b,1,2,3,,,\na,1,-90.5,3,,,\n", 3, 5, "-90 to 90"},
                    BadFile{"NoMagnitude", HEADER "a,1,2,,,,\n", 2, 7, "V magnitude"},
                    BadFile{"NotANumber", HEADER "a,1,2,nan,,,\n", 2, 7, "\"nan\""},
                    BadFile{"Colour", HEADER "a,1,2,3,-0.9,,\n", 2, 9, "colour index"},
                    BadFile{"ProperMotion", HEADER "a,1,2,3,,x,\n", 2, 10, "proper motion"},
                    BadFile{"Infinite", HEADER "a,1,2,3,,,1e999\n", 2, 11, "proper motion"}),
    [](const auto& named) { return named.param.name; });
#undef HEADER

TEST(StarCatalogue, MovesByProperMotion) {
    // Barnard's star: 10.36 arcsec a year towards position angle 355.6 degrees. 61 Cygni A: 5.28 arcsec a year.
    const CatalogueStar barnard{"Barnard", 269.452075, 4.693391, 9.51, 1.73, -798.58, 10328.12};
    EXPECT_NEAR(separation_deg(star_direction(barnard, 0), star_direction(barnard, 25)) * 3600, 25 * 10.359, 0.01);
    EXPECT_GT(star_direction(barnard, 25).z, star_direction(barnard, 0).z);
    const CatalogueStar cygni{"61 Cyg A", 316.724742, 38.749417, 5.2, 1.07, 4168.31, 3269.20};
    const Vec3 later = star_direction(cygni, 10);
    EXPECT_NEAR((std::atan2(later.y, later.x) / kDeg + 360 - 316.724742) * std::cos(38.749417 * kDeg) * 3600,
                41.683, 0.02);
    EXPECT_NEAR((std::asin(later.z) / kDeg - 38.749417) * 3600, 32.692, 0.01);
}

constexpr const char* kSceneWithoutStars =
    "[sun]\ndirection = [0, 0, 1]\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n[[camera]]\nname = "
    "\"c\"\nresolution = [8, 6]\nfov_diagonal_deg = 10\n"
    "position_m = [0, 0, 0]\nattitude_wxyz = [1, 0, 0, 0]\n";

TEST(StarsOfAScene, HaveTheEpochOfTheSceneAndTheFaintestMagnitude) {
    const MemoryFolder folder;
    folder.write("s.csv", kHeader + "a,0,0,1,0,0,360000\nb,0,0,3,,,\n");
    const auto scene = read_scene(
        folder.write("s.toml",
                     "[scene]\nepoch = 2010-01-01T12:00:00Z\n[stars]\ncatalogue = \"s.csv\"\nfaintest = 2\n"
                     "attitude_wxyz = [0, 1, 0, 0]\nrate_rad_s = [0, 0, 1]\nvelocity_m_s = [1, 2, 3]\n" +
                         std::string(kSceneWithoutStars)));
    ASSERT_TRUE(scene) << scene.error().text();
    ASSERT_TRUE(scene->stars);
    ASSERT_EQ(scene->stars->stars.size(), 1u);
    EXPECT_NEAR(std::atan2(scene->stars->stars[0].direction.z, scene->stars->stars[0].direction.x),
                std::atan(1 * kDeg), 1e-5);
    EXPECT_EQ(scene->stars->q_icrs_world, (Quat{0, 1, 0, 0}));
    EXPECT_EQ(scene->stars->velocity_m_s, (Vec3{1, 2, 3}));
    EXPECT_FALSE(read_scene(folder.write("none.toml", kSceneWithoutStars))->stars);
}

TEST(StarsOfAScene, ErrorsNameTheLineOfTheCatalogue) {
    const MemoryFolder folder;
    folder.write("s.csv", kHeader + "a,0,99,1,,,\n");
    const auto bad =
        read_scene(folder.write("s.toml", "[stars]\ncatalogue = \"s.csv\"\n" + std::string(kSceneWithoutStars)));
    ASSERT_FALSE(bad);
    EXPECT_EQ(bad.error().file, folder / "s.csv");
    EXPECT_EQ(bad.error().line, 2);
    EXPECT_EQ(bad.error().column, 5);
    EXPECT_NE(bad.error().what.find("catalogue of [stars], " + (folder / "s.toml") + ":2"), std::string::npos);
    const auto none =
        read_scene(folder.write("n.toml", "[stars]\ncatalogue = \"n.csv\"\n" + std::string(kSceneWithoutStars)));
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().line, 2);
    EXPECT_NE(none.error().what.find("n.csv: cannot be opened"), std::string::npos);
    const auto fast =
        read_scene(folder.write("f.toml", "[stars]\ncatalogue = \"n.csv\"\nvelocity_m_s = [0, 0, 3e8]\n" +
                                              std::string(kSceneWithoutStars)));
    ASSERT_FALSE(fast);
}

/// The set that ships: angles between stars as every star atlas has them, degrees.
TEST(BrightestStars, FormTheirConstellations) {
    const auto stars = read_star_catalogue(test::source_path("scenes/stars/brightest.csv"));
    ASSERT_TRUE(stars) << stars.error().text();
    EXPECT_GT(stars->size(), 100u);
    const auto named = [&](std::string_view name) {
        const auto star = std::ranges::find(*stars, name, &CatalogueStar::name);
        EXPECT_NE(star, stars->end()) << name;
        return star_direction(*star, 0);
    };
    EXPECT_NEAR(separation_deg(named("Dubhe"), named("Merak")), 5.37, 0.01);       // the pointers
    EXPECT_NEAR(separation_deg(named("Betelgeuse"), named("Rigel")), 18.6, 0.05);  // across Orion
    EXPECT_NEAR(separation_deg(named("Alnitak"), named("Mintaka")), 2.74, 0.01);   // his belt
    EXPECT_NEAR(separation_deg(named("Castor"), named("Pollux")), 4.51, 0.01);     // the twins
    EXPECT_NEAR(separation_deg(named("Polaris"), Vec3{0, 0, 1}), 0.736, 0.001);    // beside the pole
    for (const CatalogueStar& s : *stars) EXPECT_LT(s.v_magnitude, 3.5) << s.name;
}

TEST(BrightestStars, StandWhereHipparcosFoundThem) {
    const std::string file = asset_file("stars/stars.json");
    NARPA_SKIP_WITHOUT(file);
    const auto stars = read_star_catalogue(test::source_path("scenes/stars/brightest.csv"));
    ASSERT_TRUE(stars);
    std::ifstream in(file);
    const nlohmann::json hipparcos = nlohmann::json::parse(in);
    for (const CatalogueStar& s : *stars) {
        double nearest_deg = 180, v = 0;
        for (const auto& row : hipparcos.at("data")) {
            if (row[0].is_null() || row[1].is_null() || row[2].is_null()) continue;
            const CatalogueStar h{"", row[1], row[2], row[0]};
            const double angle = separation_deg(star_direction(h, 0), star_direction(s, 1991.25 - 2000));
            if (angle < nearest_deg) nearest_deg = angle, v = h.v_magnitude;
        }
        EXPECT_LT(nearest_deg * 3600, 0.05) << s.name;
        EXPECT_EQ(v, s.v_magnitude) << s.name;
    }
}

}  // namespace
}  // namespace narpa
