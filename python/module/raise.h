/// python/module/raise.h - errors as exceptions of narpa.errors.
#pragma once

#include <utility>

#include "base/result.h"

namespace narpa::python {

/// Raises narpa.Error, or narpa.SceneError of a scene that is read. With the GIL.
[[noreturn]] void raise(const Error& error);
[[noreturn]] void raise_scene_error(const Error& error);

/// The value, or raises the error. With the GIL.
template <class T>
T value_of(Result<T>&& result) {
    if (!result) raise(result.error());
    return *std::move(result);
}

}  // namespace narpa::python
