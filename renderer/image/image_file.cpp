#include "renderer/image/image_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "base/file_bytes.h"
#include "renderer/assets/images/image_codecs.h"
#include "renderer/assets/images/image_reader.h"

namespace narpa {
namespace {

Error cannot_write(const std::string& path, const std::string& why) {
    const bool forbidden = errno == EACCES || errno == EPERM || errno == EROFS;
    return Error{"cannot write: " + why, path, 0, 0, forbidden ? ErrorKind::missing : ErrorKind::bad_input};
}

Status write_to_standard_output(const std::string& head, const void* data, std::size_t size) {
    errno = 0;
    const bool all = std::fwrite(head.data(), 1, head.size(), stdout) == head.size() &&
                     std::fwrite(data, 1, size, stdout) == size && std::fflush(stdout) == 0;
    if (!all) return Error{std::string("cannot be written: ") + std::strerror(errno), "standard output"};
    return Ok{};
}

Status write_bytes(const std::string& path, const std::string& head, const void* data, std::size_t size) {
    if (path == kStandardOutput) return write_to_standard_output(head, data, size);
    errno = 0;
    std::ofstream file(path, std::ios::binary);
    file.write(head.data(), static_cast<std::streamsize>(head.size()));
    file.write(static_cast<const char*>(data), static_cast<std::streamsize>(size));
    file.close();
    if (!file) return cannot_write(path, errno != 0 ? std::strerror(errno) : "the disk did not take it all");
    return Ok{};
}

/// `kind`: "PF" colour or "Pf" grey. `pixels`: row by row from the top.
template <class Pixel>
Status write_pfm(const std::string& path, const std::string& kind, int width_px, int height_px,
                 const std::vector<Pixel>& pixels) {
    static_assert(std::endian::native == std::endian::little && sizeof(Pixel) % sizeof(float) == 0);
    const auto width = static_cast<std::size_t>(width_px), height = static_cast<std::size_t>(height_px);
    std::vector<Pixel> from_bottom(pixels.size());
    for (std::size_t y = 0; y < height; ++y)
        std::copy_n(pixels.begin() + static_cast<std::ptrdiff_t>(y * width), width,
                    from_bottom.begin() + static_cast<std::ptrdiff_t>((height - 1 - y) * width));
    return write_bytes(path, kind + "\n" + std::to_string(width) + " " + std::to_string(height) + "\n-1.0\n",
                       from_bottom.data(), from_bottom.size() * sizeof(Pixel));
}

/// Named 32-bit float planes of one size.
class Planes {
public:
    explicit Planes(std::size_t pixels) : pixels_(pixels) {}

    void add(const std::string& name, const std::function<double(std::size_t)>& value) {
        std::vector<float> plane(pixels_);
        for (std::size_t i = 0; i < pixels_; ++i) plane[i] = static_cast<float>(value(i));
        planes_.emplace_back(name, std::move(plane));
    }
    /// The value rounded to 32 bits, and the rounding error.
    void add_exact(const std::string& name, const std::function<double(std::size_t)>& value) {
        add(name, value);
        add(name + ".rest", [&](std::size_t i) {
            const double v = value(i);
            return std::isfinite(v) ? v - static_cast<double>(static_cast<float>(v)) : 0.0;
        });
    }
    std::vector<std::pair<std::string, std::vector<float>>>& all() { return planes_; }

private:
    std::size_t pixels_;
    std::vector<std::pair<std::string, std::vector<float>>> planes_;
};

constexpr std::array<const char*, 3> kAxis{"X", "Y", "Z"}, kBand{"R", "G", "B"};

Planes planes_of(const RenderedFrame& frame) {
    const auto& pixels = frame.radiance.pixels;
    Planes planes(pixels.size());
    for (int b = 0; b < 3; ++b)
        planes.add(kBand[static_cast<std::size_t>(b)], [&, b](std::size_t i) { return pixels[i][b]; });
    if (frame.aovs == nullptr) return planes;
    const Aovs& a = *frame.aovs;
    if (!a.depth_m.empty()) planes.add_exact("depth.Z", [&](std::size_t i) { return a.depth_m[i]; });
    if (!a.range_m.empty()) planes.add_exact("range", [&](std::size_t i) { return a.range_m[i]; });
    for (int k = 0; k < 3; ++k) {
        const std::string axis = kAxis[static_cast<std::size_t>(k)];
        if (!a.normal.empty()) planes.add("normal." + axis, [&, k](std::size_t i) { return a.normal[i][k]; });
        if (!a.position.empty())
            planes.add_exact("position." + axis, [&, k](std::size_t i) { return a.position[i][k]; });
    }
    for (int b = 0; b < 3 && !a.albedo.empty(); ++b)
        planes.add(std::string("albedo.") + kBand[static_cast<std::size_t>(b)],
                   [&, b](std::size_t i) { return a.albedo[i][b]; });
    if (!a.body.empty()) planes.add("body", [&](std::size_t i) { return a.body[i]; });
    if (!a.variance.empty()) planes.add("variance", [&](std::size_t i) { return a.variance[i]; });
    return planes;
}

Status write_exr(const std::string& path, const RenderedFrame& frame) {
    // OpenEXR's messages do not contain the reason why a file cannot be opened.
    if (const Status writable = write_bytes(path, "", nullptr, 0); !writable) return writable.error();
    try {
        Planes planes = planes_of(frame);
        const int width = frame.radiance.width, height = frame.radiance.height;
        Imf::Header header(width, height);
        header.compression() = Imf::ZIP_COMPRESSION;
        header.insert("comments", Imf::StringAttribute("linear radiance in W m^-2 sr^-1 a band; lengths in m; "
                                                       "NAME + NAME.rest is NAME in double precision"));
        Imf::FrameBuffer buffer;
        for (auto& [name, plane] : planes.all()) {
            header.channels().insert(name, Imf::Channel(Imf::FLOAT));
            buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(plane.data()), sizeof(float),
                                           sizeof(float) * static_cast<std::size_t>(width)));
        }
        Imf::OutputFile file(path.c_str(), header, 1);
        file.setFrameBuffer(buffer);
        file.writePixels(height);
    } catch (const std::exception& e) {
        return cannot_write(path, e.what());
    }
    return Ok{};
}

/// The camera's output as PNG.
Status write_png(const std::string& path, const RenderedFrame& frame) {
    // cv::Mat has no const view; OpenCV only reads it.
    const auto view = [&](int type) {
        return cv::Mat(frame.radiance.height, frame.radiance.width, type,
                       const_cast<std::uint8_t*>(frame.bytes.data()));
    };
    cv::Mat image;
    try {
        switch (frame.camera.format) {
            case PixelFormat::rgb24: cv::cvtColor(view(CV_8UC3), image, cv::COLOR_RGB2BGR); break;
            case PixelFormat::yuyv: cv::cvtColor(view(CV_8UC2), image, cv::COLOR_YUV2BGR_YUYV); break;
            default: image = view(is_16_bit(frame.camera.format) ? CV_16UC1 : CV_8UC1); break;
        }
    } catch (const std::exception& e) {
        return Error{std::string("OpenCV could not convert the frame: ") + e.what(), path};
    }
    return narpa::write_png(path, image);
}

std::string pixels_of(bool is_colour, bool has_alpha, bool has_floats, bool is_16_bit) {
    return fmt::format("{}{} of {}", is_colour ? "colour" : "grey", has_alpha ? " with alpha" : "",
                       has_floats  ? "floating-point samples"
                       : is_16_bit ? "16 bits"
                                   : "8 bits");
}

/// Integer samples with full scale at the largest sample of 8 or 16 bits.
void scale_to(std::uint32_t largest, DecodedImage& image) {
    if (image.largest == largest) return;
    for (std::uint16_t& v : image.samples)
        v = static_cast<std::uint16_t>(std::lround(v * static_cast<double>(largest) / image.largest));
    image.largest = largest;
}

/// Samples of 16 bits as a camera of `bits` outputs them, in the upper bits.
Status take_upper_bits(const std::string& path, const Camera& camera, int bits, DecodedImage& image) {
    const int unused_bits = 16 - bits, unused = (1 << unused_bits) - 1;
    const auto code_of_full_scale = static_cast<std::uint32_t>((1 << bits) - 1);
    const bool is_declared =
        image.largest < code_of_full_scale + 1 || (image.significant_bits > 0 && image.significant_bits <= bits);
    if (is_declared) {
        scale_to(code_of_full_scale, image);
        for (std::uint16_t& v : image.samples) v = static_cast<std::uint16_t>(v << unused_bits);
    } else if (std::has_single_bit(image.largest + 1)) {
        const int shift = 16 - std::bit_width(image.largest);
        for (std::uint16_t& v : image.samples) v = static_cast<std::uint16_t>(v << shift);
    } else {
        return Error{fmt::format("has samples up to {}, expected up to {}, the {} bits of camera \"{}\"",
                                 image.largest, code_of_full_scale, bits, camera.name),
                     path};
    }
    image.largest = 65535;
    if (std::ranges::any_of(image.samples, [unused](std::uint16_t v) { return (v & unused) != 0; }))
        return Error{
            fmt::format("has numbers of more than the {} bits of camera \"{}\": expected them in the upper "
                        "bits of 16, that is multiplied by {}",
                        bits, camera.name, unused + 1),
            path};
    return Ok{};
}

void warn_of_frame(const std::string& path, const DecodedImage& image, std::vector<std::string>& warnings) {
    for (const std::string& what : image.unused) warnings.push_back(path + ": " + what);
    const TransferCurve& curve = image.transfer;
    if (curve.kind == TransferCurve::Kind::srgb || curve.exponent != 1)
        warnings.push_back(fmt::format("{}: it declares {}, and is read as linear in light", path,
                                       curve.kind == TransferCurve::Kind::srgb
                                           ? "sRGB"
                                           : fmt::format("a gamma of {:.5g}", 1 / curve.exponent)));
}

/// An image file's pixels in the camera's format.
Result<std::vector<std::uint8_t>> decode_frame(const std::string& path, const std::string& file,
                                               const Camera& camera, std::vector<std::string>* warnings) {
    Result<DecodedImage> image =
        decode_image(path, {reinterpret_cast<const std::uint8_t*>(file.data()), file.size()});
    if (!image) return image.error();
    if (image->width != camera.width || image->height != camera.height)
        return Error{fmt::format("is {} x {}, expected {} x {} as camera \"{}\" has", image->width, image->height,
                                 camera.width, camera.height, camera.name),
                     path};
    const bool is_colour = camera.format == PixelFormat::rgb24, has_16_bits = is_16_bit(camera.format);
    if ((image->channels == 3) != is_colour || image->has_alpha || image->samples.empty() ||
        (image->largest > 255) != has_16_bits)
        return Error{fmt::format("is {}, expected {}: camera \"{}\" is {}",
                                 pixels_of(image->channels == 3, image->has_alpha, image->samples.empty(),
                                           image->largest > 255),
                                 pixels_of(is_colour, false, false, has_16_bits), camera.name, name(camera.format)),
                     path};
    if (warnings != nullptr) warn_of_frame(path, *image, *warnings);
    if (has_16_bits && camera.detector && camera.detector->bits < 16) {
        if (const Status good = take_upper_bits(path, camera, camera.detector->bits, *image); !good)
            return good.error();
    }
    scale_to(has_16_bits ? 65535 : 255, *image);
    if (!has_16_bits) return std::vector<std::uint8_t>(image->samples.begin(), image->samples.end());
    std::vector<std::uint8_t> frame(2 * image->samples.size());
    std::memcpy(frame.data(), image->samples.data(), frame.size());
    return frame;
}

/// In lower case, with the dot.
std::string extension_of(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

}  // namespace

Status check_image_name(const std::string& path) {
    if (path == kStandardOutput) return Ok{};
    const std::string extension = extension_of(path);
    for (const char* known : {".exr", ".pfm", ".png", ".raw"})
        if (extension == known) return Ok{};
    return Error{"unknown image format \"" + extension + "\": expected .exr, .pfm, .png or .raw", path};
}

Status write_image(const std::string& path, const RenderedFrame& frame) {
    if (auto good = check_image_name(path); !good) return good;
    const std::string extension = path == kStandardOutput ? ".png" : extension_of(path);
    if (extension == ".exr") return write_exr(path, frame);
    if (extension == ".pfm")
        return write_pfm(path, "PF", frame.radiance.width, frame.radiance.height, frame.radiance.pixels);
    const std::size_t expected = frame_bytes({frame.radiance.width, frame.radiance.height, frame.camera.format, 0});
    if (frame.bytes.size() != expected)
        return Error{"the frame has " + std::to_string(frame.bytes.size()) + " bytes where its format has " +
                         std::to_string(expected),
                     path};
    return extension == ".png" ? write_png(path, frame)
                               : write_bytes(path, "", frame.bytes.data(), frame.bytes.size());
}

Result<std::vector<std::uint8_t>> read_frame(const std::string& path, const Camera& camera,
                                             std::vector<std::string>* warnings) {
    const Result<std::string> file = read_file(path);
    if (!file) return file.error();
    if (extension_of(path) == ".raw") return std::vector<std::uint8_t>(file->begin(), file->end());
    if (camera.format == PixelFormat::yuyv)
        return Error{fmt::format("camera \"{}\" is YUYV: expected the device's bytes, FILE.raw", camera.name),
                     path};
    return decode_frame(path, *file, camera, warnings);
}

Status write_pfm(const std::string& path, int width, int height, std::span<const double> values) {
    return write_pfm(path, "Pf", width, height, std::vector<float>(values.begin(), values.end()));
}

Status write_png(const std::string& path, const cv::Mat& image) {
    const Result<ImageCodecs> codecs = image_codecs(path);
    if (!codecs) return codecs.error();
    std::vector<std::uint8_t> encoded;
    try {
        if (!codecs->imencode(".png", image, encoded, {})) return Error{"OpenCV could not encode the PNG", path};
    } catch (const std::exception& e) {
        return Error{std::string("OpenCV could not encode the PNG: ") + e.what(), path};
    }
    return write_bytes(path, "", encoded.data(), encoded.size());
}

}  // namespace narpa
