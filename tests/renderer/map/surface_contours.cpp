// Contour lines of fields with closed forms: where they run, where they end, how they are joined.
#include "renderer/map/contours.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>

namespace narpa {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

ScalarField field_of(int width, int height, const std::function<double(double, double)>& value) {
    ScalarField f{width, height, {}};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) f.values.push_back(value(x, y));
    return f;
}

bool everywhere(std::size_t, std::size_t) {
    return true;
}

std::vector<ContourLine> lines_at(const ScalarField& f, double level) {
    return contour_lines(f, std::array{level}, everywhere);
}

bool on_border(const ImagePoint& p, const ScalarField& f) {
    return p.x == 0 || p.y == 0 || p.x == f.width - 1 || p.y == f.height - 1;
}

double signed_area(const ContourLine& line) {
    double twice = 0;
    for (std::size_t i = 0; i + 1 < line.points.size(); ++i) {
        const ImagePoint &a = line.points[i], &b = line.points[i + 1];
        twice += a.x * b.y - b.x * a.y;
    }
    return twice / 2;
}

TEST(Contours, OfALinearFieldAreStraightFromBorderToBorder) {
    const ScalarField f = field_of(40, 30, [](double x, double y) { return 0.3 * x + 0.7 * y - 5; });
    const auto levels = contour_levels(-5, 0.3 * 39 + 0.7 * 29 - 5, 2);
    ASSERT_TRUE(levels);
    EXPECT_EQ(levels->front(), -4);
    EXPECT_EQ(levels->back(), 26);
    const auto lines = contour_lines(f, *levels, everywhere);
    ASSERT_EQ(lines.size(), levels->size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
        EXPECT_EQ(lines[i].level, (*levels)[i]);
        EXPECT_FALSE(lines[i].closed);
        EXPECT_TRUE(on_border(lines[i].points.front(), f) && on_border(lines[i].points.back(), f));
        for (const ImagePoint& p : lines[i].points) EXPECT_NEAR(0.3 * p.x + 0.7 * p.y - 5, lines[i].level, 1e-12);
    }
}

TEST(Contours, AreClosedRoundAPeakWithHigherValuesOnTheLeft) {
    for (const double sign : {1.0, -1.0}) {
        const ScalarField f =
            field_of(41, 41, [&](double x, double y) { return -sign * std::hypot(x - 20.2, y - 19.7); });
        const auto lines = lines_at(f, -sign * 12);
        ASSERT_EQ(lines.size(), 1u);
        EXPECT_TRUE(lines[0].closed);
        EXPECT_EQ(lines[0].points.front().x, lines[0].points.back().x);
        EXPECT_EQ(lines[0].points.front().y, lines[0].points.back().y);
        // The line keeps the peak on its left: counterclockwise, in an image with y down a negative area.
        EXPECT_NEAR(signed_area(lines[0]), -sign * 3.14159265 * 144, 2);
    }
}

/// Which of the corners' two sides a line joins: sums of the ends' coordinates.
std::set<std::pair<double, double>> ends_of(const std::vector<ContourLine>& lines) {
    std::set<std::pair<double, double>> middles;
    for (const ContourLine& line : lines) {
        EXPECT_EQ(line.points.size(), 2u);
        middles.insert({(line.points[0].x + line.points[1].x) / 2, (line.points[0].y + line.points[1].y) / 2});
    }
    return middles;
}

TEST(Contours, SaddleOfTheBilinearInterpolantDecidesAmbiguousCells) {
    // Corners 1 at the top left and bottom right; the saddle lies at (1 - q^2) / (2 + 2 q) = (1 - q) / 2.
    const auto cell = [](double q) { return ScalarField{2, 2, {1, -q, -q, 1}}; };
    const auto joined = ends_of(lines_at(cell(0.5), 0));  // saddle 0.25: above; the lines cut off the low corners
    const double t = 1 / 1.5;                             // from a high corner
    EXPECT_EQ(joined.size(), 2u);
    for (const auto& [x, y] : joined) EXPECT_NEAR(std::abs(x - y), (1 + t) / 2 - (1 - t) / 2, 1e-12);
    const auto parted = ends_of(lines_at(cell(2), 0));  // saddle -0.5: below; the lines cut off the high corners
    EXPECT_EQ(parted.size(), 2u);
    for (const auto& [x, y] : parted) EXPECT_NEAR(x, y, 1e-12);
    // The same field turned by a quarter.
    const auto turned = ends_of(lines_at(ScalarField{2, 2, {-2, 1, 1, -2}}, 0));
    EXPECT_EQ(turned.size(), 2u);
    for (const auto& [x, y] : turned) EXPECT_NEAR(x + y, 1, 1e-12);
}

TEST(Contours, JoinEveryCrossingOfARandomFieldOnce) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    const ScalarField f = field_of(60, 45, [&](double, double) { return normal(random); });
    const std::array levels{-1.0, 0.0, 0.5};
    std::size_t crossings = 0;
    for (const double level : levels)
        for (int y = 0; y < f.height; ++y)
            for (int x = 0; x < f.width; ++x) {
                const auto value = [&](int i, int j) {
                    return f.values[static_cast<std::size_t>(j * f.width + i)];
                };
                const bool above = value(x, y) >= level;
                crossings += x + 1 < f.width && above != (value(x + 1, y) >= level);
                crossings += y + 1 < f.height && above != (value(x, y + 1) >= level);
            }
    std::set<std::array<double, 3>> points;
    for (const ContourLine& line : contour_lines(f, levels, everywhere)) {
        const bool ends_on_border = on_border(line.points.front(), f) && on_border(line.points.back(), f);
        EXPECT_TRUE(line.closed || ends_on_border);
        const std::size_t n = line.points.size() - (line.closed ? 1 : 0);
        for (std::size_t i = 0; i < n; ++i)
            EXPECT_TRUE(points.insert({line.level, line.points[i].x, line.points[i].y}).second);
        for (std::size_t i = 0; i + 1 < line.points.size(); ++i)
            EXPECT_LE(std::hypot(line.points[i + 1].x - line.points[i].x, line.points[i + 1].y - line.points[i].y),
                      std::sqrt(2.0));
    }
    EXPECT_EQ(points.size(), crossings);
}

TEST(Contours, EndBesidePixelsWithoutValue) {
    const ScalarField f = field_of(30, 20, [](double x, double y) { return x == 12 && y < 15 ? kNone : y; });
    const auto lines = contour_lines(f, std::array{4.5, 17.5}, everywhere);
    ASSERT_EQ(lines.size(), 3u);
    std::set<double> ends;
    for (int i = 0; i < 2; ++i)
        for (const ImagePoint& p : {lines[i].points.front(), lines[i].points.back()}) ends.insert(p.x);
    EXPECT_EQ(ends, (std::set<double>{0, 11, 13, 29}));
    EXPECT_EQ(lines[2].points.size(), 30u) << "below the gap";
}

TEST(Contours, EndBesideSidesThatAreNotContinuous) {
    const ScalarField f = field_of(30, 20, [](double x, double y) { return x < 14.5 ? y : y + 0.25; });
    const auto lines =
        contour_lines(f, std::array{4.5}, [](std::size_t a, std::size_t b) { return b - a != 1 || a % 30 != 14; });
    ASSERT_EQ(lines.size(), 2u);
    for (const ContourLine& line : lines)
        for (const ImagePoint& p : line.points) EXPECT_TRUE(p.x <= 14 || p.x >= 15) << p.x;
    EXPECT_EQ(lines_at(f, 4.5).size(), 1u) << "without the break the line goes on";
}

TEST(Contours, FlatSurfaceAtALevelHasNone) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> noise(-3e-7, 3e-7);
    const ScalarField f = field_of(20, 20, [&](double, double) { return 10 + noise(random); });
    EXPECT_TRUE(lines_at(f, 10).empty());
}

TEST(Contours, LevelsAreTheMultiplesOfTheInterval) {
    EXPECT_EQ(*contour_levels(-25, 12, 10), (std::vector<double>{-20, -10, 0, 10}));
    EXPECT_EQ(*contour_levels(1, 9, 10), std::vector<double>{});
    EXPECT_EQ(contour_levels(0, 999, 1)->size(), 1000u);
    for (const auto& [lowest, highest, interval] :
         {std::array{0.0, 1000.0, 1.0}, std::array{0.0, 1.0, 0.0}, std::array{0.0, 1.0, -1.0},
          std::array{0.0, 1.0, kNone}, std::array{0.0, 1e9, 1e-300}})
        EXPECT_FALSE(contour_levels(lowest, highest, interval)) << interval;
    const std::string what = contour_levels(0, 5000, 1).error().what;
    EXPECT_NE(what.find("5001 levels"), std::string::npos) << what;
    EXPECT_NE(what.find("take 5.2 m or more"), std::string::npos) << what;
    EXPECT_TRUE(contour_levels(0, 5000, 5.2)) << "what it proposes works";
}

}  // namespace
}  // namespace narpa
