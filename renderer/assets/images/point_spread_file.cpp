#include "renderer/assets/images/point_spread_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfMultiPartInputFile.h>
#include <ImfTestFile.h>
#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "base/file_bytes.h"
#include "renderer/assets/images/image_reader.h"

namespace narpa {
namespace {

using Image = std::shared_ptr<PointSpreadImage>;
using Warnings = std::vector<std::string>;

Result<Image> image_of_size(const std::string& path, std::int64_t width, std::int64_t height) {
    if (width < 1 || height < 1 || width > kMaxPointSpreadSamples || height > kMaxPointSpreadSamples)
        return Error{.what = fmt::format("an image of {} x {} samples, expected at most {} x {}", width, height,
                                         kMaxPointSpreadSamples, kMaxPointSpreadSamples),
                     .file = path};
    auto image = std::make_shared<PointSpreadImage>();
    image->width = static_cast<int>(width), image->height = static_cast<int>(height);
    image->centre_x = 0.5 * (image->width - 1), image->centre_y = 0.5 * (image->height - 1);
    image->samples.resize(static_cast<std::size_t>(width * height));
    return image;
}

/// Notes the channels that are not read.
Status check_channels(const std::string& path, const Imf::Header& header, Warnings* warnings) {
    std::string others;
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
        if (std::string_view(c.name()) != "Y") others += (others.empty() ? "" : ", ") + std::string(c.name());
    const Imf::Channel* channel = header.channels().findChannel("Y");
    if (channel == nullptr)
        return Error{.what = fmt::format("has no channel Y, only {}, expected one band (grey)", others),
                     .file = path};
    if (channel->xSampling != 1 || channel->ySampling != 1)
        return Error{.what = "has a channel Y of fewer samples than pixels, expected one each", .file = path};
    if (header.channels().findChannel("RY") != nullptr || header.channels().findChannel("BY") != nullptr)
        return Error{.what = "has colours (RY, BY), expected one band (grey)", .file = path};
    if (std::abs(header.pixelAspectRatio() - 1) > 1e-4f)
        return Error{.what = fmt::format("has a pixelAspectRatio of {:g}, expected 1", header.pixelAspectRatio()),
                     .file = path};
    if (!others.empty() && warnings != nullptr)
        warnings->push_back(fmt::format("{}: only its channel Y is used, not {}", path, others));
    return Ok{};
}

Result<Image> read_exr(const std::string& path, Warnings* warnings) {
    try {
        Imf::InputFile file(path.c_str(), 1);
        const auto window = file.header().dataWindow(), shown = file.header().displayWindow();
        const auto size = [](int low, int high) { return std::int64_t{high} - low + 1; };
        Result<Image> image =
            image_of_size(path, size(window.min.x, window.max.x), size(window.min.y, window.max.y));
        if (!image) return image;
        if (const Status good = check_channels(path, file.header(), warnings); !good) return good.error();
        if (const int parts = Imf::MultiPartInputFile(path.c_str(), 1).parts(); parts > 1 && warnings != nullptr)
            warnings->push_back(fmt::format("{}: the first of its {} parts is used", path, parts));
        const auto middle = [](int low, int high) { return 0.5 * (static_cast<double>(low) + high); };
        (*image)->centre_x = middle(shown.min.x, shown.max.x) - window.min.x;
        (*image)->centre_y = middle(shown.min.y, shown.max.y) - window.min.y;
        const auto width = static_cast<std::size_t>((*image)->width);
        std::vector<float> samples((*image)->samples.size());
        Imf::FrameBuffer buffer;
        buffer.insert("Y",
                      Imf::Slice::Make(Imf::FLOAT, samples.data(), window, sizeof(float), sizeof(float) * width));
        file.setFrameBuffer(buffer);
        file.readPixels(window.min.y, window.max.y);
        (*image)->samples.assign(samples.begin(), samples.end());
        return image;
    } catch (const std::exception& e) {
        return Error{.what = std::string("image cannot be decoded: ") + e.what(), .file = path};
    }
}

/// Samples are linear in light, and their scale is of no importance.
Result<Image> read_grey_image(const std::string& path, Warnings* warnings) {
    const Result<std::string> bytes = read_file(path);
    if (!bytes) return bytes.error();
    const Result<DecodedImage> file =
        decode_image(path, {reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()});
    if (!file) return file.error();
    Result<Image> image = image_of_size(path, file->width, file->height);
    if (!image) return image;
    const auto channels = static_cast<std::size_t>(file->channels);
    const auto sample = [&](std::size_t i) {
        return file->samples.empty() ? static_cast<double>(file->floats[i]) : file->samples[i];
    };
    for (std::size_t i = 0; i < (*image)->samples.size(); ++i) {
        const double grey = (*image)->samples[i] = sample(i * channels);
        for (std::size_t c = 1; c < channels; ++c)
            if (const double other = sample(i * channels + c); other != grey)
                return Error{.what = "has colours, expected one band (grey)", .file = path};
    }
    if (warnings == nullptr) return image;
    for (const std::string& what : file->unused) warnings->push_back(path + ": " + what);
    const TransferCurve& curve = file->transfer;
    if (curve.kind == TransferCurve::Kind::srgb || curve.exponent != 1)
        warnings->push_back(path + ": it declares a curve (sRGB or gamma), and is read as linear in light");
    return image;
}

}  // namespace

Result<Image> read_point_spread_image(const std::string& path, Warnings* warnings) {
    if (const Status plain = check_plain_file(path); !plain) return plain.error();
    Result<Image> image =
        Imf::isOpenExrFile(path.c_str()) ? read_exr(path, warnings) : read_grey_image(path, warnings);
    if (!image) return image;
    double sum = 0;
    for (const double sample : (*image)->samples) {
        if (!(sample >= 0) || !std::isfinite(sample))
            return Error{.what = fmt::format("a sample of {}, expected light, finite and >= 0", sample),
                         .file = path};
        sum += sample;
    }
    if (!(sum > 0)) return Error{.what = "all samples are 0, expected the light of a point", .file = path};
    for (double& sample : (*image)->samples) sample /= sum;
    return image;
}

}  // namespace narpa
