#include "renderer/terrain/terrain_mesh.h"

#include <algorithm>
#include <cmath>

#include "renderer/terrain/tile_errors.h"

namespace narpa {
namespace {

constexpr double kMaxPosts = 68'719'476'736.0;  // 2^36
constexpr int kMaxAlong = 1 << 20;

/// Share of the error bound that a tile may use. The rest is for the strip along a coarser neighbour, which may
/// have that neighbour's error.
constexpr double kShare = 0.9;

/// What is known of a tile before its triangles are made.
struct Tile {
    std::array<float, kTileLevels> error_m{};  ///< of each level, [0] is 0; infinite: more than is allowed
    /// Errors of the cells along the north, south, west and east edge, at each level above the tile's own.
    std::array<std::array<float, kTileLevels>, 4> edge_error_m{};
    Vec3 centre{};
    double radius_m = 0;    ///< of a sphere about the centre that holds it
    double distance_m = 0;  ///< from that sphere to the path of the sensors
    int level = -1;         ///< sampled at every 2^level-th post; -1: nothing in it
};

double distance_to_path(const Vec3& p, const std::vector<Vec3>& path) {
    double nearest = norm(p - path.front());
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
        const Vec3 way = path[i + 1] - path[i];
        const double length2 = dot(way, way);
        const double along = length2 > 0 ? std::clamp(dot(p - path[i], way) / length2, 0.0, 1.0) : 0;
        nearest = std::min(nearest, norm(p - path[i] - along * way));
    }
    return nearest;
}

/// The source rows of a row of tiles, and of a tile's height above and below it.
class RowWindow {
public:
    explicit RowWindow(HeightSource& source)
        : source_(source), columns_(static_cast<std::size_t>(source.columns())) {}

    /// Holds rows `first` to `last`, as far as the source has them; rows that it held before are kept.
    bool move_to(int first, int last) {
        first = std::max(first, 0), last = std::min(last, source_.rows() - 1);
        const int kept_from = std::max(first, first_), kept_to = std::min(last, last_);
        if (kept_from > kept_to) {
            first_ = first, last_ = first - 1;
        } else {
            const auto skipped = static_cast<std::size_t>(kept_from - first_) * columns_;
            rows_.erase(rows_.begin(), rows_.begin() + static_cast<std::ptrdiff_t>(skipped));
            first_ = kept_from, last_ = kept_to;
        }
        const int have = last_ - first_ + 1, want = last - first_ + 1;
        rows_.resize(static_cast<std::size_t>(want) * columns_);
        const bool good = want == have || source_.read_rows(last_ + 1, want - have,
                                                            &rows_[static_cast<std::size_t>(have) * columns_]);
        last_ = last;
        return good;
    }
    [[nodiscard]] double at(int column, int row) const {
        return rows_[static_cast<std::size_t>(row - first_) * columns_ + static_cast<std::size_t>(column)];
    }
    [[nodiscard]] HeightWindow window(int column, int row, int width, int height) const {
        return {&rows_[static_cast<std::size_t>(row - first_) * columns_ + static_cast<std::size_t>(column)],
                columns_, width, height};
    }

private:
    HeightSource& source_;
    std::size_t columns_;
    std::vector<double> rows_;
    int first_ = 0, last_ = -1;
};

class Builder {
public:
    Builder(HeightSource& source, const Placement& placement, const TerrainOptions& options,
            const std::function<void(double)>& progress)
        : source_(source),
          placement_(placement),
          options_(options),
          progress_(progress),
          columns_(source.columns()),
          rows_(source.rows()),
          across_((columns_ - 2) / kTileCells + 1),
          down_((rows_ - 2) / kTileCells + 1) {}

    Result<TerrainMesh> build() {
        if (const Status good = survey(); !good) return good.error();
        if (levels_within(options_.error_px) > max_triangles()) {
            all_errors_ = true;
            if (const Status good = survey(); !good) return good.error();
        }
        if (const Status good = choose_levels(); !good) return good.error();
        if (const Status good = triangulate(); !good) return good.error();
        return std::move(out_);
    }

private:
    struct Span {
        int column, row, width, height;  ///< first post; cells
    };
    [[nodiscard]] Span span_of(int i, int j) const {
        const int column = i * kTileCells, row = j * kTileCells;
        return {column, row, std::min(kTileCells, columns_ - 1 - column), std::min(kTileCells, rows_ - 1 - row)};
    }
    [[nodiscard]] const Tile* tile(int i, int j) const {
        if (source_.is_global()) i = (i + across_) % across_;
        if (i < 0 || j < 0 || i >= across_ || j >= down_) return nullptr;
        return &tiles_[static_cast<std::size_t>(j) * static_cast<std::size_t>(across_) +
                       static_cast<std::size_t>(i)];
    }
    void tell(double part) const {
        if (progress_) progress_(part);
    }
    static Error cannot_read() { return {"its heights cannot be read: the file is damaged or ends early"}; }
    static Error no_place() {
        return {"some of its posts have no longitude and latitude in its map projection, expected on = \"plane\""};
    }

    // --- first pass: the errors of all tiles

    Status survey() {
        tiles_.assign(static_cast<std::size_t>(across_) * static_cast<std::size_t>(down_), Tile{});
        RowWindow rows(source_);
        std::array<double, 2> range{std::numeric_limits<double>::infinity(),
                                    -std::numeric_limits<double>::infinity()};
        for (int j = 0; j < down_; ++j) {
            const int first = j * kTileCells;
            if (!rows.move_to(first, first + kTileCells)) return cannot_read();
            if (!survey_band(j, rows, range)) return no_place();
            tell(0.5 * (j + 1) / down_);
        }
        if (!(range[0] <= range[1])) return Error{"it has no heights: all of it is no-data"};
        out_.summary.lowest_m = range[0], out_.summary.highest_m = range[1];
        return Ok{};
    }

    bool survey_band(int j, const RowWindow& rows, std::array<double, 2>& range) {
        std::vector<Vec3> samples;
        std::vector<double> half_m;
        for (int i = 0; i < across_; ++i) {
            const Span s = span_of(i, j);
            double low = std::numeric_limits<double>::infinity(), high = -low;
            for (int r = 0; r <= s.height; ++r)
                for (int c = 0; c <= s.width; ++c) {
                    const double h = rows.at(s.column + c, s.row + r);
                    low = h < low ? h : low, high = h > high ? h : high;
                }
            const bool any = low <= high;
            if (any) range = {std::min(range[0], low), std::max(range[1], high)};
            const double middle = any ? 0.5 * (low + high) : 0;
            half_m.push_back(any ? 0.5 * (high - low) : -1);
            for (int v = 0; v < 3; ++v)
                for (int u = 0; u < 3; ++u)
                    samples.push_back({s.column + 0.5 * u * s.width, s.row + 0.5 * v * s.height, middle});
        }
        if (!placement_.place(samples)) return false;
        for (int i = 0; i < across_; ++i)
            survey_tile(i, j, &samples[static_cast<std::size_t>(9 * i)], half_m[static_cast<std::size_t>(i)], rows);
        return true;
    }

    void survey_tile(int i, int j, const Vec3* samples, double half_m, const RowWindow& rows) {
        Tile& t =
            tiles_[static_cast<std::size_t>(j) * static_cast<std::size_t>(across_) + static_cast<std::size_t>(i)];
        if (half_m < 0) return;  // no-data
        const Span s = span_of(i, j);
        t.level = 0;
        t.centre = samples[4];
        for (int k = 0; k < 9; ++k) t.radius_m = std::max(t.radius_m, norm(samples[k] - t.centre));
        const double spacing_m =
            (norm(samples[5] - samples[3]) + norm(samples[7] - samples[1])) / (s.width + s.height);
        if (out_.summary.spacing_m == 0 || (i == across_ / 2 && j == down_ / 2)) out_.summary.spacing_m = spacing_m;
        t.radius_m = 1.05 * t.radius_m + half_m;
        t.distance_m = std::max(distance_to_path(t.centre, options_.seen_from) - t.radius_m, spacing_m);
        const HeightWindow heights = rows.window(s.column, s.row, s.width, s.height);
        // Coarsest level first: the first within the bound is taken. For coarser ones the error search ends early,
        // once it exceeds the bound.
        const double enough_m =
            all_errors_ ? std::numeric_limits<double>::infinity() : allowed_m(t, options_.error_px);
        for (int level = kTileLevels - 1; level > 0; --level) {
            const double sag_m =
                placement_.sag_m((1 << level) * spacing_m * 1.5) - placement_.sag_m(spacing_m * 1.5);
            const double error_m = sag_m + tile_error(heights, 1 << level, spacing_m, enough_m - sag_m);
            t.error_m[static_cast<std::size_t>(level)] = error_m <= enough_m
                                                             ? std::nextafter(static_cast<float>(error_m), 1e30f)
                                                             : std::numeric_limits<float>::infinity();
            if (!all_errors_ && level_within(t, options_.error_px) == level) break;
        }
        survey_edges(t, heights, spacing_m);
    }

    /// Errors of the cells along each edge, for each coarser stride. The strip between an edge that is thinned to a
    /// coarser neighbour and the rest of the tile is linear over those cells, so its error is at most twice theirs.
    void survey_edges(Tile& t, const HeightWindow& h, double hole_m) {
        const double enough_m =
            all_errors_ ? std::numeric_limits<double>::infinity() : 0.5 * allowed_m(t, options_.error_px);
        const int own = all_errors_ ? 0 : level_within(t, options_.error_px);
        for (int level = own + 1; level < kTileLevels; ++level) {
            const int stride = 1 << level;
            const int south = (h.height - 1) / stride * stride, east = (h.width - 1) / stride * stride;
            const auto part = [&](int column, int row, int width, int height) {
                return HeightWindow{h.at + static_cast<std::size_t>(row) * h.row_step + column, h.row_step, width,
                                    height};
            };
            const std::array<HeightWindow, 4> edges{
                part(0, 0, h.width, std::min(stride, h.height)), part(0, south, h.width, h.height - south),
                part(0, 0, std::min(stride, h.width), h.height), part(east, 0, h.width - east, h.height)};
            for (std::size_t e = 0; e < 4; ++e)
                t.edge_error_m[e][static_cast<std::size_t>(level)] =
                    static_cast<float>(tile_error(edges[e], stride, hole_m, enough_m));
        }
    }

    /// Refines neighbours that are too coarse for the strip along a tile's edge.
    void balance_levels(double error_px) {
        for (bool changed = true; changed;) {
            changed = false;
            for (int j = 0; j < down_; ++j)
                for (int i = 0; i < across_; ++i) {
                    const Tile& t = *tile(i, j);
                    if (t.level < 0) continue;
                    const double max_m = 0.5 * allowed_m(t, error_px);
                    const std::array<const Tile*, 4> beside{tile(i, j - 1), tile(i, j + 1), tile(i - 1, j),
                                                            tile(i + 1, j)};
                    for (std::size_t e = 0; e < 4; ++e)
                        while (beside[e] && beside[e]->level > t.level &&
                               static_cast<double>(t.edge_error_m[e][static_cast<std::size_t>(beside[e]->level)]) >
                                   max_m) {
                            --tiles_[static_cast<std::size_t>(beside[e] - tiles_.data())].level;
                            changed = true;
                        }
                }
        }
    }

    // --- between the passes

    [[nodiscard]] std::uint64_t max_triangles() const { return options_.budget_bytes / kTerrainBytesPerTriangle; }
    [[nodiscard]] double allowed_m(const Tile& t, double error_px) const {
        return kShare * std::min(error_px * t.distance_m / options_.pixels_per_rad,
                                 options_.error_m * (error_px / options_.error_px));
    }
    [[nodiscard]] int level_within(const Tile& t, double error_px) const {
        const double metres = allowed_m(t, error_px);
        for (int level = kTileLevels - 1; level > 0; --level)
            if (static_cast<double>(t.error_m[static_cast<std::size_t>(level)]) <= metres) return level;
        return 0;
    }
    [[nodiscard]] std::uint64_t triangles(const Span& s, int level) const {
        const int stride = 1 << level;
        return 2 * static_cast<std::uint64_t>((s.width + stride - 1) / stride) *
               static_cast<std::uint64_t>((s.height + stride - 1) / stride);
    }
    /// Chooses the levels of all tiles; returns the number of triangles.
    std::uint64_t levels_within(double error_px) {
        for (Tile& t : tiles_)
            if (t.level >= 0) t.level = level_within(t, error_px);
        balance_levels(error_px);
        std::uint64_t n = 0;
        for (int j = 0; j < down_; ++j)
            for (int i = 0; i < across_; ++i)
                if (const Tile& t = *tile(i, j); t.level >= 0) n += triangles(span_of(i, j), t.level);
        return n;
    }

    /// Finds the least error bound that fits the budget, in steps of a fifth from the requested one.
    Status choose_levels() {
        const std::uint64_t most = max_triangles();
        double error_px = options_.error_px;
        std::uint64_t n = levels_within(error_px);
        for (int step = 0; n > most; ++step, n = levels_within(error_px)) {
            if (step > 200)
                return Error{"its budget of " + std::to_string(options_.budget_bytes >> 20) + " MiB has room for " +
                             std::to_string(most) + " triangles, fewer than two for each of its " +
                             std::to_string(tiles_.size()) + " tiles, expected a larger budget_mib"};
            error_px *= 1.2;
        }
        out_.summary.error_px = error_px;
        for (const Tile& t : tiles_)
            if (t.level >= 0) ++out_.summary.tiles[static_cast<std::size_t>(t.level)];
        out_.faces.reserve(n);
        out_.positions.reserve(n * 11 / 20), out_.normals.reserve(n * 11 / 20), out_.uvs.reserve(n * 11 / 20);
        out_.summary.columns = columns_, out_.summary.rows = rows_;
        out_.summary.full_triangles =
            2 * static_cast<std::uint64_t>(columns_ - 1) * static_cast<std::uint64_t>(rows_ - 1);
        return Ok{};
    }

    // --- second pass: the triangles

    Status triangulate() {
        // The origin is, on a plane, the body's origin at mid height; on an ellipsoid, the middle of the tile
        // centres, which for a whole planet is its centre.
        Vec3 low{1e300, 1e300, 1e300}, high = -low;
        for (const Tile& t : tiles_)
            if (t.level >= 0)
                for (int k = 0; k < 3; ++k)
                    low[k] = std::min(low[k], t.centre[k]), high[k] = std::max(high[k], t.centre[k]);
        for (int k = 0; k < 3; ++k) out_.origin_m[k] = std::round(0.5 * (low[k] + high[k]));
        if (!placement_.on_ellipsoid) out_.origin_m.x = out_.origin_m.y = 0;
        if (source_.is_global()) out_.origin_m = {};
        RowWindow rows(source_);
        for (int j = 0; j < down_; ++j) {
            const int first = j * kTileCells;
            if (!rows.move_to(first - kTileCells, first + 2 * kTileCells)) return cannot_read();
            for (int i = 0; i < across_; ++i)
                if (tile(i, j)->level >= 0 && !triangulate_tile(i, j, rows)) return no_place();
            tell(0.5 + 0.5 * (j + 1) / down_);
        }
        if (out_.faces.empty()) return Error{"it has no cell whose four posts have heights"};
        return Ok{};
    }

    /// The stride of an edge: that of the coarser of its two tiles.
    [[nodiscard]] int edge_stride(int own, int i, int j) const {
        const Tile* beside = tile(i, j);
        return beside ? std::max(own, 1 << std::max(beside->level, 0)) : own;
    }

    /// Samples of a tile at its own stride, with a ring of their neighbours about them.
    struct Lattice {
        int stride, across, down;      ///< cells
        int north, south, west, east;  ///< strides of the edges
        Span span;
        std::vector<Vec3> position;  ///< (across + 3) * (down + 3)
        std::vector<double> height;

        [[nodiscard]] std::size_t index(int k, int l) const {
            return static_cast<std::size_t>(l + 1) * static_cast<std::size_t>(across + 3) +
                   static_cast<std::size_t>(k + 1);
        }
        [[nodiscard]] int column(int k) const {
            return k > across ? span.column + span.width + stride : span.column + std::min(k * stride, span.width);
        }
        [[nodiscard]] int row(int l) const {
            return l > down ? span.row + span.height + stride : span.row + std::min(l * stride, span.height);
        }
        /// On an edge: the nearest vertex at or before k that the coarser tile has, too.
        [[nodiscard]] static int snapped(int k, int last, int coarser) {
            return k == last ? k : k / coarser * coarser;
        }
        [[nodiscard]] std::array<int, 2> vertex(int k, int l) const {
            const int k0 = k, l0 = l;
            if (l0 == 0) k = snapped(k, across, north / stride);
            if (l0 == down) k = snapped(k, across, south / stride);
            if (k0 == 0) l = snapped(l, down, west / stride);
            if (k0 == across) l = snapped(l, down, east / stride);
            return {k, l};
        }
    };

    [[nodiscard]] int inside_columns(int column) const {
        if (source_.is_global()) return (column + columns_ - 1) % (columns_ - 1);
        return std::clamp(column, 0, columns_ - 1);
    }
    [[nodiscard]] double height_at(const RowWindow& rows, int column, int row) const {
        return rows.at(inside_columns(column), std::clamp(row, 0, rows_ - 1));
    }
    [[nodiscard]] Vec3 post(const RowWindow& rows, int column, int row) const {
        const double h = height_at(rows, column, row);
        return {static_cast<double>(
                    source_.is_global() && column >= 0 && column < columns_ ? column : inside_columns(column)),
                static_cast<double>(std::clamp(row, 0, rows_ - 1)), h == h ? h : 0};
    }

    bool triangulate_tile(int i, int j, const RowWindow& rows) {
        Lattice a;
        a.stride = 1 << tile(i, j)->level;
        a.span = span_of(i, j);
        a.across = (a.span.width + a.stride - 1) / a.stride, a.down = (a.span.height + a.stride - 1) / a.stride;
        a.north = edge_stride(a.stride, i, j - 1), a.south = edge_stride(a.stride, i, j + 1);
        a.west = edge_stride(a.stride, i - 1, j), a.east = edge_stride(a.stride, i + 1, j);
        a.position.reserve(static_cast<std::size_t>((a.across + 3) * (a.down + 3)));
        for (int l = -1; l <= a.down + 1; ++l)
            for (int k = -1; k <= a.across + 1; ++k) {
                a.position.push_back(post(rows, a.column(k), a.row(l)));
                a.height.push_back(height_at(rows, a.column(k), a.row(l)));
            }
        if (!placement_.place(a.position)) return false;
        ids_.assign(a.position.size(), kNone);
        slopes_.clear();
        const bool left_handed = is_left_handed(a);
        for (int l = 0; l < a.down; ++l)
            for (int k = 0; k < a.across; ++k) {
                const std::array<int, 2> nw = a.vertex(k, l), ne = a.vertex(k + 1, l), se = a.vertex(k + 1, l + 1),
                                         sw = a.vertex(k, l + 1);
                add_face(a, i, j, {nw, se, ne}, left_handed);
                add_face(a, i, j, {nw, sw, se}, left_handed);
            }
        return add_coarse_normals(rows);
    }

    /// Whether columns and rows are left-handed, unlike on most maps.
    [[nodiscard]] bool is_left_handed(const Lattice& a) const {
        const int k = a.across / 2, l = a.down / 2;  // a pole row is never amid a tile of more than one cell
        const Vec3 p = a.position[a.index(k, l + 1)], east = a.position[a.index(k + 1, l + 1)] - p,
                   south = a.position[a.index(k, l)] - p;
        return dot(cross(east, south), placement_.up(p)) < 0;
    }

    void add_face(const Lattice& a, int i, int j, const std::array<std::array<int, 2>, 3>& corners,
                  bool left_handed) {
        std::array<std::uint32_t, 3> face{};
        std::array<Vec3f, 3> p;
        for (std::size_t n = 0; n < 3; ++n) {
            const std::size_t at = a.index(corners[n][0], corners[n][1]);
            if (!(a.height[at] == a.height[at])) return;
            p[n] = vec_cast<float>(a.position[at] - out_.origin_m);
        }
        if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) return;  // at a pole, or merged into a coarser edge
        for (std::size_t n = 0; n < 3; ++n) face[n] = vertex_id(a, i, j, corners[n][0], corners[n][1]);
        if (left_handed) std::swap(face[1], face[2]);
        out_.faces.push_back(face);
    }

    std::uint32_t vertex_id(const Lattice& a, int i, int j, int k, int l) {
        std::uint32_t& id = ids_[a.index(k, l)];
        if (id != kNone) return id;
        id = static_cast<std::uint32_t>(out_.positions.size());
        const Vec3& p = a.position[a.index(k, l)];
        out_.positions.push_back(vec_cast<float>(p - out_.origin_m));
        out_.uvs.push_back(
            {static_cast<float>((a.column(k) + 0.5) / columns_), static_cast<float>(1 - (a.row(l) + 0.5) / rows_)});
        const int coarsest = stride_at(a, i, j, k, l);
        if (coarsest == a.stride) {
            const auto known = [&](int k2, int l2) {
                const std::size_t at = a.index(k2, l2);
                return a.height[at] == a.height[at] ? a.position[at] : p;
            };
            out_.normals.push_back(normal(p, known(k + 1, l) - known(k - 1, l), known(k, l - 1) - known(k, l + 1)));
        } else {
            out_.normals.push_back({});
            slopes_.push_back({id, p, a.column(k), a.row(l), coarsest});
        }
        return id;
    }

    /// The coarsest stride of the tiles that share a vertex: all of them give it the same normal.
    [[nodiscard]] int stride_at(const Lattice& a, int i, int j, int k, int l) const {
        const int di = k == 0 ? -1 : k == a.across ? 1 : 0, dj = l == 0 ? -1 : l == a.down ? 1 : 0;
        int stride = a.stride;
        if (di != 0) stride = edge_stride(stride, i + di, j);
        if (dj != 0) stride = edge_stride(stride, i, j + dj);
        if (di != 0 && dj != 0) stride = edge_stride(stride, i + di, j + dj);
        return stride;
    }

    [[nodiscard]] Vec3f normal(const Vec3& p, const Vec3& along_columns, const Vec3& against_rows) const {
        const Vec3 up = placement_.up(p);
        Vec3 n = cross(along_columns, against_rows);
        if (dot(n, up) < 0) n = -n;
        const double length = norm(n);
        return vec_cast<float>(length > 1e-12 ? n / length : up);
    }

    bool add_coarse_normals(const RowWindow& rows) {
        neighbours_.clear();
        for (const Slope& s : slopes_)
            for (const auto& [dc, dr] : {std::array{1, 0}, {-1, 0}, {0, -1}, {0, 1}})
                neighbours_.push_back(post(rows, s.column + dc * s.stride, s.row + dr * s.stride));
        if (!placement_.place(neighbours_)) return false;
        for (std::size_t n = 0; n < slopes_.size(); ++n) {
            const Slope& s = slopes_[n];
            std::array<Vec3, 4> p;
            std::size_t m = 0;
            for (const auto& [dc, dr] : {std::array{1, 0}, {-1, 0}, {0, -1}, {0, 1}}) {
                const double h = height_at(rows, s.column + dc * s.stride, s.row + dr * s.stride);
                p[m] = h == h ? neighbours_[4 * n + m] : s.position;
                ++m;
            }
            out_.normals[s.id] = normal(s.position, p[0] - p[1], p[2] - p[3]);
        }
        return true;
    }

    static constexpr std::uint32_t kNone = 0xffff'ffffu;
    /// A vertex whose normal needs posts that its own tile leaves out.
    struct Slope {
        std::uint32_t id;
        Vec3 position;
        int column, row, stride;
    };

    HeightSource& source_;
    const Placement& placement_;
    const TerrainOptions& options_;
    const std::function<void(double)>& progress_;
    int columns_, rows_;
    int across_, down_;  ///< tiles
    bool all_errors_ = false;
    std::vector<Tile> tiles_;
    std::vector<std::uint32_t> ids_;
    std::vector<Slope> slopes_;
    std::vector<Vec3> neighbours_;
    TerrainMesh out_;
};

}  // namespace

Result<TerrainMesh> build_terrain(HeightSource& source, const Placement& placement, const TerrainOptions& options,
                                  const std::function<void(double)>& progress) {
    const int columns = source.columns(), rows = source.rows();
    if (columns < 2 || rows < 2)
        return Error{"it has " + std::to_string(columns) + " x " + std::to_string(rows) +
                     " posts, expected at least 2 x 2"};
    if (columns > kMaxAlong || rows > kMaxAlong || static_cast<double>(columns) * rows > kMaxPosts)
        return Error{"it has " + std::to_string(columns) + " x " + std::to_string(rows) +
                     " posts, expected at most 2^20 along a side and 2^36 in all"};
    return Builder(source, placement, options, progress).build();
}

}  // namespace narpa
