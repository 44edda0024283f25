/// tracking/batch_model.h - the model of a batch with errors that are put in on purpose, to see what the batch
/// finds.
#pragma once

#include "base/result.h"
#include "estimator/batch/batch_unknowns.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The scene as a model with these errors (SI): its scale, focal lengths, mounts and so on are the truth's plus the
/// error. Not those of clock and range, which are no part of a scene. Errors: a target that cannot be scaled, a
/// camera whose projection has no such parameter.
[[nodiscard]] Status apply_model_errors(const BatchValues& error, std::size_t target, Scene& scene);

/// The change that leads from the model with an error back to the truth: what a batch should find.
[[nodiscard]] BatchValues expected_of(const BatchValues& error);

}  // namespace narpa
