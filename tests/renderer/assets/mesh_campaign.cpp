// Mesh files of random declarations: types of numbers, byte orders, normalisation, strides, strips, node
// transforms, line ends, indices. What each must give is known, because it was drawn before the file was written.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "renderer/assets/meshes/mesh_process.h"
#include "renderer/assets/meshes/mesh_readers.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/campaign.h"
#include "tests/support/gltf_document.h"
#include "tests/support/srgb.h"

namespace narpa {
namespace {

using namespace test;
using nlohmann::json;

/// What a reader must give for each corner of each triangle, in the file's order.
struct Expected {
    Vec3 position{};
    std::optional<Vec3> normal{}, colour{};
    std::optional<std::array<double, 2>> uv{};
};

class MeshTrial {
public:
    explicit MeshTrial(unsigned seed) : random_(seed) {}

    void gltf();
    void ply();
    void stl();
    void obj();
    void plates();

private:
    int number(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
    bool maybe() { return number(0, 1) != 0; }
    double real(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
    template <class T>
    T one_of(std::initializer_list<T> all) {
        return all.begin()[number(0, static_cast<int>(all.size()) - 1)];
    }

    struct Attribute {
        std::vector<double> codes;   ///< as stored
        std::vector<double> values;  ///< as meant
        int accessor = -1;
    };
    /// An accessor of random type for `count` elements.
    Attribute attribute(GltfDocument& d, std::size_t count, int components, std::initializer_list<int> types,
                        bool normalised);
    /// Triangles of a random primitive, as numbers of vertices. Sets `mode` and `indices`.
    std::vector<std::array<std::size_t, 3>> topology(GltfDocument& d, json& primitive, std::size_t vertices);
    /// A random transform in all forms that a node may have, and the map that it is.
    std::function<Vec3(const Vec3&)> transform(json& node);

    std::vector<std::array<std::size_t, 3>> random_faces(std::size_t vertices) {
        std::vector<std::array<std::size_t, 3>> faces(static_cast<std::size_t>(number(1, 8)));
        for (auto& f : faces)
            for (std::size_t& i : f) i = static_cast<std::size_t>(number(0, static_cast<int>(vertices) - 1));
        return faces;
    }
    std::string line_ends(const std::string& text) {
        const std::string end = one_of<std::string>({"\n", "\r\n", "\r"});
        std::string out = maybe() ? "\xef\xbb\xbf" : "";
        for (const char c : text) out += c == '\n' ? end : std::string(1, c);
        return out;
    }
    /// A number in one of the forms that programs write; `value` becomes what it says.
    std::string form(double& value) {
        std::string text = fmt::format("{:.6e}", value);
        value = std::stod(text);
        switch (number(0, 3)) {
            case 0: return text;
            case 1: return fmt::format("{:.9g}", value);
            case 2: std::ranges::replace(text, 'e', 'D'); return text;
            default: return (value >= 0 ? "+" : "") + text;
        }
    }
    void compare(const Result<TriangleSoup>& soup, const std::string& words) const;
    void read_in_process(const std::string& name, const std::string& bytes, const std::string& words) const {
        const MemoryFolder folder;
        compare(read_soup_in_process(folder.write(name, bytes)), words);
    }

    std::mt19937 random_;
    std::vector<Expected> expected_;
};

void MeshTrial::compare(const Result<TriangleSoup>& soup, const std::string& words) const {
    ASSERT_TRUE(soup) << soup.error().text() << "\n" << words;
    ASSERT_EQ(3 * soup->triangles.size(), expected_.size()) << words;
    for (std::size_t i = 0; i < expected_.size(); ++i) {
        const Expected& e = expected_[i];
        const TriangleSoup::Corner c = soup->triangles[i / 3].corners[i % 3];
        const double size = 1e-6 * (1 + norm(e.position));
        ASSERT_LT(norm(soup->positions[c.position] - e.position), 10 * size) << i << words;
        ASSERT_EQ(c.normal != TriangleSoup::kNone, e.normal.has_value()) << words;
        if (e.normal) {
            ASSERT_LT(norm(normalized(vec_cast<double>(soup->normals[c.normal])) - normalized(*e.normal)), 1e-4)
                << i << words;
        }
        ASSERT_EQ(c.colour != TriangleSoup::kNone, e.colour.has_value()) << words;
        if (e.colour) {
            ASSERT_LT(norm(vec_cast<double>(soup->colours[c.colour]) - *e.colour), 1e-5) << i << words;
        }
        ASSERT_EQ(c.uv != TriangleSoup::kNone, e.uv.has_value()) << words;
        for (std::size_t k = 0; e.uv && k < 2; ++k)
            ASSERT_NEAR(static_cast<double>(soup->uvs[c.uv][k]), (*e.uv)[k], 1e-5 * (1 + std::abs((*e.uv)[k])))
                << i << words;
    }
}

MeshTrial::Attribute MeshTrial::attribute(GltfDocument& d, std::size_t count, int components,
                                          std::initializer_list<int> types, bool normalised) {
    GltfAccessor how{.type = components == 1 ? "SCALAR" : fmt::format("VEC{}", components),
                     .component = one_of(types)};
    const bool is_float = how.component == 5126;
    how.is_normalised = normalised && !is_float;
    const int size = GltfDocument::size_of(how.component);
    how.padding = maybe() ? size * number(0, 3) + (4 - components * size % 4) % 4 : 0;
    how.offset = maybe() ? 4 * number(0, 4) : 0;
    how.is_sparse = number(0, 9) == 0;
    Attribute out;
    const double largest = GltfDocument::largest(how.component);
    const bool is_signed = how.component == 5120 || how.component == 5122;
    for (std::size_t i = 0; i < count * static_cast<std::size_t>(components); ++i) {
        const double code =
            is_float ? static_cast<double>(static_cast<float>(real(normalised ? 0 : -9, normalised ? 1 : 9)))
                     : std::round(real(is_signed ? -largest - 1 : 0, largest));
        out.codes.push_back(code);
        out.values.push_back(how.is_normalised ? std::max(-1.0, code / largest) : code);
    }
    out.accessor = d.add(out.codes, how);
    return out;
}

std::vector<std::array<std::size_t, 3>> MeshTrial::topology(GltfDocument& d, json& primitive,
                                                            std::size_t vertices) {
    const int mode = one_of({4, 4, 5, 6});
    const bool indexed = maybe();
    const int n = static_cast<int>(vertices), count = !indexed ? n : mode == 4 ? 3 * number(1, 8) : number(3, 12);
    std::vector<double> order;
    for (int i = 0; i < count; ++i) order.push_back(indexed ? number(0, n - 1) : i);
    if (indexed) primitive["indices"] = d.add(order, {.type = "SCALAR", .component = one_of({5121, 5123, 5125})});
    if (mode != 4 || maybe()) primitive["mode"] = mode;
    std::vector<std::array<std::size_t, 3>> out;
    const auto at = [&](std::size_t i) { return static_cast<std::size_t>(order[i]); };
    for (std::size_t i = 0; i + 2 < order.size(); i += mode == 4 ? 3 : 1)
        out.push_back(mode == 4    ? std::array{at(i), at(i + 1), at(i + 2)}
                      : mode == 6  ? std::array{at(0), at(i + 1), at(i + 2)}
                      : i % 2 == 0 ? std::array{at(i), at(i + 1), at(i + 2)}
                                   : std::array{at(i), at(i + 2), at(i + 1)});
    return out;
}

std::function<Vec3(const Vec3&)> MeshTrial::transform(json& node) {
    const Vec3 axis = normalized(Vec3{real(-1, 1), real(-1, 1), real(0.1, 1)}),
               shift{real(-9, 9), real(-9, 9), real(-9, 9)}, scale{real(0.5, 2), real(0.5, 2), real(0.5, 2)};
    const Quat q = exp_rotation(real(-3, 3) * axis);
    const auto map = [=](const Vec3& p) { return q * (scale * p) + shift; };
    if (maybe()) {
        const Vec3 o = map({}), x = map({1, 0, 0}) - o, y = map({0, 1, 0}) - o, z = map({0, 0, 1}) - o;
        node["matrix"] = {x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, o.x, o.y, o.z, 1};
    } else {
        node["rotation"] = {q.x, q.y, q.z, q.w};
        node["translation"] = {shift.x, shift.y, shift.z};
        node["scale"] = {scale.x, scale.y, scale.z};
    }
    return map;
}

void MeshTrial::gltf() {
    GltfDocument d;
    const auto n = static_cast<std::size_t>(number(3, 30));
    json primitive;
    json& attributes = primitive["attributes"];
    const Attribute p = attribute(d, n, 3, {5120, 5121, 5122, 5123, 5126, 5126}, maybe());
    std::optional<Attribute> normal, uv, colour;
    attributes["POSITION"] = p.accessor;
    if (maybe()) normal = attribute(d, n, 3, {5120, 5122, 5126}, true), attributes["NORMAL"] = normal->accessor;
    if (maybe()) uv = attribute(d, n, 2, {5121, 5123, 5126}, maybe()), attributes["TEXCOORD_0"] = uv->accessor;
    const int bands = number(3, 4);
    if (maybe())
        colour = attribute(d, n, bands, {5121, 5123, 5126}, true), attributes["COLOR_0"] = colour->accessor;
    const auto triangles = topology(d, primitive, n);
    json parent = {{"children", {1}}}, child = {{"mesh", 0}};
    const auto outer = transform(parent), inner = transform(child);
    const auto place = [&](const Vec3& v) { return outer(inner(v)); };
    const Vec3 o = place({}), x = place({1, 0, 0}) - o, y = place({0, 1, 0}) - o, z = place({0, 0, 1}) - o;
    const auto vec = [](const Attribute& a, std::size_t i, std::size_t stride) {
        return Vec3{a.values[stride * i], a.values[stride * i + 1], a.values[stride * i + 2]};
    };
    for (const auto& t : triangles)
        for (const std::size_t i : t) {
            Expected e{.position = place(vec(p, i, 3))};
            if (normal) {  // the inverse transpose
                const Vec3 v = vec(*normal, i, 3);
                e.normal = v.x * cross(y, z) + v.y * cross(z, x) + v.z * cross(x, y);
            }
            if (uv) e.uv = {uv->values[2 * i], 1 - uv->values[2 * i + 1]};
            if (colour) e.colour = vec(*colour, i, static_cast<std::size_t>(bands));
            expected_.push_back(e);
        }
    d.root["nodes"] = {parent, child};
    d.root["meshes"] = {{{"primitives", {primitive}}}};
    const bool is_binary = maybe();
    read_in_process(is_binary ? "m.glb" : "m.gltf", is_binary ? d.binary() : d.text(), d.root.dump());
}

void MeshTrial::ply() {
    struct Type {
        const char *name, *other;
        int size;
        double low, high;
    };
    static constexpr Type kUchar{"uchar", "uint8", 1, 0, 255}, kUshort{"ushort", "uint16", 2, 0, 65535},
        kInt{"int", "int32", 4, 0, 1e9}, kUint{"uint", "uint32", 4, 0, 4e9},
        kShort{"short", "int16", 2, -32768, 32767}, kFloat{"float", "float32", 4, -9, 9},
        kDouble{"double", "float64", 8, -9, 9};
    const int format = number(0, 2);
    const bool is_big_endian = format == 2;
    std::string body;
    const auto put = [&](const Type& type, double& value) {
        if (format == 0) {
            body += (body.empty() || body.ends_with('\n') ? "" : " ");
            body += type.high == 9 ? form(value) : fmt::format("{}", value);
        } else if (type.size == 4 && type.high == 9) {
            value = static_cast<double>(static_cast<float>(value));
            body += bytes_of(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4, is_big_endian);
        } else if (type.size == 8) {
            body += bytes_of(std::bit_cast<std::uint64_t>(value), 8, is_big_endian);
        } else {
            body +=
                bytes_of(static_cast<std::uint64_t>(static_cast<std::int64_t>(value)), type.size, is_big_endian);
        }
    };
    const auto name_of = [&](const Type& type) { return maybe() ? type.name : type.other; };
    const auto end_row = [&] { body += format == 0 ? "\n" : ""; };
    const auto n = static_cast<std::size_t>(number(3, 20));
    const Type real_type = one_of({kFloat, kDouble}), colour_type = one_of({kUchar, kUshort, kFloat}),
               index_type = one_of({kInt, kUint, kUshort, kShort});
    const bool has_normals = maybe(), has_uvs = maybe(), has_extra = maybe(), is_strip = maybe();
    const int colours = number(0, 2);  // 1: of vertices, 2: of faces
    std::string head = fmt::format(
        "ply\nformat {} 1.0\ncomment by C:\\\n",
        std::array{"ascii", "binary_little_endian", "binary_big_endian"}[static_cast<std::size_t>(format)]);
    const auto property = [&](const Type& type, const char* name) {
        head += fmt::format("property {} {}\n", name_of(type), name);
    };
    const auto colour_properties = [&] {
        for (const char* name : {"red", "green", "blue"}) property(colour_type, name);
    };
    const auto put_colour = [&] {
        Vec3 c;
        for (int k = 0; k < 3; ++k) {
            c[k] = colour_type.high == 9 ? real(0, 1) : std::floor(real(0, colour_type.high + 1));
            put(colour_type, c[k]);
            c[k] = colour_type.high == 255 ? light_of(c[k] / 255) : colour_type.high == 65535 ? c[k] / 65535 : c[k];
        }
        return c;
    };
    head += fmt::format("element vertex {}\n", n);
    for (const char* name : {"x", "y", "z"}) property(real_type, name);
    if (has_extra) property(kShort, "intensity");
    if (has_normals)
        for (const char* name : {"nx", "ny", "nz"}) property(kFloat, name);
    if (has_uvs)
        for (const char* name : {"s", "t"}) property(real_type, name);
    if (colours == 1) colour_properties();
    std::vector<Expected> vertices(n);
    for (Expected& v : vertices) {
        for (int k = 0; k < 3; ++k) v.position[k] = real(-9, 9), put(real_type, v.position[k]);
        double extra = number(-99, 99);
        if (has_extra) put(kShort, extra);
        if (has_normals) {
            v.normal = Vec3{real(-1, 1), real(-1, 1), real(0.5, 1)};
            for (int k = 0; k < 3; ++k) put(kFloat, (*v.normal)[k]);
        }
        if (has_uvs) {
            v.uv = {real(-2, 2), real(-2, 2)};
            for (double& x : *v.uv) put(real_type, x);
        }
        if (colours == 1) v.colour = put_colour();
        end_row();
    }
    const auto add = [&](std::initializer_list<double> corners, const std::optional<Vec3>& colour) {
        for (const double i : corners) {
            expected_.push_back(vertices[static_cast<std::size_t>(i)]);
            if (colour) expected_.back().colour = colour;
        }
    };
    const auto faces = random_faces(n);
    head += fmt::format("element {} {}\n", is_strip ? "tristrips" : "face", faces.size());
    head += fmt::format("property list {} {} {}\n", name_of(kUchar), name_of(is_strip ? kInt : index_type),
                        maybe() ? "vertex_indices" : "vertex_index");
    if (colours == 2) colour_properties();
    for (const auto& f : faces) {
        std::vector<double> list{static_cast<double>(f[0]), static_cast<double>(f[1]), static_cast<double>(f[2])};
        if (is_strip) {  // a square, a break, and a triangle
            list.push_back(number(0, static_cast<int>(n) - 1));
            list.insert(list.end(), {-1, list[2], list[1], list[0]});
        }
        double count = static_cast<double>(list.size());
        put(kUchar, count);
        for (double& i : list) put(is_strip ? kInt : index_type, i);
        const std::optional<Vec3> colour = colours == 2 ? std::optional(put_colour()) : std::nullopt;
        end_row();
        add({list[0], list[1], list[2]}, colour);
        if (is_strip) add({list[1], list[3], list[2]}, colour), add({list[2], list[1], list[0]}, colour);
    }
    head += "end_header\n";
    std::string words = head;
    if (maybe()) {
        const std::string end = one_of<std::string>({"\r\n", "\r"});
        std::string changed;
        for (const char c : head) changed += c == '\n' ? end : std::string(1, c);
        head = changed;
        if (format == 0) std::ranges::replace(body, '\n', '\r');
        if (format == 0 && end == "\r\n") {
            changed.clear();
            for (const char c : body) changed += c == '\r' ? end : std::string(1, c);
            body = changed;
        }
    }
    read_in_process("m.ply", head + body, words);
}

void MeshTrial::stl() {
    const bool is_text = maybe(), is_magics = maybe(), in_capitals = maybe();
    const int count = number(1, 8);
    std::string text = "solid part\n", bytes = is_magics ? "COLOR=" + std::string("\xff\x80\x20\xff", 4) : "";
    bytes += std::string(80 - bytes.size(), ' ') + bytes_of(static_cast<std::uint64_t>(count), 4, false);
    for (int i = 0; i < count; ++i) {
        Vec3 normal{real(-1, 1), real(-1, 1), real(0.5, 1)};
        std::array<Vec3, 3> corners;
        for (Vec3& c : corners) c = {real(-9, 9), real(-9, 9), real(-9, 9)};
        const auto put = [&](Vec3& v) {
            std::string words;
            for (int k = 0; k < 3; ++k) {
                if (is_text)
                    words += " " + form(v[k]);
                else
                    v[k] = static_cast<double>(static_cast<float>(v[k]));
                bytes += bytes_of(std::bit_cast<std::uint32_t>(static_cast<float>(v[k])), 4, false);
            }
            return words;
        };
        text += " facet normal" + put(normal) + "\n outer loop\n";
        for (Vec3& c : corners) text += "  vertex" + put(c) + "\n";
        text += " endloop\n endfacet\n";
        const std::array bits{number(0, 31), number(0, 31), number(0, 31)};
        const bool has_colour = maybe();
        unsigned attribute = 0;
        for (std::size_t k = 0; k < 3; ++k)
            attribute |= static_cast<unsigned>(bits[k]) << (is_magics ? 5 * k : 10 - 5 * k);
        if (!has_colour) attribute = 0;
        if (has_colour != is_magics) attribute |= 0x8000;
        bytes += bytes_of(attribute, 2, false);
        for (const Vec3& c : corners) {
            Expected e{.position = c, .normal = normal};
            if (!is_text && has_colour)
                e.colour = Vec3{light_of(bits[0] / 31.0), light_of(bits[1] / 31.0), light_of(bits[2] / 31.0)};
            expected_.push_back(e);
        }
    }
    text += "endsolid part\n";
    if (in_capitals)
        for (char& c : text) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c;
    read_in_process("m.stl", is_text ? line_ends(text) : bytes, is_text ? text : "binary");
}

void MeshTrial::obj() {
    const auto n = static_cast<std::size_t>(number(3, 20));
    std::string text = "# made on C:\\\n";
    const bool has_uvs = maybe(), has_normals = maybe();
    const int colours = number(0, 2);  // 2: codes of 8 bits
    std::vector<Expected> vertices(n);
    for (Expected& v : vertices) {
        text += "v";
        for (int k = 0; k < 3; ++k) v.position[k] = real(-9, 9), text += " " + form(v.position[k]);
        if (colours > 0) {
            v.colour = Vec3{};
            for (int k = 0; k < 3; ++k) {
                // The first vertex has full red, so that the file's scale is known.
                double code = &v == &vertices[0] && k == 0 ? 1 : real(0, 1);
                if (colours == 2) code = std::round(255 * code);
                text += fmt::format(" {:.17g}", code);
                (*v.colour)[k] = light_of(colours == 2 ? code / 255 : code);
            }
        }
        text += "\n";
        if (has_uvs) {
            v.uv = {real(-2, 2), real(-2, 2)};
            text += "vt";
            for (double& x : *v.uv) text += " " + form(x);
            text += "\n";
        }
        if (has_normals) {
            v.normal = Vec3{real(-1, 1), real(-1, 1), real(0.5, 1)};
            text += "vn";
            for (int k = 0; k < 3; ++k) text += " " + form((*v.normal)[k]);
            text += "\n";
        }
    }
    for (const auto& f : random_faces(n)) {
        text += "f";
        for (const std::size_t i : f) {
            const long index = maybe() ? static_cast<long>(i) + 1 : static_cast<long>(i) - static_cast<long>(n);
            text += number(0, 4) == 0 ? " \\\n" : " ";
            text += fmt::format("{}{}{}{}{}", index, has_uvs || has_normals ? "/" : "",
                                has_uvs ? fmt::format("{}", index) : "", has_normals ? "/" : "",
                                has_normals ? fmt::format("{}", index) : "");
            expected_.push_back(vertices[i]);
        }
        text += "\n";
    }
    const MemoryFolder folder;
    compare(read_obj(folder.write("m.obj", line_ends(text))), text);
}

/// A closed surface: an octahedron that was cut into smaller triangles, its vertices in random order.
void MeshTrial::plates() {
    std::vector<Vec3> points{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    std::vector<std::array<std::size_t, 3>> faces{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                                  {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    for (int cuts = number(0, 5); cuts > 0; --cuts) {
        const std::size_t f = static_cast<std::size_t>(number(0, static_cast<int>(faces.size()) - 1)),
                          i = points.size();
        const auto [a, b, c] = faces[f];
        points.push_back(1.1 / 3 * (points[a] + points[b] + points[c]));
        faces[f] = {a, b, i};
        faces.push_back({b, c, i}), faces.push_back({c, a, i});
    }
    std::vector<std::size_t> place(points.size());
    for (std::size_t i = 0; i < place.size(); ++i) place[i] = i;
    std::ranges::shuffle(place, random_);
    std::vector<Vec3> stored(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) stored[place[i]] = points[i];
    const std::size_t base = static_cast<std::size_t>(number(0, 1));
    if (number(0, 3) == 0) {  // no face has the first vertex and the last
        stored.insert(stored.begin(), stored.front());
        stored.push_back(stored.back());
        for (std::size_t& i : place) ++i;
    }
    const int form_of_file = number(0, 3);  // 0: v and f; 1: both counts; 2: a count before each; 3: numbered rows
    std::string vertices, plates;
    for (std::size_t i = 0; i < stored.size(); ++i) {
        vertices += form_of_file == 0 ? "v" : form_of_file == 3 ? fmt::format("{} ", i + base) : "";
        for (int k = 0; k < 3; ++k) vertices += " " + form(stored[i][k]);
        vertices += "\n";
    }
    for (std::size_t i = 0; i < faces.size(); ++i) {
        plates += form_of_file == 0 ? "f" : form_of_file == 3 ? fmt::format("{} ", i + 1) : "";
        for (const std::size_t corner : faces[i]) {
            plates += fmt::format(" {}", place[corner] + base);
            expected_.push_back({.position = stored[place[corner]]});
        }
        plates += "\n";
    }
    std::string text = vertices + plates;
    if (form_of_file == 1) text = fmt::format("{} {}\n", stored.size(), faces.size()) + text;
    if (form_of_file >= 2) text = fmt::format("{}\n{}{}\n{}", stored.size(), vertices, faces.size(), plates);
    const MemoryFolder folder;
    compare(read_plates(folder.write("m.tab", line_ends(text))), text);
}

TEST(MeshCampaign, AnyDeclarationGivesItsValues) {
    for (int seed = 0; seed < trials(200, 10000); ++seed) {
        SCOPED_TRACE(seed);
        MeshTrial trial(static_cast<unsigned>(seed));
        switch (seed % 8) {
            case 0: trial.obj(); break;
            case 1: trial.plates(); break;
            case 2:
            case 3: trial.ply(); break;
            case 4: trial.stl(); break;
            default: trial.gltf(); break;
        }
        if (HasFatalFailure()) return;
    }
}

}  // namespace
}  // namespace narpa
