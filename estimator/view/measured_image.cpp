#include "estimator/view/measured_image.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "renderer/camera/detector.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

/// Weights by which the bands' digital numbers are averaged; monochrome formats add the bands before conversion.
std::array<double, 3> band_weights(PixelFormat format) {
    switch (format) {
        case PixelFormat::grey:
        case PixelFormat::y16: return {1, 1, 1};
        case PixelFormat::rgb24: return {1.0 / 3, 1.0 / 3, 1.0 / 3};
        case PixelFormat::yuyv: return {0.299, 0.587, 0.114};  // BT.601
    }
    return {1, 1, 1};
}

bool one_pixel_for_all_bands(PixelFormat format) {
    return format == PixelFormat::grey || format == PixelFormat::y16;
}

int converter_bits(const Camera& camera) {
    if (camera.detector) return camera.detector->bits;
    return camera.format == PixelFormat::y16 ? 16 : 8;
}

/// DN between neighbouring values of the format.
double step_dn(const Camera& camera) {
    const double eight_bits = std::exp2(converter_bits(camera) - 8);
    switch (camera.format) {
        case PixelFormat::y16: return 1;
        case PixelFormat::yuyv: return eight_bits * 255.0 / 219.0;  // luma 16 .. 235
        case PixelFormat::grey:
        case PixelFormat::rgb24: return eight_bits;
    }
    return 1;
}

}  // namespace

double SensorModel::dn(const Rgb& L) const {
    return std::min(top_dn,
                    black_dn + dn_per_radiance[0] * L.x + dn_per_radiance[1] * L.y + dn_per_radiance[2] * L.z);
}

double SensorModel::variance_dn2(double expected_dn) const {
    return read_dn2 + shot_dn * std::max(0.0, expected_dn - black_dn) + rounding_dn2;
}

SensorModel sensor_model(const Camera& camera) {
    SensorModel s;
    const auto weights = band_weights(camera.format);
    const double converter_top = std::exp2(converter_bits(camera)) - 1;
    const double step = step_dn(camera);
    s.rounding_dn2 = step * step / 12;
    if (!camera.detector) {
        const double share = one_pixel_for_all_bands(camera.format) ? 1.0 / 3 : 1.0;
        for (std::size_t b = 0; b < 3; ++b)
            s.dn_per_radiance[b] = weights[b] * share * converter_top / camera.white_radiance;
        s.top_dn = converter_top;
        return s;
    }
    const Detector& d = *camera.detector;
    const double dn_per_e = 1 / gain_e_per_dn(d);
    double squares = 1;  // of the weights of numbers whose noise is independent
    if (!one_pixel_for_all_bands(camera.format))
        squares = weights[0] * weights[0] + weights[1] * weights[1] + weights[2] * weights[2];
    for (int b = 0; b < 3; ++b) {
        const auto i = static_cast<std::size_t>(b);
        s.dn_per_radiance[i] = weights[i] * electrons_per_radiance(d, b) * dn_per_e;
    }
    s.black_dn = d.black_level_dn;
    s.rounding_dn2 *= camera.format == PixelFormat::rgb24 ? squares : 1;
    s.top_dn = std::min(converter_top, std::floor(d.black_level_dn + d.full_well_e * dn_per_e + 0.5));
    if (camera.format != PixelFormat::y16) {  // what its truncated bytes stand for
        const double byte = std::exp2(converter_bits(camera) - 8);
        s.top_dn = std::floor(s.top_dn / byte) * byte + 0.5 * (byte - 1);
    }
    s.read_dn2 = squares * d.read_noise_e * d.read_noise_e * dn_per_e * dn_per_e;
    s.shot_dn = d.shot_noise ? squares * dn_per_e : 0;
    return s;
}

Result<MeasuredImage> measured_image(const Camera& camera, std::span<const std::uint8_t> bytes) {
    const VideoFormat format{camera.width, camera.height, camera.format, camera.period_ns};
    if (bytes.size() != frame_bytes(format))
        return Error{"a frame of " + std::to_string(bytes.size()) + " bytes, expected " +
                     std::to_string(frame_bytes(format)) + ": " + std::to_string(camera.width) + " x " +
                     std::to_string(camera.height) + " " + std::string(name(camera.format))};
    MeasuredImage image{camera.width, camera.height - (camera.embedded_line ? 1 : 0), {}};
    image.dn.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
    const int bits = converter_bits(camera);
    // A truncated number is read as the centre of its interval.
    const double step = std::exp2(bits - 8), middle = (step - 1) / 2;
    for (std::size_t i = 0; i < image.dn.size(); ++i) {
        double dn = 0;
        switch (camera.format) {
            case PixelFormat::y16: dn = (bytes[2 * i] | bytes[2 * i + 1] << 8) >> (16 - bits); break;
            case PixelFormat::grey: dn = bytes[i] * step + middle; break;
            case PixelFormat::rgb24:
                dn = (bytes[3 * i] + bytes[3 * i + 1] + bytes[3 * i + 2]) / 3.0 * step + middle;
                break;
            case PixelFormat::yuyv: dn = (bytes[2 * i] - 16) * (255.0 / 219.0) * step + middle; break;
        }
        image.dn[i] = static_cast<float>(dn);
    }
    return image;
}

Status check_image(const Camera& camera, const MeasuredImage& image, const std::string& what) {
    const int height = camera.height - (camera.embedded_line ? 1 : 0);
    const auto size = [](int w, int h) { return std::to_string(w) + " x " + std::to_string(h); };
    if (image.width != camera.width || image.height != height ||
        image.dn.size() != static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(height))
        return Error{what + " is of " + size(image.width, image.height) + " pixels, expected the camera's " +
                     size(camera.width, height)};
    if (!std::all_of(image.dn.begin(), image.dn.end(), [](float dn) { return std::isfinite(dn); }))
        return Error{what + " has pixels that are not finite, expected DN"};
    return Ok{};
}

Camera coarser_camera(const Camera& camera, int factor) {
    return scaled(camera, 1.0 / factor, 1.0 / factor);
}

MeasuredImage coarser_image(const MeasuredImage& image, int factor) {
    MeasuredImage out{image.width / factor, image.height / factor, {}};
    out.dn.reserve(static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            double sum = 0;
            for (int j = 0; j < factor; ++j)
                for (int i = 0; i < factor; ++i) sum += image.at(x * factor + i, y * factor + j);
            out.dn.push_back(static_cast<float>(sum / (factor * factor)));
        }
    return out;
}

}  // namespace narpa
