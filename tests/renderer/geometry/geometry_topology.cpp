#include <gtest/gtest.h>

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

}  // namespace
}  // namespace narpa
