#include "renderer/mesh_reader/ply_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <utility>

#include "base/file_bytes.h"
#include "renderer/mesh_reader/stored_number.h"

namespace narpa {
namespace {

constexpr std::array kTypes{PlyType{"char", "int8", 1, 255, stored_number<std::int8_t>},
                            PlyType{"uchar", "uint8", 1, 255, stored_number<std::uint8_t>},
                            PlyType{"short", "int16", 2, 255, stored_number<std::int16_t>},
                            PlyType{"ushort", "uint16", 2, 65535, stored_number<std::uint16_t>},
                            PlyType{"int", "int32", 4, 255, stored_number<std::int32_t>},
                            PlyType{"uint", "uint32", 4, 255, stored_number<std::uint32_t>},
                            PlyType{"float", "float32", 4, 1, stored_number<float>},
                            PlyType{"double", "float64", 8, 1, stored_number<double>}};

const PlyType* type_named(std::string_view name) {
    const auto found =
        std::ranges::find_if(kTypes, [&](const PlyType& t) { return t.name == name || t.other_name == name; });
    return found == kTypes.end() ? nullptr : &*found;
}

constexpr std::array<std::string_view, 6> kKeywords{"format",  "comment",  "obj_info",
                                                    "element", "property", "end_header"};
constexpr std::string_view kEnd = "end_header";

}  // namespace

int PlyElement::find(std::initializer_list<std::string_view> names) const {
    for (const std::string_view wanted : names)
        for (std::size_t i = 0; i < properties.size(); ++i)
            if (properties[i].name == wanted) return static_cast<int>(i);
    return -1;
}

Result<PlyFile> PlyFile::open(const std::string& path) {
    Result<MappedFile> mapped = MappedFile::open(path);
    if (!mapped) return mapped.error();
    PlyFile file(*std::move(mapped), path);
    std::size_t end = std::min(file.bytes_.find("\nend_header"), file.bytes_.find("\rend_header"));
    if (end == std::string::npos || !file.bytes_.starts_with("ply"))
        return Error{.what = "no \"end_header\" line, expected a PLY header", .file = path};
    if (Status read = file.read_header(std::string(file.bytes_.substr(0, end))); !read) return read.error();
    // A binary body begins behind a line end as that of the first line.
    end = file.bytes_.find_first_of("\r\n", end + 1 + kEnd.size());
    const bool has_two = file.bytes_.find("\r\n") == file.bytes_.find_first_of("\r\n");
    file.at_ =
        end == std::string::npos ? file.bytes_.size() : std::min(file.bytes_.size(), end + (has_two ? 2 : 1));
    if (file.is_ascii_) {
        file.text_ = std::make_unique<TextCursor>(std::string(file.bytes_), path, kKeywords);
        while (file.text_->next_line() && file.text_->token() != kEnd) {
        }
    }
    return file;
}

Status PlyFile::read_header(std::string text) {
    TextCursor lines(std::move(text), path_, kKeywords);
    while (lines.next_line())
        if (Status read = read_header_line(lines, lines.token()); !read) return read;
    return Ok{};
}

Status PlyFile::read_header_line(TextCursor& line, std::string_view keyword) {
    if (keyword == "format") {
        const std::string_view format = line.token();
        is_ascii_ = format == "ascii";
        swap_ =
            format == (std::endian::native == std::endian::little ? "binary_big_endian" : "binary_little_endian");
        if (!is_ascii_ && format != "binary_big_endian" && format != "binary_little_endian")
            return line.error(
                format, fmt::format("\"{}\", expected ascii, binary_little_endian or binary_big_endian", format));
    } else if (keyword == "comment" && line.token() == "TextureFile") {
        textures.emplace_back(line.rest());
    } else if (keyword == "element") {
        PlyElement element{.name = std::string(line.token()), .properties = {}};
        const std::string_view count = line.token();
        const std::optional<double> number = number_from(count);
        if (!number || !(*number >= 0 && *number <= static_cast<double>(bytes_.size())))
            return line.error(count,
                              fmt::format("\"{}\" is not a number of elements that this file can hold", count));
        element.count = *number;
        elements.push_back(std::move(element));
    } else if (keyword == "property" && !elements.empty()) {
        std::string_view type = line.token();
        PlyProperty property;
        if (type == "list") {
            property.count_type = type_named(line.token());
            type = line.token();
        }
        const bool is_list = property.count_type != nullptr;
        property.type = type_named(type);
        property.name = line.token();
        if (property.type == nullptr || property.name.empty() || (is_list && property.count_type->largest == 1))
            return line.error(type, "expected a property with one of PLY's types, such as float, and a name");
        elements.back().properties.push_back(std::move(property));
    }
    return Ok{};
}

bool PlyFile::next(const PlyType& type, double& x) {
    if (text_ != nullptr) {
        const std::optional<double> number = number_from(text_->token());
        return number && (x = *number, true);
    }
    if (type.size > bytes_.size() - at_) return false;
    std::array<char, 8> value{};
    std::copy_n(bytes_.data() + at_, type.size, value.begin());
    if (swap_) std::reverse(value.begin(), value.begin() + static_cast<std::ptrdiff_t>(type.size));
    at_ += type.size;
    x = type.read(value.data());
    return true;
}

PlyRows PlyFile::rows(const PlyElement& element, std::size_t list_length) const {
    PlyRows rows{.bytes = bytes_.data() + at_, .swap = swap_};
    std::size_t lists = 0;
    for (const PlyProperty& p : element.properties) {
        rows.offsets.push_back(rows.stride);
        rows.stride += p.count_type == nullptr ? p.type->size : p.count_type->size + list_length * p.type->size;
        lists += p.count_type != nullptr;
    }
    if (is_ascii_ || lists > 1 || rows.stride == 0) return rows;
    rows.count = std::min(static_cast<std::size_t>(element.count), (bytes_.size() - at_) / rows.stride);
    return rows;
}

double PlyRows::swapped(const char* at, const PlyType& type) {
    std::array<char, 8> value{};
    std::reverse_copy(at, at + type.size, value.begin());
    return type.read(value.data());
}

Status PlyFile::read(const PlyElement& element, std::size_t index, PlyValues& values) {
    const auto missing = [&] {
        return error(fmt::format("expected \"{}\" {} of {}, with the values of its properties", element.name,
                                 index + 1, element.count));
    };
    values.resize(element.properties.size());
    if (text_ != nullptr && !element.properties.empty()) {
        bool is_blank = true;
        while (is_blank) {
            if (!text_->next_line()) return missing();
            is_blank = text_->at_line_end();
        }
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
        const PlyProperty& property = element.properties[i];
        double count = 1;
        if (property.count_type != nullptr && !next(*property.count_type, count)) return missing();
        values[i].clear();
        for (double k = 0; k < count; ++k) {
            double x = 0;
            if (!next(*property.type, x)) return missing();
            values[i].push_back(x);
        }
    }
    return Ok{};
}

Error PlyFile::error(std::string what) const {
    if (text_ != nullptr) return text_->error({}, std::move(what));
    return Error{.what = std::move(what), .file = path_};
}

}  // namespace narpa
