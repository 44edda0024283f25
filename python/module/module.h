/// python/module/module.h - the parts of the module narpa._narpa, one file each.
#pragma once

#include <pybind11/pybind11.h>

namespace narpa::python {

/// Calls f() without the GIL. Everything that takes a session's turn is called so: a thread that waits for its turn
/// must not hold the GIL, which the one whose turn it is may need.
auto without_gil(const auto& f) {
    const pybind11::gil_scoped_release release;
    return f();
}

void bind_scene(pybind11::module_& m);
void bind_emulator(pybind11::module_& m);
void bind_estimate(pybind11::module_& m);

}  // namespace narpa::python
