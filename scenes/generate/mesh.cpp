#include "scenes/generate/mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <stdexcept>
#include <utility>

namespace narpa::scenes {
namespace {

constexpr double kTicksPerMetre = 1e5;

double snap(double x) {
    return std::round(x * kTicksPerMetre) / kTicksPerMetre;
}
Vec3 snap(const Vec3& p) {
    return {snap(p.x), snap(p.y), snap(p.z)};
}

std::uint16_t index_of(std::vector<std::string>& names, const std::string& name) {
    auto it = std::find(names.begin(), names.end(), name);
    if (it == names.end()) it = names.insert(names.end(), name);
    return static_cast<std::uint16_t>(it - names.begin());
}

/// A number with a fixed number of decimals in the "C" form, whatever the locale; never "-0". `out` gets it without
/// zeros at its end and before its point.
void append(std::string& out, double x, int decimals) {
    char text[40];
    const char* end = std::to_chars(text, text + sizeof text, x, std::chars_format::fixed, decimals).ptr;
    const char* begin = text;
    while (end[-1] == '0') --end;  // all numbers here have a point
    if (end[-1] == '.') --end;
    const bool is_negative = *begin == '-';
    if (is_negative) ++begin;
    if (*begin == '0') ++begin;
    if (begin == end) return void(out += '0');
    if (is_negative) out += '-';
    out.append(begin, end);
}
void append(std::string& out, const char* key, std::initializer_list<double> numbers, int decimals) {
    out += key;
    for (const double x : numbers) out += ' ', append(out, x, decimals);
    out += '\n';
}
constexpr int kPositionDecimals = 5, kUvDecimals = 4, kNormalDecimals = 3;
/// The number that the text stands for, in single precision.
float rounded(double x, int decimals) {
    char text[40];
    const auto end = std::to_chars(text, text + sizeof text, x, std::chars_format::fixed, decimals).ptr;
    double out = 0;
    std::from_chars(text, end, out);
    return static_cast<float>(out + 0.0);
}

/// Bytes of a number in this machine's order.
template <class T>
void append_bytes(std::string& out, T x) {
    const auto bytes = std::bit_cast<std::array<char, sizeof x>>(x);
    out.append(bytes.data(), bytes.size());
}

/// Lines of one OBJ key in `text`, each written once and numbered from 1 in order of appearance.
class Lines {
public:
    Lines(const char* key, int decimals, std::string& text) : key_(key), decimals_(decimals), text_(text) {}
    std::uint32_t number(std::initializer_list<double> numbers) {
        std::array<std::int64_t, 3> id{};
        std::size_t i = 0;
        for (const double x : numbers) id[i++] = std::llround(x * std::pow(10.0, decimals_));
        const auto [it, is_new] = seen_.try_emplace(id, static_cast<std::uint32_t>(seen_.size() + 1));
        if (is_new) append(text_, key_, numbers, decimals_);
        return it->second;
    }
    /// How faces may name a line: by its number, or, where that is shorter, counted back from the newest line as
    /// -1.
    [[nodiscard]] std::string name(std::uint32_t number) const {
        std::string forwards = std::to_string(number), back = "-" + std::to_string(seen_.size() + 1 - number);
        return back.size() < forwards.size() ? back : forwards;
    }

private:
    const char* key_;
    int decimals_;
    std::string& text_;
    std::map<std::array<std::int64_t, 3>, std::uint32_t> seen_;
};

void write_file(const std::string& path, const std::string& content) {
    std::ofstream file(path, std::ios::binary);
    file << content;
    if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace

void Mesh::begin(const std::string& part, const std::string& material_name) {
    part_ = index_of(parts_, part);
    material(material_name);
}
void Mesh::material(const std::string& name) {
    material_ = index_of(materials_, name);
}

void Mesh::add_face(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    const Vec3 &pa = vertices_[a].position, &pb = vertices_[b].position, &pc = vertices_[c].position;
    if (pa == pb || pb == pc || pc == pa) return;
    if (norm(cross(pb - pa, pc - pa)) < 1e-9)
        throw std::runtime_error("part " + parts_[part_] + ": a needle triangle");
    faces_.push_back({{a, b, c}, part_, material_});
}

void Mesh::grid(int nu, int nv, bool wrap_u, const std::function<Vec3(int, int)>& point,
                const std::function<Uv(int, int)>& uv) {
    const auto first = static_cast<std::uint32_t>(vertices_.size());
    const auto at = [&](int i, int j) { return first + static_cast<std::uint32_t>(j * (nu + 1) + i); };
    for (int j = 0; j <= nv; ++j)
        for (int i = 0; i <= nu; ++i)
            vertices_.push_back({snap(point(wrap_u && i == nu ? 0 : i, j)), {}, uv(i, j)});

    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        const Vec3 n =
            cross(vertices_[b].position - vertices_[a].position, vertices_[c].position - vertices_[a].position);
        for (const std::uint32_t v : {a, b, c}) vertices_[v].normal += n;
        add_face(a, b, c);
    };
    for (int j = 0; j < nv; ++j)
        for (int i = 0; i < nu; ++i) {
            add(at(i, j), at(i + 1, j), at(i + 1, j + 1));
            add(at(i, j), at(i + 1, j + 1), at(i, j + 1));
        }
    for (int j = 0; j <= nv && wrap_u; ++j) {
        const Vec3 n = vertices_[at(0, j)].normal + vertices_[at(nu, j)].normal;
        vertices_[at(0, j)].normal = vertices_[at(nu, j)].normal = n;
    }
    for (std::size_t v = first; v < vertices_.size(); ++v)
        if (norm(vertices_[v].normal) > 0) vertices_[v].normal = normalized(vertices_[v].normal);
}

void Mesh::polygon(const std::vector<Vec3>& corners, const Vec3& inside, double metres_per_unit) {
    std::vector<Vec3> points;
    for (const Vec3& p : corners) points.push_back(snap(p));
    Vec3 n = cross(points[1] - points[0], points[2] - points[0]);
    if (dot(n, points[0] - inside) < 0) std::reverse(points.begin(), points.end()), n = -n;
    n = normalized(n);
    const double ax = std::abs(n.x), ay = std::abs(n.y), az = std::abs(n.z);
    const int u = ax >= ay && ax >= az ? 1 : 0, v = az > ax && az > ay ? 1 : 2;

    const auto first = static_cast<std::uint32_t>(vertices_.size());
    for (const Vec3& p : points) vertices_.push_back({p, n, {p[u] / metres_per_unit, p[v] / metres_per_unit}});
    for (std::uint32_t i = 2; i < points.size(); ++i) add_face(first, first + i - 1, first + i);
}

bool Mesh::is_convex(const std::array<std::uint32_t, 4>& quad) const {
    const auto p = [&](std::size_t i) -> const Vec3& { return vertices_[quad[i % 4]].position; };
    const Vec3 n = cross(p(1) - p(0), p(2) - p(0)) + cross(p(2) - p(0), p(3) - p(0));
    const double least = 1e-3 * norm(n);
    int main = 0;
    for (int axis = 1; axis < 3; ++axis)
        if (std::abs(n[axis]) > std::abs(n[main])) main = axis;
    const auto turns_left = [&](std::size_t a, std::size_t b, std::size_t c) {
        return cross(p(b) - p(a), p(c) - p(a))[main] * (n[main] < 0 ? -1 : 1) > least;
    };
    for (std::size_t i = 0; i < 4; ++i)
        if (!turns_left(i, i + 1, i + 2)) return false;
    return turns_left(0, 1, 2) && turns_left(0, 2, 3);
}

std::vector<Mesh::Polygon> Mesh::polygons() const {
    std::vector<Face> faces = faces_;
    std::ranges::stable_sort(faces, {}, [](const Face& f) { return std::pair(f.part, f.material); });
    std::vector<Polygon> out;
    for (std::size_t i = 0; i < faces.size(); ++i) {
        const Face& face = faces[i];
        const auto& [a, b, c] = face.vertices;
        out.push_back({{a, b, c}, face.part, face.material});
        if (i + 1 == faces.size()) break;
        const Face& next = faces[i + 1];
        const auto& [d, e, last] = next.vertices;
        const bool is_fan = d == a && e == c && next.part == face.part && next.material == face.material;
        if (is_fan && is_convex({a, b, c, last})) out.back().vertices.push_back(last), ++i;
    }
    return out;
}

void Mesh::write_obj(const std::string& path, const std::string& mtl_name, MeshParts wanted) const {
    std::string text = "mtllib " + mtl_name + "\n";
    Lines positions("v", kPositionDecimals, text), uvs("vt", kUvDecimals, text),
        normals("vn", kNormalDecimals, text);
    int part = -1, material = -1;
    for (const Polygon& polygon : polygons()) {
        if (polygon.part != part) text += "o " + parts_[polygon.part] + "\n";
        if (polygon.part != part || polygon.material != material)
            text += "usemtl " + materials_[polygon.material] + "\n";
        part = polygon.part, material = polygon.material;
        std::vector<std::array<std::uint32_t, 3>> corners;
        for (const std::uint32_t index : polygon.vertices) {
            const Vertex& v = vertices_[index];
            auto& corner = corners.emplace_back();
            corner[0] = positions.number({v.position.x, v.position.y, v.position.z});
            if (wanted == MeshParts::positions) continue;
            corner[1] = uvs.number({v.uv[0], v.uv[1]});
            corner[2] = normals.number({v.normal.x, v.normal.y, v.normal.z});
        }
        text += 'f';
        for (const auto& [position, uv, normal] : corners) {
            text += ' ' + positions.name(position);
            if (wanted != MeshParts::positions) text += '/' + uvs.name(uv) + '/' + normals.name(normal);
        }
        text += '\n';
    }
    write_file(path, text);
}

void Mesh::write_ply(const std::string& path, MeshParts wanted) const {
    std::map<std::string, std::uint32_t> numbers;  // of vertices, by their bytes
    std::string vertices, faces;
    std::size_t count = 0;
    for (const Polygon& polygon : polygons()) {
        ++count;
        append_bytes(faces, static_cast<std::uint8_t>(polygon.vertices.size()));
        for (const std::uint32_t index : polygon.vertices) {
            const Vertex& v = vertices_[index];
            std::string bytes;
            for (int k = 0; k < 3; ++k) append_bytes(bytes, rounded(v.position[k], kPositionDecimals));
            for (int k = 0; k < 3; ++k) append_bytes(bytes, rounded(v.normal[k], kNormalDecimals));
            for (std::size_t k = 0; k < 2 && wanted == MeshParts::all; ++k)
                append_bytes(bytes, rounded(v.uv[k], kUvDecimals));
            const auto [it, is_new] = numbers.try_emplace(bytes, static_cast<std::uint32_t>(numbers.size()));
            if (is_new) vertices += bytes;
            append_bytes(faces, it->second);
        }
    }
    std::string head = "ply\nformat ";
    head += std::endian::native == std::endian::little ? "binary_little_endian" : "binary_big_endian";
    head += " 1.0\nelement vertex " + std::to_string(numbers.size()) + "\n";
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz"}) head += std::string("property float ") + name + "\n";
    if (wanted == MeshParts::all) head += "property float s\nproperty float t\n";
    head += "element face " + std::to_string(count) + "\nproperty list uchar uint vertex_indices\nend_header\n";
    write_file(path, head + vertices + faces);
}

void write_mtl(const std::string& path, const std::vector<MaterialSpec>& materials) {
    std::string text;
    for (const MaterialSpec& m : materials) {
        const bool shiny = norm(m.specular) > 0;
        text += "newmtl " + m.name + "\n";
        append(text, "Kd", {m.diffuse.x, m.diffuse.y, m.diffuse.z}, 3);
        append(text, "Ks", {m.specular.x, m.specular.y, m.specular.z}, 3);
        if (shiny) append(text, "Ns", {m.exponent}, 1);
        if (norm(m.emission) > 0) append(text, "Ke", {m.emission.x, m.emission.y, m.emission.z}, 3);
        text += shiny ? "illum 2\n" : "illum 1\n";
        if (!m.texture.empty()) text += "map_Kd " + m.texture + "\n";
        text += "\n";
    }
    write_file(path, text);
}

}  // namespace narpa::scenes
