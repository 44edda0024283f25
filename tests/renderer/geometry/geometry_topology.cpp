#include <gtest/gtest.h>

#include <cmath>

#include "renderer/geometry/mesh_shape.h"

namespace narpa {
namespace {

/// A tetrahedron, outwards.
Mesh tetrahedron() {
    Mesh m;
    m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    m.faces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    return m;
}

TEST(IsClosed, ASolidsSkinIs) {
    EXPECT_TRUE(is_closed(tetrahedron()));
}

TEST(IsClosed, VerticesSplitAtSeamsAreOnePlace) {
    Mesh m = tetrahedron();
    m.positions.push_back({-0.0f, 0, 1});  // vertex 3 again, for one face
    m.faces[3][2] = 4;
    EXPECT_TRUE(is_closed(m));
}

TEST(IsClosed, AHoleOrATurnedFaceOrNothingIsNot) {
    Mesh hole = tetrahedron(), turned = tetrahedron();
    hole.faces.pop_back();
    std::swap(turned.faces[1][0], turned.faces[1][1]);
    EXPECT_FALSE(is_closed(hole));
    EXPECT_FALSE(is_closed(turned));
    EXPECT_FALSE(is_closed(Mesh{}));
}

TEST(IsClosed, LargeOnesToo) {
    constexpr std::uint32_t kAround = 200;  // a torus of 80,000 triangles
    Mesh m;
    for (std::uint32_t i = 0; i < kAround; ++i)
        for (std::uint32_t j = 0; j < kAround; ++j) {
            const float a = 0.0314f * static_cast<float>(i), b = 0.0314f * static_cast<float>(j);
            m.positions.push_back({(3 + std::cos(b)) * std::cos(a), (3 + std::cos(b)) * std::sin(a), std::sin(b)});
            const auto at = [&](std::uint32_t u, std::uint32_t v) { return u % kAround * kAround + v % kAround; };
            m.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            m.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    EXPECT_TRUE(is_closed(m));
    std::swap(m.faces[70'000][0], m.faces[70'000][1]);
    EXPECT_FALSE(is_closed(m));
    m.faces.erase(m.faces.begin() + 70'000);
    EXPECT_FALSE(is_closed(m));
}

}  // namespace
}  // namespace narpa
