/// emulator/sinks.h - what all kinds of sensors do with their sinks.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"
#include "emulator/world.h"

namespace narpa {

template <class Sink>
using Sinks = std::vector<std::unique_ptr<Sink>>;

/// Opens the sinks of sensor `index`, in the order in which they were given. `kept`: those of an earlier run, by
/// the name of their sensor, which go on.
template <class Sink>
Result<Sinks<Sink>> open_sinks(const std::vector<std::pair<std::string, std::string>>& outputs, std::size_t index,
                               const auto& sensors, std::string_view kind, const std::string& file, auto& kept,
                               const auto& open) {
    if (auto found = kept.find(sensors[index].name); found != kept.end()) return std::move(found->second);
    Sinks<Sink> sinks;
    for (const auto& [name, spec] : outputs) {
        auto named = sensor_named(sensors, name, kind, file);
        if (!named) return named.error();
        if (*named != index) continue;
        Result<std::unique_ptr<Sink>> sink = open(spec);
        if (!sink) return sink.error();
        sinks.push_back(*std::move(sink));
    }
    return sinks;
}

/// Flushes the sinks. Returns the first file that could not be written.
template <class Sink>
Status finish_all(const Sinks<Sink>& sinks) {
    Status first = Ok{};
    for (const auto& sink : sinks) {
        sink->flush();
        if (first) first = sink->failure();
    }
    return first;
}

template <class Sink>
[[nodiscard]] std::vector<std::string> descriptions(const Sinks<Sink>& sinks) {
    std::vector<std::string> texts;
    for (const auto& sink : sinks) texts.push_back(sink->description());
    return texts;
}

}  // namespace narpa
