#include "renderer/trajectory/trajectory_keys.h"

#include <fmt/format.h>

#include <algorithm>

#include "renderer/keys/toml_file.h"
#include "renderer/trajectory/trajectory_description.h"

namespace narpa {
namespace {

using Unit = std::pair<std::string_view, double>;
constexpr std::array<Unit, 7> kTimeUnits{
    {{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}, {"min", 60}, {"h", 3600}, {"day", 86400}}};
constexpr std::array<Unit, 2> kLengthUnits{{{"m", 1}, {"km", 1e3}}};
constexpr std::array<Unit, 2> kSpeedUnits{{{"m/s", 1}, {"km/s", 1e3}}};
constexpr std::array<std::pair<std::string_view, StateTable::Frame>, 3> kTableFrames{
    {{"world", StateTable::Frame::world},
     {"ICRF", StateTable::Frame::icrf},
     {"EME2000", StateTable::Frame::eme2000}}};
constexpr std::array<std::pair<std::string_view, bool>, 2> kOrders{{{"wxyz", true}, {"xyzw", false}}};
constexpr std::array<std::pair<std::string_view, bool>, 2> kTurns{
    {{"body_to_frame", true}, {"frame_to_body", false}}};
constexpr std::array<std::pair<std::string_view, TrajectoryDescription::Axes>, 2> kAxes{
    {{"ICRF", TrajectoryDescription::Axes::icrf}, {"LVLH", TrajectoryDescription::Axes::lvlh}}};
constexpr Range kSteps{.low = 1e-6, .high = 1e6}, kTimes{.low = -1e9, .high = 1e9};

constexpr TableKey kHeadRows[]{
    {"epoch", rows::date(), "UTC at simulation time 0"},
    {"step_s", rows::number(kSteps), "the step of the poses"},
    {"from_s", rows::number(kTimes)},
    {"until_s", rows::number(kTimes)},
};
constexpr TableKeys kHeadKeys{.rows = kHeadRows};
constexpr TableKey kInterpolationRows[]{
    {"interpolation", rows::choice<Interpolation::kMethods>()},
    {"degree", rows::integer(1, Interpolation::kDegreeMax)},
};
constexpr TableKeys kInterpolationKeys{.rows = kInterpolationRows};
constexpr TableKey kWorldRows[]{
    {"origin", rows::file()},
    {"axes", rows::choice<kAxes>()},
    {"attitude_wxyz", rows::attitude()},
};
constexpr TableKeys kWorldKeys{.rows = kWorldRows, .parts = {&kInterpolationKeys}};

constexpr std::string_view kNames = "names of columns";
constexpr TableKey kTimeRows[]{
    {"column", rows::text(), "the name of a column"},
    {"unit", rows::choice<kTimeUnits>()},
    {"system", rows::choice<kTimeSystems>()},
};
constexpr TableKeys kTimeKeys{.rows = kTimeRows};
constexpr TableKey kPositionRows[]{{"columns", rows::texts(), kNames},
                                   {"unit", rows::choice<kLengthUnits>(), "\"m\" or \"km\""}};
constexpr TableKeys kPositionKeys{.rows = kPositionRows};
constexpr TableKey kVelocityRows[]{{"columns", rows::texts(), kNames},
                                   {"unit", rows::choice<kSpeedUnits>(), "\"m/s\" or \"km/s\""}};
constexpr TableKeys kVelocityKeys{.rows = kVelocityRows};
constexpr TableKey kAttitudeRows[]{
    {"columns", rows::texts(), kNames},
    {"order", rows::choice<kOrders>(), "\"wxyz\" or \"xyzw\""},
    {"turns", rows::choice<kTurns>(), "\"body_to_frame\" or \"frame_to_body\""},
};
constexpr TableKeys kAttitudeKeys{.rows = kAttitudeRows};
constexpr TableKey kTableRows[]{
    {"file", rows::file(), "the name of a file"},
    {"frame", rows::choice<kTableFrames>(), "the axes of the states: \"world\", \"ICRF\" or \"EME2000\""},
    {"time", rows::table(kTimeKeys), "a table {column, unit} or {column, system}"},
    {"position", rows::table(kPositionKeys)},
    {"velocity", rows::table(kVelocityKeys)},
    {"attitude", rows::table(kAttitudeKeys)},
};
constexpr TableKeys kTableKeys{.rows = kTableRows};
constexpr TableKey kBodyRows[]{
    {"name", rows::text(), "the name of a body of the scene"},
    {"oem", rows::file()},
    {"aem", rows::file()},
    {"table", rows::table(kTableKeys)},
    {"at_centre", rows::boolean()},
    {"position_m", rows::vec3()},
    {"attitude_wxyz", rows::attitude()},
    {"attitude_interpolation", rows::choice<Interpolation::kMethods>()},
    {"attitude_degree", rows::integer(1, Interpolation::kDegreeMax)},
};
constexpr TableKeys kBodyKeys{.rows = kBodyRows, .parts = {&kInterpolationKeys}};
constexpr TableKey kFileRows[]{
    {"trajectory", rows::table(kHeadKeys), "a table [trajectory]"},
    {"world", rows::table(kWorldKeys)},
    {"body", rows::tables(kBodyKeys), "[[body]], one at least"},
};

std::optional<Interpolation> read_interpolation(TableReader& table, std::string_view key, std::string_view degree) {
    const auto method = table.choice(key, Interpolation::kMethods);
    const auto number = table.integer(degree);
    if (!method) {
        table.refuse(degree, fmt::format("belongs to `{}`", key));
        return std::nullopt;
    }
    Interpolation result{.method = *method};
    if (!number && result.method != Interpolation::Method::linear)
        table.fail(key, fmt::format("expected `{}`, too", degree));
    if (number) result.degree = static_cast<int>(*number);
    if (const std::string problem = result.problem(); number && !problem.empty()) table.fail(degree, problem);
    return result;
}

/// The columns' names, exactly as many.
template <std::size_t N>
void read_columns(TableReader& table, std::array<std::string, N>& columns) {
    const auto names = table.texts("columns");
    if (!names) return;
    if (names->size() != N) return table.fail("columns", fmt::format("expected {} names", N));
    std::ranges::copy(*names, columns.begin());
}

template <const auto& units>
std::optional<StateTable::Vectors> read_vectors(TableReader& parent, std::string_view key) {
    auto table = parent.table(key);
    if (!table) return std::nullopt;
    StateTable::Vectors vectors;
    read_columns(*table, vectors.columns);
    vectors.unit = table->choice("unit", units).value_or(1);
    table->finish();
    return vectors;
}

void read_time(TableReader& parent, StateTable::Time& time) {
    auto table = parent.table("time");
    if (!table) return;
    time.column = table->text("column").value_or("");
    const auto unit = table->choice("unit", kTimeUnits);
    time.system = table->choice("system", kTimeSystems);
    time.unit_s = unit.value_or(1);
    if (table->has("unit") == table->has("system"))
        table->fail("unit", "expected either `unit`, of the time since the epoch, or `system`, of calendar times");
    table->finish();
}

std::optional<StateTable::Attitudes> read_attitudes(TableReader& parent) {
    auto table = parent.table("attitude");
    if (!table) return std::nullopt;
    StateTable::Attitudes attitudes;
    read_columns(*table, attitudes.columns);
    attitudes.scalar_first = table->choice("order", kOrders).value_or(true);
    attitudes.body_to_frame = table->choice("turns", kTurns).value_or(true);
    table->finish();
    return attitudes;
}

std::optional<StateTable> read_table_of_states(TableReader& body, const std::string& path) {
    auto table = body.table("table");
    if (!table) return std::nullopt;
    StateTable states;
    states.file = beside(path, table->text("file").value_or(""));
    states.frame = table->choice("frame", kTableFrames).value_or(StateTable::Frame::world);
    read_time(*table, states.time);
    states.position = read_vectors<kLengthUnits>(*table, "position");
    states.velocity = read_vectors<kSpeedUnits>(*table, "velocity");
    states.attitude = read_attitudes(*table);
    if (!table->has("position") && !table->has("attitude"))
        table->fail("file", "expected `position`, `attitude` or both");
    if (!table->has("position")) table->refuse("velocity", "expected `position`, too");
    table->finish();
    return states;
}

/// Checks that exactly one of these is there.
void expect_one(TableReader& table, std::string_view what, std::initializer_list<bool> there,
                std::string_view choices) {
    if (std::ranges::count(there, true) == 1) return;
    table.fail("name", fmt::format("expected one {}: {}", what, choices));
}

DescribedBody read_body_of_trajectory(TableReader& table, const std::string& path) {
    DescribedBody body;
    body.name = table.text("name").value_or("");
    body.line = table.place("name").line;
    if (const auto file = table.text("oem")) body.oem = beside(path, *file);
    if (const auto file = table.text("aem")) body.aem = beside(path, *file);
    body.table = read_table_of_states(table, path);
    body.at_centre = table.boolean("at_centre").value_or(false);
    table.read("position_m", body.position_m);
    table.read("attitude_wxyz", body.q_world_body);
    const bool table_has_position = body.table && body.table->position,
               table_has_attitude = body.table && body.table->attitude;
    expect_one(table, "position", {table.has("oem"), table_has_position, body.at_centre, table.has("position_m")},
               "`oem`, `table.position`, `at_centre = true` or `position_m`");
    expect_one(table, "attitude", {table.has("aem"), table_has_attitude, table.has("attitude_wxyz")},
               "`aem`, `table.attitude` or `attitude_wxyz`");
    body.of_position = read_interpolation(table, "interpolation", "degree");
    body.of_attitude = read_interpolation(table, "attitude_interpolation", "attitude_degree");
    using enum Interpolation::Method;
    if (table_has_position && !body.of_position)
        table.fail("table", "expected `interpolation` of the table's positions");
    if (table_has_attitude && !body.of_attitude)
        table.fail("table", "expected `attitude_interpolation` of the table's attitudes");
    if (table_has_position && !body.table->velocity && body.of_position && body.of_position->method == hermite)
        table.fail("interpolation", "HERMITE without velocities, expected `table.velocity`, or LAGRANGE or LINEAR");
    if (body.of_attitude && body.of_attitude->method == hermite && body.aem.empty())
        table.fail("attitude_interpolation", "HERMITE without derivatives, expected LAGRANGE or LINEAR");
    table.finish();
    return body;
}

void read_world(TableReader& root, const std::string& path, TrajectoryDescription& d) {
    auto table = root.table("world");
    if (!table) return;
    if (const auto file = table->text("origin")) d.origin = beside(path, *file);
    d.axes = table->choice("axes", kAxes).value_or(d.axes);
    table->read("attitude_wxyz", d.q_axes_world);
    d.of_origin = read_interpolation(*table, "interpolation", "degree");
    if (d.axes == TrajectoryDescription::Axes::lvlh && d.origin.empty())
        table->fail("axes", "LVLH is of the orbit of `origin`, expected an OEM there");
    table->finish();
}

void read_head(TableReader& root, TrajectoryDescription& d) {
    auto table = root.table("trajectory");
    if (!table) return;
    d.epoch_ns = tai_ns_of_utc(table->date("epoch").value_or(0));
    table->read("step_s", d.step_s);
    d.from_s = table->number("from_s");
    d.until_s = table->number("until_s");
    if (d.from_s && d.until_s && *d.until_s < *d.from_s) table->fail("until_s", "is before from_s");
    table->finish();
}

}  // namespace

constinit const TableKeys kTrajectoryFileKeys{.rows = kFileRows};

Result<TrajectoryDescription> read_description_of_trajectory(const std::string& path) {
    Problems problems(path);
    const auto file = TomlFile::read(path, "trajectory", kTrajectoryFileKeys);
    if (!file) return file.error();
    TableReader root = file->root("the trajectory", problems, &kTrajectoryFileKeys);
    TrajectoryDescription d;
    read_head(root, d);
    read_world(root, path, d);
    for (TableReader& table : root.tables("body")) {
        d.bodies.push_back(read_body_of_trajectory(table, path));
        for (std::size_t i = 0; i + 1 < d.bodies.size(); ++i)
            if (d.bodies[i].name == d.bodies.back().name)
                problems.add({path, d.bodies.back().line, 1},
                             fmt::format("body \"{}\" a second time", d.bodies[i].name));
    }
    root.finish();
    if (!problems.none()) return problems.first();
    return d;
}

}  // namespace narpa
