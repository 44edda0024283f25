#include "dataset/image/image_maker.h"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <thread>

#include "dataset/folder/dataset_folder.h"
#include "dataset/image/label.h"
#include "renderer/image/image_file.h"

namespace narpa::dataset {
namespace {

/// Numbers of bodies, 0 for none: 8 bits where these are enough for all bodies of the whole scene.
Status write_mask(const std::string& path, const std::vector<std::int32_t>& body, const std::vector<int>& ids,
                  std::size_t all_bodies, int width, int height) {
    const auto fill = [&]<class Pixel>(int type, Pixel) {
        cv::Mat mask(height, width, type);
        std::ranges::transform(body, mask.ptr<Pixel>(), [&](std::int32_t b) {
            return static_cast<Pixel>(b < 0 ? 0 : ids[static_cast<std::size_t>(b)]);
        });
        return write_png(path, mask);
    };
    return all_bodies < 256 ? fill(CV_8UC1, std::uint8_t{}) : fill(CV_16UC1, std::uint16_t{});
}

/// Unit normals in camera axes as the bands of an image; 0 where nothing is hit.
RadianceImage normals_image(const Aovs& aovs, const Quat& q_camera_world, int width, int height) {
    RadianceImage image(width, height);
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
        if (aovs.body[i] >= 0) image.pixels[i] = vec_cast<float>(q_camera_world * aovs.normal[i]);
    return image;
}

}  // namespace

Result<ImageRenderer*> ImageMaker::renderer_of(const ImageDraw& draw) {
    const bool is_own = scenes_.recipe().albedo_factor.has_value();  // no other thread renders it while it changes
    auto& renderer = renderers_[{draw.variant, draw.backdrop}];
    if (!renderer) {
        auto scene =
            is_own ? scenes_.make(draw.variant, draw.backdrop) : scenes_.shared(draw.variant, draw.backdrop);
        if (!scene) return scene.error();
        renderer = std::make_unique<ImageRenderer>(*std::move(scene));
    }
    if (is_own) renderer->scene().set_albedo_factor(draw.albedo_factor);
    return renderer.get();
}

Status ImageMaker::make(std::uint32_t image) {
    const ImageDraw draw = draw_image(scenes_.recipe(), scenes_.facts(), image);
    const auto renderer = renderer_of(draw);
    if (!renderer) return renderer.error();
    const Placement placement = (*renderer)->scene().place(draw);
    (*renderer)->render(placement, {draw.time_factor, draw.gain_factor}, scenes_.recipe().seed, image);
    if (auto written = write(image, **renderer, placement); !written) return written;
    const nlohmann::json label = make_label(scenes_, draw, placement, **renderer, image);
    return write_whole_text(folder_ + "/" + image_file(kLabelOutput, image), label.dump() + "\n");
}

Status ImageMaker::write(std::uint32_t image, ImageRenderer& renderer, const Placement& placement) const {
    const Camera& camera = renderer.camera();
    const Aovs& aovs = renderer.aovs();
    const auto write_one = [&](std::size_t output, const auto& writer) -> Status {
        if (!scenes_.recipe().outputs[output]) return Ok{};
        return write_whole(folder_ + "/" + image_file(output, image), writer);
    };
    Status good = write_one(kImageOutput, [&](const std::string& path) {
        return write_image(path, {camera, renderer.radiance(), nullptr, renderer.bytes()});
    });
    if (good)
        good = write_one(kMaskOutput, [&](const std::string& path) {
            return write_mask(path, aovs.body, renderer.scene().body_ids(), scenes_.scene(0).bodies.size(),
                              camera.width, camera.height);
        });
    if (good)
        good = write_one(kDepthOutput, [&](const std::string& path) {
            return write_pfm(path, camera.width, camera.height, aovs.depth_m);
        });
    if (good)
        good = write_one(kNormalsOutput, [&](const std::string& path) {
            const RadianceImage normals =
                normals_image(aovs, conjugate(placement.T_world_camera.q), camera.width, camera.height);
            return write_image(path, {camera, normals, nullptr, {}});
        });
    if (good)
        good = write_one(kRadianceOutput, [&](const std::string& path) {
            return write_image(path, {camera, renderer.radiance(), nullptr, {}});
        });
    return good;
}

Status make_images(SceneSet& scenes, const std::string& folder, const std::vector<std::uint32_t>& images,
                   const MakeOptions& options) {
    const auto cores = static_cast<std::size_t>(tbb::info::default_concurrency());
    const std::size_t threads = options.threads > 0 ? static_cast<std::size_t>(options.threads) : cores;
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const std::size_t makers = std::min(threads, images.size());
    std::atomic<std::size_t> next{0};
    std::mutex mutex;
    std::optional<Error> error;
    const auto work = [&](int own_threads) {
        tbb::task_arena arena(own_threads);
        ImageMaker maker(scenes, folder);
        for (std::size_t k = next++; k < images.size() && !(options.stop && *options.stop); k = next++) {
            const Status made = arena.execute([&] { return maker.make(images[k]); });
            if (!made) {
                const std::lock_guard lock(mutex);
                if (!error) error = made.error();
                next = images.size();
                return;
            }
            if (options.done) ++*options.done;
        }
    };
    {
        std::vector<std::jthread> workers;
        for (std::size_t i = 0; i < makers; ++i)
            workers.emplace_back(work, static_cast<int>(std::max<std::size_t>(1, threads / makers)));
    }
    if (error) return *error;
    return Ok{};
}

}  // namespace narpa::dataset
