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
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/file_bytes.h"
#include "renderer/assets/image_codecs.h"
#include "renderer/assets/image_header.h"

namespace narpa {
namespace {

Error cannot_write(const std::string& path, const std::string& why) {
    const bool forbidden = errno == EACCES || errno == EPERM || errno == EROFS;
    return Error{"cannot write: " + why, path, 0, 0, forbidden ? ErrorKind::missing : ErrorKind::bad_input};
}

Status write_bytes(const std::string& path, const std::string& head, const void* data, std::size_t size) {
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

std::string pixels_of(int type) {
    const std::string kind = CV_MAT_CN(type) == 1 ? "grey" : CV_MAT_CN(type) == 3 ? "colour" : "colour with alpha";
    return CV_MAT_DEPTH(type) == CV_8U    ? kind + " of 8 bits"
           : CV_MAT_DEPTH(type) == CV_16U ? kind + " of 16 bits"
                                          : kind + " of neither 8 nor 16 bits";
}

/// An image file's pixels in the camera's format.
Result<std::vector<std::uint8_t>> decode_frame(const std::string& path, const std::string& file,
                                               const Camera& camera) {
    const Error no_image{"is no image that can be decoded, expected .raw, .png, .tif or .pgm", path};
    const auto size = image_size({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()});
    if (!size) return no_image;
    if (size->width != static_cast<std::uint64_t>(camera.width) ||
        size->height != static_cast<std::uint64_t>(camera.height))
        return Error{fmt::format("is {} x {}, expected {} x {} as camera \"{}\" has", size->width, size->height,
                                 camera.width, camera.height, camera.name),
                     path};
    const Result<ImageCodecs> codecs = image_codecs(path);
    if (!codecs) return codecs.error();
    const cv::Mat bytes(1, static_cast<int>(file.size()), CV_8U, const_cast<char*>(file.data()));
    cv::Mat image;
    try {
        image = codecs->imdecode(bytes, cv::IMREAD_UNCHANGED);
    } catch (const std::exception&) {  // of a damaged file too
    }
    if (image.cols != camera.width || image.rows != camera.height)
        return Error{"cannot be decoded: it is damaged, or cut short", path};
    const int expected = camera.format == PixelFormat::rgb24 ? CV_8UC3
                         : is_16_bit(camera.format)          ? CV_16UC1
                                                             : CV_8UC1;
    if (image.type() != expected)
        return Error{fmt::format("is {}, expected {}: camera \"{}\" is {}", pixels_of(image.type()),
                                 pixels_of(expected), camera.name, name(camera.format)),
                     path};
    if (expected == CV_16UC1 && camera.detector && camera.detector->bits < 16) {
        const int unused = (1 << (16 - camera.detector->bits)) - 1;
        if (std::any_of(image.begin<std::uint16_t>(), image.end<std::uint16_t>(),
                        [unused](std::uint16_t v) { return (v & unused) != 0; }))
            return Error{
                fmt::format("has numbers of more than the {} bits of camera \"{}\": expected them in the upper "
                            "bits of 16, that is multiplied by {}",
                            camera.detector->bits, camera.name, unused + 1),
                path};
    }
    if (expected == CV_8UC3) cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
    std::vector<std::uint8_t> frame(image.total() * image.elemSize());
    std::memcpy(frame.data(), image.data, frame.size());
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
    const std::string extension = extension_of(path);
    for (const char* known : {".exr", ".pfm", ".png", ".raw"})
        if (extension == known) return Ok{};
    return Error{"unknown image format \"" + extension + "\": expected .exr, .pfm, .png or .raw", path};
}

Status write_image(const std::string& path, const RenderedFrame& frame) {
    if (auto good = check_image_name(path); !good) return good;
    const std::string extension = extension_of(path);
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

Result<std::vector<std::uint8_t>> read_frame(const std::string& path, const Camera& camera) {
    const Result<std::string> file = read_file(path);
    if (!file) return file.error();
    if (extension_of(path) == ".raw") return std::vector<std::uint8_t>(file->begin(), file->end());
    if (camera.format == PixelFormat::yuyv)
        return Error{fmt::format("camera \"{}\" is YUYV: expected the device's bytes, FILE.raw", camera.name),
                     path};
    return decode_frame(path, *file, camera);
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
