#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/file_bytes.h"
#include "base/text_cursor.h"
#include "renderer/mesh_reader/assimp_reader.h"

namespace narpa {
namespace {

struct PlyElement {
    std::string name;
    double count = 0;
    std::vector<bool> is_list;  ///< of each property
};

struct PlyHeader {
    bool ascii = false;
    std::vector<PlyElement> elements;
};

Result<PlyHeader> read_header(const std::string& path, const std::string& text, std::size_t bytes) {
    PlyHeader header;
    TextCursor lines(text, path);
    while (lines.next_line()) {
        const std::string_view keyword = lines.token();
        if (keyword == "format") {
            header.ascii = lines.token() == "ascii";
        } else if (keyword == "element") {
            PlyElement element;
            element.name = lines.token();
            const std::string_view count = lines.token();
            const std::optional<double> number = number_from(count);
            if (!number || !(*number >= 0 && *number <= static_cast<double>(bytes)))
                return lines.error(
                    count, fmt::format("\"{}\" is not a number of elements that this file can hold", count));
            element.count = *number;
            header.elements.push_back(std::move(element));
        } else if (keyword == "property" && !header.elements.empty()) {
            header.elements.back().is_list.push_back(lines.token() == "list");
        }
    }
    return header;
}

/// Whether the next line that is not empty has the element's values.
bool has_values(TextCursor& lines, const PlyElement& element) {
    std::string_view value;
    while (value.empty() && lines.next_line()) value = lines.token();
    for (const bool is_list : element.is_list) {
        if (value.empty()) return false;
        const std::optional<double> items = is_list ? number_from(value) : 0;
        if (!items) return false;
        for (double i = 0; i < *items; ++i)
            if (lines.token().empty()) return false;
        value = lines.token();
    }
    return true;
}

}  // namespace

Status check_ply(const std::string& path) {
    const Result<std::string> bytes = read_file(path);
    if (!bytes) return bytes.error();
    const std::size_t end = std::min(bytes->find("\nend_header\n"), bytes->find("\nend_header\r"));
    if (end == bytes->npos) return Error{.what = "no \"end_header\" line, expected a PLY header", .file = path};
    const auto header = read_header(path, bytes->substr(0, end), bytes->size());
    if (!header) return header.error();
    if (!header->ascii) return Ok{};
    TextCursor lines(*bytes, path);
    const auto header_lines =
        std::count(bytes->begin(), bytes->begin() + static_cast<std::ptrdiff_t>(end), '\n') + 2;
    for (std::ptrdiff_t i = 0; i < header_lines; ++i) lines.next_line();
    for (const PlyElement& element : header->elements)
        for (double i = 0; i < element.count; ++i) {
            if (has_values(lines, element)) continue;
            return lines.error({}, fmt::format("expected \"{}\" {} of {}, with the values of its properties",
                                               element.name, i + 1, element.count));
        }
    return Ok{};
}

}  // namespace narpa
