/// renderer/mesh_reader/ply_file.h - the header of a PLY file (G. Turk, "The PLY Polygon File Format", 1994), and
/// the values behind it.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/text/text_cursor.h"
#include "renderer/assets/mapped_file.h"

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

/// Rows of an element in a binary file that all have the same size.
struct PlyRows {
    const char* bytes = nullptr;
    std::size_t count = 0, stride = 0;
    std::vector<std::size_t> offsets{};  ///< of the properties in a row; of a list, that of its length
    bool swap = false;                   ///< the bytes of each number

    /// A number at `offset` in row i.
    [[nodiscard]] double value(std::size_t i, std::size_t offset, const PlyType& type) const {
        const char* const at = bytes + i * stride + offset;
        return swap ? swapped(at, type) : type.read(at);
    }

private:
    static double swapped(const char* at, const PlyType& type);
};

class PlyFile {
public:
    static Result<PlyFile> open(const std::string& path);

    std::vector<PlyElement> elements{};
    std::vector<std::string> textures{};  ///< of comments "TextureFile"

    /// The values of the next element; `index` counts from 0.
    Status read(const PlyElement& element, std::size_t index, PlyValues& values);
    /// The next rows of an element, as if each of its lists had `list_length` values: as many as the file has bytes
    /// for, but none where it is text, or where the element has several lists. `skip` steps over some of them.
    [[nodiscard]] PlyRows rows(const PlyElement& element, std::size_t list_length) const;
    void skip(const PlyRows& rows, std::size_t count) { at_ += count * rows.stride; }
    /// An error at the line of the newest element, where the file is text.
    [[nodiscard]] Error error(std::string what) const;

private:
    PlyFile(MappedFile file, const std::string& path)
        : path_(path), file_(std::move(file)), bytes_(file_.bytes()) {}
    Status read_header(std::string text);
    Status read_header_line(TextCursor& line, std::string_view keyword);
    bool next(const PlyType& type, double& x);

    std::string path_;
    MappedFile file_;
    std::string_view bytes_;
    std::unique_ptr<TextCursor> text_{};  ///< null: binary
    std::size_t at_ = 0;
    bool is_ascii_ = false, swap_ = false;
};

}  // namespace narpa
