/// renderer/detector/pixel_tasks.h - splits an image into parallel tasks of whole batches of kLanes pixels, on the
/// calling thread's TBB arena.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <span>

#include "base/lanes.h"
#include "base/vec3.h"

namespace narpa {

/// Calls `f(first_pixel, pixels)` for each task.
template <class F>
void for_each_task(std::span<const Rgb> pixels, const F& f) {
    constexpr std::size_t kPixels = 1024 * kLanes;
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, (pixels.size() + kPixels - 1) / kPixels),
        [&](const tbb::blocked_range<std::size_t>& tasks) {
            for (std::size_t task = tasks.begin(); task != tasks.end(); ++task) {
                const std::size_t first = task * kPixels;
                f(first, pixels.subspan(first, std::min(kPixels, pixels.size() - first)));
            }
        },
        tbb::simple_partitioner());
}

}  // namespace narpa
