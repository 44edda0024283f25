/// drivers/device_kind.h - what the tables of buses, sinks and sources have in common: a text such as `uvc:3240`
/// names one row of its table. Openers, error messages, --help and `narpa check` use the rows.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace narpa {

/// What an output occupies: no two may have the same port, device or file. `narpa check` opens all but new files,
/// which it would empty: it tests whether they can be written.
enum class Destination : std::uint8_t {
    free,      ///< nothing, or the second one cannot be opened
    port,      ///< the text before a comma
    device,    ///< a device node or FIFO
    new_file,  ///< a file, which is made or emptied
    bus,       ///< the run's CAN bus, shared by any number; nothing is opened
};

struct DeviceKind {
    std::string_view prefix;                      ///< of its texts: "uvc:"; empty: `names` decides
    std::string_view form;                        ///< for error messages: "uvc:PORT"
    std::string_view help;                        ///< for --help: "uvc:[ADDRESS:]PORT (a USB camera over USB/IP)"
    bool (*names)(const std::string&) = nullptr;  ///< for a kind without a prefix
    /// Whether a text shows its kind where no option says what it is; null: all that it names do.
    bool (*evident)(const std::string&) = nullptr;
    Destination destination = Destination::free;

    [[nodiscard]] bool named_by(const std::string& text) const;
    [[nodiscard]] bool shown_by(const std::string& text) const;
    /// The text after the prefix.
    [[nodiscard]] std::string rest_of(const std::string& text) const { return text.substr(prefix.size()); }
    /// Equal for texts of one port or file; empty: it shares with others.
    [[nodiscard]] std::string place_of(const std::string& text) const;
};

/// Of sinks that are none.
[[nodiscard]] inline bool is_none(const std::string& text) {
    return text == "none";
}
/// "A, B, or C".
[[nodiscard]] std::string list_of(const std::vector<std::string_view>& words);
/// An Error unless the file, or the folders that a run would make for it, can be written.
[[nodiscard]] Status check_writable(const std::string& file);

/// One row or none. A table has the common part of its rows as base class.
template <class Row>
[[nodiscard]] const Row* find_kind(std::span<const Row> table, const std::string& text) {
    for (const Row& row : table)
        if (row.named_by(text)) return &row;
    return nullptr;
}
/// For error messages: "uvc:PORT, FILE.y4m, or none".
template <class Row>
[[nodiscard]] std::string forms_of(std::span<const Row> table) {
    std::vector<std::string_view> forms;
    for (const Row& row : table) forms.push_back(row.form);
    return list_of(forms);
}
/// For --help: "uvc:[ADDRESS:]PORT (a USB camera over USB/IP) | none".
template <class Row>
[[nodiscard]] std::string help_of(std::span<const Row> table) {
    std::string text;
    for (const Row& row : table) text.append(text.empty() ? "" : " | ").append(row.help);
    return text;
}

}  // namespace narpa
