/// dataset/image/image_maker.h - makes images of a data set: draws, renders and writes all files of each.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/stop.h"
#include "dataset/image/image_renderer.h"
#include "dataset/scene/scene_set.h"

namespace narpa::dataset {

/// Makes images one after another. Each belongs to one thread.
class ImageMaker {
public:
    /// `scenes` outlives it.
    ImageMaker(SceneSet& scenes, std::string folder) : scenes_(scenes), folder_(std::move(folder)) {}

    /// Writes all files of the image, its label last.
    Status make(std::uint32_t image);

private:
    /// The renderer of the draw's scene, with its albedo: made at the scene's first use.
    Result<ImageRenderer*> renderer_of(const ImageDraw& draw);
    Status write(std::uint32_t image, ImageRenderer& renderer, const Placement& placement) const;

    SceneSet& scenes_;
    const std::string folder_;
    std::map<std::pair<std::size_t, std::size_t>, std::unique_ptr<ImageRenderer>>
        renderers_;  ///< by variant, background
};

struct MakeOptions {
    int threads = 0;                           ///< 0: one for each core
    std::atomic<std::size_t>* done = nullptr;  ///< counts finished images; may be null
    const StopFlag* stop = nullptr;            ///< no further image is begun once it is set; may be null
};
/// Makes these images, on each thread one at a time. The first error ends it.
[[nodiscard]] Status make_images(SceneSet& scenes, const std::string& folder,
                                 const std::vector<std::uint32_t>& images, const MakeOptions& options);

}  // namespace narpa::dataset
