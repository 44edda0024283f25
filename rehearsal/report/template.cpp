#include "rehearsal/report/template.h"

#include <fmt/format.h>

#include <cassert>
#include <nlohmann/json.hpp>
#include <vector>

namespace narpa::rehearsal {

namespace {

using nlohmann::json;
/// Values of the open sections, the innermost last.
using Sections = std::vector<const json*>;

const json* find(const Sections& sections, std::string_view name) {
    if (name == ".") return sections.back();
    const std::size_t dot = name.find('.');
    for (auto s = sections.rbegin(); s != sections.rend(); ++s) {
        if (!(*s)->is_object()) continue;
        if (const auto at = (*s)->find(name); at != (*s)->end()) return &*at;
        if (dot == std::string_view::npos) continue;
        if (const auto at = (*s)->find(name.substr(0, dot)); at != (*s)->end())
            return find({&*at}, name.substr(dot + 1));
    }
    return nullptr;
}

std::string value_text(const json* value, std::string_view format) {
    if (!value || value->is_null()) return "";
    if (!format.empty()) return fmt::format(fmt::runtime(fmt::format("{{:{}}}", format)), value->get<double>());
    return escape(value->is_string() ? value->get_ref<const std::string&>() : value->dump());
}

/// Appends the text up to the end of the innermost section; returns what follows it.
std::string_view fill(std::string_view text, Sections& sections, std::string& out) {
    for (;;) {
        const std::size_t begin = text.find("{{"), end = text.find("}}", begin);
        out += text.substr(0, begin);
        if (begin == std::string_view::npos) return {};
        assert(end != std::string_view::npos && "a tag of a template has no end");
        const std::string_view tag = text.substr(begin + 2, end - begin - 2), name = tag.substr(1);
        text.remove_prefix(end + 2);
        if (tag.starts_with('/')) return text;
        if (tag.starts_with('>')) {
            fill(template_text(name), sections, out);
        } else if (tag.starts_with('#') || tag.starts_with('^')) {
            const json* const value = find(sections, name);
            const bool shown = value && *value != false && *value != "" && !value->empty();
            std::vector<const json*> each;
            if (tag.starts_with('^') && !shown) each.push_back(sections.back());
            if (tag.starts_with('#') && shown && !value->is_array()) each.push_back(value);
            if (tag.starts_with('#') && shown && value->is_array())
                for (const json& element : *value) each.push_back(&element);
            const std::string_view inner = text;
            std::string unused;
            if (each.empty()) text = fill(inner, sections, unused);
            for (const json* const element : each) {
                sections.push_back(element);
                text = fill(inner, sections, out);
                sections.pop_back();
            }
        } else {
            const std::size_t colon = std::min(tag.find(':'), tag.size());
            out += value_text(find(sections, tag.substr(0, colon)), tag.substr(std::min(colon + 1, tag.size())));
        }
    }
}

}  // namespace

std::string filled(std::string_view text, const json& data) {
    Sections sections{&data};
    std::string out;
    fill(text, sections, out);
    return out;
}

std::string escape(std::string_view text) {
    std::string out;
    for (const char c : text) switch (c) {
            case '&': out += "&amp;"; break;
            case '<': out += "&lt;"; break;
            case '>': out += "&gt;"; break;
            case '"': out += "&quot;"; break;
            case '\'': out += "&#39;"; break;
            default:
                if (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t')
                    out += "\xEF\xBF\xBD";
                else
                    out += c;
        }
    return out;
}

}  // namespace narpa::rehearsal
