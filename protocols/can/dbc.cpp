#include "protocols/can/dbc.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstddef>
#include <set>
#include <string_view>
#include <vector>

namespace narpa {
namespace {

std::string symbol(std::string_view text) {
    std::string s(text);
    for (char& c : s)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    if (s.empty() || std::isdigit(static_cast<unsigned char>(s[0]))) s.insert(0, "_");
    return s;
}

/// Comments cannot hold quotes.
std::string without_quotes(std::string text) {
    std::ranges::replace(text, '"', '\'');
    return text;
}

/// Shortest decimal text that reads back as the same double.
std::string number(double value) {
    std::array<char, 32> text{};
    const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
    return {text.data(), end};
}

constexpr std::size_t kLongestName = 32;  // of DBC files; an attribute states longer ones

/// What the names of a body's messages begin with.
struct Prefix {
    std::string text{},
        full{};          ///< text: at most so long that names have kLongestName characters, and unlike others
    std::string note{};  ///< the body's name, if `text` is another; for comments
};

std::size_t longest_name_of_a_body(std::span<const SetLayout* const> messages) {
    std::size_t longest = 0;
    for (const SetLayout* m : messages) {
        if (m->instances != Instances::per_body) continue;
        longest = std::max(longest, m->name.size());
        for (const std::string_view frame : m->frames) longest = std::max(longest, frame.size());
    }
    return longest;
}

/// A prefix for each body. Bodies whose names need no change come first.
std::vector<Prefix> prefixes_of(std::span<const CanBody> bodies, std::size_t room, int cameras) {
    std::set<std::string> taken;
    for (int i = 0; i < cameras; ++i) taken.insert("Camera" + std::to_string(i));
    std::vector<Prefix> prefixes(bodies.size());
    for (const bool changes : {false, true})
        for (std::size_t i = 0; i < bodies.size(); ++i) {
            const std::string& name = bodies[i].name;
            Prefix& p = prefixes[i];
            const bool needs_none = symbol(name) == name && name.size() <= room && !taken.contains(name);
            if (!p.text.empty() || (!changes && !needs_none)) continue;
            p.full = symbol(name);
            p.text = p.full.substr(0, room);
            for (int k = 2; !taken.insert(p.text).second; ++k) {
                const std::string tail = "_" + std::to_string(k);
                p.text = p.full.substr(0, room - tail.size()) + tail;
            }
            if (p.full.size() <= room) p.full = p.text;
            if (p.text != name) p.note = " Body: " + without_quotes(name) + ".";
        }
    return prefixes;
}

/// The DBC is written in sections; each message adds to all of them.
struct Sections {
    std::string messages{}, comments{}, attributes{}, long_names{}, values{};

    void begin_message(std::uint32_t id, const Prefix& prefix, std::string_view name, std::size_t bytes,
                       std::string_view sender, std::string_view comment, bool fd) {
        id_ = std::to_string(id);
        messages += "BO_ " + id_ + " " + prefix.text + std::string(name) + ": " + std::to_string(bytes) + " " +
                    std::string(sender) + "\n";
        comments += "CM_ BO_ " + id_ + " \"" + std::string(comment) + prefix.note + "\";\n";
        if (prefix.full.size() > prefix.text.size())
            long_names +=
                "BA_ \"SystemMessageLongSymbol\" BO_ " + id_ + " \"" + prefix.full + std::string(name) + "\";\n";
        attributes += "BA_ \"VFrameFormat\" BO_ " + id_ + (fd ? " 14" : " 0") + ";\n";
    }
    void signal(const Signal& s, const BitField& at, std::string_view receiver) {
        messages += " SG_ " + std::string(s.name) + " : " + std::to_string(at.start_bit) + "|" +
                    std::to_string(at.length) + "@1" + (s.is_signed ? "-" : "+") + " (" +
                    number(1.0 / s.steps_per_unit) + ",0) [" +
                    number(static_cast<double>(raw_min(s.is_signed, at.length)) / s.steps_per_unit) + "|" +
                    number(static_cast<double>(raw_max(s.is_signed, at.length)) / s.steps_per_unit) + "] \"" +
                    std::string(s.unit) + "\" " + std::string(receiver) + "\n";
        comments += "CM_ SG_ " + id_ + " " + std::string(s.name) + " \"" + std::string(s.comment) + "\";\n";
        if (s.choices.empty()) return;
        values += "VAL_ " + id_ + " " + std::string(s.name);
        for (const Choice& c : s.choices)
            values += " " + std::to_string(c.raw) + " \"" + std::string(c.name) + "\"";
        values += " ;\n";
    }
    void end_message() { messages += "\n"; }

private:
    std::string id_{};
};

void write_set(Sections& out, const SetLayout& layout, const Prefix& prefix, std::uint32_t which) {
    const std::uint32_t base_id = layout.base_id_of(which);
    const Route& route = layout.route;
    for (std::size_t frame = 0; frame < layout.frames.size(); ++frame) {
        out.begin_message(base_id + static_cast<std::uint32_t>(frame), prefix, layout.frames[frame], kClassicBytes,
                          route.sender, layout.comment, false);
        for (const Signal& s : layout.signals)
            if (s.classic.frame == frame) out.signal(s, s.classic, route.receiver);
        out.signal({"Counter", "", "Same in all frames of a set, +1 with every set, wraps"},
                   {0, 8 * kClassicCounterByte, 8}, route.receiver);
        out.signal({"Crc", "", "CRC-8/SAE-J1850 over identifier (2 bytes, low first) and bytes 0..6"},
                   {0, 8 * kClassicCrcByte, 8}, route.receiver);
        out.end_message();
    }
    if (layout.fd_counter_bit == 0) return;
    out.begin_message(base_id + kFdOffset, prefix, layout.name, kFdBytes, route.sender, layout.comment, true);
    for (const Signal& s : layout.signals) out.signal(s, s.fd, route.receiver);
    out.signal({"Counter", "", "+1 with every set, wraps"}, {0, layout.fd_counter_bit, 8}, route.receiver);
    out.signal({"Crc", "", "CRC-16/IBM-3740 over identifier (2 bytes, low first) and bytes 0..61"},
               {0, 8 * kFdCrcByte, 16}, route.receiver);
    out.end_message();
}

}  // namespace

std::string write_dbc(std::span<const CanBody> bodies, int cameras, std::span<const SetLayout* const> messages) {
    Sections out;
    std::vector<Prefix> prefixes =
        prefixes_of(bodies, kLongestName - 1 - longest_name_of_a_body(messages), cameras);
    for (Prefix& p : prefixes) p.text += "_", p.full += "_";
    for (const SetLayout* m : messages) {
        if (m->instances == Instances::one) write_set(out, *m, {}, 0);
        if (m->instances == Instances::per_body)
            for (std::size_t i = 0; i < bodies.size(); ++i) write_set(out, *m, prefixes[i], bodies[i].base_id);
        if (m->instances == Instances::per_camera)
            for (int i = 0; i < cameras; ++i)
                write_set(out, *m, {.text = "Camera" + std::to_string(i) + "_"}, static_cast<std::uint32_t>(i));
    }
    return "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: Commander narpa Navigation\n\n" + out.messages +
           "CM_ \"narpa on CAN. The most negative raw value of a signed signal means: not available.\";\n" +
           out.comments + "BA_DEF_ \"BusType\" STRING;\n" +
           (out.long_names.empty() ? "" : "BA_DEF_ BO_ \"SystemMessageLongSymbol\" STRING;\n") +
           "BA_DEF_ BO_ \"VFrameFormat\" ENUM "
           "\"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\",\"reserved\",\"reserved\",\"reserved\","
           "\"reserved\","
           "\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"StandardCAN_FD\","
           "\"ExtendedCAN_FD\";\nBA_DEF_DEF_ \"BusType\" \"CAN\";\n" +
           (out.long_names.empty() ? "" : "BA_DEF_DEF_ \"SystemMessageLongSymbol\" \"\";\n") +
           "BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n"
           "BA_ \"BusType\" \"CAN FD\";\n" +
           out.attributes + out.long_names + out.values;
}

}  // namespace narpa
