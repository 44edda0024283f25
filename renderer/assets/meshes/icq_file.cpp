// ICQ shape models ("implicitly connected quadrilateral"; R. Gaskell et al., Meteoritics & Planetary Science 43,
// 2008): q, then six square grids of (q + 1)^2 vertices, those of a cube's faces.
#include <fmt/format.h>

#include <cmath>

#include "base/file_bytes.h"
#include "base/text/text_cursor.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

namespace {

constexpr double kMaxIcqCells = 4096;

/// The three numbers of a line, whose first token has been read; on failure `token` is the one that is not a
/// number.
std::optional<Vec3> vertex_of(TextCursor& text, std::string_view& token) {
    Vec3 v;
    for (int k = 0; k < 3; ++k) {
        if (k > 0) token = text.token();
        const auto x = number_from(token);
        if (!x) return std::nullopt;
        v[k] = *x;
    }
    return v;
}

/// The grid of a face of the cube, its vertices from `first`, facing away from `inside`.
void add_grid(TriangleSoup& soup, std::uint32_t first, std::uint32_t q, const Vec3& inside) {
    const auto at = [&](std::uint32_t i, std::uint32_t j) { return first + j * (q + 1) + i; };
    const auto p = [&](std::uint32_t vertex) { return soup.positions[vertex] - inside; };
    std::vector<std::array<std::uint32_t, 3>> faces;
    double volume = 0;
    for (std::uint32_t j = 0; j < q; ++j)
        for (std::uint32_t i = 0; i < q; ++i) {
            faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    for (const auto& f : faces) volume += dot(p(f[0]), cross(p(f[1]), p(f[2])));
    for (auto f : faces) {
        if (volume < 0) std::swap(f[1], f[2]);
        TriangleSoup::Triangle t;
        for (std::size_t k = 0; k < 3; ++k) t.corners[k].position = f[k];
        soup.triangles.push_back(t);
    }
}

}  // namespace

Result<TriangleSoup> read_icq(const std::string& path) {
    Result<std::string> bytes = read_file(path);
    if (!bytes) return bytes.error();
    TextCursor text(*std::move(bytes), path);
    std::string_view token;
    while (token.empty() && text.next_line()) token = text.token();
    const auto cells = number_from(token);
    if (!cells || !(*cells >= 1 && *cells <= kMaxIcqCells) || *cells != std::floor(*cells))
        return text.error(token, fmt::format("expected the number of cells along an edge, 1 to {}", kMaxIcqCells));
    const auto q = static_cast<std::uint32_t>(*cells), n = q + 1;

    TriangleSoup soup;
    soup.materials.push_back(MeshMaterial{.material = {.name = "icq"}});
    Vec3 sum{};
    while (soup.positions.size() < std::size_t{6} * n * n) {
        if (!text.next_line())
            return text.error({}, fmt::format("{} vertices, expected 6 * {}^2", soup.positions.size(), n));
        token = text.token();
        if (token.empty()) continue;
        const auto v = vertex_of(text, token);
        if (!v) return text.error(token, "expected x, y and z of a vertex");
        soup.positions.push_back(*v);
        sum += *v;
    }
    for (std::uint32_t face = 0; face < 6; ++face)
        add_grid(soup, face * n * n, q, sum / static_cast<double>(soup.positions.size()));
    return soup;
}

}  // namespace narpa
