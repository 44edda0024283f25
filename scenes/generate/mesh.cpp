#include "scenes/generate/mesh.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <map>
#include <stdexcept>

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

/// Numbers in the "C" form whatever the locale; never "-0".
void append(std::string& out, double x, int decimals) {
    char text[40];
    const auto end = std::to_chars(text, text + sizeof text, x, std::chars_format::fixed, decimals).ptr;
    char* begin = text;
    if (*begin == '-' && std::all_of(begin + 1, end, [](char c) { return c == '0' || c == '.'; })) ++begin;
    out.append(begin, end);
}
void append(std::string& out, const char* key, std::initializer_list<double> numbers, int decimals) {
    out += key;
    for (const double x : numbers) out += ' ', append(out, x, decimals);
    out += '\n';
}

/// Lines of one OBJ key, each written once and numbered from 1 in order of appearance.
class Lines {
public:
    Lines(const char* key, int decimals) : key_(key), decimals_(decimals) {}
    std::uint32_t number(std::initializer_list<double> numbers) {
        std::array<std::int64_t, 3> id{};
        std::size_t i = 0;
        for (const double x : numbers) id[i++] = std::llround(x * std::pow(10.0, decimals_));
        const auto [it, is_new] = seen_.try_emplace(id, static_cast<std::uint32_t>(seen_.size() + 1));
        if (is_new) append(text, key_, numbers, decimals_);
        return it->second;
    }
    std::string text;

private:
    const char* key_;
    int decimals_;
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

void Mesh::write_obj(const std::string& path, const std::string& mtl_name, ObjParts wanted) const {
    Lines positions("v", 5), uvs("vt", 4), normals("vn", 3);
    std::map<std::pair<std::uint16_t, std::uint16_t>, std::string> groups;  // by part, then material
    for (const Face& face : faces_) {
        std::string& out = groups[{face.part, face.material}];
        out += 'f';
        for (const std::uint32_t index : face.vertices) {
            const Vertex& v = vertices_[index];
            out += ' ' + std::to_string(positions.number({v.position.x, v.position.y, v.position.z}));
            if (wanted == ObjParts::positions) continue;
            out += '/' + std::to_string(uvs.number({v.uv[0], v.uv[1]})) + '/' +
                   std::to_string(normals.number({v.normal.x, v.normal.y, v.normal.z}));
        }
        out += '\n';
    }
    std::string text = "mtllib " + mtl_name + "\n" + positions.text + uvs.text + normals.text;
    int part = -1;
    for (const auto& [group, lines] : groups) {
        if (group.first != part) text += "o " + parts_[group.first] + "\n";
        part = group.first;
        text += "usemtl " + materials_[group.second] + "\n" + lines;
    }
    write_file(path, text);
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
