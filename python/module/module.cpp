// The compiled module of the Python package narpa. python/narpa/ has what users import.
#include "python/module/module.h"

#include <dlfcn.h>

#include <filesystem>

#include "base/program_beside.h"

namespace narpa::python {
namespace {

/// The folder of narpa's programs, which scenes with terrain and meshes need: in the build folder, or PREFIX/bin.
std::filesystem::path folder_of_programs() {
    Dl_info info{};
    if (::dladdr(reinterpret_cast<const void*>(&folder_of_programs), &info) == 0) return {};
    std::error_code error;
    std::filesystem::path folder = std::filesystem::canonical(info.dli_fname, error).parent_path();
    for (; folder.has_relative_path(); folder = folder.parent_path())
        if (std::filesystem::exists(folder / "bin/narpa", error)) return folder / "bin";
    return {};
}

}  // namespace
}  // namespace narpa::python

PYBIND11_MODULE(_narpa, m) {
    m.doc() = "The compiled part of narpa: import narpa instead.";
    narpa::use_program_folder(narpa::python::folder_of_programs());
    narpa::python::bind_scene(m);
    narpa::python::bind_emulator(m);
    narpa::python::bind_estimate(m);
}
