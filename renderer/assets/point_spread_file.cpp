#include "renderer/assets/point_spread_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfTestFile.h>
#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "base/file_bytes.h"
#include "renderer/assets/texture_file.h"

namespace narpa {
namespace {

using Image = std::shared_ptr<PointSpreadImage>;

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

Result<Image> read_exr(const std::string& path) {
    try {
        Imf::InputFile file(path.c_str(), 1);
        const auto window = file.header().dataWindow();
        const auto size = [](int low, int high) { return std::int64_t{high} - low + 1; };
        Result<Image> image =
            image_of_size(path, size(window.min.x, window.max.x), size(window.min.y, window.max.y));
        if (!image) return image;
        const Imf::Channel* channel = file.header().channels().findChannel("Y");
        if (channel == nullptr || channel->xSampling != 1 || channel->ySampling != 1)
            return Error{.what = "has no channel Y, expected one band (grey)", .file = path};
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

Result<Image> read_grey_texture(const std::string& path) {
    const Result<Texture> texture = read_texture(path, {.colour = TextureUse::Colour::linear});
    if (!texture) return texture.error();
    Result<Image> image = image_of_size(path, texture->width, texture->height);
    if (!image) return image;
    for (std::size_t i = 0; i < (*image)->samples.size(); ++i) {
        const std::uint16_t* rgb = &texture->rgb[3 * i];
        if (rgb[0] != rgb[1] || rgb[0] != rgb[2])
            return Error{.what = "has colours, expected one band (grey)", .file = path};
        (*image)->samples[i] = rgb[0];
    }
    return image;
}

}  // namespace

Result<Image> read_point_spread_image(const std::string& path) {
    if (const Status plain = check_plain_file(path); !plain) return plain.error();
    Result<Image> image = Imf::isOpenExrFile(path.c_str()) ? read_exr(path) : read_grey_texture(path);
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
