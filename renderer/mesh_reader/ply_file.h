/// renderer/mesh_reader/ply_file.h - the header of a PLY file (G. Turk, "The PLY Polygon File Format", 1994), and
/// the values behind it.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/text/text_cursor.h"

namespace narpa {

struct PlyType {
    std::string_view name, other_name;
    std::size_t size;
    double largest;  ///< code of full scale for colours; 1: they are fractions
    double (*read)(const char* bytes);
};

struct PlyProperty {
    std::string name;
    const PlyType* type = nullptr;
    const PlyType* count_type = nullptr;  ///< of a list; null: one value
};

struct PlyElement {
    std::string name;
    double count = 0;
    std::vector<PlyProperty> properties;

    /// Index of the property with one of these names; -1: none.
    [[nodiscard]] int find(std::initializer_list<std::string_view> names) const;
};

/// Values of an element, property by property.
using PlyValues = std::vector<std::vector<double>>;

class PlyFile {
public:
    static Result<PlyFile> open(const std::string& path);

    std::vector<PlyElement> elements{};
    std::vector<std::string> textures{};  ///< of comments "TextureFile"

    /// The values of the next element; `index` counts from 0.
    Status read(const PlyElement& element, std::size_t index, PlyValues& values);
    /// An error at the line of the newest element, where the file is text.
    [[nodiscard]] Error error(std::string what) const;

private:
    PlyFile(std::string bytes, const std::string& path) : path_(path), bytes_(std::move(bytes)) {}
    Status read_header(std::string text);
    Status read_header_line(TextCursor& line, std::string_view keyword);
    bool next(const PlyType& type, double& x);

    std::string path_, bytes_;
    std::unique_ptr<TextCursor> text_{};  ///< null: binary
    std::size_t at_ = 0;
    bool is_ascii_ = false, swap_ = false;
};

}  // namespace narpa
