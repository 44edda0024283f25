// STL: text, or binary with the colours of two dialects, VisCAM's and Materialise Magics'.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <optional>

#include "base/text/text_cursor.h"
#include "renderer/assets/mapped_file.h"
#include "renderer/assets/meshes/mesh_readers.h"
#include "renderer/mesh_reader/mesh_reader.h"
#include "renderer/scene/for_parts.h"

namespace narpa {
namespace {

constexpr std::size_t kHeader = 80, kFacet = 50;

std::string lower_case(std::string_view word) {
    std::string out(word);
    std::ranges::transform(out, out.begin(),
                           [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
    return out;
}

/// A facet of a polygon with one normal.
void add_facet(TriangleSoup& soup, const std::vector<Vec3>& corners, const Vec3f& normal) {
    const auto first = static_cast<std::uint32_t>(soup.positions.size()),
               own_normal = static_cast<std::uint32_t>(soup.normals.size());
    soup.positions.insert(soup.positions.end(), corners.begin(), corners.end());
    soup.normals.push_back(normal);
    for (const auto& t : triangulate(corners)) {
        TriangleSoup::Triangle out{.corners = {}};
        for (std::size_t k = 0; k < 3; ++k) out.corners[k] = {.position = first + t[k], .normal = own_normal};
        soup.triangles.push_back(out);
    }
}

/// Keywords in capitals or small letters.
class TextStl {
public:
    TextStl(std::string text, const std::string& path) : in_(std::move(text), path), path_(path) {}

    MeshMessage read() {
        while (!error_ && in_.next_line())
            for (std::string_view word = in_.token(); !error_ && !word.empty(); word = in_.token()) read_word(word);
        if (!error_ && in_facet_) error_ = in_.error({}, "the file ends within a facet");
        if (error_) return {.error = error_->what, .line = error_->line, .column = error_->column};
        if (!unused_.empty())
            soup_.warnings.push_back(fmt::format("{}: words that are not used: {}", path_, unused_));
        return {.soup = std::move(soup_), .materials = {grey_material()}};
    }

private:
    void read_word(std::string_view word) {
        const std::string keyword = lower_case(word);
        if (keyword == "solid" || keyword == "endsolid") {
            in_.rest();  // its name
        } else if (keyword == "facet") {
            in_facet_ = true, normal_ = {};
            corners_.clear();
        } else if (keyword == "normal") {
            if (const auto n = three_numbers()) normal_ = vec_cast<float>(*n);
        } else if (keyword == "vertex") {
            if (const auto v = three_numbers()) corners_.push_back(*v);
        } else if (keyword == "endfacet") {
            finish_facet(word);
        } else if (keyword != "outer" && keyword != "loop" && keyword != "endloop") {
            note_unused(keyword);
        }
    }

    void note_unused(const std::string& keyword) {
        if (unused_.find(keyword) == std::string::npos && unused_.size() < 80)
            unused_ += (unused_.empty() ? "" : ", ") + keyword.substr(0, 20);
    }

    std::optional<Vec3> three_numbers() {
        Vec3 out;
        for (int k = 0; k < 3; ++k) {
            const std::string_view token = in_.token();
            const std::optional<double> x = number_from(token);
            if (!x) {
                error_ = in_.error(token, fmt::format("\"{}\" where a number was expected", token));
                return std::nullopt;
            }
            out[k] = *x;
        }
        return out;
    }

    void finish_facet(std::string_view word) {
        if (corners_.size() < 3 || corners_.size() > kMaxCorners)
            error_ = in_.error(word, fmt::format("a facet of {} vertices, expected 3", corners_.size()));
        else
            add_facet(soup_, corners_, normal_);
        in_facet_ = false;
    }

    TextCursor in_;
    const std::string& path_;
    TriangleSoup soup_;
    std::vector<Vec3> corners_;
    Vec3f normal_{};
    bool in_facet_ = false;
    std::string unused_;
    std::optional<Error> error_;
};

class BinaryStl {
public:
    BinaryStl(std::string_view bytes, const std::string& path)
        : bytes_(bytes),
          path_(path),
          count_(word_at(kHeader)),
          color_at_(bytes.substr(0, kHeader).find("COLOR=")) {}

    MeshMessage read() {
        const bool is_magics = color_at_ != std::string::npos && color_at_ + 10 <= kHeader;
        PlainMaterial material = grey_material();
        if (is_magics) {
            material.numbers.diffuse = colour_of_bytes(color_at_ + 6);
            material.numbers.is_grey_by_default = true;  // a facet's own colour replaces it
        }
        if (bytes_.substr(0, kHeader).find("MATERIAL=") != std::string::npos)
            warn("MATERIAL= of its header is not used");
        std::size_t other = 0;
        soup_.positions.resize(3 * count_);
        soup_.normals.resize(count_);
        soup_.triangles.position.resize(count_);
        soup_.triangles.normal.resize(count_);
        for_parts(count_, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) read_facet(i);
        });
        for (std::size_t i = 0; i < count_; ++i) {
            const std::size_t at = kHeader + 4 + i * kFacet;
            const auto attribute = static_cast<std::uint16_t>(byte_at(at + 48) | byte_at(at + 49) << 8);
            if (const bool marked = (attribute & 0x8000) != 0; marked != is_magics)
                for (std::size_t k = 0, colour = colour_number(attribute, is_magics); k < 3; ++k)
                    soup_.triangles.set(soup_.triangles.colour, i, k, static_cast<std::uint32_t>(colour));
            else if (!is_magics && attribute != 0)
                ++other;
        }
        if (other > 0) warn(fmt::format("attributes of {} facets are no colours and are not used", other));
        if (const std::size_t end = kHeader + 4 + count_ * kFacet; bytes_.size() > end)
            warn(fmt::format("{} bytes behind its last facet are not used", bytes_.size() - end));
        return {.soup = std::move(soup_), .materials = {std::move(material)}};
    }

private:
    void read_facet(std::size_t i) {
        const std::size_t at = kHeader + 4 + i * kFacet;
        soup_.normals[i] = vector_at(at);
        soup_.triangles.normal[i].fill(static_cast<std::uint32_t>(i));
        for (std::size_t k = 0; k < 3; ++k) {
            soup_.positions[3 * i + k] = vec_cast<double>(vector_at(at + 12 + 12 * k));
            soup_.triangles.position[i][k] = static_cast<std::uint32_t>(3 * i + k);
        }
    }
    void warn(std::string_view what) { soup_.warnings.push_back(fmt::format("{}: {}", path_, what)); }
    [[nodiscard]] unsigned byte_at(std::size_t at) const { return static_cast<unsigned char>(bytes_[at]); }
    [[nodiscard]] std::uint32_t word_at(std::size_t at) const {
        return byte_at(at) | byte_at(at + 1) << 8 | byte_at(at + 2) << 16 | byte_at(at + 3) << 24;
    }
    [[nodiscard]] Vec3f vector_at(std::size_t at) const {
        return {std::bit_cast<float>(word_at(at)), std::bit_cast<float>(word_at(at + 4)),
                std::bit_cast<float>(word_at(at + 8))};
    }
    [[nodiscard]] Rgb colour_of_bytes(std::size_t at) const {
        return linear_colour({static_cast<float>(byte_at(at)) / 255, static_cast<float>(byte_at(at + 1)) / 255,
                              static_cast<float>(byte_at(at + 2)) / 255});
    }

    /// Five bits a band in sRGB: VisCAM's with blue in the lowest, Magics' with red.
    std::uint32_t colour_number(std::uint16_t attribute, bool red_is_lowest) {
        const auto part = [&](unsigned shift) { return static_cast<float>(attribute >> shift & 31) / 31; };
        const Rgb codes = red_is_lowest ? Rgb{part(0), part(5), part(10)} : Rgb{part(10), part(5), part(0)};
        soup_.colours.push_back(linear_colour(codes));
        return static_cast<std::uint32_t>(soup_.colours.size() - 1);
    }

    std::string_view bytes_;
    const std::string& path_;
    std::size_t count_, color_at_;
    TriangleSoup soup_;
};

}  // namespace

MeshMessage read_stl(const std::string& path) {
    const Result<MappedFile> file = MappedFile::open(path);
    if (!file) return {.error = file.error().what};
    const std::string_view bytes = file->bytes();
    std::size_t count = 0;
    for (std::size_t i = 4; i-- > 0 && bytes.size() >= kHeader + 4;)
        count = count << 8 | static_cast<unsigned char>(bytes[kHeader + i]);
    const std::size_t size = kHeader + 4 + count * kFacet;
    if (bytes.size() >= kHeader + 4 && bytes.size() == size) return BinaryStl(bytes, path).read();
    const std::string start = plain_lines(std::string(bytes.substr(0, 1024)));
    const std::size_t first = start.find_first_not_of(" \t\n");
    if (first != std::string::npos && lower_case(std::string_view(start).substr(first, 5)) == "solid")
        return TextStl(std::string(bytes), path).read();
    if (bytes.size() < kHeader + 4 || bytes.size() < size)
        return {.error = fmt::format("neither STL text (solid ...) nor whole binary STL: {} bytes, expected {}",
                                     bytes.size(), size)};
    return BinaryStl(bytes, path).read();
}

}  // namespace narpa
