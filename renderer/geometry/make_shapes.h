/// renderer/geometry/make_shapes.h - the shapes of a scene's bodies.
#pragma once

#include <memory>
#include <vector>

#include "base/result.h"
#include "renderer/geometry/embree.h"
#include "renderer/geometry/shape.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// One for each body; bodies with the same mesh share theirs.
using Shapes = std::vector<std::shared_ptr<const Shape>>;

/// `given` stands for the first bodies, where it is not null, in place of what the scene says. The scene must
/// outlive the shapes. `threads` bounds the threads that build; 0 is all.
[[nodiscard]] Result<Shapes> make_shapes(const Scene& scene, const Shapes& given, RTCDevice device, int threads);

}  // namespace narpa
