#include "plot/plot.h"

#include <sched.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/program_beside.h"
#include "base/text/base64.h"
#include "base/write_file.h"

namespace narpa {
namespace {

/// Exit statuses of narpa-plot, and of a program that could not be started (posix_spawn(3)).
constexpr int kMatplotlibMissing = 3, kNotStarted = 127;

/// The program that the environment variable NARPA_PLOT names; else narpa-plot beside the running program; else the
/// one on PATH.
std::string plot_program() {
    if (const char* named = std::getenv("NARPA_PLOT")) return named;
    return program_beside("narpa-plot");
}

/// Runs a program with normal priority and its standard output redirected to our standard error. It has a process
/// group of its own, so that a stop signal to our group lets it finish its picture. Returns its exit status.
int run_program(std::vector<std::string> arguments) {
    std::vector<char*> argv;
    argv.reserve(arguments.size() + 1);
    for (std::string& a : arguments) argv.push_back(a.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, STDERR_FILENO, STDOUT_FILENO);
    posix_spawnattr_init(&attributes);
    const sched_param usual{};
    sigset_t no_signals;
    sigemptyset(&no_signals);
    posix_spawnattr_setschedpolicy(&attributes, SCHED_OTHER);
    posix_spawnattr_setschedparam(&attributes, &usual);
    posix_spawnattr_setsigmask(&attributes, &no_signals);
    posix_spawnattr_setflags(&attributes,
                             POSIX_SPAWN_SETSCHEDULER | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    pid_t child = 0;
    const int failed = posix_spawnp(&child, argv[0], &files, &attributes, argv.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    if (failed != 0) return kNotStarted;
    int status = 0;
    while (waitpid(child, &status, 0) < 0)
        if (errno != EINTR) return kNotStarted;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

Error failed(std::string what, const std::string& picture) {
    return {std::move(what), picture, 0, 0, ErrorKind::failed};
}
Error no_picture_name(const std::string& picture) {
    return failed("cannot be written, expected the name of a picture, like FILE.png", picture);
}

}  // namespace

Status write_plot(const std::string& picture, const nlohmann::json& document) {
    const std::string json_file = document_beside(picture);
    if (json_file == picture) return no_picture_name(picture);
    const std::string text = document.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
    if (Status written = write_file(json_file, text); !written) return written;
    const int status = run_program({plot_program(), json_file, "-o", picture});
    if (status == 0 || status == kMatplotlibMissing) return Ok{};
    if (status != kNotStarted) return failed("is not drawn: narpa-plot has said why", picture);
    std::fprintf(stderr, "%s is not drawn: narpa-plot is not installed beside narpa; %s has the data\n",
                 picture.c_str(), json_file.c_str());
    return Ok{};
}

Status can_write_plot(const std::string& picture) {
    const std::string json_file = document_beside(picture);
    if (json_file == picture) return no_picture_name(picture);
    if (!std::ofstream(json_file, std::ios::app)) return cannot_open_to_write(json_file);
    return Ok{};
}

std::uint8_t srgb_byte(double linear) {
    const double l = std::clamp(linear, 0.0, 1.0),
                 s = l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055;
    return static_cast<std::uint8_t>(std::lround(255 * s));
}

nlohmann::json plot_image(int width, int height, int channels, std::span<const std::uint8_t> pixels) {
    assert(pixels.size() ==
           static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(channels));
    return {{"width", width},
            {"height", height},
            {"channels", channels},
            {"base64", base64({reinterpret_cast<const char*>(pixels.data()), pixels.size()})}};
}

}  // namespace narpa
