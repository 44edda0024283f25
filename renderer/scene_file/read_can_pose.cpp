#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "protocols/can/pose_map.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr std::array<std::string_view, 2> kAttitudeSenses{"body_to_world", "world_to_body"};
constexpr TableKey kCanPoseRows[]{
    {"dbc", rows::file(), "the DBC file of the bus"},
    {"position", rows::texts(), "three signals, [\"MESSAGE.SIGNAL\", ...]"},
    {"attitude_wxyz", rows::texts(), "four signals, [\"MESSAGE.SIGNAL\", ...]"},
    {"velocity", rows::texts()},
    {"rate", rows::texts()},
    {"time", rows::text()},
    {"attitude", rows::choice<kAttitudeSenses>()},
};
constexpr std::uintmax_t kMostDbcBytes = 64u << 20;

/// The signals that a table names, out of the messages of a DBC file.
class SignalFinder {
public:
    SignalFinder(TableReader& table, const std::vector<DbcMessage>& all, PoseMap& map, SceneReading& reading)
        : table_(table), all_(all), map_(map), reading_(reading) {}

    template <std::size_t N>
    void find(std::string_view key, PoseQuantity quantity, std::array<MappedNumber, N>& out) {
        const auto names = table_.texts(key);
        if (!names) return;
        if (names->size() != N)
            return table_.fail(key, fmt::format("has {} signals, expected {}", names->size(), N));
        for (std::size_t i = 0; i < N; ++i) find(key, (*names)[i], quantity, out[i]);
    }
    void find(std::string_view key, const std::string& name, PoseQuantity quantity, MappedNumber& out) {
        const std::size_t dot = name.find('.');
        const auto message = std::ranges::find(all_, name.substr(0, dot), &DbcMessage::name);
        if (dot == std::string::npos || message == all_.end())
            return table_.fail(key,
                               fmt::format("\"{}\": expected MESSAGE.SIGNAL with a message of the DBC file", name));
        const auto signal = std::ranges::find(message->signals, name.substr(dot + 1), &DbcSignal::name);
        if (signal == message->signals.end())
            return table_.fail(key, fmt::format("\"{}\": the message has no such signal, expected one of {}", name,
                                                signals_of(*message)));
        if (signal->multiplexed)
            return table_.fail(key, fmt::format("\"{}\" is multiplexed, expected a signal of every frame", name));
        const auto to_si = si_factor(quantity, signal->unit);
        if (!to_si)
            return table_.fail(key, fmt::format("\"{}\" has the unit \"{}\", expected one of {}", name,
                                                signal->unit, units_of(quantity)));
        if (signal->unit.empty() && quantity != PoseQuantity::attitude)
            reading_.scene.warnings.push_back(
                fmt::format("{}: signal {} has no unit, taken for {}", table_.name(), name,
                            units_of(quantity).substr(0, units_of(quantity).find(','))));
        out = {index_of_message(*message), *signal, *to_si};
    }

private:
    static std::string signals_of(const DbcMessage& message) {
        std::string text;
        for (const DbcSignal& s : message.signals) text += (text.empty() ? "" : ", ") + s.name;
        return text;
    }
    std::size_t index_of_message(const DbcMessage& message) {
        const auto known = std::ranges::find(map_.messages, message.name, &DbcMessage::name);
        const auto index = static_cast<std::size_t>(known - map_.messages.begin());
        if (known == map_.messages.end()) map_.messages.push_back(message);
        return index;
    }

    TableReader& table_;
    const std::vector<DbcMessage>& all_;
    PoseMap& map_;
    SceneReading& reading_;
};

Result<std::vector<DbcMessage>> read_dbc_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary | std::ios::ate);
    if (!in) return Error{"cannot be read, expected a DBC file", path};
    if (static_cast<std::uintmax_t>(in.tellg()) > kMostDbcBytes)
        return Error{"has more than 64 MiB, expected a DBC file", path};
    in.seekg(0);
    const std::string text(std::istreambuf_iterator<char>(in), {});
    return read_dbc(text, path);
}

}  // namespace

constinit const TableKeys kCanPoseKeys{.rows = kCanPoseRows};

void read_can_pose(TableReader& body_table, Body& body, SceneReading& reading) {
    auto table = body_table.table("can_pose");
    if (!table) return;
    if (!body.can_id)
        body_table.fail("can_pose", "the body has no can_id, by which narpa's own messages name it: expected one");
    const auto file = table->text("dbc");
    if (!file) return table->finish();  // its absence has been noted
    const auto all = read_dbc_file((reading.folder / *file).string());
    if (!all) {
        reading.problems.add(table->place("dbc"), all.error());
        return table->finish();
    }
    auto map = std::make_shared<PoseMap>();
    SignalFinder finder(*table, *all, *map, reading);
    finder.find("position", PoseQuantity::position, map->position);
    finder.find("attitude_wxyz", PoseQuantity::attitude, map->attitude_wxyz);
    if (table->has("velocity")) finder.find("velocity", PoseQuantity::velocity, map->velocity.emplace());
    if (table->has("rate")) finder.find("rate", PoseQuantity::rate, map->rate.emplace());
    if (const auto time = table->text("time")) finder.find("time", *time, PoseQuantity::time, map->time.emplace());
    if (const auto sense = table->word("attitude")) map->world_to_body = *sense == 1;
    table->finish();
    body.can_map = std::move(map);
}

}  // namespace narpa
