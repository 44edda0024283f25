#include "renderer/assets/meshes/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/file_bytes.h"
#include "renderer/assets/meshes/mesh_process.h"
#include "renderer/assets/meshes/mesh_readers.h"
#include "renderer/assets/meshes/numbering.h"
#include "renderer/assets/meshes/smooth_normals.h"

namespace narpa {

namespace {

/// Bit pattern for keys, equal for equal numbers: -0 counts as 0.
std::uint32_t bits(float x) {
    return std::bit_cast<std::uint32_t>(x + 0.0f);
}
float from_bits(std::uint32_t b) {
    return std::bit_cast<float>(b);
}

float largest_part(const Vec3f& p) {
    return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
}

/// Twice the triangle's area, as a vector along its normal.
Vec3 area_vector(const std::array<Vec3f, 3>& p) {
    const Vec3 a = vec_cast<double>(p[0]);
    return cross(vec_cast<double>(p[1]) - a, vec_cast<double>(p[2]) - a);
}

bool is_degenerate(const std::array<Vec3f, 3>& p) {
    double longest2 = 0;
    for (int i = 0; i < 3; ++i) {
        const Vec3 side = vec_cast<double>(p[static_cast<std::size_t>((i + 1) % 3)]) -
                          vec_cast<double>(p[static_cast<std::size_t>(i)]);
        longest2 = std::max(longest2, dot(side, side));
    }
    return !(norm(area_vector(p)) > 0x1p-24 * longest2);
}

/// Drops bad triangles of a soup and welds its vertices into a Mesh.
class MeshBuilder {
public:
    MeshBuilder(TriangleSoup& soup, double scale)
        : soup_(soup),
          points_(soup.positions.size()),
          triangles_(soup.triangles.size()),
          vertices_(soup.positions.size()),
          colours_(soup.colours.empty() ? 0 : soup.positions.size()),
          last_(soup.positions.size()) {
        scaled_.reserve(soup.positions.size());
        for (const Vec3& p : soup.positions) scaled_.push_back(vec_cast<float>(scale * p));
        out_.mesh.faces.reserve(soup.triangles.size());
        out_.mesh.face_material.reserve(soup.triangles.size());
    }

    /// Largest coordinate of a triangle, either way; after `build`.
    [[nodiscard]] float reach_m() const { return reach_m_; }

    MeshFile build() {
        for (const TriangleSoup::Triangle& t : soup_.triangles) sift(t);
        const bool with_normals = !soup_.normals.empty(), with_uvs = !soup_.uvs.empty(),
                   with_colours = !soup_.colours.empty();
        const std::size_t n = vertices_.keys().size();
        out_.mesh.positions.reserve(n);
        if (with_normals) out_.mesh.normals.reserve(n);
        if (with_uvs) out_.mesh.uvs.reserve(n);
        if (with_colours) out_.mesh.colours.reserve(n);
        for (const VertexKey& v : vertices_.keys()) {
            const auto& p = points_.keys()[v[0]];
            out_.mesh.positions.push_back({from_bits(p[0]), from_bits(p[1]), from_bits(p[2])});
            if (with_normals) out_.mesh.normals.push_back({from_bits(v[1]), from_bits(v[2]), from_bits(v[3])});
            if (with_uvs) out_.mesh.uvs.push_back({from_bits(v[4]), from_bits(v[5])});
            if (with_colours) {
                const auto& c = colours_.keys()[v[6]];
                out_.mesh.colours.push_back({from_bits(c[0]), from_bits(c[1]), from_bits(c[2])});
            }
        }
        out_.materials = std::move(soup_.materials);
        out_.warnings = std::move(soup_.warnings);
        return std::move(out_);
    }

private:
    using VertexKey = std::array<std::uint32_t, 7>;  // point, normal x y z, u, v, colour

    void sift(const TriangleSoup::Triangle& t) {
        std::array<Vec3f, 3> p;
        std::array<std::uint32_t, 3> point{};
        for (std::size_t i = 0; i < 3; ++i) {
            p[i] = scaled_[t.corners[i].position];
            if (!is_finite(p[i])) return void(++out_.non_finite);
            reach_m_ = std::max(reach_m_, largest_part(p[i]));
            std::uint32_t& known = last_[t.corners[i].position].point;
            if (known == kUnknown) known = points_.number({bits(p[i].x), bits(p[i].y), bits(p[i].z)});
            point[i] = known;
        }
        if (is_degenerate(p)) return void(++out_.degenerate);
        std::array<std::uint32_t, 3> sorted = point;
        std::sort(sorted.begin(), sorted.end());
        const std::size_t known = triangles_.keys().size();
        if (triangles_.number(sorted) < known) return void(++out_.duplicate);
        add(t, p, point);
    }

    void add(const TriangleSoup::Triangle& t, const std::array<Vec3f, 3>& p,
             const std::array<std::uint32_t, 3>& point) {
        const Vec3f flat = soup_.normals.empty() ? Vec3f{} : vec_cast<float>(normalized(area_vector(p)));
        std::array<std::uint32_t, 3> face{};
        for (std::size_t i = 0; i < 3; ++i) {
            const TriangleSoup::Corner& c = t.corners[i];
            Last& last = last_[c.position];
            if (last.vertex == kUnknown || last.uv != c.uv || last.normal != c.normal || last.colour != c.colour) {
                const auto [n, is_flat] = normal_of(c, flat);
                const std::array<float, 2> uv = uv_of(c);
                face[i] = vertices_.number(
                    {point[i], bits(n.x), bits(n.y), bits(n.z), bits(uv[0]), bits(uv[1]), colour_of(c)});
                last = {point[i], c.uv, c.normal, c.colour, is_flat ? kUnknown : face[i]};
            } else {
                face[i] = last.vertex;
            }
        }
        out_.mesh.faces.push_back(face);
        out_.mesh.face_material.push_back(t.material);
    }

    struct Normal {
        Vec3f n;
        bool is_flat;  ///< the triangle's own
    };
    /// The corner's normal; where the file gives none that can be used, the triangle's own.
    [[nodiscard]] Normal normal_of(const TriangleSoup::Corner& c, const Vec3f& flat) const {
        if (soup_.normals.empty()) return {{}, false};
        if (c.normal == TriangleSoup::kNone) return {flat, true};
        const Vec3 n = vec_cast<double>(soup_.normals[c.normal]);
        const double length = norm(n);
        if (!(length > 0) || !std::isfinite(length)) return {flat, true};
        return {vec_cast<float>(n / length), false};
    }

    [[nodiscard]] std::array<float, 2> uv_of(const TriangleSoup::Corner& c) const {
        if (c.uv == TriangleSoup::kNone) return {0, 0};
        const auto& uv = soup_.uvs[c.uv];
        return std::isfinite(uv[0]) && std::isfinite(uv[1]) ? uv : std::array<float, 2>{0, 0};
    }

    /// The number of the corner's colour, from 0 to 1 in each band.
    [[nodiscard]] std::uint32_t colour_of(const TriangleSoup::Corner& c) {
        if (soup_.colours.empty()) return 0;
        const Rgb colour = c.colour == TriangleSoup::kNone ? Rgb{1, 1, 1} : soup_.colours[c.colour];
        const auto part = [](float x) { return bits(x > 0 ? std::min(x, 1.0f) : 0.0f); };  // NaN is 0
        return colours_.number({part(colour.x), part(colour.y), part(colour.z)});
    }

    static constexpr std::uint32_t kUnknown = 0xffff'ffffu;
    /// Cache: the last vertex used at a position, which most other triangles there share.
    struct Last {
        std::uint32_t point = kUnknown, uv = 0, normal = 0, colour = 0, vertex = kUnknown;
    };

    TriangleSoup& soup_;
    std::vector<Vec3f> scaled_;
    Numbering<3> points_, triangles_;
    Numbering<7> vertices_;
    Numbering<3> colours_;
    std::vector<Last> last_;
    float reach_m_ = 0;
    MeshFile out_;
};

/// A texture needs coordinates: triangles without them get the material without it.
void take_textures_off_bare_triangles(TriangleSoup& soup, const std::string& path) {
    const std::size_t given = soup.materials.size();
    std::vector<std::size_t> bare(given, 0);  // the material without its texture; 0 is none yet
    for (TriangleSoup::Triangle& t : soup.triangles) {
        const bool has_uvs = std::all_of(t.corners.begin(), t.corners.end(),
                                         [](const auto& c) { return c.uv != TriangleSoup::kNone; });
        if (has_uvs || !soup.materials[t.material].has_textures()) continue;
        std::size_t& without = bare[t.material];
        if (without == 0) {
            if (soup.materials.size() >= kMaxMaterials) return;
            without = soup.materials.size();
            soup.warnings.push_back(
                fmt::format("{}: triangles of material \"{}\" have no texture coordinates; its "
                            "textures are not used on them",
                            path, soup.materials[t.material].material.name));
            soup.materials.push_back({.material = soup.materials[t.material].material,
                                      .is_grey_by_default = soup.materials[t.material].is_grey_by_default});
        }
        t.material = static_cast<std::uint16_t>(without);
    }
}

/// Triangles with a colour at each corner get their material with vertex colours.
void use_vertex_colours(TriangleSoup& soup, const std::string& path) {
    if (soup.colours.empty()) return;
    std::vector<std::size_t> coloured(soup.materials.size(), 0);  // the material with vertex colours; 0 is none yet
    std::size_t partly = 0;
    for (TriangleSoup::Triangle& t : soup.triangles) {
        const auto given =
            std::ranges::count_if(t.corners, [](const auto& c) { return c.colour != TriangleSoup::kNone; });
        partly += given == 1 || given == 2;
        if (given < 3) continue;
        std::size_t& with = coloured[t.material];
        if (with == 0) {
            if (soup.materials.size() >= kMaxMaterials)
                return soup.warnings.push_back(path + ": has too many materials for vertex colours on all of them");
            with = soup.materials.size();
            MeshMaterial m = soup.materials[t.material];
            m.material.vertex_colours = 0;
            if (m.is_grey_by_default) m.material.diffuse = {1, 1, 1};
            soup.materials.push_back(std::move(m));
        }
        t.material = static_cast<std::uint16_t>(with);
    }
    if (partly > 0)
        soup.warnings.push_back(
            fmt::format("{}: {} triangle{} with colours at some corners only: they are not used", path, partly,
                        partly > 1 ? "s" : ""));
}

void warn_of_dropped(MeshFile& file, const std::string& path) {
    const auto warn = [&](std::size_t count, std::string_view kind) {
        if (count > 0)
            file.warnings.push_back(
                fmt::format("{}: {} {} triangle{} dropped", path, count, kind, count > 1 ? "s" : ""));
    };
    warn(file.non_finite, "not finite (NaN or infinite coordinates)");
    warn(file.degenerate, "degenerate (without area)");
    warn(file.duplicate, "duplicated");
}

}  // namespace

Result<MeshFile> read_mesh(const std::string& path, double scale, double crease_rad,
                           const MeshReaderLimits& limits) {
    if (const Status plain = check_plain_file(path); !plain) return plain.error();
    const std::string extension = extension_of(path);
    const bool is_obj = extension == ".obj", is_plates = extension == ".tab", is_icq = extension == ".icq";
    if (!is_obj && !is_plates && !is_icq && !is_read_in_process(extension))
        return Error{.what = fmt::format("not a mesh format that can be read, expected {}", kMeshExtensions),
                     .file = path};
    Result<TriangleSoup> soup = is_obj      ? read_obj(path)
                                : is_plates ? read_plates(path)
                                : is_icq    ? read_icq(path)
                                            : read_soup_in_process(path, limits);
    if (!soup) return soup.error();
    take_textures_off_bare_triangles(*soup, path);
    use_vertex_colours(*soup, path);
    if (soup->triangles.empty())
        return Error{.what = "no triangles in it, expected a mesh with faces", .file = path};
    const std::size_t given = soup->triangles.size();
    if (crease_rad > 0 && soup->normals.empty())
        add_smooth_normals(*soup, crease_rad);
    else if (soup->has_smoothing_groups && crease_rad == 0)
        soup->warnings.push_back(path + ": smoothing groups (s) are not used; crease_angle_deg smooths edges");
    else if (crease_rad > 0)
        soup->warnings.push_back(path + ": has normals of its own, crease_angle_deg is not used");
    MeshBuilder builder(*soup, scale);
    MeshFile file = builder.build();
    file.mesh.name = path;
    if (builder.reach_m() > kMeshReach_m)
        return Error{
            .what = fmt::format("reaches to {:.3g} m, expected coordinates of at most {:g} m, scale included",
                                builder.reach_m(), kMeshReach_m),
            .file = path};
    if (file.mesh.faces.empty())
        return Error{.what = fmt::format("none of its {} triangles can be used: {} not finite, {} degenerate",
                                         given, file.non_finite, file.degenerate),
                     .file = path};
    warn_of_dropped(file, path);
    return file;
}

}  // namespace narpa
