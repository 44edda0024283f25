// Meshes of PLY files: vertices with normals, texture coordinates and colours; faces and strips.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "renderer/assets/meshes/mesh_readers.h"
#include "renderer/mesh_reader/mesh_reader.h"
#include "renderer/mesh_reader/ply_file.h"
#include "renderer/scene/for_parts.h"

namespace narpa {
namespace {

/// Indices of properties that belong together; -1: absent.
template <std::size_t N>
using Columns = std::array<int, N>;

template <std::size_t N>
bool has(const Columns<N>& columns) {
    return std::ranges::all_of(columns, [](int i) { return i >= 0; });
}

double value(const PlyValues& values, int column) {
    const std::vector<double>& v = values[static_cast<std::size_t>(column)];
    return v.empty() ? 0 : v[0];
}

/// Colours of vertices or of faces. Codes of 8 bits are sRGB; those of 16 bits and fractions are linear.
class Colours {
public:
    Colours() = default;
    explicit Colours(const PlyElement& element)
        : columns_{element.find({"red", "diffuse_red", "r"}), element.find({"green", "diffuse_green", "g"}),
                   element.find({"blue", "diffuse_blue", "b"})} {
        if (has(columns_)) type_ = element.properties[static_cast<std::size_t>(columns_[0])].type;
    }
    [[nodiscard]] bool given() const { return type_ != nullptr; }
    [[nodiscard]] const Columns<3>& columns() const { return columns_; }
    [[nodiscard]] Rgb read(const PlyValues& values) const {
        return {static_cast<float>(value(values, columns_[0])), static_cast<float>(value(values, columns_[1])),
                static_cast<float>(value(values, columns_[2]))};
    }
    /// From the file's codes to linear light. Fractions above 2 are codes of 8 bits.
    void finish(std::vector<Rgb>& colours) const {
        const bool are_codes =
            type_->largest == 255 || (type_->largest == 1 && std::ranges::any_of(colours, [](const Rgb& c) {
                                          return std::max({c.x, c.y, c.z}) > 2;
                                      }));
        for (Rgb& c : colours) c = are_codes ? linear_colour(c / 255.0f) : c / static_cast<float>(type_->largest);
    }

private:
    Columns<3> columns_{-1, -1, -1};
    const PlyType* type_ = nullptr;
};

class PlyReader {
public:
    PlyReader(PlyFile& file, const std::string& path) : file_(file), path_(path) {}

    MeshMessage read() {
        if (Status read = read_elements(); !read)
            return {.error = read.error().what, .line = read.error().line, .column = read.error().column};
        if (!faces_have_colours_ && vertex_colours_.given()) vertex_colours_.finish(soup_.colours);
        if (faces_have_colours_) face_colours_.finish(soup_.colours);
        PlainMaterial material = grey_material();
        if (!file_.textures.empty()) {
            material.colour.file = texture_path(path_, file_.textures[0]);
            material.numbers.diffuse = {1, 1, 1};
            material.numbers.is_grey_by_default = false;
        }
        if (file_.textures.size() > 1)
            warn(fmt::format("of its {} textures only the first is used", file_.textures.size()));
        warn_of_unused();
        return {.soup = std::move(soup_), .materials = {std::move(material)}};
    }

private:
    void warn(std::string_view what) { soup_.warnings.push_back(fmt::format("{}: {}", path_, what)); }

    void warn_of_unused() {
        std::string all;
        for (const std::string& name : unused_) all += (all.empty() ? "" : ", ") + name;
        if (!all.empty()) warn("elements and properties that are not used: " + all);
    }
    template <std::size_t N>
    void mark(const Columns<N>& columns) {
        for (const int i : columns) used_.insert(i);
    }
    void note_unused(const PlyElement& element) {
        for (std::size_t i = 0; i < element.properties.size(); ++i)
            if (const std::string& name = element.properties[i].name;
                !used_.contains(static_cast<int>(i)) && name != "alpha")
                unused_.insert(element.name + "." + name);
        used_.clear();
    }

    /// Faces that come before the vertices wait for them.
    Status read_elements() {
        struct Faces {
            const PlyElement* element;
            std::vector<PlyValues> rows;
        };
        std::vector<Faces> waiting;
        bool has_vertices = false;
        for (const PlyElement& element : file_.elements) {
            const bool has_faces = element.name == "face" || element.name == "tristrips";
            Status read = Ok{};
            if (element.name == "vertex") {
                has_vertices = true;
                read = read_vertices(element);
            } else if (has_faces && has_vertices) {
                read = read_faces(element, true,
                                  [&](std::size_t i, PlyValues& v) { return file_.read(element, i, v); });
            } else {
                read = keep_values(element, has_faces ? &waiting.emplace_back(Faces{&element, {}}).rows : nullptr);
            }
            if (!read) return read;
        }
        for (Faces& faces : waiting) {
            const auto next = [&](std::size_t i, PlyValues& v) -> Status {
                return v = std::move(faces.rows[i]), Ok{};
            };
            if (Status read = read_faces(*faces.element, false, next); !read) return read;
        }
        return Ok{};
    }

    /// `rows`: null where the element is not used.
    Status keep_values(const PlyElement& element, std::vector<PlyValues>* rows) {
        if (rows == nullptr && element.count > 0) unused_.insert(element.name);
        PlyValues values;
        for (std::size_t i = 0; static_cast<double>(i) < element.count; ++i) {
            if (Status read = file_.read(element, i, values); !read) return read;
            if (rows != nullptr) rows->push_back(values);
        }
        return Ok{};
    }

    Status read_vertices(const PlyElement& e) {
        const Columns<3> position{e.find({"x"}), e.find({"y"}), e.find({"z"})},
            normal{e.find({"nx", "normal_x"}), e.find({"ny", "normal_y"}), e.find({"nz", "normal_z"})};
        const Columns<2> uv{e.find({"s", "u", "texture_u", "tx"}), e.find({"t", "v", "texture_v", "ty"})};
        if (!has(position)) return file_.error("its vertices have no x, y and z");
        vertex_colours_ = Colours(e);
        mark(position), mark(normal), mark(uv), mark(vertex_colours_.columns());
        note_unused(e);
        has_vertex_normals_ = has(normal), has_vertex_uvs_ = has(uv);
        PlyValues v;
        for (std::size_t i = take_vertices(e, position, normal, uv); static_cast<double>(i) < e.count; ++i) {
            if (Status read = file_.read(e, i, v); !read) return read;
            soup_.positions.push_back({value(v, position[0]), value(v, position[1]), value(v, position[2])});
            if (has(normal))
                soup_.normals.push_back({static_cast<float>(value(v, normal[0])),
                                         static_cast<float>(value(v, normal[1])),
                                         static_cast<float>(value(v, normal[2]))});
            if (has(uv))
                soup_.uvs.push_back({static_cast<float>(value(v, uv[0])), static_cast<float>(value(v, uv[1]))});
            if (vertex_colours_.given()) soup_.colours.push_back(vertex_colours_.read(v));
        }
        return Ok{};
    }

    /// Reads all vertices in parallel where their rows have one size. Returns how many there are.
    std::size_t take_vertices(const PlyElement& e, const Columns<3>& position, const Columns<3>& normal,
                              const Columns<2>& uv) {
        const PlyRows rows = file_.rows(e, 0);
        const bool has_lists = std::ranges::any_of(e.properties, [](const PlyProperty& p) { return p.count_type; });
        if (has_lists || static_cast<double>(rows.count) < e.count) return 0;
        const std::size_t n = rows.count;
        soup_.positions.resize(n);
        if (has(normal)) soup_.normals.resize(n);
        if (has(uv)) soup_.uvs.resize(n);
        if (vertex_colours_.given()) soup_.colours.resize(n);
        for_parts(n, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                const auto x = [&](int column) {
                    const auto c = static_cast<std::size_t>(column);
                    return rows.value(i, rows.offsets[c], *e.properties[c].type);
                };
                const auto vector = [&](const Columns<3>& c) { return Vec3{x(c[0]), x(c[1]), x(c[2])}; };
                soup_.positions[i] = vector(position);
                if (has(normal)) soup_.normals[i] = vec_cast<float>(vector(normal));
                if (has(uv)) soup_.uvs[i] = {static_cast<float>(x(uv[0])), static_cast<float>(x(uv[1]))};
                if (vertex_colours_.given()) soup_.colours[i] = vec_cast<float>(vector(vertex_colours_.columns()));
            }
        });
        file_.skip(rows, n);
        return n;
    }

    /// `next(i, values)` gives the values of face `i`. `can_take`: they are next in the file.
    Status read_faces(const PlyElement& e, bool can_take, const auto& next) {
        const int list = e.find({"vertex_indices", "vertex_index"});
        const bool is_strips = e.name == "tristrips";
        if (list < 0) return file_.error(fmt::format("its {} have no vertex_indices", e.name));
        const int wedge = is_strips ? -1 : e.find({"texcoord"});
        const Colours colours(e);
        if (colours.given() && vertex_colours_.given() && e.count > 0)
            warn("colours of faces are not used, as its vertices have some");
        else if (colours.given())
            face_colours_ = colours, faces_have_colours_ = true;
        mark(Columns<3>{list, wedge, e.find({"texnumber"})}), mark(colours.columns());
        note_unused(e);
        // Where runs of faces with equally many corners are short, all are read one by one.
        constexpr std::size_t kShortRun = 64;
        const auto count = static_cast<std::size_t>(e.count);
        bool may_take = can_take && !is_strips;
        PlyValues v;
        for (std::size_t i = 0; i < count; ++i) {
            if (may_take) {
                const std::size_t taken = take_faces(e, count - i, static_cast<std::size_t>(list), colours);
                may_take = taken >= kShortRun;
                if (i += taken; i == count) break;
            }
            if (Status read = next(i, v); !read) return read;
            const std::uint32_t colour = colour_of(colours, v);
            const std::vector<double>& corners = v[static_cast<std::size_t>(list)];
            Status added =
                is_strips
                    ? add_strips(corners, colour)
                    : add_face(corners, wedge < 0 ? std::vector<double>{} : v[static_cast<std::size_t>(wedge)],
                               colour);
            if (!added) return added;
        }
        return Ok{};
    }

    /// Reads faces in parallel, from the next one up to the first that has another number of corners than it, or a
    /// vertex that there is not. Returns how many; none unless the next is a triangle or a quadrangle.
    std::size_t take_faces(const PlyElement& e, std::size_t left, std::size_t list, const Colours& colours) {
        const PlyProperty& corners = e.properties[list];
        const PlyRows next = file_.rows(e, 0);
        if (corners.count_type == nullptr || next.count == 0) return 0;
        const double length = next.value(0, next.offsets[list], *corners.count_type);
        if (length != 3 && length != 4) return 0;
        const auto size = static_cast<std::size_t>(length), triangles = size - 2;
        PlyRows rows = file_.rows(e, size);
        rows.count = std::min(rows.count, left);
        TriangleSoup::Column& out = soup_.triangles.position;
        const std::size_t from = out.size();
        out.resize(from + rows.count * triangles);
        const std::size_t n = count_until_false(rows.count, [&](std::size_t i) {
            if (rows.value(i, rows.offsets[list], *corners.count_type) != length) return false;
            std::array<std::uint32_t, 4> vertex{};
            for (std::size_t k = 0; k < size; ++k) {
                const std::size_t at = rows.offsets[list] + corners.count_type->size + k * corners.type->size;
                const double x = rows.value(i, at, *corners.type);
                if (!is_vertex(x)) return false;
                vertex[k] = static_cast<std::uint32_t>(x);
            }
            cut_face(std::span(vertex).first(size), &out[from + i * triangles]);
            return true;
        });
        out.resize(from + n * triangles);
        take_attributes(from);
        if (colours.given() && faces_have_colours_) take_colours(e, rows, n, triangles, colours);
        file_.skip(rows, n);
        return n;
    }

    /// `out`: room for the triangles.
    void cut_face(std::span<const std::uint32_t> vertices, std::array<std::uint32_t, 3>* out) const {
        if (vertices.size() == 3) return void(*out = {vertices[0], vertices[1], vertices[2]});
        std::array<Vec3, 4> points;
        for (std::size_t k = 0; k < vertices.size(); ++k) points[k] = soup_.positions[vertices[k]];
        for (const auto& [a, b, c] : triangulate(points)) *out++ = {vertices[a], vertices[b], vertices[c]};
    }

    /// The least i for which f(i) is false, or `count`. Calls f in parallel, for all i below that at least.
    static std::size_t count_until_false(std::size_t count, const auto& f) {
        std::atomic<std::size_t> end_of_true = count;
        for_parts(count, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                if (f(i)) continue;
                for (std::size_t least = end_of_true; i < least;)
                    if (end_of_true.compare_exchange_weak(least, i)) break;
                return;
            }
        });
        return end_of_true;
    }

    /// Of the triangles from `from` on: those of their vertices.
    void take_attributes(std::size_t from) {
        const TriangleSoup::Column& position = soup_.triangles.position;
        const auto copy = [&](TriangleSoup::Column& column) {
            column.resize(from, kNoIndices);
            column.insert(column.end(), position.begin() + static_cast<std::ptrdiff_t>(from), position.end());
        };
        if (has_vertex_uvs_) copy(soup_.triangles.uv);
        if (has_vertex_normals_) copy(soup_.triangles.normal);
        if (vertex_colours_.given()) copy(soup_.triangles.colour);
    }

    /// Of the newest n faces, each cut into so many triangles.
    void take_colours(const PlyElement& e, const PlyRows& rows, std::size_t n, std::size_t triangles,
                      const Colours& colours) {
        TriangleSoup::Column& column = soup_.triangles.colour;
        column.resize(soup_.triangles.size() - n * triangles, kNoIndices);
        for (std::size_t i = 0; i < n; ++i) {
            const auto band = [&](std::size_t k) {
                const auto c = static_cast<std::size_t>(colours.columns()[k]);
                return static_cast<float>(rows.value(i, rows.offsets[c], *e.properties[c].type));
            };
            const auto number = static_cast<std::uint32_t>(soup_.colours.size());
            column.insert(column.end(), triangles, {number, number, number});
            soup_.colours.push_back({band(0), band(1), band(2)});
        }
    }

    std::uint32_t colour_of(const Colours& colours, const PlyValues& values) {
        if (!colours.given() || !faces_have_colours_) return TriangleSoup::kNone;
        soup_.colours.push_back(colours.read(values));
        return static_cast<std::uint32_t>(soup_.colours.size() - 1);
    }

    /// `colour`: the face's.
    TriangleSoup::Corner corner(double index, std::uint32_t colour) const {
        const auto i = static_cast<std::uint32_t>(index);
        TriangleSoup::Corner c{.position = i, .colour = colour};
        if (has_vertex_uvs_) c.uv = i;
        if (has_vertex_normals_) c.normal = i;
        if (vertex_colours_.given()) c.colour = i;
        return c;
    }
    [[nodiscard]] bool is_vertex(double i) const {
        return i >= 0 && i < static_cast<double>(soup_.positions.size()) && i == std::floor(i);
    }
    Status check(const std::vector<double>& corners) const {
        const auto size = static_cast<double>(soup_.positions.size());
        for (const double i : corners)
            if (!is_vertex(i))
                return file_.error(fmt::format("a face has vertex {}, counted from 0, of {}", i, size));
        if (corners.size() > kMaxCorners)
            return file_.error(
                fmt::format("a face of {} corners, expected at most {}", corners.size(), kMaxCorners));
        return Ok{};
    }

    Status add_face(const std::vector<double>& corners, const std::vector<double>& uvs, std::uint32_t colour) {
        if (Status good = check(corners); !good) return good;
        const auto first_uv = static_cast<std::uint32_t>(soup_.uvs.size());
        const bool has_uvs = !uvs.empty() && uvs.size() == 2 * corners.size();
        for (std::size_t k = 0; has_uvs && k < corners.size(); ++k)
            soup_.uvs.push_back({static_cast<float>(uvs[2 * k]), static_cast<float>(uvs[2 * k + 1])});
        std::vector<Vec3> points;
        for (const double i : corners) points.push_back(soup_.positions[static_cast<std::size_t>(i)]);
        for (const auto& t : triangulate(points)) {
            TriangleSoup::Triangle out{.corners = {}};
            for (std::size_t k = 0; k < 3; ++k) {
                out.corners[k] = corner(corners[t[k]], colour);
                if (has_uvs) out.corners[k].uv = first_uv + t[k];
            }
            soup_.triangles.push_back(out);
        }
        return Ok{};
    }

    /// Strips are separated by -1.
    Status add_strips(const std::vector<double>& all, std::uint32_t colour) {
        for (auto from = all.begin(); from != all.end();) {
            const auto end = std::find(from, all.end(), -1.0);
            const auto n = static_cast<std::size_t>(end - from);
            for (std::size_t i = 0; i + 2 < n; ++i) {
                const auto at = [&](std::size_t k) { return from[static_cast<std::ptrdiff_t>(k)]; };
                const std::vector<double> corners{at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)};
                if (Status good = check(corners); !good) return good;
                soup_.triangles.push_back(
                    {{corner(corners[0], colour), corner(corners[1], colour), corner(corners[2], colour)}});
            }
            from = end == all.end() ? end : end + 1;
        }
        return Ok{};
    }

    static constexpr std::array<std::uint32_t, 3> kNoIndices{TriangleSoup::kNone, TriangleSoup::kNone,
                                                             TriangleSoup::kNone};

    PlyFile& file_;
    const std::string& path_;
    TriangleSoup soup_;
    Colours vertex_colours_, face_colours_;
    bool faces_have_colours_ = false, has_vertex_normals_ = false, has_vertex_uvs_ = false;
    std::set<int> used_;
    std::set<std::string> unused_;
};

}  // namespace

MeshMessage read_ply(const std::string& path) {
    Result<PlyFile> file = PlyFile::open(path);
    if (!file) return {.error = file.error().what, .line = file.error().line, .column = file.error().column};
    return PlyReader(*file, path).read();
}

}  // namespace narpa
