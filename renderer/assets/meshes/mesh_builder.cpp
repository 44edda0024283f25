#include "renderer/assets/meshes/mesh_builder.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <mutex>
#include <utility>

#include "renderer/assets/meshes/equal_keys.h"
#include "renderer/scene/for_parts.h"

namespace narpa {
namespace {

constexpr std::uint32_t kNone = TriangleSoup::kNone;

std::uint32_t bits(float x) {
    return std::bit_cast<std::uint32_t>(x);
}
std::array<std::uint32_t, 3> words(const Vec3f& v) {
    return {bits(v.x), bits(v.y), bits(v.z)};
}
/// The same numbers with 0 in place of -0: equal numbers have equal bits.
Vec3f without_negative_zero(const Vec3f& v) {
    return {v.x + 0.0f, v.y + 0.0f, v.z + 0.0f};
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

class MeshBuilder {
public:
    MeshBuilder(TriangleSoup& soup, double scale)
        : soup_(soup), triangles_(soup.triangles), fate_(triangles_.size(), Fate::kept) {
        positions_.resize(soup.positions.size());
        for_parts(positions_.size(), [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                positions_[i] = without_negative_zero(vec_cast<float>(scale * soup.positions[i]));
        });
        soup.positions = {};
    }
    [[nodiscard]] float reach_m() const { return reach_m_; }

    MeshFile build() {
        point_ = least_equal(positions_.size(), [&](std::size_t i) { return words(positions_[i]); });
        drop_bad_triangles();
        drop_duplicates();
        if (soup_.normals.empty() && soup_.uvs.empty() && soup_.colours.empty()) {
            weld(positions_.size(),
                 [&](std::size_t i, std::size_t k) { return point_[triangles_.position[i][k]]; });
        } else {
            prepare_normals();
            prepare_uvs();
            prepare_colours();
            const std::vector<std::uint32_t> vertex = equal_corners();
            weld(vertex.size(), [&](std::size_t i, std::size_t k) { return vertex[3 * i + k]; });
        }
        out_.materials = std::move(soup_.materials);
        out_.warnings = std::move(soup_.warnings);
        return std::move(out_);
    }

private:
    enum class Fate : std::uint8_t { kept, non_finite, degenerate, duplicate };

    [[nodiscard]] std::array<Vec3f, 3> corners(std::size_t i) const {
        const auto& t = triangles_.position[i];
        return {positions_[t[0]], positions_[t[1]], positions_[t[2]]};
    }

    void drop_bad_triangles() {
        std::mutex merging;
        for_parts(triangles_.size(), [&](std::size_t begin, std::size_t end) {
            float reach_m = 0;
            std::size_t non_finite = 0, degenerate = 0;
            for (std::size_t i = begin; i < end; ++i) {
                const std::array<Vec3f, 3> p = corners(i);
                if (!is_finite(p[0]) || !is_finite(p[1]) || !is_finite(p[2])) {
                    fate_[i] = Fate::non_finite, ++non_finite;
                    continue;
                }
                for (const Vec3f& v : p) reach_m = std::max({reach_m, std::abs(v.x), std::abs(v.y), std::abs(v.z)});
                if (is_degenerate(p)) fate_[i] = Fate::degenerate, ++degenerate;
            }
            const std::scoped_lock lock(merging);
            reach_m_ = std::max(reach_m_, reach_m);
            out_.non_finite += non_finite, out_.degenerate += degenerate;
        });
    }

    /// Keeps the first of triangles with the same corners, whichever way round.
    void drop_duplicates() {
        const auto key = [&](std::size_t i) -> std::array<std::uint32_t, 3> {
            if (fate_[i] != Fate::kept) return {kNone, static_cast<std::uint32_t>(i), 0};
            const auto& t = triangles_.position[i];
            std::uint32_t a = point_[t[0]], b = point_[t[1]], c = point_[t[2]];
            if (a > b) std::swap(a, b);
            if (b > c) std::swap(b, c);
            if (a > b) std::swap(a, b);
            return {a, b, c};
        };
        const std::vector<std::uint32_t> first = least_equal(triangles_.size(), key);
        for (std::size_t i = 0; i < first.size(); ++i)
            if (first[i] != i) fate_[i] = Fate::duplicate, ++out_.duplicate;
    }

    /// Unit length. Behind those of the file, where a corner has none that can be used, follow the triangles' own.
    void prepare_normals() {
        if (soup_.normals.empty()) return;
        constexpr Vec3f kUnusable{};
        const std::size_t given = soup_.normals.size();
        for (Vec3f& normal : soup_.normals) {
            const Vec3 n = vec_cast<double>(normal);
            const double length = norm(n);
            const bool is_usable = length > 0 && std::isfinite(length);
            normal = is_usable ? without_negative_zero(vec_cast<float>(n / length)) : kUnusable;
        }
        triangles_.normal.resize(triangles_.size(), {kNone, kNone, kNone});
        for (std::size_t i = 0; i < triangles_.size(); ++i) {
            if (fate_[i] != Fate::kept) continue;
            bool has_flat = false;
            for (std::uint32_t& n : triangles_.normal[i]) {
                if (n != kNone && n < given && soup_.normals[n] != kUnusable) continue;
                n = static_cast<std::uint32_t>(soup_.normals.size());
                has_flat = true;
            }
            if (has_flat)
                soup_.normals.push_back(
                    without_negative_zero(vec_cast<float>(normalized(area_vector(corners(i))))));
        }
    }

    /// Corners without any have 0, 0.
    void prepare_uvs() {
        if (soup_.uvs.empty()) return;
        for (auto& [u, v] : soup_.uvs)
            if (!std::isfinite(u) || !std::isfinite(v))
                u = v = 0;
            else
                u += 0.0f, v += 0.0f;
        fill_up(triangles_.uv, soup_.uvs.size());
        soup_.uvs.push_back({0, 0});
    }

    /// From 0 to 1 in each band; corners without any are white.
    void prepare_colours() {
        if (soup_.colours.empty()) return;
        const auto part = [](float x) { return x > 0 ? std::min(x, 1.0f) : 0.0f; };  // NaN is 0
        for (Rgb& c : soup_.colours) c = {part(c.x), part(c.y), part(c.z)};
        fill_up(triangles_.colour, soup_.colours.size());
        soup_.colours.push_back({1, 1, 1});
    }

    void fill_up(TriangleSoup::Column& column, std::size_t index) const {
        column.resize(triangles_.size(), {kNone, kNone, kNone});
        for (auto& three : column)
            for (std::uint32_t& i : three)
                if (i == kNone) i = static_cast<std::uint32_t>(index);
    }

    /// For each corner, the least one with the same vertex.
    [[nodiscard]] std::vector<std::uint32_t> equal_corners() const {
        const auto normal =
            least_equal(soup_.normals.size(), [&](std::size_t i) { return words(soup_.normals[i]); });
        const auto colour =
            least_equal(soup_.colours.size(), [&](std::size_t i) { return words(soup_.colours[i]); });
        const auto uv = least_equal(soup_.uvs.size(), [&](std::size_t i) {
            return std::array{bits(soup_.uvs[i][0]), bits(soup_.uvs[i][1])};
        });
        const auto in = [](const std::vector<std::uint32_t>& least, const TriangleSoup::Column& column,
                           std::size_t corner) {
            return least.empty() ? 0 : least[column[corner / 3][corner % 3]];
        };
        return least_equal(3 * triangles_.size(), [&](std::size_t c) -> std::array<std::uint32_t, 4> {
            if (fate_[c / 3] != Fate::kept) return {kNone, static_cast<std::uint32_t>(c), 0, 0};
            return {point_[triangles_.position[c / 3][c % 3]], in(normal, triangles_.normal, c),
                    in(uv, triangles_.uv, c), in(colour, triangles_.colour, c)};
        });
    }

    /// Numbers the vertices of the triangles that are kept, and copies what they have. `vertex(i, k)`, below
    /// `count`, is the same for corners with the same vertex.
    void weld(std::size_t count, const auto& vertex) {
        std::vector<std::uint32_t> number(count, kNone), first;  // the corner that named it first
        TriangleSoup::Column& faces = out_.mesh.faces;
        const std::size_t given = triangles_.size();
        const std::size_t kept = given - out_.non_finite - out_.degenerate - out_.duplicate;
        faces.reserve(kept);
        out_.mesh.face_material.reserve(kept);
        for (std::size_t i = 0; i < given; ++i) {
            if (fate_[i] != Fate::kept) continue;
            auto& face = faces.emplace_back();
            for (std::size_t k = 0; k < 3; ++k) {
                std::uint32_t& known = number[vertex(i, k)];
                if (known == kNone) {
                    known = static_cast<std::uint32_t>(first.size());
                    first.push_back(static_cast<std::uint32_t>(3 * i + k));
                }
                face[k] = known;
            }
            out_.mesh.face_material.push_back(triangles_.material(i));
        }
        gather(out_.mesh.positions, positions_, triangles_.position, first);
        gather(out_.mesh.normals, soup_.normals, triangles_.normal, first);
        gather(out_.mesh.uvs, soup_.uvs, triangles_.uv, first);
        gather(out_.mesh.colours, soup_.colours, triangles_.colour, first);
    }

    template <class T>
    static void gather(std::vector<T>& out, const std::vector<T>& from, const TriangleSoup::Column& column,
                       const std::vector<std::uint32_t>& corners) {
        if (from.empty()) return;
        out.resize(corners.size());
        for_parts(corners.size(), [&](std::size_t begin, std::size_t end) {
            for (std::size_t v = begin; v < end; ++v) out[v] = from[column[corners[v] / 3][corners[v] % 3]];
        });
    }

    TriangleSoup& soup_;
    TriangleSoup::Triangles& triangles_;
    std::vector<Fate> fate_;
    std::vector<Vec3f> positions_;      ///< in metres
    std::vector<std::uint32_t> point_;  ///< for each of them, the least one at the same place
    float reach_m_ = 0;
    MeshFile out_;
};

}  // namespace

MeshFile build_mesh(TriangleSoup&& soup, double scale, float& reach_m) {
    MeshBuilder builder(soup, scale);
    MeshFile file = builder.build();
    reach_m = builder.reach_m();
    return file;
}

}  // namespace narpa
