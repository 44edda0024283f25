/// renderer/assets/meshes/mesh_readers.h - from a mesh file to triangles and materials, before vertices are welded
/// and bad triangles dropped.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/assets/meshes/mesh_file.h"

namespace narpa {

struct TriangleSoup {
    static constexpr std::uint32_t kNone = 0xffff'ffffu;
    struct Corner {
        std::uint32_t position = kNone, uv = kNone, normal = kNone,
                      colour = kNone;  ///< indices below; kNone: not given
    };
    struct Triangle {
        std::array<Corner, 3> corners;
        std::uint16_t material = 0;
    };
    using Column = std::vector<std::array<std::uint32_t, 3>>;
    /// Triangles, column by column: most large meshes have positions alone.
    struct Triangles {
        Column position, uv, normal, colour;   ///< the last three: empty where no corner has any
        std::vector<std::uint16_t> materials;  ///< empty: all are 0

        [[nodiscard]] std::size_t size() const { return position.size(); }
        [[nodiscard]] bool empty() const { return position.empty(); }
        [[nodiscard]] Triangle operator[](std::size_t i) const {
            Triangle t{.corners = {}, .material = material(i)};
            for (std::size_t k = 0; k < 3; ++k)
                t.corners[k] = {position[i][k], at(uv, i, k), at(normal, i, k), at(colour, i, k)};
            return t;
        }
        /// Of a corner; kNone where it has none.
        [[nodiscard]] static std::uint32_t at(const Column& column, std::size_t i, std::size_t k) {
            return column.empty() ? kNone : column[i][k];
        }
        [[nodiscard]] std::uint16_t material(std::size_t i) const { return materials.empty() ? 0 : materials[i]; }

        void push_back(const Triangle& t) {
            const auto& c = t.corners;
            position.push_back({c[0].position, c[1].position, c[2].position});
            append(uv, {c[0].uv, c[1].uv, c[2].uv});
            append(normal, {c[0].normal, c[1].normal, c[2].normal});
            append(colour, {c[0].colour, c[1].colour, c[2].colour});
            if (t.material != 0 || !materials.empty()) {
                materials.resize(size(), 0);
                materials.back() = t.material;
            }
        }
        void set(Column& column, std::size_t i, std::size_t k, std::uint32_t index) {
            column.resize(size(), kNoneOfThree);
            column[i][k] = index;
        }
        void set_material(std::size_t i, std::uint16_t material) {
            materials.resize(size(), 0);
            materials[i] = material;
        }

    private:
        static constexpr std::array<std::uint32_t, 3> kNoneOfThree{kNone, kNone, kNone};
        /// To a column that is empty, or one shorter than `position`.
        void append(Column& column, const std::array<std::uint32_t, 3>& indices) {
            if (column.empty() && indices == kNoneOfThree) return;
            column.resize(size() - 1, kNoneOfThree);
            column.push_back(indices);
        }
    };
    std::vector<Vec3> positions;  ///< in the file's unit
    std::vector<Vec3f> normals;   ///< of any length
    std::vector<std::array<float, 2>> uvs;
    std::vector<Rgb> colours;  ///< linear, of any size
    Triangles triangles;
    std::vector<MeshMaterial> materials;
    std::vector<std::string> warnings;
    bool has_smoothing_groups = false;  ///< on faces without normals of their own
};

/// Most materials of a mesh.
inline constexpr std::size_t kMaxMaterials = 65535;

/// In small letters, with its dot: ".obj".
std::string extension_of(const std::string& path);

/// The path of a file that a material names: as written, or, if there is none, by its last part in the folder of
/// the mesh.
std::string texture_path(const std::string& mesh_path, std::string name);

/// Wavefront OBJ (Alias/Wavefront, Advanced Visualizer manual, appendix B1). Our own reader, because Assimp 5.2
/// leaves out vertices such as `v .5 0 0` in silence (so that every later index means another vertex), takes
/// `1.#IND` for 1, gives up at MTL extensions, and cannot name the line of an error.
///
/// Faces of any number of corners, with their materials and the colours of their vertices. Groups are passed over;
/// warnings name other statements. Errors carry line and column: a token that is no number, an index of 0 or out of
/// range, a face of fewer than 3 corners. In a table of plates (.tab) indices may count from 0: plate_base.
Result<TriangleSoup> read_obj(const std::string& path);

/// The name of the material of faces before the first `usemtl`.
inline constexpr const char* kObjDefaultMaterial = "default";
/// Adds the materials `names` to `soup`, from the MTL files `libraries`; grey 0.5 for those that none of them has.
Status read_obj_materials(const std::string& path, const std::vector<std::string>& libraries,
                          const std::vector<std::string>& names, TriangleSoup& soup);

/// A table of plates (.tab): OBJ, or the numbers of vertices and faces with a row of numbers for each.
Result<TriangleSoup> read_plates(const std::string& path);

/// Triangles, as numbers of vertices in the file.
using PlateFaces = TriangleSoup::Column;
/// Whether faces count vertices from 0 or 1. 0: a face has vertex 0; or none has the last vertex, and counted from
/// 0 the surface is closed rather than open, or has fewer edges without length, or, by 1 %, more volume for its
/// area (open: shorter edges). A warning tells which, unless a face has the last vertex. Error: both 0 and a number
/// beyond the last vertex.
Result<std::uint32_t> plate_base(const PlateFaces& faces, const std::vector<Vec3>& positions,
                                 const std::string& path, std::vector<std::string>& warnings);

/// An sRGB colour, each band from 0 to 1, as linear light.
[[nodiscard]] Rgb linear_colour(const Rgb& srgb);

/// An ICQ shape model: the number q, then six grids of (q + 1)^2 vertices, the faces of a cube, which all face away
/// from the middle. Errors carry line and column.
Result<TriangleSoup> read_icq(const std::string& path);

/// A material's name as OBJ and MTL give it: backslashes at its end, which continue no line, are left out.
std::string material_name(std::string_view rest_of_line);

/// Adds the materials of an MTL file by name (docs/meshes.md has the mapping). `warnings` gets what is left out.
Status read_mtl(const std::string& path, std::map<std::string, MeshMaterial>& materials,
                std::vector<std::string>& warnings);

/// An MTL material; what the file leaves out is absent.
struct MtlMaterial {
    std::string name{};
    std::optional<Rgb> kd{}, ke{};
    Rgb ks{};
    float ns = 0;
    std::optional<float> d{}, tr{}, ni{}, pr{}, pm{};
    int illum = 2;
    MeshTexture map_kd{}, map_ke{}, norm{}, bump{};
    std::optional<float> bump_multiplier{};

    [[nodiscard]] bool transparent() const { return d ? *d < 1 : tr && *tr > 0; }
};
MeshMaterial from_mtl(const MtlMaterial& given);

/// Lambert, or Phong where ks > 0; every band clamped to [0, 1] and both scaled so that kd + ks <= 1.
Material diffuse_and_lobe(std::string name, Rgb kd, Rgb ks, float exponent, const Rgb& emission);
/// Clamps every number to its range in scene.h.
Material metallic_roughness(std::string name, const Rgb& base_colour, float metallic, float roughness, float ior,
                            const Rgb& emission);
Material smooth_glass(std::string name, float ior, const Rgb& emission);

/// Polygons of more corners are refused by the readers: the work is cubic in the worst case.
inline constexpr std::size_t kMaxCorners = 1024;

/// Cuts a simple polygon, convex or not, into corners.size() - 2 triangles of the same winding, as indices into
/// `corners`. A convex one becomes a fan about its first corner; others lose one ear after the other.
/// One that crosses itself, or has no area, still gives triangles. At most cubic in the number of corners.
std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const Vec3> corners);

}  // namespace narpa
