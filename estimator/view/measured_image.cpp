#include "estimator/view/measured_image.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "renderer/camera/scene_camera.h"
#include "renderer/detector/detector.h"
#include "renderer/detector/detector_stage.h"

namespace narpa {
namespace {

/// Weights by which the bands' digital numbers are averaged; monochrome formats add the bands before conversion.
std::array<double, 3> band_weights(PixelFormat format) {
    if (format == PixelFormat::rgb24) return {1.0 / 3, 1.0 / 3, 1.0 / 3};
    if (format == PixelFormat::yuyv) return {0.299, 0.587, 0.114};  // BT.601
    if (is_bayer(format)) return {0.25, 0.5, 0.25};                 // without_mosaic
    return {1, 1, 1};
}

int converter_bits(const Camera& camera) {
    if (camera.detector) return camera.detector->bits;
    return is_16_bit(camera.format) ? 16 : 8;
}

/// DN between neighbouring values of the format.
double step_dn(const Camera& camera) {
    const double eight_bits = std::exp2(converter_bits(camera) - 8);
    if (camera.format == PixelFormat::yuyv) return eight_bits * 255.0 / 219.0;  // luma 16 .. 235
    return is_16_bit(camera.format) ? 1 : eight_bits;
}

/// Standard deviations of read noise by which a full well may come out below its mean.
constexpr double kReadSigmas = 4;

/// Each pixel becomes the mean of its neighbourhood with the weights [1 2 1] x [1 2 1] / 16, which gives a quarter
/// of red, half of green and a quarter of blue at every position; clipped if one of the nine is. The image is
/// mirrored at its edges, which preserves the mosaic's pattern.
void without_mosaic(MeasuredImage& image) {
    const std::vector<float> mosaic = image.dn;
    const std::vector<std::uint8_t> clipped = image.clipped;
    const auto inside = [](int i, int size) {
        return std::clamp(i < 0 ? -i : i >= size ? 2 * size - 2 - i : i, 0, size - 1);
    };
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            float sum = 0;
            std::uint8_t any = 0;
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) {
                    const int weight = (2 - std::abs(dx)) * (2 - std::abs(dy));
                    const int from = inside(y + dy, image.height) * image.width + inside(x + dx, image.width);
                    sum += static_cast<float>(weight) * mosaic[static_cast<std::size_t>(from)];
                    any |= clipped[static_cast<std::size_t>(from)];
                }
            image.dn[static_cast<std::size_t>(y * image.width + x)] = sum / 16;
            image.clipped[static_cast<std::size_t>(y * image.width + x)] = any;
        }
}

}  // namespace

double SensorModel::signal(const Rgb& radiance) const {
    const auto& k = dn_per_radiance;
    const Vec3 L = vec_cast<double>(radiance);
    return k[0] * L.x + k[1] * L.y + k[2] * L.z;
}

double SensorModel::dn(const Rgb& radiance) const {
    return std::min(top_dn, black_dn + signal(radiance));
}

double SensorModel::variance_dn2(double expected_dn) const {
    const double signal = std::max(0.0, expected_dn - black_dn);
    return read_dn2 + shot_dn * signal + prnu2 * signal * signal + rounding_dn2;
}

SensorModel sensor_model(const Camera& camera) {
    SensorModel s;
    const auto weights = band_weights(camera.format);
    const double converter_top = std::exp2(converter_bits(camera)) - 1;
    const double step = step_dn(camera);
    s.rounding_dn2 = step * step / 12;
    if (!camera.detector) {
        const double share = is_mono(camera.format) ? 1.0 / 3 : 1.0;
        for (std::size_t b = 0; b < 3; ++b)
            s.dn_per_radiance[b] = weights[b] * share * converter_top / camera.white_radiance;
        s.top_dn = s.clips_dn = converter_top;
        return s;
    }
    const Detector& d = *camera.detector;
    const double dn_per_e = 1 / gain_e_per_dn(d);
    double squares = 1;  // of the weights of numbers whose noise is independent
    if (camera.format == PixelFormat::rgb24 || camera.format == PixelFormat::yuyv)
        squares = weights[0] * weights[0] + weights[1] * weights[1] + weights[2] * weights[2];
    for (int b = 0; b < 3; ++b) {
        const auto i = static_cast<std::size_t>(b);
        s.dn_per_radiance[i] = weights[i] * electrons_per_radiance(d, b) * dn_per_e;
    }
    const SiteAmounts amounts = site_amounts(d);
    const double dark_e = amounts.dark_e;
    s.black_dn = d.black_level_dn + dark_e * dn_per_e;
    s.rounding_dn2 *= camera.format == PixelFormat::rgb24 ? squares : 1;
    const double well_dn = d.black_level_dn + d.full_well_e * dn_per_e;
    s.top_dn = std::min(converter_top, std::floor(well_dn + 0.5));
    s.clips_dn = std::min(converter_top, well_dn - kReadSigmas * d.read_noise_e * dn_per_e);
    if (!is_16_bit(camera.format)) {  // centre of the last byte's interval
        const double byte = std::exp2(converter_bits(camera) - 8);
        s.top_dn = std::floor(s.top_dn / byte) * byte + 0.5 * (byte - 1);
    }
    const double dark_e2 =
        d.read_noise_e * d.read_noise_e + amounts.dsnu_e * amounts.dsnu_e + (d.shot_noise ? dark_e : 0);
    s.read_dn2 = squares * dark_e2 * dn_per_e * dn_per_e;
    s.prnu2 = squares * amounts.prnu * amounts.prnu;
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
    image.clipped.resize(image.dn.size());
    const double clips_dn = sensor_model(camera).clips_dn;
    const int bits = converter_bits(camera);
    // A truncated number is read as the centre of its interval.
    const double step = std::exp2(bits - 8), middle = (step - 1) / 2;
    for (std::size_t i = 0; i < image.dn.size(); ++i) {
        double dn = 0;
        if (camera.format == PixelFormat::rgb24)
            dn = (bytes[3 * i] + bytes[3 * i + 1] + bytes[3 * i + 2]) / 3.0 * step + middle;
        else if (camera.format == PixelFormat::yuyv)
            dn = (bytes[2 * i] - 16) * (255.0 / 219.0) * step + middle;
        else if (is_16_bit(camera.format))
            dn = (bytes[2 * i] | bytes[2 * i + 1] << 8) >> (16 - bits);
        else
            dn = bytes[i] * step + middle;
        image.dn[i] = static_cast<float>(dn);
        const double brightest = camera.format != PixelFormat::rgb24
                                     ? dn
                                     : std::max({bytes[3 * i], bytes[3 * i + 1], bytes[3 * i + 2]}) * step + middle;
        const double interval_end = is_16_bit(camera.format) ? brightest : brightest + middle;
        image.clipped[i] = interval_end >= clips_dn ? 1 : 0;
    }
    if (is_bayer(camera.format)) without_mosaic(image);
    return image;
}

std::vector<float> expected_signal(const Camera& camera, const RadianceImage& radiance) {
    const SensorModel sensor = sensor_model(camera);
    MeasuredImage image{camera.width, camera.height - (camera.embedded_line ? 1 : 0), {}};
    image.dn.resize(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
    for (std::size_t i = 0; i < image.dn.size(); ++i)
        image.dn[i] = static_cast<float>(sensor.signal(radiance.pixels[i]));
    if (!is_bayer(camera.format)) return image.dn;
    const auto weights = band_weights(camera.format);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const std::size_t b = bayer_band(camera.format, x, y), i = image.index(x, y);
            image.dn[i] = static_cast<float>(sensor.dn_per_radiance[b] / weights[b] *
                                             static_cast<double>(radiance.pixels[i][static_cast<int>(b)]));
        }
    image.clipped.assign(image.dn.size(), 0);
    without_mosaic(image);
    return image.dn;
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
    if (!image.clipped.empty()) out.clipped.reserve(out.dn.capacity());
    for (int y = 0; y < out.height; ++y)
        for (int x = 0; x < out.width; ++x) {
            double sum = 0;
            std::uint8_t any = 0;
            for (int j = 0; j < factor; ++j)
                for (int i = 0; i < factor; ++i) {
                    sum += image.at(x * factor + i, y * factor + j);
                    if (!image.clipped.empty()) any |= image.clipped[image.index(x * factor + i, y * factor + j)];
                }
            out.dn.push_back(static_cast<float>(sum / (factor * factor)));
            if (!image.clipped.empty()) out.clipped.push_back(any);
        }
    return out;
}

std::vector<float> coarser_variance(std::span<const float> variance, const Camera& camera, int factor) {
    if (variance.empty()) return {};
    MeasuredImage mean = coarser_image({camera.width, camera.height, {variance.begin(), variance.end()}}, factor);
    for (float& v : mean.dn) v /= static_cast<float>(factor * factor);
    return std::move(mean.dn);
}

}  // namespace narpa
