/// apps/options.h - options of a program or subcommand. Only options.cpp includes CLI11, which adds 7 s of compile
/// time to a file.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace narpa::cli {

/// A handle of one option; methods return the handle, so that they can be chained.
class Option {
public:
    explicit Option(CLI::Option* option) : option_(option) {}

    Option required() const;
    /// least <= value <= most; not NaN.
    Option range(int least, int most) const;
    Option range(double least, double most) const;
    Option range(std::uint64_t least, std::uint64_t most) const;
    /// 0 < value <= most.
    Option above_zero(double most) const;
    /// Refuses NaN and infinity.
    Option finite() const;
    Option one_of(const std::vector<std::string>& values) const;
    /// `complaint` returns the error text for a bad value; empty: the value is good.
    Option check(const std::function<std::string(const std::string&)>& complaint) const;
    Option needs(Option other) const;
    Option excludes(Option other) const;
    /// --help shows the default.
    Option shows_default() const;
    /// May be given many times, with one value each.
    Option repeatable() const;
    /// May be given several times: one value, of the parts joined by this character.
    Option joined_by(char separator) const;
    /// One value, of comma-separated parts.
    Option comma_separated() const;
    /// Takes `least` to `most` values.
    Option values(int least, int most) const;
    /// Placeholder of the value in --help; default: N, X or TEXT, by its type.
    Option type_name(const std::string& name) const;
    /// Heading of the option in --help.
    Option group(const std::string& name) const;

    [[nodiscard]] bool given() const;
    [[nodiscard]] std::string name() const;

private:
    CLI::Option* option_;
};

class Parser {
public:
    explicit Parser(CLI::App& app) : app_(&app) {}

    Parser subcommand(const std::string& name, const std::string& help) const;
    /// `names`: "--spp", "-o,--output", or "SCENE" for a positional argument. T: a string or number, or an optional
    /// or vector of them.
    template <class T>
    Option option(const std::string& names, T& value, const std::string& help) const;
    Option flag(const std::string& names, bool& value, const std::string& help) const;
    /// An option that was added before.
    [[nodiscard]] Option find(const std::string& name) const;
    void footer(const std::string& text) const;
    /// The heading of this command in its parent's --help.
    void group(const std::string& name) const;
    /// Command lines that --help shows above the footer. After `footer`.
    void examples(const std::vector<std::string>& lines) const;

    /// Adds subcommands, each by a function that returns what runs when it is chosen; one of them must be. Sets
    /// `chosen` while the command line is parsed.
    template <class Command>
    void choice(const std::vector<std::function<Command(Parser)>>& adders, Command& chosen) const {
        require_subcommand();
        for (const auto& add : adders) {
            const Command command = add(*this);
            when_last_is_chosen([&chosen, command] { chosen = command; });
        }
    }

private:
    void require_subcommand() const;
    void when_last_is_chosen(const std::function<void()>& f) const;

    CLI::App* app_;
};

struct ProgramTexts {
    std::string name, description, version;
    std::string footer =
        "Exit status: 0 good; 1 ran, but something failed; 2 bad input; 3 a device or permission is missing.";
};
/// Parses a command line, then calls `run` while the options still exist. Prints help, version and errors itself.
/// Returns the exit status. `json`: whether --json was given, anywhere on the line; null: there is no such option.
int parse_and_run(int argc, char** argv, const ProgramTexts& texts, const std::function<void(Parser)>& add_options,
                  const std::function<int()>& run, bool* json = nullptr);

}  // namespace narpa::cli
