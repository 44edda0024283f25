// From heights to triangles: posts and normals are exact, no edge is open, errors and budgets are kept.
#include "renderer/terrain/terrain_mesh.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <numbers>

#include "renderer/terrain/tile_errors.h"
#include "tests/support/height_grid.h"

namespace narpa {
namespace {

using test::HeightGrid, test::metre_posts, test::rough_ground;

TerrainMesh built(HeightSource& source, const Placement& placement, const TerrainOptions& options) {
    auto terrain = build_terrain(source, placement, options);
    EXPECT_TRUE(terrain) << terrain.error().what;
    return terrain ? *std::move(terrain) : TerrainMesh{};
}

/// Edges that are passed in one direction only, by the positions of their ends.
std::size_t open_edges(const TerrainMesh& t) {
    using End = std::array<float, 3>;
    std::map<std::pair<End, End>, int> passed;
    const auto end = [&](std::uint32_t v) { return End{t.positions[v].x, t.positions[v].y, t.positions[v].z}; };
    for (const auto& f : t.faces)
        for (std::size_t k = 0; k < 3; ++k) {
            const End a = end(f[k]), b = end(f[(k + 1) % 3]);
            a < b ? ++passed[{a, b}] : --passed[{b, a}];
        }
    return static_cast<std::size_t>(
        std::count_if(passed.begin(), passed.end(), [](const auto& e) { return e.second != 0; }));
}

/// Edges along the border of the grid.
std::size_t border_edges(const TerrainMesh& t, int columns, int rows) {
    std::size_t n = 0;
    const auto on_border = [&](std::uint32_t a, std::uint32_t b) {
        const auto column = [&](std::uint32_t v) {
            return std::lround(t.uvs[v][0] * static_cast<float>(columns) - 0.5f);
        };
        const auto row = [&](std::uint32_t v) {
            return std::lround((1 - t.uvs[v][1]) * static_cast<float>(rows) - 0.5f);
        };
        return (column(a) == column(b) && (column(a) == 0 || column(a) == columns - 1)) ||
               (row(a) == row(b) && (row(a) == 0 || row(a) == rows - 1));
    };
    for (const auto& f : t.faces)
        for (std::size_t k = 0; k < 3; ++k) n += on_border(f[k], f[(k + 1) % 3]);
    return n;
}

/// The surface of a terrain over its plane: heights at the places of posts, by the triangles that hold them.
std::vector<double> heights_at_posts(const TerrainMesh& t, int columns, int rows, double spacing_m) {
    std::vector<double> heights(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), kNoHeight);
    const double x0 = 0.5 * spacing_m * (columns - 1), y0 = 0.5 * spacing_m * (rows - 1);
    for (const auto& f : t.faces) {
        std::array<Vec3, 3> p;
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3 at = t.origin_m + vec_cast<double>(t.positions[f[k]]);
            p[k] = {(at.x + x0) / spacing_m, (y0 - at.y) / spacing_m, at.z};
        }
        const double area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (p[1].y - p[0].y);
        const auto [left, right] = std::minmax({p[0].x, p[1].x, p[2].x});
        const auto [top, bottom] = std::minmax({p[0].y, p[1].y, p[2].y});
        for (int r = static_cast<int>(std::ceil(top - 1e-3)); r <= bottom + 1e-3; ++r)
            for (int c = static_cast<int>(std::ceil(left - 1e-3)); c <= right + 1e-3; ++c) {
                const double b1 = ((c - p[0].x) * (p[2].y - p[0].y) - (p[2].x - p[0].x) * (r - p[0].y)) / area,
                             b2 = ((p[1].x - p[0].x) * (r - p[0].y) - (c - p[0].x) * (p[1].y - p[0].y)) / area;
                if (b1 > -1e-4 && b2 > -1e-4 && b1 + b2 < 1 + 1e-4)
                    heights[static_cast<std::size_t>(r * columns + c)] =
                        p[0].z + b1 * (p[1].z - p[0].z) + b2 * (p[2].z - p[0].z);
            }
    }
    return heights;
}

TEST(Terrain, HeightsAndNormalsAtPostsAreExact) {
    constexpr int kColumns = 150, kRows = 101;
    HeightGrid grid(kColumns, kRows, rough_ground);
    const TerrainMesh t = built(grid, metre_posts(kColumns, kRows, 2),
                                {.error_px = 1e-3, .seen_from = {{0, 0, 0}}, .budget_bytes = 1 << 26});
    EXPECT_EQ(t.faces.size(), 2u * (kColumns - 1) * (kRows - 1));
    EXPECT_EQ(t.summary.tiles[0], 6u);
    for (std::size_t v = 0; v < t.positions.size(); ++v) {
        const Vec3 p = t.origin_m + vec_cast<double>(t.positions[v]);
        const int c = static_cast<int>(std::lround(p.x / 2 + 0.5 * (kColumns - 1))),
                  r = static_cast<int>(std::lround(0.5 * (kRows - 1) - p.y / 2));
        ASSERT_NEAR(p.z, grid.at(c, r), 5e-6);
        const int west = std::max(c - 1, 0), east = std::min(c + 1, kColumns - 1), north = std::max(r - 1, 0),
                  south = std::min(r + 1, kRows - 1);
        const Vec3 n = normalized(Vec3{-(grid.at(east, r) - grid.at(west, r)) / (2 * (east - west)),
                                       -(grid.at(c, north) - grid.at(c, south)) / (2 * (south - north)), 1});
        ASSERT_LT(norm(vec_cast<double>(t.normals[v]) - n), 1e-6);
        EXPECT_NEAR(t.uvs[v][0], (c + 0.5) / kColumns, 1e-6);
        EXPECT_NEAR(t.uvs[v][1], 1 - (r + 0.5) / kRows, 1e-6);
    }
}

TEST(Terrain, NoEdgeIsOpenBetweenLevels) {
    constexpr int kColumns = 700, kRows = 523;  // tiles at the border are cut
    HeightGrid grid(kColumns, kRows, rough_ground);
    for (const Vec3& eye : {Vec3{-300, 200, 60}, {0, 0, 500}, {900, 900, 100}, {0, 0, 3000}}) {
        const TerrainMesh t = built(grid, metre_posts(kColumns, kRows), {.error_px = 1, .seen_from = {eye}});
        EXPECT_LT(t.faces.size(), t.summary.full_triangles);
        EXPECT_EQ(open_edges(t), border_edges(t, kColumns, kRows));
        for (const Vec3f& n : t.normals) EXPECT_NEAR(norm(n), 1, 1e-6);
        for (const auto& f : t.faces)  // all of them face up
            EXPECT_GT(cross(t.positions[f[1]] - t.positions[f[0]], t.positions[f[2]] - t.positions[f[0]]).z, 0);
    }
    const TerrainMesh mixed =
        built(grid, metre_posts(kColumns, kRows), {.error_px = 1, .seen_from = {{-300, 200, 60}}});
    int levels = 0;
    for (const std::uint32_t tiles : mixed.summary.tiles) levels += tiles > 0;
    EXPECT_GE(levels, 3);
}

TEST(Terrain, ErrorsStayBelowTheBound) {
    constexpr int kColumns = 513, kRows = 449;
    HeightGrid grid(kColumns, kRows, rough_ground);
    const std::vector<Vec3> path{{-100, 0, 400}, {50, 20, 60}};
    const TerrainOptions options{.error_px = 0.5, .pixels_per_rad = 700, .seen_from = path};
    const TerrainMesh t = built(grid, metre_posts(kColumns, kRows), options);
    EXPECT_LT(t.faces.size(), t.summary.full_triangles * 2 / 3);
    const std::vector<double> heights = heights_at_posts(t, kColumns, kRows, 1);
    double worst_px = 0;
    for (int r = 0; r < kRows; ++r)
        for (int c = 0; c < kColumns; ++c) {
            const double h = heights[static_cast<std::size_t>(r * kColumns + c)];
            ASSERT_TRUE(std::isfinite(h)) << c << " " << r;
            const Vec3 p{c - 0.5 * (kColumns - 1), 0.5 * (kRows - 1) - r, grid.at(c, r)};
            for (int k = 0; k <= 100; ++k) {
                const Vec3 eye = path[0] + 0.01 * k * (path[1] - path[0]);
                worst_px = std::max(worst_px, std::abs(h - p.z) / norm(p - eye) * 700);
            }
        }
    RecordProperty("worst_px", std::to_string(worst_px));
    EXPECT_LT(worst_px, 0.5);
    EXPECT_GT(worst_px, 0.1);
}

TEST(Terrain, ABoundInMetresIsKeptToo) {
    HeightGrid grid(257, 257, rough_ground);
    const TerrainMesh t = built(grid, metre_posts(257, 257), {.error_m = 0.3, .seen_from = {{0, 0, 1e6}}});
    const std::vector<double> heights = heights_at_posts(t, 257, 257, 1);
    for (int r = 0; r < 257; ++r)
        for (int c = 0; c < 257; ++c)
            EXPECT_LT(std::abs(heights[static_cast<std::size_t>(r * 257 + c)] - grid.at(c, r)), 0.31);
}

TEST(Terrain, TheBudgetIsKeptAtACoarserBound) {
    HeightGrid grid(513, 513, rough_ground);
    const TerrainOptions wish{.seen_from = {{0, 0, 50}}};
    const TerrainMesh fine = built(grid, metre_posts(513, 513), wish);
    EXPECT_EQ(fine.summary.error_px, 0.5);
    TerrainOptions scant = wish;
    scant.budget_bytes = fine.faces.size() * kTerrainBytesPerTriangle / 10;
    const TerrainMesh coarse = built(grid, metre_posts(513, 513), scant);
    EXPECT_LE(coarse.faces.size() * kTerrainBytesPerTriangle, scant.budget_bytes);
    EXPECT_GT(coarse.summary.error_px, 0.5);
    EXPECT_EQ(open_edges(coarse), border_edges(coarse, 513, 513));
    scant.budget_bytes = 1000;
    const auto none = build_terrain(grid, metre_posts(513, 513), scant);
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().what.find("expected a larger budget_mib"), std::string::npos) << none.error().what;
}

TEST(Terrain, HolesStayHoles) {
    HeightGrid grid(200, 130, [](int c, int r) {
        return c >= 60 && c < 70 && r >= 50 && r < 80 ? kNoHeight : rough_ground(c, r);
    });
    const TerrainMesh t = built(grid, metre_posts(200, 130), {.error_px = 1e-3, .seen_from = {{0, 0, 10}}});
    EXPECT_EQ(t.faces.size(), 2u * (199 * 129 - 11 * 31) + 2);  // at two corners a triangle is whole
    EXPECT_EQ(open_edges(t), border_edges(t, 200, 130) + 2 * (11 + 31) - 2);
    const TerrainMesh far = built(grid, metre_posts(200, 130), {.seen_from = {{0, 0, 1e4}}});
    EXPECT_LT(far.faces.size(), t.faces.size());
    HeightGrid empty(100, 100, [](int, int) { return kNoHeight; });
    const auto none = build_terrain(empty, metre_posts(100, 100), {.seen_from = {{0, 0, 1}}});
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().what, "it has no heights: all of it is no-data");
}

TEST(Terrain, AWholePlanetIsClosed) {
    constexpr int kAround = 360, kRows = 182;
    constexpr double kRadius = 1.7374e6;
    const auto bumps = [](int c, int r) {
        return r == 0 || r == kRows - 1 ? 100
                                        : 3000 * std::sin(0.1 * (c % kAround)) * std::sin(0.17 * r) *
                                              std::sin(std::numbers::pi * r / (kRows - 1));
    };
    HeightGrid grid(kAround + 1, kRows, bumps, true);
    Placement p;
    p.map = {0.5, 1, 0, 89.5, 0, -1};
    p.on_ellipsoid = true;
    p.equatorial_m = p.polar_m = kRadius;
    p.around = kAround, p.first_pole = 1, p.last_pole = -1, p.last_row = kRows - 1;
    for (const double distance : {2e6, 1e8}) {
        const TerrainMesh t = built(grid, p, {.seen_from = {{distance, 0, 0}}});
        EXPECT_EQ(open_edges(t), 0u);
        double farthest_off = 0;
        for (std::size_t v = 0; v < t.positions.size(); ++v) {
            const Vec3 at = t.origin_m + vec_cast<double>(t.positions[v]);
            EXPECT_GT(dot(normalized(at), vec_cast<double>(t.normals[v])), 0.9);
            if (std::hypot(at.x, at.y) < 1) {
                EXPECT_NEAR(std::abs(at.z), kRadius + 100, 0.1);
                EXPECT_NEAR(std::abs(t.normals[v].z), 1, 1e-6);  // no slope at the poles
            }
            farthest_off = std::max(farthest_off, std::abs(norm(at) - kRadius));
        }
        EXPECT_LT(farthest_off, 3001);
    }
}

TEST(Terrain, PostsStandOnTheEllipsoid) {
    Placement p;
    p.map = {137.4, 1e-4, 0, -4.5, 0, -1e-4};
    p.on_ellipsoid = true;
    p.equatorial_m = 3396190, p.polar_m = 3376200;
    std::array<Vec3, 1> post{Vec3{10, 20, 1234}};
    ASSERT_TRUE(p.place(post));
    // (x, y, z) back to geodetic height and latitude by Bowring's iteration.
    const double lon = std::atan2(post[0].y, post[0].x), s = std::hypot(post[0].x, post[0].y);
    const double e2 = 1 - std::pow(3376200.0 / 3396190, 2);
    double lat = std::atan2(post[0].z, s * (1 - e2)), n = 0;
    for (int i = 0; i < 10; ++i) {
        n = 3396190 / std::sqrt(1 - e2 * std::pow(std::sin(lat), 2));
        lat = std::atan2(post[0].z + e2 * n * std::sin(lat), s);
    }
    constexpr double kDegree = std::numbers::pi / 180;
    EXPECT_NEAR(lon / kDegree, 137.401, 1e-10);
    EXPECT_NEAR(lat / kDegree, -4.502, 1e-10);
    EXPECT_NEAR(s / std::cos(lat) - n, 1234, 1e-6);
    EXPECT_GT(dot(p.up(post[0]),
                  normalized(Vec3{std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat)})),
              1 - 1e-12);
}

TEST(Terrain, TileErrorsAreThoseOfTheTriangles) {
    HeightGrid grid(65, 65, [](int c, int r) { return c == 33 && r == 20 ? 5.0 : 0.1 * c - 0.2 * r; });
    std::vector<double> h(65 * 65);
    ASSERT_TRUE(grid.read_rows(0, 65, h.data()));
    const HeightWindow window{h.data(), 65, 64, 64};
    EXPECT_NEAR(tile_error(window, 1, 1), 0, 1e-12);
    for (int stride = 2; stride <= 64; stride *= 2)
        EXPECT_NEAR(tile_error(window, stride, 1), 5 - (3.3 - 4), 1e-12) << stride;
    h[20 * 65 + 32] = kNoHeight;
    EXPECT_NEAR(tile_error(window, 4, 10), 40, 1e-12);
    EXPECT_GT(tile_error(window, 64, 1, 0.5), 0.5);
}

}  // namespace
}  // namespace narpa
