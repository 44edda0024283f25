#include "python/module/raise.h"

#include <pybind11/pybind11.h>

namespace narpa::python {
namespace {

namespace py = pybind11;

[[noreturn]] void raise_as(const char* name, const Error& e) {
    const py::object type = py::module_::import("narpa.errors").attr(name);
    const py::object exception = type(e.text(), e.file, e.line, e.column);
    PyErr_SetObject(type.ptr(), exception.ptr());
    throw py::error_already_set();
}

}  // namespace

void raise(const Error& error) {
    raise_as("Error", error);
}
void raise_scene_error(const Error& error) {
    raise_as("SceneError", error);
}

}  // namespace narpa::python
