// Runs a fuzz target without libFuzzer, the same in every run:  fuzz_TARGET [--inputs N] [--seed S]
// FILE_OR_FOLDER... First every file, then N inputs mutated from them. An input that crashes, or takes over a
// minute, is written to fuzz-crash.bin in the current folder; given as FILE, it is tried again.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <iterator>
#include <vector>

#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/mutator.h"

extern "C" __attribute__((weak)) void __sanitizer_set_death_callback(void (*)());

namespace {

namespace fs = std::filesystem;

constexpr unsigned kPatience_s = 60;
const std::string* current = nullptr;

/// Async-signal-safe.
void keep_current() {
    if (current == nullptr) return;
    const int file = open("fuzz-crash.bin", O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (file < 0 || write(file, current->data(), current->size()) < 0) return;
    close(file);
    constexpr char kWords[] = "fuzz: the input is in fuzz-crash.bin\n";
    if (write(STDERR_FILENO, kWords, sizeof kWords - 1) < 0) return;
}
void on_signal(int signal) {
    keep_current();
    std::signal(signal, SIG_DFL);
    raise(signal);
}

void run(const std::string& input) {
    current = &input;
    alarm(kPatience_s);
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
    current = nullptr;
}

std::string read_all(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::string> inputs_in(const std::vector<std::string>& paths) {
    std::vector<fs::path> files;
    for (const std::string& path : paths) {
        if (!fs::is_directory(path)) files.emplace_back(path);
        if (fs::is_directory(path))
            for (const auto& entry : fs::recursive_directory_iterator(path))
                if (entry.is_regular_file()) files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    std::vector<std::string> inputs;
    for (const fs::path& file : files) inputs.push_back(read_all(file));
    return inputs;
}

}  // namespace

int main(int argc, char** argv) {
    std::uint64_t inputs = 0, seed = 1;
    std::vector<std::string> paths;
    for (int i = 1; i < argc; ++i) {
        const bool has_value = i + 1 < argc;
        if (std::strcmp(argv[i], "--inputs") == 0 && has_value)
            inputs = std::strtoull(argv[++i], nullptr, 10);
        else if (std::strcmp(argv[i], "--seed") == 0 && has_value)
            seed = std::strtoull(argv[++i], nullptr, 10);
        else
            paths.emplace_back(argv[i]);
    }
    for (const int signal : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGALRM})
        if (__sanitizer_set_death_callback == nullptr || signal == SIGALRM || signal == SIGABRT)
            std::signal(signal, on_signal);
    if (__sanitizer_set_death_callback != nullptr) __sanitizer_set_death_callback(keep_current);
    std::signal(SIGPIPE, SIG_IGN);

    const std::vector<std::string> seeds = inputs_in(paths);
    if (seeds.empty()) return std::fputs("fuzz: no files to start from\n", stderr), 2;
    const auto begin = std::chrono::steady_clock::now();
    for (const std::string& s : seeds) run(s);
    narpa::fuzz::Mutator mutator(seeds, seed);
    for (std::uint64_t n = 0; n < inputs; ++n) run(mutator.next());
    const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const auto number = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
    std::printf("%s: %zu files, %llu mutated inputs, %llu taken, %llu refused, %.1f s\n",
                fs::path(argv[0]).filename().c_str(), seeds.size(), number(inputs), number(narpa::fuzz::taken),
                number(narpa::fuzz::refused), took_s);
    if (inputs == 0 || (narpa::fuzz::taken > 0 && narpa::fuzz::refused > 0)) return 0;
    return std::fputs("fuzz: expected inputs that are taken and inputs that are refused\n", stderr), 1;
}
