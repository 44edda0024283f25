// apps/program/assimp_assertions.cpp - part of every program of ours, never of the libraries: it replaces a
// function of Assimp for the whole process.
#include <stdexcept>
#include <string>

namespace Assimp {

/// Debian builds Assimp with assertions enabled, and some damaged files violate them, which aborts the program. The
/// dynamic linker prefers this definition in the executable to the library's own; the mesh reader catches the
/// exception.
[[noreturn]] void aiAssertViolation(const char* failed_expression, const char* file, int line) {
    throw std::runtime_error(std::string(file) + ":" + std::to_string(line) +
                             ": assertion failed: " + failed_expression);
}

}  // namespace Assimp
