/// scenes/generate/mesh.h - a mesh under construction, and its OBJ, MTL and PLY files.
///
/// Every surface that goes in belongs to a closed shell with its faces counter-clockwise seen from outside. Shells
/// may touch or run into each other. Positions are kept on a grid of 10 um, so that neighbouring surfaces meet
/// exactly and the file repeats them to the last digit.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "base/pose.h"

namespace narpa::scenes {

using Uv = std::array<double, 2>;

/// As an MTL file says it. `texture` (a PNG beside it) multiplies `diffuse`.
struct MaterialSpec {
    std::string name;
    Vec3 diffuse;
    Vec3 specular{};
    double exponent = 1;
    std::string texture{};
    Vec3 emission{};  ///< W m^-2 sr^-1
};

/// What a file has of the corners of faces.
enum class MeshParts : std::uint8_t {
    all,         ///< position, texture coordinates, normal
    untextured,  ///< position and normal; PLY alone
    positions,   ///< nothing else, for flat faces without textures: a third of the size; OBJ alone
};

class Mesh {
public:
    /// What follows is of this material, in the OBJ object `part`.
    void begin(const std::string& part, const std::string& material);
    void material(const std::string& name);

    /// A patch of nu x nv quads through point(i, j), outward side du x dv, with smooth normals inside the patch and
    /// hard edges around it. `wrap_u`: column nu is column 0. Quads that shrink to a line or a point are left out.
    void grid(int nu, int nv, bool wrap_u, const std::function<Vec3(int, int)>& point,
              const std::function<Uv(int, int)>& uv);
    /// A flat convex polygon, turned so that it faces away from `inside`; texture by its two longest axes, one
    /// unit every `metres_per_unit`.
    void polygon(const std::vector<Vec3>& corners, const Vec3& inside, double metres_per_unit = 1);

    [[nodiscard]] std::size_t triangle_count() const { return faces_.size(); }
    /// Both write pairs of triangles that make a convex quadrangle as one face, and throw std::runtime_error where
    /// they cannot write. An OBJ file names `mtl_name`; a PLY file, binary, has no materials: the scene gives one.
    /// Numbers are the same, rounded to the same decimals.
    void write_obj(const std::string& path, const std::string& mtl_name, MeshParts wanted = MeshParts::all) const;
    void write_ply(const std::string& path, MeshParts wanted = MeshParts::all) const;

private:
    struct Vertex {
        Vec3 position, normal;
        Uv uv;
    };
    struct Face {
        std::array<std::uint32_t, 3> vertices;
        std::uint16_t part, material;
    };
    struct Polygon {
        std::vector<std::uint32_t> vertices;  // three or four
        std::uint16_t part, material;
    };
    [[nodiscard]] bool is_convex(const std::array<std::uint32_t, 4>& quad) const;
    /// By part, then material.
    [[nodiscard]] std::vector<Polygon> polygons() const;
    void add_face(std::uint32_t a, std::uint32_t b, std::uint32_t c);

    std::vector<std::string> parts_, materials_;
    std::vector<Vertex> vertices_;
    std::vector<Face> faces_;
    std::uint16_t part_ = 0, material_ = 0;
};

void write_mtl(const std::string& path, const std::vector<MaterialSpec>& materials);

}  // namespace narpa::scenes
