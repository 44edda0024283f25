#include "renderer/trajectory/trajectory_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/trajectory/ccsds_message.h"
#include "renderer/trajectory/trajectory_keys.h"

namespace narpa {
namespace {

constexpr double kRowsMax = 2e6;

struct MovingBody {
    const DescribedBody* body = nullptr;
    std::optional<SampledCourse> position{}, attitude{};
};

Vec3 vec3_of(const CourseValue& v) {
    return {v[0], v[1], v[2]};
}

/// Evaluates the courses in the scene's world.
class WorldCourses {
public:
    static Result<WorldCourses> read(const TrajectoryDescription& d) {
        WorldCourses courses;
        courses.epoch_ns_ = d.epoch_ns;
        if (!d.origin.empty()) {
            auto origin = read_oem(d.origin, d.of_origin);
            if (!origin) return origin.error();
            courses.origin_ = *std::move(origin);
        }
        for (const DescribedBody& body : d.bodies) {
            auto moving = read_courses(body, d.epoch_ns);
            if (!moving) return moving.error();
            courses.bodies_.push_back(*std::move(moving));
        }
        if (Status good = courses.check_centres(); !good) return good.error();
        if (Status good = courses.orient(d); !good) return good.error();
        return courses;
    }

    [[nodiscard]] const std::vector<MovingBody>& bodies() const { return bodies_; }
    /// The files' common time, ns of simulation time; nullopt: constant bodies only.
    [[nodiscard]] std::optional<std::pair<std::int64_t, std::int64_t>> common_time() const {
        std::optional<std::pair<std::int64_t, std::int64_t>> common;
        for (const SampledCourse* course : all()) {
            const std::int64_t from = course->from_ns() - epoch_ns_, to = course->to_ns() - epoch_ns_;
            common = common ? std::pair{std::max(common->first, from), std::min(common->second, to)}
                            : std::pair{from, to};
        }
        return common;
    }
    /// The file whose time begins last, or ends first.
    [[nodiscard]] Error out_of_time(std::string what) const {
        const auto courses = all();
        const SampledCourse* latest = *std::ranges::max_element(courses, {}, &SampledCourse::from_ns);
        const SampledCourse* earliest = *std::ranges::min_element(courses, {}, &SampledCourse::to_ns);
        return Error{fmt::format("{}: {} begins at {} s, {} ends at {} s of simulation time", what, latest->file,
                                 seconds(latest->from_ns()), earliest->file, seconds(earliest->to_ns()))};
    }

    Result<Motion> motion(const MovingBody& moving, std::int64_t t_ns) const {
        Motion m{{moving.body->q_world_body, moving.body->position_m}, {}, {}};
        if (moving.position || moving.body->at_centre) {
            const auto state = position(moving, t_ns);
            if (!state) return state.error();
            m.T_world_body.t = state->first;
            m.velocity_m_s = state->second;
        }
        if (!moving.attitude) return m;
        const auto found = at(*moving.attitude, t_ns);
        if (!found) return found.error();
        const auto& [value, rate] = *found;
        const Quat q{value[0], value[1], value[2], value[3]}, dq{rate[0], rate[1], rate[2], rate[3]};
        m.T_world_body.q = normalized(moving.attitude->in_world ? q : q_world_icrf_ * q);
        m.rate_rad_s = (2 / dot(q, q)) * (conjugate(q) * dq).vec();
        return m;
    }

private:
    static Result<MovingBody> read_courses(const DescribedBody& body, std::int64_t epoch_ns) {
        MovingBody moving{.body = &body};
        if (body.table) {
            auto table = read_state_table(*body.table, epoch_ns, body.of_position, body.of_attitude);
            if (!table) return table.error();
            moving.position = std::move(table->position);
            moving.attitude = std::move(table->attitude);
        }
        if (!body.oem.empty()) {
            auto course = read_oem(body.oem, body.of_position);
            if (!course) return course.error();
            moving.position = *std::move(course);
        }
        if (!body.aem.empty()) {
            auto course = read_aem(body.aem, body.of_attitude);
            if (!course) return course.error();
            moving.attitude = *std::move(course);
        }
        return moving;
    }

    Status check_centres() const {
        const SampledCourse* first = nullptr;
        for (const SampledCourse* course : all()) {
            if (course->centre.empty()) continue;
            if (!first) first = course;
            if (course->centre != first->centre)
                return Error{fmt::format("CENTER_NAME = {}, expected {} as in {}", course->centre, first->centre,
                                         first->file),
                             course->file};
        }
        return Ok{};
    }
    /// The world's axes, which rest, against ICRF. LVLH at simulation time 0: z away from the centre, y along the
    /// orbital angular momentum.
    Status orient(const TrajectoryDescription& d) {
        Quat q_icrf_axes;
        if (d.axes == TrajectoryDescription::Axes::lvlh) {
            const auto state = at(*origin_, 0);
            if (!state) return state.error();
            const Vec3 z = normalized(vec3_of(state->first));
            const Vec3 y = normalized(cross(z, vec3_of(state->second)));
            q_icrf_axes = quat_from_columns(cross(y, z), y, z);
        }
        q_world_icrf_ = conjugate(q_icrf_axes * d.q_axes_world);
        return Ok{};
    }

    /// In world axes.
    Result<std::pair<Vec3, Vec3>> position(const MovingBody& moving, std::int64_t t_ns) const {
        std::pair<Vec3, Vec3> state;
        if (moving.position) {
            const auto found = at(*moving.position, t_ns);
            if (!found) return found.error();
            state = {vec3_of(found->first), vec3_of(found->second)};
            if (moving.position->in_world) return state;
        }
        if (origin_) {
            const auto origin = at(*origin_, t_ns);
            if (!origin) return origin.error();
            state.first = state.first - vec3_of(origin->first);
            state.second = state.second - vec3_of(origin->second);
        }
        return std::pair{q_world_icrf_ * state.first, q_world_icrf_ * state.second};
    }
    Result<std::pair<CourseValue, CourseValue>> at(const SampledCourse& course, std::int64_t t_ns) const {
        if (auto found = course.at(epoch_ns_ + t_ns)) return *std::move(found);
        return Error{
            fmt::format("has no data at {} s of simulation time, expected some", seconds(epoch_ns_ + t_ns)),
            course.file};
    }
    [[nodiscard]] double seconds(std::int64_t tai_ns) const {
        return 1e-9 * static_cast<double>(tai_ns - epoch_ns_);
    }
    [[nodiscard]] std::vector<const SampledCourse*> all() const {
        std::vector<const SampledCourse*> courses;
        if (origin_) courses.push_back(&*origin_);
        for (const MovingBody& body : bodies_)
            for (const auto* course : {&body.position, &body.attitude})
                if (*course) courses.push_back(&**course);
        return courses;
    }

    std::int64_t epoch_ns_ = 0;
    std::optional<SampledCourse> origin_{};
    Quat q_world_icrf_{};
    std::vector<MovingBody> bodies_{};
};

/// First and last time of the rows, in steps.
Result<std::pair<std::int64_t, std::int64_t>> steps_of(const TrajectoryDescription& d, const WorldCourses& courses,
                                                       std::int64_t step_ns) {
    const auto common = courses.common_time();
    const auto steps = [&](double s) { return std::llround(1e9 * s / static_cast<double>(step_ns)); };
    if (!common && !d.until_s) return Error{"no body moves, expected `until_s` in [trajectory]"};
    if (common && common->second < std::max<std::int64_t>(common->first, 0))
        return courses.out_of_time("no time after the epoch that all files have");
    const std::int64_t begin = common ? std::max<std::int64_t>((common->first + step_ns - 1) / step_ns, 0) : 0;
    const std::pair<std::int64_t, std::int64_t> range{d.from_s ? steps(*d.from_s) : begin,
                                                      d.until_s ? steps(*d.until_s) : common->second / step_ns};
    if (common && (range.first * step_ns < common->first || range.second * step_ns > common->second))
        return courses.out_of_time("from_s or until_s is outside of the files' time");
    if (range.second < range.first) return courses.out_of_time("no multiple of step_s that all files have");
    return range;
}

}  // namespace

Result<std::vector<TrajectoryRow>> read_trajectory_description(const std::string& path) {
    const auto description = read_description_of_trajectory(path);
    if (!description) return description.error();
    const auto courses = WorldCourses::read(*description);
    if (!courses) return courses.error();
    const std::int64_t step_ns = std::llround(1e9 * description->step_s);
    const auto steps = steps_of(*description, *courses, step_ns);
    if (!steps) return Error{steps.error().what, path};
    const double count =
        static_cast<double>(steps->second - steps->first + 1) * static_cast<double>(courses->bodies().size());
    if (count > kRowsMax)
        return Error{fmt::format("{:.3g} poses, expected at most {:.3g}: a larger step_s, or from_s and until_s",
                                 count, kRowsMax),
                     path};
    std::vector<TrajectoryRow> rows;
    rows.reserve(static_cast<std::size_t>(count));
    for (std::int64_t k = steps->first; k <= steps->second; ++k)
        for (const MovingBody& body : courses->bodies()) {
            auto motion = courses->motion(body, k * step_ns);
            if (!motion) return motion.error();
            rows.push_back({k * step_ns, body.body->name, *motion, body.body->line});
        }
    return rows;
}

}  // namespace narpa
