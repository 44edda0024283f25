#include "renderer/trajectory/state_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <vector>

#include "base/text/csv.h"

namespace narpa {
namespace {

class StateTableReader {
public:
    StateTableReader(const StateTable& table, std::int64_t epoch_ns) : table_(table), epoch_ns_(epoch_ns) {}

    Status read(CourseSegment* position, CourseSegment* attitude) {
        std::ifstream in(table_.file);
        if (!in)
            return Error{fmt::format("cannot be opened ({}), expected a table (CSV)", std::strerror(errno)),
                         table_.file};
        TextLines lines(in);
        bool has_header = false;
        for (std::string_view line; lines.next(line);) {
            row_.number = lines.number();
            if (trimmed(line).empty() || line.front() == '#') continue;
            const Status read = has_header ? read_row(line, position, attitude) : read_header(line);
            if (!read) return read;
            has_header = true;
        }
        if (!has_header) return Error{"no header line, expected one with the names of the columns", table_.file};
        return Ok{};
    }

private:
    [[nodiscard]] Error error(std::string_view cell, std::string what) const {
        return {std::move(what), table_.file, row_.number, row_.column_of(cell)};
    }

    /// The separator is that with which all columns are there.
    Status read_header(std::string_view line) {
        std::vector<std::string> wanted{table_.time.column};
        for (const auto& vectors : {table_.position, table_.velocity})
            if (vectors) wanted.insert(wanted.end(), vectors->columns.begin(), vectors->columns.end());
        if (table_.attitude)
            wanted.insert(wanted.end(), table_.attitude->columns.begin(), table_.attitude->columns.end());
        std::string missing;
        for (const char separator : {',', ';', '\t'}) {
            if (!row_.split(line, separator)) continue;
            columns_.clear();
            for (const std::string& name : wanted) {
                const auto count = std::ranges::count(row_.cells, name);
                if (count > 1) return error(row_.cells.front(), fmt::format("column \"{}\" a second time", name));
                if (count == 0) break;
                columns_.push_back(
                    static_cast<std::size_t>(std::ranges::find(row_.cells, name) - row_.cells.begin()));
            }
            if (columns_.size() == wanted.size()) {
                separator_ = separator;
                width_ = row_.cells.size();
                return Ok{};
            }
            if (missing.empty() || row_.cells.size() > 1)
                missing = fmt::format("no column \"{}\", expected it among {}", wanted[columns_.size()],
                                      fmt::join(row_.cells, ", "));
        }
        return Error{missing, table_.file, row_.number, 1};
    }

    Status read_row(std::string_view line, CourseSegment* position, CourseSegment* attitude) {
        if (!row_.split(line, separator_))
            return error(row_.cells.back(), "expected a quote at the end of the cell, and a separator behind it");
        if (row_.cells.size() != width_)
            return error(row_.cells.front(),
                         fmt::format("{} columns, expected {} as in the header", row_.cells.size(), width_));
        CourseSample sample{.line = row_.number};
        const std::string_view time = row_.cells[columns_[0]];
        if (table_.time.system) {
            const auto t_ns = tai_ns(time, *table_.time.system);
            if (!t_ns) return error(time, t_ns.error().what);
            sample.t_ns = *t_ns;
        } else {
            const auto t = number(time);
            if (!t) return t.error();
            if (std::abs(*t * table_.time.unit_s) > 3e9) return error(time, "a time of more than 3e9 s");
            sample.t_ns = epoch_ns_ + std::llround(1e9 * table_.time.unit_s * *t);
        }
        std::size_t next = 1;
        if (position)
            if (Status good = add_position(sample, next, *position); !good) return good;
        if (attitude) return add_attitude(sample, next, *attitude);
        return Ok{};
    }

    [[nodiscard]] Result<double> number(std::string_view cell) const {
        const auto x = row_.number_in(cell);
        if (!x || !std::isfinite(*x))
            return error(cell, fmt::format("\"{}\" where a finite number was expected", cell));
        return *x;
    }
    /// Numbers of the columns from `next` on, which moves behind them.
    template <std::size_t N>
    Result<std::array<double, N>> numbers(std::size_t& next) const {
        std::array<double, N> values{};
        for (double& value : values) {
            const auto x = number(row_.cells[columns_[next++]]);
            if (!x) return x.error();
            value = *x;
        }
        return values;
    }
    [[nodiscard]] Quat q_frame() const {
        return table_.frame == StateTable::Frame::eme2000 ? q_icrf_eme2000() : Quat{};
    }

    Status add(CourseSegment& segment, const CourseSample& sample) const {
        if (!segment.samples.empty() && sample.t_ns <= segment.samples.back().t_ns)
            return error(row_.cells[columns_[0]],
                         fmt::format("the time does not come after that of line {}", segment.samples.back().line));
        segment.samples.push_back(sample);
        return Ok{};
    }
    Status add_position(CourseSample sample, std::size_t& next, CourseSegment& segment) const {
        for (const auto& [vectors, out] :
             {std::pair{&table_.position, &sample.value}, std::pair{&table_.velocity, &sample.rate_per_s}}) {
            if (!*vectors) continue;
            const auto v = numbers<3>(next);
            if (!v) return v.error();
            const Vec3 turned = q_frame() * ((*vectors)->unit * Vec3{(*v)[0], (*v)[1], (*v)[2]});
            *out = {turned.x, turned.y, turned.z, 0};
        }
        return add(segment, sample);
    }
    Status add_attitude(CourseSample sample, std::size_t& next, CourseSegment& segment) const {
        const std::string_view first = row_.cells[columns_[next]];
        const auto v = numbers<4>(next);
        if (!v) return v.error();
        Quat q = table_.attitude->scalar_first ? Quat{(*v)[0], (*v)[1], (*v)[2], (*v)[3]}
                                               : Quat{(*v)[3], (*v)[0], (*v)[1], (*v)[2]};
        q = q_frame() * (table_.attitude->body_to_frame ? q : conjugate(q));
        sample.value = {q.w, q.x, q.y, q.z};
        if (Status good = accept_quaternion(segment, sample); !good) return error(first, good.error().what);
        return add(segment, sample);
    }

    const StateTable& table_;
    std::int64_t epoch_ns_;
    CsvRow row_;
    char separator_ = ',';
    std::size_t width_ = 0;
    std::vector<std::size_t> columns_;  ///< of time, position, velocity, attitude
};

/// The course of a table's only segment.
Result<SampledCourse> course_of(const StateTable& table, CourseSegment segment) {
    segment.line = segment.samples.empty() ? 0 : segment.samples.front().line;
    if (Status good = check_samples(segment); !good) return Error{good.error().what, table.file, good.error().line};
    segment.from_ns = segment.samples.front().t_ns;
    segment.to_ns = segment.samples.back().t_ns;
    SampledCourse course{.file = table.file, .in_world = table.frame == StateTable::Frame::world};
    course.segments.push_back(std::move(segment));
    return course;
}

}  // namespace

Result<TableCourses> read_state_table(const StateTable& table, std::int64_t epoch_ns,
                                      const std::optional<Interpolation>& of_position,
                                      const std::optional<Interpolation>& of_attitude) {
    CourseSegment position{.interpolation = of_position.value_or(Interpolation{})},
        attitude{.interpolation = of_attitude.value_or(Interpolation{})};
    if (Status read = StateTableReader(table, epoch_ns)
                          .read(table.position ? &position : nullptr, table.attitude ? &attitude : nullptr);
        !read)
        return read.error();
    TableCourses courses;
    if (table.position) {
        auto course = course_of(table, std::move(position));
        if (!course) return course.error();
        courses.position = *std::move(course);
    }
    if (table.attitude) {
        auto course = course_of(table, std::move(attitude));
        if (!course) return course.error();
        courses.attitude = *std::move(course);
    }
    return courses;
}

}  // namespace narpa
