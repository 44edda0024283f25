// Plate shape models of the Planetary Data System: OBJ's v and f lines, or counts and rows of numbers.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/file_bytes.h"
#include "base/text/text_cursor.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

namespace {

/// What a surface looks like if its faces count vertices from `first`.
struct PlateFit {
    bool is_closed = true;  ///< each edge occurs equally often in both directions, vertices identified by position
    std::size_t collapsed = 0;  ///< edges without length
    double shape = 0;           ///< closed: volume / area^1.5; open: 1 / length of all edges

    PlateFit(const PlateFaces& faces, std::uint32_t first, const std::vector<Vec3>& positions) {
        const std::vector<std::uint32_t> point = points_of(positions);
        std::vector<std::array<std::uint32_t, 3>> sides;  // the lower end, the upper end, the direction
        sides.reserve(3 * faces.size());
        double volume = 0, area = 0, length = 0;
        for (const auto& f : faces) {
            std::array<Vec3, 3> p;
            for (std::size_t k = 0; k < 3; ++k) {
                const std::uint32_t from = f[k] - first, to = f[(k + 1) % 3] - first, a = point[from],
                                    b = point[to];
                if (a == b) ++collapsed;
                if (a != b) sides.push_back({std::min(a, b), std::max(a, b), a < b ? 1u : 0u});
                length += norm(positions[from] - positions[to]);
                p[k] = positions[from] - positions[0];
            }
            volume += dot(p[0], cross(p[1], p[2])) / 6;
            area += norm(cross(p[1] - p[0], p[2] - p[0])) / 2;
        }
        std::ranges::sort(sides);
        for (std::size_t i = 0, end = 0; i < sides.size() && is_closed; i = end) {
            std::size_t upwards = 0;
            for (end = i; end < sides.size() && sides[end][0] == sides[i][0] && sides[end][1] == sides[i][1]; ++end)
                upwards += sides[end][2];
            is_closed = 2 * upwards == end - i;
        }
        shape = is_closed ? std::abs(volume) / std::pow(area, 1.5) : 1 / length;
    }
    [[nodiscard]] bool is_better_than(const PlateFit& other) const {
        if (is_closed != other.is_closed) return is_closed;
        if (collapsed != other.collapsed) return collapsed < other.collapsed;
        return shape > 1.01 * other.shape;
    }

private:
    /// Equal numbers for positions that agree to 1e-6 of the extent: seams may differ in the last digit.
    static std::vector<std::uint32_t> points_of(const std::vector<Vec3>& positions) {
        double extent = 0;
        for (const Vec3& p : positions)
            for (int k = 0; k < 3; ++k)
                if (std::isfinite(p[k])) extent = std::max(extent, std::abs(p[k]));
        const double step = extent > 0 ? 1e-6 * extent : 1;
        const auto cell = [&](double x) { return std::isfinite(x) ? std::llround(x / step) : 0; };
        const auto key = [&](std::uint32_t v) {
            return std::array{cell(positions[v].x), cell(positions[v].y), cell(positions[v].z)};
        };
        std::vector<std::uint32_t> order(positions.size()), point(positions.size());
        std::iota(order.begin(), order.end(), 0u);
        std::ranges::sort(order, {}, key);
        for (std::size_t i = 1; i < order.size(); ++i)
            point[order[i]] = point[order[i - 1]] + (key(order[i]) == key(order[i - 1]) ? 0 : 1);
        return point;
    }
};

/// Rows of numbers: the counts of vertices and of faces, in one row or each before its own rows; vertices; faces,
/// whose corners count from 0 or 1. Rows may begin with their running number.
class PlateReader {
public:
    PlateReader(std::string text, const std::string& path) : in_(std::move(text), path), path_(path) {}

    Result<TriangleSoup> read() {
        if (!next_row() || !read_counts() || !read_vertices()) return *error_;
        if (!faces_ && !(next_row() && read_count_of_faces())) return *error_;
        if (!read_faces() || !find_base()) return *error_;
        soup_.materials.push_back({.material = {.name = "plates"}, .is_grey_by_default = true});
        return std::move(soup_);
    }

private:
    bool fail(std::string what) {
        error_ = in_.error(first_, std::move(what));
        return false;
    }

    /// The numbers of the next row that is not empty.
    bool next_row() {
        row_.clear();
        while (row_.empty()) {
            if (!in_.next_line()) return fail("the file ends, expected the rows that its counts promise");
            first_ = {};
            for (std::string_view token = in_.token(); !token.empty(); token = in_.token()) {
                if (first_.empty()) first_ = token;
                if (token.ends_with(',')) token.remove_suffix(1);
                const auto number = number_from(token);
                if (!number) {
                    error_ = in_.error(token, fmt::format("\"{}\" is not a number", token));
                    return false;
                }
                row_.push_back(*number);
            }
        }
        return true;
    }

    static bool is_count(double x) { return x >= 0 && x <= 1e9 && x == std::floor(x); }

    bool read_counts() {
        const bool good = row_.size() <= 2 && is_count(row_[0]) && is_count(row_.back());
        if (!good)
            return fail("expected lines of v and f, or the numbers of vertices and of faces, with rows of both");
        vertices_ = static_cast<std::size_t>(row_[0]);
        if (row_.size() == 2) faces_ = static_cast<std::size_t>(row_[1]);
        return true;
    }
    bool read_count_of_faces() {
        if (row_.size() != 1 || !is_count(row_[0])) return fail("expected the number of faces");
        faces_ = static_cast<std::size_t>(row_[0]);
        return true;
    }

    /// Three numbers, perhaps behind the row's own, which counts on from `start`.
    bool take_three(std::size_t index, std::optional<double>& start, std::array<double, 3>& out) {
        if (row_.size() == 4) {
            if (index == 0) start = row_[0];
            if (start && row_[0] == *start + static_cast<double>(index)) row_.erase(row_.begin());
        }
        if (row_.size() != 3) return fail("expected three numbers, or the row's own number and three");
        std::ranges::copy(row_, out.begin());
        return true;
    }

    bool read_vertices() {
        std::array<double, 3> v{};
        for (std::size_t i = 0; i < vertices_; ++i) {
            if (!next_row() || !take_three(i, first_vertex_, v)) return false;
            soup_.positions.push_back({v[0], v[1], v[2]});
        }
        return true;
    }

    bool read_faces() {
        std::optional<double> first_face;
        std::array<double, 3> corners{};
        for (std::size_t i = 0; i < *faces_; ++i) {
            if (!next_row() || !take_three(i, first_face, corners)) return false;
            TriangleSoup::Triangle t;
            for (std::size_t k = 0; k < 3; ++k) {
                if (!is_count(corners[k]) || corners[k] > static_cast<double>(vertices_))
                    return fail(fmt::format("a face with vertex {}, the file has {}", corners[k], vertices_));
                t.corners[k].position = static_cast<std::uint32_t>(corners[k]);
            }
            soup_.triangles.push_back(t);
        }
        return true;
    }

    bool find_base() {
        PlateFaces& faces = soup_.triangles.position;
        const Result<std::uint32_t> base = first_vertex_ == 0.0 || first_vertex_ == 1.0
                                               ? check_base(faces, static_cast<std::uint32_t>(*first_vertex_))
                                               : plate_base(faces, soup_.positions, path_, soup_.warnings);
        if (!base) {
            error_ = base.error();
            return false;
        }
        for (auto& face : faces)
            for (std::uint32_t& v : face) v -= *base;
        return true;
    }

    /// The numbers of the vertices' rows say where faces count from.
    [[nodiscard]] Result<std::uint32_t> check_base(const PlateFaces& faces, std::uint32_t base) const {
        for (const auto& face : faces)
            for (const std::uint32_t v : face)
                if (v < base || v - base >= vertices_)
                    return Error{
                        .what = fmt::format("a face with vertex {}, the rows of vertices count from {} to {}", v,
                                            base, vertices_ + base - 1),
                        .file = path_};
        return base;
    }

    TextCursor in_;
    const std::string& path_;
    TriangleSoup soup_;
    std::string_view first_;  ///< token of the row
    std::vector<double> row_;
    std::size_t vertices_ = 0;
    std::optional<std::size_t> faces_;
    std::optional<double> first_vertex_;
    std::optional<Error> error_;
};

}  // namespace

Result<std::uint32_t> plate_base(const PlateFaces& faces, const std::vector<Vec3>& positions,
                                 const std::string& path, std::vector<std::string>& warnings) {
    std::uint32_t low = 0xffff'ffffu, high = 0;
    for (const auto& face : faces)
        for (const std::uint32_t v : face) low = std::min(low, v), high = std::max(high, v);
    const std::size_t n = positions.size();
    if (low == 0 && high >= n)
        return Error{.what = fmt::format("faces with vertices 0 to {}, the file has {}", high, n), .file = path};
    if (faces.empty() || high >= n) return 1u;
    if (low == 0 || PlateFit(faces, 0, positions).is_better_than(PlateFit(faces, 1, positions))) {
        warnings.push_back(path + ": its faces count vertices from 0");
        return 0u;
    }
    warnings.push_back(
        fmt::format("{}: its faces are taken to count vertices from 1; none has the last one, {}", path, n));
    return 1u;
}

Result<TriangleSoup> read_plates(const std::string& path) {
    Result<std::string> text = read_file(path);
    if (!text) return text.error();
    TextCursor lines(*text, path);
    std::string_view token;
    while (token.empty() && lines.next_line()) token = lines.token();
    if (token.ends_with(',')) token.remove_suffix(1);
    return number_from(token) ? PlateReader(*std::move(text), path).read() : read_obj(path);
}

}  // namespace narpa
