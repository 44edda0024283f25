#include "renderer/assets/mesh_readers.h"

#include <fmt/format.h>

#include <filesystem>

#include "base/file_bytes.h"
#include "base/text_cursor.h"

namespace narpa {

namespace {

constexpr const char* kNoMaterial = "default";

class ObjReader {
public:
    ObjReader(std::string text, const std::string& path) : in_(std::move(text), path), path_(path) {}

    Result<TriangleSoup> read() {
        while (in_.next_line())
            if (!read_line()) return *error_;
        if (!check_forward_references()) return *error_;
        cut_polygons();
        if (!read_materials()) return *error_;
        return std::move(soup_);
    }

private:
    struct Polygon {
        std::size_t first, count;  // of corners_
        std::uint16_t material;
    };
    struct Reference {
        std::string_view token;
        std::uint32_t TriangleSoup::Corner::*part;
        std::int64_t index;  // from 1
    };

    bool fail(std::string_view token, std::string what) {
        error_ = in_.error(token, std::move(what));
        return false;
    }

    bool read_line() {
        const std::string_view keyword = in_.token();
        if (keyword == "v") return read_position();
        if (keyword == "f") return read_face(keyword);
        if (keyword == "vt") return read_uv();
        if (keyword == "vn") return read_normal();
        if (keyword == "usemtl") return use_material(keyword);
        if (keyword == "mtllib") libraries_.emplace_back(in_.rest());
        return true;
    }

    bool read_number(double& x) {
        const std::string_view token = in_.token();
        if (token.empty()) return fail(token, "the line ends, expected a number");
        const std::optional<double> number = number_from(token);
        if (!number) return fail(token, fmt::format("\"{}\" is not a number", token));
        x = *number;
        return true;
    }

    bool read_position() {
        Vec3 p;
        for (int i = 0; i < 3; ++i)
            if (!read_number(p[i])) return false;
        soup_.positions.push_back(p);  // a weight or a colour may follow, and is passed over
        return true;
    }

    bool read_normal() {
        Vec3 n;
        for (int i = 0; i < 3; ++i)
            if (!read_number(n[i])) return false;
        soup_.normals.push_back(vec_cast<float>(n));
        return true;
    }

    bool read_uv() {
        double u = 0, v = 0;
        if (!read_number(u)) return false;
        const std::string_view second = in_.token();
        if (!second.empty()) {
            const std::optional<double> number = number_from(second);
            if (!number) return fail(second, fmt::format("\"{}\" is not a number", second));
            v = *number;
        }
        soup_.uvs.push_back({static_cast<float>(u), static_cast<float>(v)});
        return true;
    }

    bool read_face(std::string_view keyword) {
        const std::size_t first = corners_.size();
        for (std::string_view token = in_.token(); !token.empty(); token = in_.token())
            if (!read_corner(token)) return false;
        const std::size_t count = corners_.size() - first;
        if (count < 3) return fail(keyword, fmt::format("a face of {} corners, expected at least 3", count));
        if (count > kMaxCorners)
            return fail(keyword, fmt::format("a face of {} corners, expected at most {}", count, kMaxCorners));
        if (!material_) material_ = material_number(kNoMaterial);
        polygons_.push_back({first, count, *material_});
        return true;
    }

    /// `position`, `position/uv`, `position//normal` or `position/uv/normal`.
    bool read_corner(std::string_view token) {
        using Corner = TriangleSoup::Corner;
        static constexpr std::uint32_t Corner::*kParts[] = {&Corner::position, &Corner::uv, &Corner::normal};
        Corner& corner = corners_.emplace_back();
        std::string_view left = token;
        for (const auto part : kParts) {
            const std::size_t slash = std::min(left.find('/'), left.size());
            const std::string_view digits = left.substr(0, slash);
            if (digits.empty() && part == &Corner::position)
                return fail(token, fmt::format("\"{}\" has no vertex index", token));
            if (!digits.empty() && !read_index(digits, part, corner.*part)) return false;
            if (slash == left.size()) return true;
            left.remove_prefix(slash + 1);
        }
        return fail(token, fmt::format("\"{}\" has too many parts, expected vertex/uv/normal", token));
    }

    bool read_index(std::string_view digits, std::uint32_t TriangleSoup::Corner::*part, std::uint32_t& index) {
        std::int64_t i = 0;
        const auto [end, problem] = std::from_chars(digits.data(), digits.data() + digits.size(), i);
        if (problem != std::errc() || end != digits.data() + digits.size())
            return fail(digits, fmt::format("\"{}\" is not an index", digits));
        const auto have = static_cast<std::int64_t>(count_of(part));
        if (i == 0) return fail(digits, "index 0, expected indices that count from 1");
        if (i < 0 && -i > have)
            return fail(digits, fmt::format("index {} is out of range, the file has {} {} before here", i, have,
                                            name_of(part)));
        if (i > have) forward_.push_back({digits, part, i});
        index = static_cast<std::uint32_t>(i < 0 ? have + i : i - 1);
        return true;
    }

    [[nodiscard]] std::size_t count_of(std::uint32_t TriangleSoup::Corner::*part) const {
        using Corner = TriangleSoup::Corner;
        if (part == &Corner::position) return soup_.positions.size();
        return part == &Corner::uv ? soup_.uvs.size() : soup_.normals.size();
    }
    static const char* name_of(std::uint32_t TriangleSoup::Corner::*part) {
        using Corner = TriangleSoup::Corner;
        if (part == &Corner::position) return "vertices (v)";
        return part == &Corner::uv ? "texture coordinates (vt)" : "normals (vn)";
    }

    /// Checks indices of elements that had not been read yet when they were used.
    bool check_forward_references() {
        for (const Reference& r : forward_)
            if (const std::size_t have = count_of(r.part); r.index > static_cast<std::int64_t>(have))
                return fail(r.token, fmt::format("index {} is out of range, the file has {} {}", r.index, have,
                                                 name_of(r.part)));
        return true;
    }

    bool use_material(std::string_view keyword) {
        material_ = material_number(std::string(in_.rest()));
        return names_.size() <= kMaxMaterials ||
               fail(keyword, fmt::format("more than {} materials", kMaxMaterials));
    }

    std::uint16_t material_number(const std::string& name) {
        const auto [it, is_new] = numbers_.try_emplace(name, static_cast<std::uint16_t>(names_.size()));
        if (is_new) names_.push_back(name);
        return it->second;
    }

    void cut_polygons() {
        soup_.triangles.reserve(corners_.size() - 2 * polygons_.size());
        std::vector<Vec3> points;
        for (const Polygon& polygon : polygons_) {
            const TriangleSoup::Corner* corner = &corners_[polygon.first];
            if (polygon.count == 3) {
                soup_.triangles.push_back({{corner[0], corner[1], corner[2]}, polygon.material});
                continue;
            }
            points.clear();
            for (std::size_t i = 0; i < polygon.count; ++i) points.push_back(soup_.positions[corner[i].position]);
            for (const auto& t : triangulate(points))
                soup_.triangles.push_back({{corner[t[0]], corner[t[1]], corner[t[2]]}, polygon.material});
        }
    }

    bool read_materials() {
        std::map<std::string, MeshMaterial> known;
        for (const std::string& library : libraries_)
            if (!read_library(library, known)) return false;
        std::string missing;
        for (const std::string& name : names_) {
            const auto it = known.find(name);
            if (it == known.end() && name != kNoMaterial)
                missing += (missing.empty() ? "\"" : ", \"") + name + "\"";
            soup_.materials.push_back(it != known.end() ? it->second : MeshMaterial{.material = {.name = name}});
        }
        if (!missing.empty())
            soup_.warnings.push_back(
                fmt::format("{}: in none of its material files: {}; grey 0.5 is used", path_, missing));
        return true;
    }

    /// `mtllib` names one file, perhaps with spaces in it, or several.
    bool read_library(const std::string& names, std::map<std::string, MeshMaterial>& known) {
        std::error_code problem;
        if (std::filesystem::exists(beside(names), problem)) return read_library_file(names, known);
        TextCursor words(names, path_);
        words.next_line();
        for (std::string_view name = words.token(); !name.empty(); name = words.token()) {
            if (std::filesystem::exists(beside(name), problem)) {
                if (!read_library_file(name, known)) return false;
            } else {
                soup_.warnings.push_back(fmt::format("{}: its material file {} is not there", path_, name));
            }
        }
        return true;
    }

    bool read_library_file(std::string_view name, std::map<std::string, MeshMaterial>& known) {
        Status status = read_mtl(beside(name), known, soup_.warnings);
        if (!status) error_ = status.error();
        return status.has_value();
    }

    [[nodiscard]] std::string beside(std::string_view name) const { return texture_path(path_, std::string(name)); }

    TextCursor in_;
    const std::string& path_;
    TriangleSoup soup_;
    std::vector<TriangleSoup::Corner> corners_;
    std::vector<Polygon> polygons_;
    std::vector<Reference> forward_;
    std::vector<std::string> libraries_, names_;
    std::map<std::string, std::uint16_t> numbers_;
    std::optional<std::uint16_t> material_;
    std::optional<Error> error_;
};

}  // namespace

Result<TriangleSoup> read_obj(const std::string& path) {
    Result<std::string> text = read_file(path);
    if (!text) return text.error();
    return ObjReader(std::move(*text), path).read();
}

}  // namespace narpa
