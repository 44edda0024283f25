#include "renderer/assets/images/image_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace narpa {

namespace {

using Format = ImageHeader::Format;

/// The bytes of a file; those beyond its end read as 0.
class Bytes {
public:
    explicit Bytes(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

    [[nodiscard]] std::size_t size() const { return bytes_.size(); }
    std::uint8_t operator[](std::size_t at) const { return at < bytes_.size() ? bytes_[at] : std::uint8_t{0}; }
    [[nodiscard]] bool begins(std::size_t at, std::string_view text) const {
        return this->text(at, text.size()) == text;
    }
    [[nodiscard]] std::uint64_t little(std::size_t at, std::size_t count) const {
        std::uint64_t x = 0;
        for (std::size_t i = count; i-- > 0;) x = x << 8 | (*this)[at + i];
        return x;
    }
    [[nodiscard]] std::uint64_t big(std::size_t at, std::size_t count) const {
        std::uint64_t x = 0;
        for (std::size_t i = 0; i < count; ++i) x = x << 8 | (*this)[at + i];
        return x;
    }
    /// Shorter where the file ends.
    [[nodiscard]] Bytes part(std::size_t at, std::size_t count) const {
        at = std::min(at, size());
        return Bytes(bytes_.subspan(at, std::min(count, size() - at)));
    }
    [[nodiscard]] std::string_view text(std::size_t at, std::size_t count) const {
        const Bytes b = part(at, count);
        return {reinterpret_cast<const char*>(b.bytes_.data()), b.size()};
    }

private:
    std::span<const std::uint8_t> bytes_;
};

/// The numbers of a tag in the first directory of a TIFF file (TIFF 6.0, or BigTIFF), the largest where it occurs
/// more than once.
class TiffDirectory {
public:
    explicit TiffDirectory(const Bytes& b) : b_(b), is_little_(b[0] == 'I'), is_big_(number(2, 2) == 43) {
        first_ = is_big_ ? number(8, 8) : number(4, 4);
        // A file has no more entries than bytes.
        count_ = first_ < b.size() ? std::min<std::uint64_t>(number(first_, count_bytes()), b.size()) : 0;
    }
    [[nodiscard]] std::uint64_t largest(std::uint64_t tag) const {
        constexpr std::uint64_t kShort = 3, kLong8 = 16;
        std::uint64_t found = 0;
        for (std::uint64_t i = 0; i < count_; ++i) {
            const std::size_t entry = first_ + count_bytes() + (is_big_ ? 20 : 12) * i;
            if (entry >= b_.size()) break;
            if (number(entry, 2) != tag) continue;
            const std::uint64_t type = number(entry + 2, 2);
            const std::size_t size = type == kShort ? 2 : type == kLong8 && is_big_ ? 8 : 4;
            found = std::max(found, number(entry + (is_big_ ? 12 : 8), size));
        }
        return found;
    }

private:
    [[nodiscard]] std::uint64_t number(std::size_t at, std::size_t count) const {
        return is_little_ ? b_.little(at, count) : b_.big(at, count);
    }
    [[nodiscard]] std::size_t count_bytes() const { return is_big_ ? 8 : 2; }

    Bytes b_;
    bool is_little_, is_big_;
    std::uint64_t first_ = 0, count_ = 0;
};

bool begins_as_tiff(const Bytes& b) {
    for (const char* magic : {"II*\0", "MM\0*", "II+\0", "MM\0+"})
        if (b.begins(0, std::string_view(magic, 4))) return true;
    return false;
}

/// Notes an orientation that is declared in Exif and not applied. `exif`: from its TIFF header.
void note_orientation(const Bytes& exif, ImageHeader& h) {
    constexpr std::uint64_t kOrientation = 274;
    if (!begins_as_tiff(exif)) return;
    if (const std::uint64_t turned = TiffDirectory(exif).largest(kOrientation); turned > 1 && turned <= 8)
        h.unused.push_back(fmt::format("its Exif orientation, {}, is not applied", turned));
}

void note_profile(std::string_view profile, ImageHeader& h) {
    if (is_srgb_profile(profile))
        h.transfer = {TransferCurve::Kind::srgb};
    else
        h.unused.emplace_back("its ICC profile is not used");
}

/// PNG, third edition, 11.3.
class PngChunks {
public:
    explicit PngChunks(ImageHeader& h) : h_(h) {}

    void read(const Bytes& b) {
        depth_ = b[24], colour_type_ = b[25];
        h_.has_alpha = (colour_type_ & 4) != 0, h_.is_grey = (colour_type_ & 2) == 0;
        for (std::size_t at = 8; at + 8 <= b.size() && !b.begins(at + 4, "IDAT") && !b.begins(at + 4, "IEND");) {
            const std::uint64_t length = b.big(at, 4);
            read_chunk(b.text(at + 4, 4), b.part(at + 8, length));
            at += 12 + length;
        }
        resolve_transfer();
    }

private:
    void read_chunk(std::string_view name, const Bytes& c) {
        if (name == "gAMA") gamma_ = static_cast<double>(c.big(0, 4)) / 1e5;
        if (name == "sRGB") is_srgb_ = true;
        if (name == "cHRM") read_primaries(c);
        if (name == "sBIT") read_significant_bits(c);
        if (name == "tRNS") h_.has_alpha = h_.has_alpha || colour_type_ != 0;
        if (name == "eXIf") note_orientation(c, h_);
        if (name == "acTL") h_.unused.emplace_back("its animation is not used, only the default image");
        if (name == "cICP") coding_ = c[1], has_coding_ = true;
        if (name == "iCCP") {
            const std::string_view text = c.text(0, 80);
            profile_ = text.substr(0, text.find('\0'));
            has_profile_ = true;
        }
    }
    void read_primaries(const Bytes& c) {
        constexpr std::array<int, 8> kSrgb{31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000};
        for (std::size_t i = 0; i < kSrgb.size(); ++i)
            if (std::abs(static_cast<double>(c.big(4 * i, 4)) - kSrgb[i]) > 300) are_primaries_other_ = true;
        are_primaries_srgb_ = !are_primaries_other_;
    }
    void read_significant_bits(const Bytes& c) {
        const bool is_colour = (colour_type_ & 2) != 0;
        for (std::size_t i = 0; i < 3; ++i) h_.significant_bits[i] = c[is_colour ? i : 0];
        const int bits = colour_type_ == 3 ? 8 : depth_;
        for (int& b : h_.significant_bits)
            if (b < 1 || b >= bits) b = 0;  // all of them, or not valid
        if (bits >= 8 || h_.significant_bits[0] == 0) return;
        h_.unused.push_back(
            fmt::format("its {} significant bits of {} are not used", h_.significant_bits[0], bits));
        h_.significant_bits = {};
    }
    /// By the order of precedence of 13.13: cICP, iCCP, sRGB, gAMA.
    void resolve_transfer() {
        using Kind = TransferCurve::Kind;
        constexpr double kSrgbGamma = 0.45455;
        if (has_coding_ && coding_ == 13) return void(h_.transfer = {Kind::srgb});
        if (has_coding_ && coding_ == 8) return void(h_.transfer = {Kind::power, 1});
        if (has_coding_)
            h_.unused.push_back(fmt::format("its transfer function {} of ITU-T H.273 (cICP) is not used", coding_));
        if (has_profile_ && is_srgb_profile(profile_)) return void(h_.transfer = {Kind::srgb});
        if (has_profile_) h_.unused.push_back(fmt::format("its ICC profile \"{}\" is not used", profile_));
        if (is_srgb_) return void(h_.transfer = {Kind::srgb});
        if (are_primaries_other_ && (colour_type_ & 2) != 0)
            h_.unused.emplace_back("its primaries (cHRM) are not used");
        if (!gamma_) return;
        // Programs that know no sRGB chunk write sRGB as this gamma with these primaries.
        if (are_primaries_srgb_ && std::abs(*gamma_ - kSrgbGamma) < 2e-5)
            h_.transfer = {Kind::srgb};
        else if (*gamma_ > 0.01 && *gamma_ < 100)
            h_.transfer = {Kind::power, 1 / *gamma_};
        else
            h_.unused.push_back(fmt::format("its gamma (gAMA) of {:g} is not used", *gamma_));
    }

    ImageHeader& h_;
    int depth_ = 0, colour_type_ = 0, coding_ = 0;
    std::optional<double> gamma_;
    bool is_srgb_ = false, are_primaries_srgb_ = false, are_primaries_other_ = false, has_coding_ = false,
         has_profile_ = false;
    std::string_view profile_;
};

void read_png(const Bytes& b, ImageHeader& h) {
    h.width = b.big(16, 4), h.height = b.big(20, 4);
    PngChunks(h).read(b);
}

/// ITU-T T.81, B.2.2: the first frame header.
void read_jpeg_frame(const Bytes& frame, std::uint8_t marker, bool is_adobe, ImageHeader& h) {
    h.height = frame.big(1, 2), h.width = frame.big(3, 2);
    if (marker == 0xc3 || (marker >= 0xc5 && marker <= 0xc7) || marker == 0xcb || marker >= 0xcd)
        h.refusal = "a lossless or hierarchical JPEG, expected a baseline or progressive one";
    else if (frame[0] != 8)
        h.refusal = fmt::format("a JPEG of {} bits a sample, expected 8", frame[0]);
    if (frame[5] == 4)
        h.unused.emplace_back(is_adobe ? "its inks (CMYK) are converted without a profile"
                                       : "it has four components without Adobe's marker: read as inverted CMYK");
}

/// Bytes between segments are skipped, as decoders do.
void read_jpeg(const Bytes& b, ImageHeader& h) {
    bool is_adobe = false;
    std::string profile;
    for (std::size_t at = 2; at + 9 < b.size();) {
        if (b[at] != 0xff || b[at + 1] == 0xff || b[at + 1] == 0) {
            ++at;
            continue;
        }
        const std::uint8_t marker = b[at + 1];
        const bool has_no_length = marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8);
        const std::size_t length = has_no_length ? 0 : b.big(at + 2, 2);
        const Bytes segment = b.part(at + 4, length < 2 ? 0 : length - 2);
        const bool is_frame =
            marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
        if (is_frame) {
            read_jpeg_frame(b.part(at + 4, 6), marker, is_adobe, h);
            break;
        }
        if (marker == 0xe1 && segment.begins(0, std::string_view("Exif\0\0", 6)))
            note_orientation(segment.part(6, segment.size()), h);
        if (marker == 0xe2 && segment.begins(0, std::string_view("ICC_PROFILE\0", 12)))
            profile += segment.text(14, segment.size());
        if (marker == 0xee && segment.begins(0, "Adobe")) is_adobe = true;
        at += 2 + length;
    }
    if (!profile.empty()) note_profile(profile, h);
}

/// RFC 9649, section 2.
void read_webp(const Bytes& b, ImageHeader& h) {
    constexpr std::uint64_t k14Bits = 0x3fff, kAnimation = 2, kAlpha = 0x10;
    if (b.begins(12, "VP8L")) {
        const std::uint64_t bits = b.little(21, 4);
        h.width = 1 + (bits & k14Bits), h.height = 1 + (bits >> 14 & k14Bits), h.has_alpha = (bits >> 28 & 1) != 0;
    }
    if (b.begins(12, "VP8 ")) h.width = b.little(26, 2) & k14Bits, h.height = b.little(28, 2) & k14Bits;
    if (!b.begins(12, "VP8X")) return;
    h.width = 1 + b.little(24, 3), h.height = 1 + b.little(27, 3), h.has_alpha = (b[20] & kAlpha) != 0;
    if ((b[20] & kAnimation) != 0) h.refusal = "an animated WebP, expected one image";
    for (std::size_t at = 12; at + 8 <= b.size();) {
        const std::uint64_t length = b.little(at + 4, 4);
        const Bytes chunk = b.part(at + 8, length);
        if (b.begins(at, "ICCP")) note_profile(chunk.text(0, chunk.size()), h);
        if (b.begins(at, "EXIF"))
            note_orientation(chunk.begins(0, "Exif") ? chunk.part(6, chunk.size()) : chunk, h);
        at += 8 + length + length % 2;
    }
}

/// BITMAPCOREHEADER of 12 bytes, BITMAPINFOHEADER of 40, BITMAPV4HEADER of 108, BITMAPV5HEADER of 124.
void read_bmp(const Bytes& b, ImageHeader& h) {
    const std::uint64_t header = b.little(14, 4);
    if (header == 12) {
        h.width = b.little(18, 2), h.height = b.little(20, 2);
        return;
    }
    const std::uint64_t height = b.little(22, 4);  // two's complement: below 0 where rows come from the top
    h.width = b.little(18, 4), h.height = height > 0x7fff'ffffu ? 0x1'0000'0000u - height : height;
    const std::uint64_t bits = b.little(28, 2), coding = b.little(30, 4);
    if (coding == 3 || coding == 6) {
        const std::array<std::uint64_t, 3> masks{b.little(54, 4), b.little(58, 4), b.little(62, 4)};
        using Masks = std::array<std::uint64_t, 3>;
        const bool is_known = bits == 16
                                  ? masks == Masks{0x7c00, 0x3e0, 0x1f} || masks == Masks{0xf800, 0x7e0, 0x1f}
                                  : masks == Masks{0xff0000, 0xff00, 0xff};
        if (!is_known)
            h.refusal = fmt::format(
                "a BMP of {} bits with the masks {:#x}, {:#x}, {:#x}, expected 8 bits a colour "
                "in the order blue, green, red",
                bits, masks[0], masks[1], masks[2]);
    }
    if (coding == 4 || coding == 5) h.refusal = "a BMP that contains a JPEG or PNG, expected that file by itself";
    if (header < 108) return;
    const std::uint64_t space = b.little(70, 4), gamma = b.little(110, 4);
    if (space == 0x4d42'4544 || space == 0x4c49'4e4b) h.unused.emplace_back("its ICC profile is not used");
    if (space == 0 && gamma != 0)
        h.unused.push_back(fmt::format("its gamma of {:.4g} is not used", static_cast<double>(gamma) / 65536));
}

constexpr std::uint64_t kLargestSample = 65535;

void take_largest(std::uint64_t declared, const char* format, ImageHeader& h) {
    if (declared < 1 || declared > kLargestSample)
        h.refusal = fmt::format("a {} whose maxval is {}, expected 1 to {}", format, declared, kLargestSample);
    else
        h.largest = static_cast<std::uint32_t>(declared);
}

/// Netpbm's P1 to P6: numbers in decimal, comments from # to the end of the line.
void read_pnm(const Bytes& b, ImageHeader& h) {
    std::size_t at = 2;
    const auto number = [&] {
        constexpr std::uint64_t kLargest = 1u << 31;
        for (; at < b.size() && (b[at] < '0' || b[at] > '9'); ++at)
            if (b[at] == '#')
                while (at < b.size() && b[at] != '\n') ++at;
        std::uint64_t x = 0;
        for (; b[at] >= '0' && b[at] <= '9'; ++at) x = std::min<std::uint64_t>(10 * x + (b[at] - '0'), kLargest);
        return x;
    };
    h.width = number();
    h.height = number();
    const bool is_bitmap = b[1] == '1' || b[1] == '4';
    if (is_bitmap) return;
    take_largest(number(), "PNM", h);
    h.channels = b[1] == '3' || b[1] == '6' ? 3 : 1, h.is_text = b[1] <= '3', h.data = at + 1;
}

/// Netpbm's P7: a line for each key, up to ENDHDR.
void read_pam(const Bytes& b, ImageHeader& h) {
    const std::string_view text = b.text(0, b.size());
    std::uint64_t largest = 0, depth = 0;
    std::string_view kind;
    for (std::size_t at = 3; at < text.size();) {
        const std::size_t end = std::min(text.find('\n', at), text.size());
        std::string_view line = text.substr(at, end - at);
        at = end + 1;
        const std::string_view key = line.substr(0, line.find_first_of(" \t\r"));
        if (key == "ENDHDR") {
            h.data = at;
            break;
        }
        line.remove_prefix(std::min(line.size(), line.find_first_not_of(" \t", key.size())));
        while (!line.empty() && (line.back() == ' ' || line.back() == '\r' || line.back() == '\t'))
            line.remove_suffix(1);
        std::uint64_t number = 0;
        for (const char c : line)
            if (c >= '0' && c <= '9')
                number = std::min<std::uint64_t>(10 * number + static_cast<std::uint64_t>(c - '0'), 1u << 31);
        if (key == "WIDTH") h.width = number;
        if (key == "HEIGHT") h.height = number;
        if (key == "DEPTH") depth = number;
        if (key == "MAXVAL") largest = number;
        if (key == "TUPLTYPE") kind = line;
    }
    take_largest(largest, "PAM", h);
    h.has_alpha = kind.ends_with("_ALPHA") || (kind.empty() && depth % 2 == 0);
    h.channels = static_cast<int>(std::min<std::uint64_t>(depth, 5));
    const bool is_grey = kind.starts_with("BLACKANDWHITE") || kind.starts_with("GRAYSCALE"),
               is_rgb = kind.starts_with("RGB");
    const int expected = (is_rgb ? 3 : 1) + h.has_alpha;
    if (h.refusal.empty() && (h.data == 0 || depth < 1 || depth > 4 ||
                              (!kind.empty() && (!(is_grey || is_rgb) || h.channels != expected))))
        h.refusal = fmt::format(
            "a PAM of {} samples a pixel, \"{}\", expected GRAYSCALE, RGB or BLACKANDWHITE, also with _ALPHA",
            depth, kind);
}

std::optional<Format> format_of(const Bytes& b) {
    if (b.begins(0, "\x89PNG\r\n\x1a\n")) return Format::png;
    if (b.begins(0, "\xff\xd8\xff")) return Format::jpeg;
    if (begins_as_tiff(b)) return Format::tiff;
    if (b.begins(0, "RIFF") && b.begins(8, "WEBP")) return Format::webp;
    if (b.begins(0, "BM")) return Format::bmp;
    if (b[0] == 'P' && b[1] >= '1' && b[1] <= '6') return Format::pnm;
    if (b.begins(0, "P7\n")) return Format::pam;
    return std::nullopt;
}

}  // namespace

std::optional<ImageHeader> image_header(std::span<const std::uint8_t> bytes) {
    const Bytes b(bytes);
    const std::optional<Format> format = format_of(b);
    if (!format) return std::nullopt;
    ImageHeader h{.format = *format};
    switch (*format) {
        case Format::png: read_png(b, h); break;
        case Format::jpeg: read_jpeg(b, h); break;
        case Format::tiff: h.width = TiffDirectory(b).largest(256), h.height = TiffDirectory(b).largest(257); break;
        case Format::webp: read_webp(b, h); break;
        case Format::bmp: read_bmp(b, h); break;
        case Format::pnm: read_pnm(b, h); break;
        case Format::pam: read_pam(b, h); break;
    }
    return h.width > 0 && h.height > 0 ? std::optional(h) : std::nullopt;
}

std::string name_of_other_format(std::span<const std::uint8_t> bytes) {
    struct Known {
        std::size_t at;
        std::string_view magic;
        const char* name;
    };
    static constexpr Known kKnown[]{
        {0, "\x76\x2f\x31\x01", "OpenEXR"},
        {0, "PF\n", "PFM (32-bit float)"},
        {0, "Pf\n", "PFM (32-bit float)"},
        {0, "GIF8", "GIF"},
        {0, "8BPS", "Photoshop"},
        {0, "#?RADIANCE", "Radiance HDR"},
        {0, "#?RGBE", "Radiance HDR"},
        {0, "\xabKTX ", "KTX"},
        {0, "DDS ", "DDS"},
        {0, "SIMPLE  =", "FITS"},
        {0, "CDF", "netCDF"},
        {0, "\x89HDF", "HDF5"},
        {0, "PDS_VERSION_ID", "PDS3"},
        {0, "\xff\x4f\xff\x51", "JPEG 2000"},
        {4, "jP  \r\n", "JPEG 2000"},
        {4, "JXL \r\n", "JPEG XL"},
        {0, "\xff\x0a", "JPEG XL"},
        {4, "ftyp", "AVIF or HEIF"},
        {0, "\x59\xa6\x6a\x95", "Sun raster"},
        {0, "%PDF", "PDF"},
    };
    const Bytes b(bytes);
    for (const Known& k : kKnown)
        if (b.begins(k.at, k.magic)) return k.name;
    return {};
}

bool is_srgb_profile(std::string_view profile) {
    // The name is in ASCII, or, since version 4 of ICC.1, in UTF-16.
    std::string name;
    std::ranges::copy_if(profile, std::back_inserter(name), [](char c) { return c != '\0'; });
    const std::size_t at = name.find("sRGB");
    if (at == std::string::npos) return false;
    const std::string_view around = std::string_view(name).substr(at < 16 ? 0 : at - 16, 48);
    return around.find("inear") == around.npos && around.find("-g10") == around.npos;
}

}  // namespace narpa
