#include "renderer/assets/meshes/mesh_readers.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <set>

#include "base/file_bytes.h"
#include "base/text/text_cursor.h"

namespace narpa {

namespace {

constexpr std::array<std::string_view, 12> kObjKeywords{"v", "vt", "vn", "vp", "f",      "l",
                                                        "p", "s",  "g",  "o",  "usemtl", "mtllib"};

class ObjReader {
public:
    ObjReader(std::string text, const std::string& path)
        : in_(std::move(text), path, kObjKeywords), path_(path), is_plates_(extension_of(path) == ".tab") {}

    Result<TriangleSoup> read() {
        while (in_.next_line())
            if (!read_line()) return *error_;
        if (!(is_plates_ ? count_from_base() : check_forward_references())) return *error_;
        finish_colours();
        cut_polygons();
        if (!read_materials()) return *error_;
        warn_of_unused();
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
        if (keyword == "mtllib")
            libraries_.emplace_back(in_.rest());
        else if (keyword == "s")
            is_smooth_ = std::ranges::find(kFlat, in_.token()) == kFlat.end();
        else if (!keyword.empty() && keyword != "g" && keyword != "o")
            unused_.emplace(keyword.substr(0, 20));
        return true;
    }

    void warn_of_unused() {
        constexpr std::size_t kMost = 8;
        std::string all;
        std::size_t n = 0;
        for (const std::string& keyword : unused_)
            if (++n <= kMost) all += (all.empty() ? "" : ", ") + keyword;
        if (n > kMost) all += fmt::format(" and {} others", n - kMost);
        if (n > 0) soup_.warnings.push_back(fmt::format("{}: statements that are not used: {}", path_, all));
        if (has_odd_vertices_)
            soup_.warnings.push_back(
                path_ + ": vertices with further numbers that are neither a weight nor a colour: not used");
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
        soup_.positions.push_back(p);
        if (const std::string_view token = in_.token(); !token.empty()) read_colour(token);
        return true;
    }

    /// Behind a position: a weight, which only curves use; a colour; or a colour and its alpha.
    void read_colour(std::string_view token) {
        std::array<float, 4> x{};
        std::size_t n = 0;
        for (; !token.empty() && n < x.size(); token = in_.token()) {
            const std::optional<double> number = number_from(token);
            if (!number) break;
            x[n++] = static_cast<float>(*number);
        }
        if (n < 3 || !token.empty()) return void(has_odd_vertices_ |= n != 1 || !token.empty());
        colour_of_.resize(soup_.positions.size() - 1, TriangleSoup::kNone);
        colour_of_.push_back(static_cast<std::uint32_t>(soup_.colours.size()));
        soup_.colours.push_back({x[0], x[1], x[2]});
    }

    /// Colours are sRGB, from 0 to 1, or to 255 where one is above 2.
    void finish_colours() {
        if (soup_.colours.empty()) return;
        const bool are_codes = std::ranges::any_of(soup_.colours, [](const Rgb& c) {
            return std::max({c.x, c.y, c.z}) > 2;
        });
        for (Rgb& c : soup_.colours) c = linear_colour(are_codes ? c / 255.0f : c);
        colour_of_.resize(soup_.positions.size(), TriangleSoup::kNone);
        for (TriangleSoup::Corner& c : corners_) c.colour = colour_of_[c.position];
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
        if (!material_) material_ = material_number(kObjDefaultMaterial);
        polygons_.push_back({first, count, *material_});
        soup_.has_smoothing_groups |= is_smooth_ && corners_.back().normal == TriangleSoup::kNone;
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
        const bool is_position = part == &TriangleSoup::Corner::position;
        if (is_plates_ && i >= 0 && i < TriangleSoup::kNone && is_position) {
            index = static_cast<std::uint32_t>(i);
            if (i > have) forward_.push_back({digits, part, i});
            return true;
        }
        if (i == 0) return fail(digits, "index 0, expected indices that count from 1");
        if (i < 0 && -i > have)
            return fail(digits, fmt::format("index {} is out of range, the file has {} {} before here", i, have,
                                            name_of(part)));
        if (i > have) forward_.push_back({digits, part, i});
        index =
            static_cast<std::uint32_t>((i < 0 ? have + i : i - 1) + (is_plates_ && i < 0 && is_position ? 1 : 0));
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

    /// Finds out where the faces of a table of plates count from.
    bool count_from_base() {
        if (!check_forward_references()) return false;
        PlateFaces faces;
        for (const Polygon& polygon : polygons_)
            for (std::size_t i = 1; i + 1 < polygon.count; ++i) {
                const TriangleSoup::Corner* corner = &corners_[polygon.first];
                faces.push_back({corner[0].position, corner[i].position, corner[i + 1].position});
            }
        const Result<std::uint32_t> base = plate_base(faces, soup_.positions, path_, soup_.warnings);
        if (!base) {
            error_ = base.error();
            return false;
        }
        for (TriangleSoup::Corner& corner : corners_) corner.position -= *base;
        return true;
    }

    bool use_material(std::string_view keyword) {
        material_ = material_number(material_name(in_.rest()));
        return names_.size() <= kMaxMaterials ||
               fail(keyword, fmt::format("more than {} materials", kMaxMaterials));
    }

    std::uint16_t material_number(const std::string& name) {
        const auto [it, is_new] = numbers_.try_emplace(name, static_cast<std::uint16_t>(names_.size()));
        if (is_new) names_.push_back(name);
        return it->second;
    }

    void cut_polygons() {
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
        const Status read = read_obj_materials(path_, libraries_, names_, soup_);
        if (!read) error_ = read.error();
        return read.has_value();
    }

    TextCursor in_;
    const std::string& path_;
    TriangleSoup soup_;
    std::vector<TriangleSoup::Corner> corners_;
    std::vector<Polygon> polygons_;
    std::vector<Reference> forward_;
    std::vector<std::string> libraries_, names_;
    std::map<std::string, std::uint16_t> numbers_;
    std::optional<std::uint16_t> material_;
    std::vector<std::uint32_t> colour_of_;  ///< of the positions, while there are colours
    std::set<std::string> unused_;
    bool is_plates_, is_smooth_ = false, has_odd_vertices_ = false;
    static constexpr std::array<std::string_view, 3> kFlat{"off", "0", ""};
    std::optional<Error> error_;
};

}  // namespace

Result<TriangleSoup> read_obj(const std::string& path) {
    Result<std::string> text = read_file(path);
    if (!text) return text.error();
    const bool has_painted_comments = text->find("\n#MRGB") != std::string::npos;
    Result<TriangleSoup> soup = ObjReader(std::move(*text), path).read();
    if (soup && has_painted_comments) soup->warnings.push_back(path + ": colours in comments (#MRGB) are not used");
    return soup;
}

}  // namespace narpa
