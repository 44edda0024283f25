#include <array>
#include <string_view>

#include "scenes/generate/scenes.h"
#include "scenes/generate/shapes.h"

namespace narpa::scenes {
namespace {

/// A square tag as its dictionary states it: rows from the top, '#' black, '.' white; with its black border.
struct Tag {
    double y_m, z_m;  ///< centre on the board
    std::array<std::string_view, 8> rows;
    std::size_t modules;
};
constexpr double kTagSide_m = 0.24;
/// ArUco's dictionary 4X4_50 (Garrido-Jurado et al. 2014), numbers 7 and 23, and AprilTag's 36h11 (Olson 2011), 1
/// and 4.
constexpr std::array<Tag, 4> kTags{
    {{-0.22, 0.22, {"######", "#..###", "##.###", "#....#", "###.##", "######"}, 6},
     {0.22, 0.22, {"######", "#..#.#", "#..#.#", "#.####", "###.##", "######"}, 6},
     {-0.22,
      -0.22,
      {"########", "#.##.###", "#.#..#.#", "####..##", "###....#", "#...#.##", "##..#..#", "########"},
      8},
     {0.22,
      -0.22,
      {"########", "##.###.#", "######.#", "##.#.###", "#....#.#", "###....#", "##.#...#", "########"},
      8}}};

struct Reflector {
    double y, z, x;
};
constexpr std::array<Reflector, 5> kReflectors{
    {{0, 0, 0.06}, {0, 0.40, 0.02}, {-0.40, 0, 0.06}, {0.40, 0, 0.02}, {0, -0.40, 0.10}}};

/// A rectangle that faces x, between y and y + width and from z up to z + height.
void panel(Mesh& mesh, double y, double z, double width, double height) {
    mesh.polygon({{0, y, z}, {0, y + width, z}, {0, y + width, z + height}, {0, y, z + height}}, {-1, y, z});
}

/// The modules of a tag, seen from x with z up and y to the right.
void tag(Mesh& mesh, const Tag& t) {
    const double module = kTagSide_m / static_cast<double>(t.modules);
    for (std::size_t row = 0; row < t.modules; ++row)
        for (std::size_t column = 0; column < t.modules; ++column) {
            mesh.material(t.rows[row][column] == '#' ? "black" : "white");
            panel(mesh, t.y_m - kTagSide_m / 2 + static_cast<double>(column) * module,
                  t.z_m + kTagSide_m / 2 - static_cast<double>(row + 1) * module, module, module);
        }
}

}  // namespace

std::vector<MaterialSpec> tag_board_materials() {
    return {{"white", {0.8, 0.8, 0.8}}, {"black", {0.03, 0.03, 0.03}}, {"grey", {0.3, 0.3, 0.3}}};
}

Mesh build_tag_board() {
    Mesh mesh;
    constexpr double kHalf = 0.46, kMargin = 0.05, kThick = 0.02;
    mesh.begin("board", "grey");
    box(mesh, {{}, {-kThick / 2 - 0.001, 0, 0}}, {kThick / 2, kHalf, kHalf}, 0.002);
    mesh.begin("tags", "white");
    for (const Tag& t : kTags) {
        tag(mesh, t);
        mesh.material("white");  // the margin around it
        const double side = kTagSide_m + 2 * kMargin, y = t.y_m - side / 2, z = t.z_m - side / 2;
        panel(mesh, y, z, side, kMargin), panel(mesh, y, z + side - kMargin, side, kMargin);
        panel(mesh, y, z + kMargin, kMargin, kTagSide_m),
            panel(mesh, y + side - kMargin, z + kMargin, kMargin, kTagSide_m);
    }
    // Reflectors on black feet before the board, so that their parallax shows its tilt.
    mesh.begin("reflectors", "black");
    for (const auto& [y, z, x] : kReflectors) {
        mesh.material("black");
        lathe(mesh, {{}, {x, y, z}}, {{-x, 0}, {-x, 0.04}, {-0.0005, 0.04}, {-0.0005, 0}}, 32);
        mesh.material("white");
        lathe(mesh, {{}, {x, y, z}}, {{-0.0005, 0}, {-0.0005, 0.02}, {0, 0.02}, {0, 0}}, 32);
    }
    return mesh;
}

}  // namespace narpa::scenes
