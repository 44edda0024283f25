#include "apps/cli.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>

#include "apps/print_error.h"
#include "apps/warnings.h"
#include "base/each_isa.h"
#include "base/lanes.h"
#include "generated/commit.h"
#include "renderer/image/image_file.h"

namespace narpa::cli {

Result<std::vector<std::uint8_t>> load_frame(const std::string& path, const Camera& camera) {
    std::vector<std::string> warnings;
    auto frame = read_frame(path, camera, &warnings);
    for (const std::string& w : warnings) warn(w);
    return frame;
}

Status make_folder_of(const std::string& file) {
    const auto folder = std::filesystem::path(file).parent_path();
    std::error_code failed;
    if (!folder.empty()) std::filesystem::create_directories(folder, failed);
    if (failed)
        return Error{"its folder cannot be made: " + failed.message(), file, 0, 0,
                     failed == std::errc::permission_denied || failed == std::errc::read_only_file_system
                         ? ErrorKind::missing
                         : ErrorKind::bad_input};
    return Ok{};
}

Status make_folder_of_picture(const std::string& file) {
    const auto extension = std::filesystem::path(file).extension();
    if (!file.empty() && extension != ".png" && extension != ".svg" && extension != ".pdf")
        return Error{"expected the name of a picture, FILE.png, .svg or .pdf", file};
    return make_folder_of(file);
}

Result<std::pair<std::string, std::string>> split_pair(const std::string& text, std::string_view expected) {
    const std::size_t at = text.find('=');
    if (at == std::string::npos || at == 0 || at + 1 == text.size())
        return Error{fmt::format("\"{}\", expected {}", text, expected)};
    return std::pair{text.substr(0, at), text.substr(at + 1)};
}

nlohmann::json to_json(const Error& e) {
    return {{"error",
             {{"what", e.what},
              {"file", e.file},
              {"line", e.line},
              {"column", e.column},
              {"remedy", e.remedy},
              {"exit_status", exit_status(e.kind)}}}};
}

namespace {

/// False: standard output cannot be written.
bool print_json(const nlohmann::json& document) {
    fmt::print("{}\n", document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
    if (std::fflush(stdout) == 0) return true;
    say(fmt::format("narpa: standard output cannot be written: {}", std::strerror(errno)));
    return false;
}

/// The widest of the instruction sets of base/each_isa.h that this processor has.
const char* isa_in_use() {
#ifdef NARPA_HAS_EACH_ISA
    __builtin_cpu_init();
    if (__builtin_cpu_supports("x86-64-v4")) return "AVX-512 (x86-64-v4)";
    if (__builtin_cpu_supports("x86-64-v3")) return "AVX2 (x86-64-v3)";
#endif
    return "the compiler's base line";
}

/// "narpa 0.1.0, commit 2bbdc3b" and the instruction set, which decides the last bits of results.
std::string version() {
    const std::string commit = NARPA_COMMIT;
    return fmt::format("narpa {}{}\nvector instructions: {}, {} rays at once", NARPA_VERSION,
                       commit.empty() ? "" : ", commit " + commit, isa_in_use(), kLanes);
}

}  // namespace

int finish(const Outcome& outcome, bool json) {
    const auto with_warnings = [](nlohmann::json document) {
        if (document.is_object() && !warnings().empty() && !document.contains("warnings"))
            document["warnings"] = warnings();
        return document;
    };
    if (!outcome) {
        say("narpa: " + outcome.error().text());
        if (json) print_json(with_warnings(to_json(outcome.error())));
        return exit_status(outcome.error().kind);
    }
    const Status strict = check_warnings();
    if (!strict) say("narpa: " + strict.error().text());
    if (json && !outcome->is_null() && !print_json(with_warnings(*outcome))) return exit_status(ErrorKind::failed);
    if (outcome->contains("error")) return (*outcome)["error"]["exit_status"];
    if (!strict) return exit_status(strict.error().kind);
    return outcome->is_object() && !outcome->value("passed", true) ? exit_status(ErrorKind::failed) : 0;
}

int run_commands(int argc, char** argv, const CommandTexts& texts,
                 const std::vector<std::function<Command(Parser)>>& adders) {
    try {
        bool json = false;
        Command chosen;
        const auto add_commands = [&](const Parser& app) {
            app.choice(adders, chosen);
            app.examples(texts.examples);
        };
        return parse_and_run(
            argc, argv, {texts.name, texts.description, version()}, add_commands,
            [&] { return finish(chosen(), json); }, &json);
    } catch (const std::exception& e) {  // such as out of memory: narpa's own code does not throw
        print_error("narpa: {}\n", e.what());
        return 1;
    }
}

}  // namespace narpa::cli
