#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/motion_between.h"
#include "renderer/scene_file/trajectory_bodies.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa {
namespace {

constexpr double kSecondsPerNs = 1e-9;

/// Interpolates between rows; constant velocity and rate before the first and after the last.
class TrajectoryCourse final : public Course {
public:
    void add(const TrajectoryRow& row) { samples_.push_back({row.t_ns, row.motion}); }

    [[nodiscard]] Motion at(double t_s) const noexcept override {
        const auto after = std::ranges::upper_bound(samples_, t_s, {}, &Sample::t_s);
        if (after == samples_.begin()) return extrapolate(after->motion, t_s - after->t_s());
        const Sample& before = *std::prev(after);
        const double since_s = t_s - before.t_s();
        if (after == samples_.end() || since_s == 0) return extrapolate(before.motion, since_s);
        const double h_s = static_cast<double>(after->t_ns - before.t_ns) * kSecondsPerNs;
        return motion_between(before.motion, after->motion, h_s, std::min(1.0, since_s / h_s));
    }

private:
    struct Sample {
        std::int64_t t_ns;
        Motion motion;
        [[nodiscard]] double t_s() const { return static_cast<double>(t_ns) * kSecondsPerNs; }
    };
    std::vector<Sample> samples_;  ///< at least one, by time
};

TrajectoryMotions motions_of(const std::vector<TrajectoryRow>& rows) {
    TrajectoryMotions motions;
    std::map<std::string, std::shared_ptr<TrajectoryCourse>, std::less<>> courses;
    for (const TrajectoryRow& row : rows) {
        std::shared_ptr<TrajectoryCourse>& course = courses[row.body];
        if (!course) course = std::make_shared<TrajectoryCourse>(), motions.names.push_back(row.body);
        course->add(row);
    }
    motions.courses.insert(courses.begin(), courses.end());
    return motions;
}

/// All bodies of the file whose names begin so.
std::vector<NamedCourse> read_group(TableReader& body, const std::string& prefix, TakenNames& taken,
                                    const TrajectoryMotions& motions) {
    std::vector<NamedCourse> group;
    for (const std::string& name : motions.names) {
        if (!name.starts_with(prefix)) continue;
        if (!is_name(name))
            body.fail("trajectory", fmt::format("has a body \"{}\", expected a name of 1 to 64 letters, digits, "
                                                "'_', '-' or '.'",
                                                name));
        else if (!taken.insert(name).second)
            body.fail("name", fmt::format("\"{}*\" stands for \"{}\", which is the name of another [[body]], "
                                          "expected each once",
                                          prefix, name));
        else
            group.push_back({name, motions.courses.find(name)->second});
    }
    if (group.empty())
        body.fail("trajectory",
                  fmt::format("has no body whose name begins with \"{}\", expected at least one", prefix));
    return group;
}

}  // namespace

const TrajectoryMotions* TrajectoryFiles::named_by(TableReader& body) {
    const auto file = body.text("trajectory");
    if (!file) return nullptr;
    const std::string path = (reading_.folder / *file).string();
    if (const auto known = files_.find(path); known != files_.end()) return &known->second;
    const auto rows = read_trajectory(path);
    if (!rows) {
        if (rows.error().line == 0)
            body.fail("trajectory", rows.error().text());
        else
            reading_.problems.add(body.place("trajectory"), rows.error());
        return nullptr;
    }
    return &files_.emplace(path, motions_of(*rows)).first->second;
}

std::vector<NamedCourse> read_named_courses(TableReader& body, TakenNames& taken, TrajectoryFiles& files) {
    if (!body.has("trajectory")) return {{read_name(body, taken)}};
    for (const char* key : {"position_m", "attitude_wxyz", "velocity_m_s", "rate_rad_s", "orbit", "rotation"})
        body.refuse(key, "follows from trajectory");
    body.refuse("can_id", "commands a pose, which follows from trajectory; expected one of the two");
    const TrajectoryMotions* const motions = files.named_by(body);
    if (const auto name = body.text("name"); name && name->ends_with('*')) {
        body.refuse("dem", "is for one body, expected one name");
        return motions ? read_group(body, name->substr(0, name->size() - 1), taken, *motions)
                       : std::vector<NamedCourse>{};
    }
    NamedCourse one{read_name(body, taken)};
    if (!motions) return {one};
    const auto course = motions->courses.find(one.name);
    if (course == motions->courses.end())
        body.fail("trajectory", fmt::format("has no body \"{}\", expected rows of this name", one.name));
    else
        one.course = course->second;
    return {one};
}

}  // namespace narpa
