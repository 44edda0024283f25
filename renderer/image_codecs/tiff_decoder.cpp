#include "renderer/image_codecs/tiff_decoder.h"

#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

namespace narpa {
namespace {

constexpr std::uint64_t kLargestBuffer = std::uint64_t{1} << 30;  // of a row or tile

// libtiff's handlers have no pointer of the caller's in all versions.
thread_local std::string first_message;

void keep_message(const char* /*module*/, const char* format, va_list values) {
    if (!first_message.empty()) return;
    std::array<char, 200> text{};
    std::vsnprintf(text.data(), text.size(), format, values);
    first_message = text.data();
}

/// A file in memory, as libtiff reads it.
struct Memory {
    std::span<const std::uint8_t> bytes;
    std::uint64_t at = 0;

    static Memory& of(thandle_t handle) { return *static_cast<Memory*>(handle); }
    static tmsize_t read(thandle_t handle, void* out, tmsize_t count) {
        Memory& m = of(handle);
        const std::uint64_t left = m.bytes.size() - std::min<std::uint64_t>(m.at, m.bytes.size());
        const std::uint64_t n = std::min(left, static_cast<std::uint64_t>(count));
        if (n > 0) std::memcpy(out, m.bytes.data() + m.at, n);
        m.at += n;
        return static_cast<tmsize_t>(n);
    }
    static tmsize_t write(thandle_t, void*, tmsize_t) { return 0; }
    static toff_t seek(thandle_t handle, toff_t offset, int from) {
        Memory& m = of(handle);
        return m.at = offset + (from == SEEK_CUR ? m.at : from == SEEK_END ? m.bytes.size() : 0);
    }
    static int close(thandle_t) { return 0; }
    static toff_t size(thandle_t handle) { return of(handle).bytes.size(); }
};

struct Closer {
    void operator()(TIFF* file) const { TIFFClose(file); }
};

template <class T>
T field(TIFF* file, std::uint32_t tag, T otherwise) {
    T value{};
    return TIFFGetFieldDefaulted(file, tag, &value) == 1 ? value : otherwise;
}

/// What the file declares of its samples.
struct Layout {
    std::uint32_t width = 0, height = 0;
    std::uint16_t bits = 1, bands = 1, format = SAMPLEFORMAT_UINT, planes = PLANARCONFIG_CONTIG,
                  orientation = ORIENTATION_TOPLEFT;
    std::optional<std::uint16_t> photometric{};
    std::vector<std::uint16_t> extra{};  ///< the meanings of extra bands

    explicit Layout(TIFF* file)
        : width(field<std::uint32_t>(file, TIFFTAG_IMAGEWIDTH, 0)),
          height(field<std::uint32_t>(file, TIFFTAG_IMAGELENGTH, 0)),
          bits(field<std::uint16_t>(file, TIFFTAG_BITSPERSAMPLE, 1)),
          bands(field<std::uint16_t>(file, TIFFTAG_SAMPLESPERPIXEL, 1)),
          format(field<std::uint16_t>(file, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT)),
          planes(field<std::uint16_t>(file, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG)),
          orientation(field<std::uint16_t>(file, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT)) {
        std::uint16_t value = 0, count = 0, *meanings = nullptr;
        if (TIFFGetField(file, TIFFTAG_PHOTOMETRIC, &value) == 1) photometric = value;
        if (TIFFGetField(file, TIFFTAG_EXTRASAMPLES, &count, &meanings) == 1 && meanings != nullptr)
            extra.assign(meanings, meanings + count);
    }

    /// Photometric interpretations that libtiff converts.
    [[nodiscard]] bool is_converted() const {
        return photometric == PHOTOMETRIC_PALETTE || photometric == PHOTOMETRIC_YCBCR ||
               photometric == PHOTOMETRIC_SEPARATED || photometric == PHOTOMETRIC_CIELAB ||
               photometric == PHOTOMETRIC_ICCLAB;
    }
    [[nodiscard]] bool is_float() const { return format == SAMPLEFORMAT_IEEEFP; }
    [[nodiscard]] bool is_inverted() const { return photometric == PHOTOMETRIC_MINISWHITE; }
    [[nodiscard]] bool has_alpha() const {
        return !extra.empty() && (extra[0] == EXTRASAMPLE_ASSOCALPHA || extra[0] == EXTRASAMPLE_UNASSALPHA);
    }
    /// 3 also where grey is declared for three bands or more that are not alpha: GDAL writes colours so.
    [[nodiscard]] int colours() const {
        if (photometric == PHOTOMETRIC_RGB) return 3;
        return bands >= 3 && !(has_alpha() && extra.size() + 1u >= bands) ? 3 : 1;
    }
};

std::string name_of_photometric(std::uint16_t photometric) {
    switch (photometric) {
        case PHOTOMETRIC_PALETTE: return "palette";
        case PHOTOMETRIC_MASK: return "transparency mask";
        case PHOTOMETRIC_SEPARATED: return "separated (CMYK)";
        case PHOTOMETRIC_YCBCR: return "YCbCr";
        case PHOTOMETRIC_CIELAB: return "CIELab";
        case PHOTOMETRIC_ICCLAB: return "ICCLab";
        case PHOTOMETRIC_ITULAB: return "ITULab";
        case PHOTOMETRIC_LOGL: return "LogL";
        case PHOTOMETRIC_LOGLUV: return "LogLuv";
        case 32803: return "colour filter array";
        case 34892: return "linear raw";
        default: return std::to_string(photometric);
    }
}

/// Why samples of this layout are not read; empty where they are.
std::string refusal_of(const Layout& l) {
    const std::string bits = std::to_string(l.bits);
    const std::string help =
        "expected unsigned integers of 1 to 16 or 32 bits, or floats of 32 or 64: gdal_translate "
        "-ot UInt16 -scale converts it";
    if (l.format == SAMPLEFORMAT_INT) return "has signed integer samples of " + bits + " bits, " + help;
    if (l.format == SAMPLEFORMAT_COMPLEXINT || l.format == SAMPLEFORMAT_COMPLEXIEEEFP)
        return "has complex samples of " + bits + " bits, " + help;
    if (l.is_float() ? l.bits != 32 && l.bits != 64 : (l.bits < 1 || l.bits > 16) && l.bits != 32)
        return "has " + std::string(l.is_float() ? "floating-point" : "integer") + " samples of " + bits +
               " bits, " + help;
    if (l.photometric && l.is_converted()) {
        const bool is_palette = l.photometric == PHOTOMETRIC_PALETTE;
        if (l.is_float() || (is_palette ? l.bits > 8 : l.bits != 8))
            return "has the photometric interpretation " + name_of_photometric(*l.photometric) + " with " + bits +
                   (is_palette ? " bits, expected at most 8: gdal_translate -expand rgb converts it"
                               : " bits, expected 8, or RGB");
        return {};
    }
    if (l.photometric && *l.photometric > PHOTOMETRIC_RGB)
        return "has the photometric interpretation " + name_of_photometric(*l.photometric) +
               ", expected grey, RGB, palette, YCbCr, CMYK or CIELab";
    if (l.bands < l.colours())
        return "has " + std::to_string(l.bands) + " bands, expected 3, as its photometric interpretation is RGB";
    if (l.planes != PLANARCONFIG_CONTIG && l.planes != PLANARCONFIG_SEPARATE)
        return "has the planar configuration " + std::to_string(l.planes) + ", expected 1 or 2";
    return {};
}

Error damaged() {
    return Error{"cannot be decoded: it is damaged, or cut short" +
                 (first_message.empty() ? std::string() : ": " + first_message)};
}

/// Sample `i` of a row of samples that are packed from the highest bit (FillOrder 1, which libtiff makes of
/// others). The row has three bytes more than its samples.
std::uint32_t packed(const std::uint8_t* row, std::size_t i, int bits) {
    if (bits == 8) return row[i];
    if (bits == 16 || bits == 32) {
        std::uint32_t whole = 0;
        std::uint16_t half = 0;
        if (bits == 32) return std::memcpy(&whole, row + 4 * i, 4), whole;
        return std::memcpy(&half, row + 2 * i, 2), half;
    }
    const std::size_t at = i * static_cast<std::size_t>(bits);
    const std::uint8_t* b = row + at / 8;
    const std::uint32_t window = static_cast<std::uint32_t>(b[0] << 16 | b[1] << 8 | b[2]);
    return window >> (24 - static_cast<int>(at % 8) - bits) & ((1u << bits) - 1);
}

class SampleReader {
public:
    SampleReader(TIFF* file, const Layout& l, DecodedImage& out)
        : file_(file), l_(l), out_(out), colours_(static_cast<std::size_t>(out.channels)) {}

    Status read() {
        const bool is_tiled = TIFFIsTiled(file_) != 0;
        const std::uint64_t size = is_tiled ? TIFFTileSize64(file_) : TIFFScanlineSize64(file_);
        if (size == 0 || size > kLargestBuffer)
            return Error{"has rows or tiles of " + std::to_string(size) + " bytes, expected at most " +
                         std::to_string(kLargestBuffer)};
        buffer_.resize(size + 3);
        const int planes = l_.planes == PLANARCONFIG_SEPARATE ? out_.channels : 1;
        for (int plane = 0; plane < planes; ++plane)
            if (!(is_tiled ? read_tiles(plane) : read_rows(plane))) return damaged();
        return Ok{};
    }

private:
    bool read_rows(int plane) {
        for (std::uint32_t y = 0; y < l_.height; ++y) {
            if (TIFFReadScanline(file_, buffer_.data(), y, static_cast<std::uint16_t>(plane)) < 0) return false;
            keep(buffer_.data(), 0, y, l_.width, plane);
        }
        return true;
    }
    bool read_tiles(int plane) {
        const auto width = field<std::uint32_t>(file_, TIFFTAG_TILEWIDTH, 0),
                   height = field<std::uint32_t>(file_, TIFFTAG_TILELENGTH, 0);
        const auto row_bytes = static_cast<std::size_t>(TIFFTileRowSize64(file_));
        if (width == 0 || height == 0 || row_bytes * height > buffer_.size()) return false;
        for (std::uint32_t y = 0; y < l_.height; y += std::min(height, l_.height - y))
            for (std::uint32_t x = 0; x < l_.width; x += std::min(width, l_.width - x)) {
                if (TIFFReadTile(file_, buffer_.data(), x, y, 0, static_cast<std::uint16_t>(plane)) < 0)
                    return false;
                for (std::uint32_t row = 0; row < std::min(height, l_.height - y); ++row)
                    keep(buffer_.data() + row * row_bytes, x, y + row, std::min(width, l_.width - x), plane);
            }
        return true;
    }

    /// Takes `count` pixels of a decoded row to their place, which is allocated once a row has been decoded.
    void keep(const std::uint8_t* row, std::size_t x, std::size_t y, std::size_t count, int plane) {
        const std::size_t all = std::size_t{l_.width} * l_.height * colours_;
        const bool is_planar = l_.planes == PLANARCONFIG_SEPARATE;
        const std::size_t stride = is_planar ? 1 : l_.bands, step = is_planar ? 1 : colours_;
        const std::size_t first = is_planar ? static_cast<std::size_t>(plane) : 0,
                          to = (y * l_.width + x) * colours_;
        if (l_.is_float()) {
            out_.floats.resize(all);
            for (std::size_t i = 0; i < count; ++i)
                for (std::size_t c = 0; c < step; ++c)
                    out_.floats[to + i * colours_ + first + c] = real(row, i * stride + c);
            return;
        }
        out_.samples.resize(all);
        const int shift = l_.bits == 32 ? 16 : 0;
        for (std::size_t i = 0; i < count; ++i)
            for (std::size_t c = 0; c < step; ++c) {
                const std::uint32_t v = packed(row, i * stride + c, l_.bits) >> shift;
                out_.samples[to + i * colours_ + first + c] =
                    static_cast<std::uint16_t>(l_.is_inverted() ? out_.largest - v : v);
            }
    }
    [[nodiscard]] float real(const std::uint8_t* row, std::size_t i) const {
        float single = 0;
        double twice = 0;
        if (l_.bits == 64)
            std::memcpy(&twice, row + 8 * i, 8), single = static_cast<float>(twice);
        else
            std::memcpy(&single, row + 4 * i, 4);
        return l_.is_inverted() ? 1 - single : single;
    }

    TIFF* file_;
    const Layout& l_;
    DecodedImage& out_;
    std::size_t colours_;
    std::vector<std::uint8_t> buffer_;
};

/// By libtiff's conversion to 8 bits a colour.
Status read_converted(TIFF* file, const Layout& l, DecodedImage& out) {
    std::array<char, 1024> why{};
    if (TIFFRGBAImageOK(file, why.data()) == 0) return Error{std::string("cannot be decoded: ") + why.data()};
    TIFFSetField(file, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);  // turned below, as all are
    const std::size_t pixels = std::size_t{l.width} * l.height;
    const auto raster = std::make_unique_for_overwrite<std::uint32_t[]>(pixels);
    if (TIFFReadRGBAImageOriented(file, l.width, l.height, raster.get(), ORIENTATION_TOPLEFT, 1) == 0)
        return damaged();
    out.samples.resize(3 * pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
        out.samples[3 * i] = static_cast<std::uint16_t>(TIFFGetR(raster[i]));
        out.samples[3 * i + 1] = static_cast<std::uint16_t>(TIFFGetG(raster[i]));
        out.samples[3 * i + 2] = static_cast<std::uint16_t>(TIFFGetB(raster[i]));
    }
    return Ok{};
}

/// `of`: samples as stored, whose first row and column are where TIFF 6.0's Orientation says.
template <class Sample>
void turn(std::uint16_t orientation, std::size_t width, std::size_t height, std::size_t channels,
          std::vector<Sample>& of) {
    const bool transposed = orientation >= ORIENTATION_LEFTTOP;
    const bool from_right = orientation == ORIENTATION_TOPRIGHT || orientation == ORIENTATION_BOTRIGHT ||
                            orientation == ORIENTATION_RIGHTTOP || orientation == ORIENTATION_RIGHTBOT;
    const bool from_bottom = orientation == ORIENTATION_BOTRIGHT || orientation == ORIENTATION_BOTLEFT ||
                             orientation == ORIENTATION_RIGHTBOT || orientation == ORIENTATION_LEFTBOT;
    const std::size_t new_width = transposed ? height : width, new_height = transposed ? width : height;
    const std::vector<Sample> stored = of;
    for (std::size_t row = 0; row < height; ++row)
        for (std::size_t column = 0; column < width; ++column) {
            std::size_t x = transposed ? row : column, y = transposed ? column : row;
            if (from_right) x = new_width - 1 - x;
            if (from_bottom) y = new_height - 1 - y;
            std::copy_n(stored.begin() + static_cast<std::ptrdiff_t>((row * width + column) * channels), channels,
                        of.begin() + static_cast<std::ptrdiff_t>((y * new_width + x) * channels));
        }
}

/// Images other than the first, without overviews and masks; counted up to a hundred.
int other_images(TIFF* file) {
    int others = 0;
    for (int i = 0; i < 100 && TIFFReadDirectory(file) == 1; ++i)
        others +=
            (field<std::uint32_t>(file, TIFFTAG_SUBFILETYPE, 0) & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0;
    return others;
}

void note_declarations(TIFF* file, const Layout& l, DecodedImage& out) {
    const auto note = [&](std::string what) { out.unused.push_back(std::move(what)); };
    std::uint32_t size = 0;
    void* profile = nullptr;
    if (TIFFGetField(file, TIFFTAG_ICCPROFILE, &size, &profile) == 1)
        out.icc_profile.assign(static_cast<const char*>(profile), size);
    std::uint16_t *red = nullptr, *green = nullptr, *blue = nullptr;
    if (TIFFGetField(file, TIFFTAG_TRANSFERFUNCTION, &red, &green, &blue) == 1)
        note("its TransferFunction is not used");
    float* primaries = nullptr;
    if (TIFFGetField(file, TIFFTAG_PRIMARYCHROMATICITIES, &primaries) == 1)
        note("its PrimaryChromaticities are not used");
    std::uint16_t most = 0;
    if (!l.is_float() && TIFFGetField(file, TIFFTAG_MAXSAMPLEVALUE, &most) == 1 && most < out.largest)
        note("its MaxSampleValue of " + std::to_string(most) + " is not used: " + std::to_string(out.largest) +
             " is read as 1");
    if (!l.photometric) note("it has no photometric interpretation, and black is taken for 0");
    if (l.photometric == PHOTOMETRIC_SEPARATED) note("its inks (CMYK) are converted without a profile");
    if (l.is_converted()) return;
    if (l.photometric && l.photometric != PHOTOMETRIC_RGB && out.channels == 3)
        note("its photometric interpretation is grey, with " + std::to_string(l.bands) +
             " bands: the first three are read as red, green and blue");
    if (const int extra = l.bands - out.channels - l.has_alpha(); extra > 0)
        note("the last " + std::to_string(extra) + " of its bands are not used");
    if (!l.extra.empty() && l.extra[0] == EXTRASAMPLE_ASSOCALPHA)
        note("its colours are multiplied by alpha, and stay so");
}

}  // namespace

Result<DecodedImage> decode_tiff(std::span<const std::uint8_t> bytes) {
    TIFFSetErrorHandler(keep_message);
    TIFFSetWarningHandler(nullptr);
    first_message.clear();
    Memory memory{bytes};
    const std::unique_ptr<TIFF, Closer> file(TIFFClientOpen("image", "rm", &memory, Memory::read, Memory::write,
                                                            Memory::seek, Memory::close, Memory::size, nullptr,
                                                            nullptr));
    if (!file) return damaged();
    const Layout l(file.get());
    if (l.width == 0 || l.height == 0) return damaged();
    if (const std::string refusal = refusal_of(l); !refusal.empty()) return Error{refusal};
    DecodedImage out{.channels = l.is_converted() ? 3 : l.colours(),
                     .has_alpha = !l.is_converted() && l.has_alpha()};
    out.largest = l.is_converted() ? 255 : l.is_float() || l.bits >= 16 ? 65535 : (1u << l.bits) - 1;
    const Status read =
        l.is_converted() ? read_converted(file.get(), l, out) : SampleReader(file.get(), l, out).read();
    if (!read) return read.error();
    const bool transposed = l.orientation >= ORIENTATION_LEFTTOP && l.orientation <= ORIENTATION_LEFTBOT;
    if (l.orientation > ORIENTATION_TOPLEFT && l.orientation <= ORIENTATION_LEFTBOT) {
        const auto channels = static_cast<std::size_t>(out.channels);
        if (!out.samples.empty()) turn(l.orientation, l.width, l.height, channels, out.samples);
        if (!out.floats.empty()) turn(l.orientation, l.width, l.height, channels, out.floats);
    }
    out.width = static_cast<int>(transposed ? l.height : l.width);
    out.height = static_cast<int>(transposed ? l.width : l.height);
    note_declarations(file.get(), l, out);
    if (const int others = other_images(file.get()); others > 0)
        out.unused.push_back("the first of its " + std::to_string(others + 1) + " images is used");
    return out;
}

}  // namespace narpa
