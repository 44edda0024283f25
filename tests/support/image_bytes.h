/// tests/support/image_bytes.h - TIFF and PNG files written sample by sample, with what they declare.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace narpa::test {

/// The code that is stored for a pixel.
using Code = std::function<std::uint64_t(int x, int y, int band)>;

inline std::string bytes_of(std::uint64_t value, int count, bool is_big_endian) {
    std::string out;
    for (int i = 0; i < count; ++i)
        out += static_cast<char>(value >> 8 * (is_big_endian ? count - 1 - i : i) & 0xff);
    return out;
}

/// TIFF 6.0 and BigTIFF, uncompressed.
struct TiffFile {
    int width = 2, height = 1, bands = 1, bits = 8, format = 1, photometric = 1, planes = 1, orientation = 1;
    int rows_per_strip = 1, tile = 0;  ///< 0: strips
    bool is_bigtiff = false, is_big_endian = false;
    std::vector<int> extra{};
    std::vector<std::uint64_t> palette{};

    struct Entry {
        int tag, type;  ///< type: 3 for 2 bytes, 4 for 4, 16 for 8
        std::vector<std::uint64_t> values;
    };

    [[nodiscard]] std::string packed_row(int y, int x0, int count, int first_band, int last_band,
                                         const Code& code) const {
        std::string row;
        int free_bits = 0;
        for (int x = x0; x < x0 + count; ++x)
            for (int band = first_band; band < last_band; ++band) {
                const std::uint64_t v = x < width && y < height ? code(x, y, band) : 0;
                if (bits % 8 == 0) {
                    row += bytes_of(v, bits / 8, is_big_endian);
                    continue;
                }
                for (int b = bits - 1; b >= 0; --b) {
                    if (free_bits == 0) row += '\0', free_bits = 8;
                    --free_bits;
                    if ((v >> b & 1) != 0) row.back() = static_cast<char>(row.back() | 1 << free_bits);
                }
            }
        return row;
    }

    [[nodiscard]] std::string bytes(const Code& code) const {
        std::vector<std::string> parts;
        for (int plane = 0; plane < (planes == 2 ? bands : 1); ++plane) {
            const int first = planes == 2 ? plane : 0, last = planes == 2 ? plane + 1 : bands;
            for (int y = 0; y<height; y += tile> 0 ? tile : rows_per_strip)
                for (int x = 0; x < (tile > 0 ? width : 1); x += std::max(tile, 1)) {
                    std::string part;
                    for (int row = 0; row < (tile > 0 ? tile : std::min(rows_per_strip, height - y)); ++row)
                        part += packed_row(y + row, x, tile > 0 ? tile : width, first, last, code);
                    parts.push_back(part);
                }
        }
        const auto n = [](int v) { return static_cast<std::uint64_t>(v); };
        const auto each = [&](int v) { return std::vector<std::uint64_t>(static_cast<std::size_t>(bands), n(v)); };
        const int long_type = is_bigtiff ? 16 : 4;
        std::vector<std::uint64_t> sizes, offsets(parts.size());
        for (const std::string& part : parts) sizes.push_back(part.size());
        std::vector<Entry> entries{{256, 3, {n(width)}},
                                   {257, 3, {n(height)}},
                                   {258, 3, each(bits)},
                                   {259, 3, {1}},
                                   {262, 3, {n(photometric)}}};
        if (tile == 0) entries.push_back({273, long_type, offsets});
        entries.push_back({274, 3, {n(orientation)}});
        entries.push_back({277, 3, {n(bands)}});
        if (tile == 0) entries.push_back({278, 3, {n(rows_per_strip)}}), entries.push_back({279, long_type, sizes});
        entries.push_back({284, 3, {n(planes)}});
        if (!palette.empty()) entries.push_back({320, 3, palette});
        if (tile > 0)
            for (const Entry& e : {Entry{322, 3, {n(tile)}}, Entry{323, 3, {n(tile)}},
                                   Entry{324, long_type, offsets}, Entry{325, long_type, sizes}})
                entries.push_back(e);
        if (!extra.empty()) entries.push_back({338, 3, std::vector<std::uint64_t>(extra.begin(), extra.end())});
        entries.push_back({339, 3, each(format)});
        return with_directory(entries, parts);
    }

private:
    static int size_of(int type) { return type == 3 ? 2 : type == 4 ? 4 : 8; }

    /// Header, directory, values that do not fit into their entries, and the parts.
    [[nodiscard]] std::string with_directory(std::vector<Entry> entries,
                                             const std::vector<std::string>& parts) const {
        const auto number = [&](std::uint64_t v, int count) { return bytes_of(v, count, is_big_endian); };
        const std::size_t fits = is_bigtiff ? 8 : 4, header = is_bigtiff ? 16 : 8,
                          directory = (is_bigtiff ? 8 : 2) + entries.size() * (is_bigtiff ? 20 : 12) + fits;
        const auto length = [&](const Entry& e) {
            return e.values.size() * static_cast<std::size_t>(size_of(e.type));
        };
        std::size_t at = header + directory;
        for (const Entry& e : entries) at += length(e) > fits ? length(e) : 0;
        for (Entry& e : entries)
            if (e.tag == 273 || e.tag == 324)
                for (std::size_t i = 0; i < parts.size(); ++i) e.values[i] = at, at += parts[i].size();
        std::string out = is_big_endian ? "MM" : "II", values, body;
        out +=
            is_bigtiff ? number(43, 2) + number(8, 2) + number(0, 2) + number(16, 8) : number(42, 2) + number(8, 4);
        out += number(entries.size(), is_bigtiff ? 8 : 2);
        for (const Entry& e : entries) {
            std::string field;
            for (const std::uint64_t v : e.values) field += number(v, size_of(e.type));
            if (field.size() > fits) {
                const std::size_t place = header + directory + values.size();
                values += field;
                field = number(place, static_cast<int>(fits));
            }
            field.resize(fits, '\0');
            out += number(static_cast<std::uint64_t>(e.tag), 2) + number(static_cast<std::uint64_t>(e.type), 2) +
                   number(e.values.size(), is_bigtiff ? 8 : 4) + field;
        }
        out += number(0, static_cast<int>(fits)) + values;
        for (const std::string& part : parts) out += part;
        return out;
    }
};

/// PNG, annex D.
inline std::uint32_t crc_of(const std::string& bytes) {
    std::uint32_t crc = 0xffff'ffff;
    for (const char c : bytes) {
        crc ^= static_cast<std::uint8_t>(c);
        for (int i = 0; i < 8; ++i) crc = (crc & 1) != 0 ? 0xedb8'8320 ^ crc >> 1 : crc >> 1;
    }
    return ~crc;
}

inline std::string png_chunk(const std::string& name, const std::string& data) {
    return bytes_of(data.size(), 4, true) + name + data + bytes_of(crc_of(name + data), 4, true);
}

/// PNG of 8 bits whose samples, row by row, are indices of `palette`, three bytes for each entry. Stored, RFC 1950
/// and 1951.
inline std::string palette_png(int width, int height, const std::string& indices, const std::string& palette) {
    const auto n = [](int v) { return static_cast<std::uint64_t>(v); };
    std::string rows;
    for (int y = 0; y < height; ++y)
        rows += '\0' + indices.substr(static_cast<std::size_t>(y * width), static_cast<std::size_t>(width));
    std::uint32_t a = 1, b = 0;
    for (const char c : rows) a = (a + static_cast<std::uint8_t>(c)) % 65521, b = (b + a) % 65521;
    const std::string data = "\x78\x01\x01" + bytes_of(rows.size(), 2, false) +
                             bytes_of(~rows.size() & 0xffff, 2, false) + rows + bytes_of(b << 16 | a, 4, true);
    return "\x89PNG\r\n\x1a\n" +
           png_chunk("IHDR", bytes_of(n(width), 4, true) + bytes_of(n(height), 4, true) +
                                 std::string("\x08\x03\0\0\0", 5)) +
           png_chunk("PLTE", palette) + png_chunk("IDAT", data) + png_chunk("IEND", "");
}

}  // namespace narpa::test
