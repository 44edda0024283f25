#include "apps/options.h"

#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <span>
#include <sstream>
#include <type_traits>
#include <utility>

#include "base/result.h"
#include "base/text/nearest_name.h"

namespace narpa::cli {
namespace {

/// The type of one value of an option.
template <class T>
struct OneValue {
    using Type = T;
};
template <class T>
struct OneValue<std::optional<T>> : OneValue<T> {};
template <class T>
struct OneValue<std::vector<T>> : OneValue<T> {};

/// Placeholder in --help of a value without type_name: a whole number, another number, text.
template <class T>
constexpr const char* kKindOfValue = std::is_integral_v<T>         ? "N"
                                     : std::is_floating_point_v<T> ? "X"
                                                                   : "TEXT";

}  // namespace

Option Option::required() const {
    return Option(option_->required());
}
Option Option::range(int least, int most) const {
    return Option(option_->check(CLI::Range(least, most)));
}
Option Option::range(double least, double most) const {
    return Option(option_->check(CLI::Range(least, most))).finite();
}
Option Option::range(std::uint64_t least, std::uint64_t most) const {
    return Option(option_->check(CLI::Range(least, most)));
}
Option Option::finite() const {
    return check([](const std::string& text) {
        return std::isfinite(std::strtod(text.c_str(), nullptr)) ? "" : text + " is not a finite number";
    });
}
Option Option::above_zero(double most) const {
    return range(0.0, most).check([](const std::string& text) {
        return std::strtod(text.c_str(), nullptr) > 0 ? "" : text + ", expected a number greater than 0";
    });
}
Option Option::one_of(const std::vector<std::string>& values) const {
    std::string names;
    for (const std::string& value : values) names += (names.empty() ? "" : "|") + value;
    return Option(option_->check(CLI::IsMember(values))->type_name(names));
}
Option Option::check(const std::function<std::string(const std::string&)>& complaint) const {
    return Option(option_->check(complaint));
}
Option Option::needs(Option other) const {
    return Option(option_->needs(other.option_));
}
Option Option::excludes(Option other) const {
    return Option(option_->excludes(other.option_));
}
Option Option::shows_default() const {
    return Option(option_->capture_default_str());
}
Option Option::repeatable() const {
    return Option(option_->take_all()->allow_extra_args(false));
}
Option Option::joined_by(char separator) const {
    return Option(
        option_->multi_option_policy(CLI::MultiOptionPolicy::Join)->delimiter(separator)->allow_extra_args(false));
}
Option Option::comma_separated() const {
    return Option(option_->delimiter(',')->allow_extra_args(false));
}
Option Option::values(int least, int most) const {
    return Option(option_->expected(least, most));
}
Option Option::type_name(const std::string& name) const {
    return Option(option_->type_name(name));
}
Option Option::group(const std::string& name) const {
    return Option(option_->group(name));
}
bool Option::given() const {
    return option_->count() > 0;
}
std::string Option::name() const {
    return option_->get_name();
}

Parser Parser::subcommand(const std::string& name, const std::string& help) const {
    return Parser(*app_->add_subcommand(name, help));
}
template <class T>
Option Parser::option(const std::string& names, T& value, const std::string& help) const {
    using Value = typename OneValue<T>::Type;
    const Option option(app_->add_option(names, value, help)->type_name(kKindOfValue<Value>));
    if constexpr (std::is_unsigned_v<Value>)  // CLI11 takes -1 for the largest number
        option.check([](const std::string& text) { return text.starts_with("-") ? text + " is negative" : ""; });
    return option;
}
Option Parser::flag(const std::string& names, bool& value, const std::string& help) const {
    return Option(app_->add_flag(names, value, help));
}
Option Parser::find(const std::string& name) const {
    return Option(app_->get_option(name));
}
void Parser::footer(const std::string& text) const {
    app_->footer(text);
}
void Parser::group(const std::string& name) const {
    app_->group(name);
}
void Parser::examples(const std::vector<std::string>& lines) const {
    std::string text = "Examples:\n";
    for (const std::string& line : lines) text += "  " + line + "\n";
    app_->footer(text + "\n" + app_->get_footer());
}
void Parser::require_subcommand() const {
    app_->require_subcommand(1);
}
void Parser::when_last_is_chosen(const std::function<void()>& f) const {
    app_->get_subcommands([](const CLI::App*) { return true; }).back()->final_callback(f);
}

#define NARPA_OPTION_OF(...) \
    template Option Parser::option(const std::string&, __VA_ARGS__&, const std::string&) const;
NARPA_OPTION_OF(std::string)
NARPA_OPTION_OF(int)
NARPA_OPTION_OF(double)
NARPA_OPTION_OF(std::uint32_t)
NARPA_OPTION_OF(std::uint64_t)
NARPA_OPTION_OF(std::optional<int>)
NARPA_OPTION_OF(std::optional<double>)
NARPA_OPTION_OF(std::optional<std::uint32_t>)
NARPA_OPTION_OF(std::optional<std::uint64_t>)
NARPA_OPTION_OF(std::vector<std::string>)
NARPA_OPTION_OF(std::vector<int>)
NARPA_OPTION_OF(std::vector<double>)
#undef NARPA_OPTION_OF

namespace {

/// Adds the flag to every subcommand, so that it may stand anywhere on the line.
void add_json_flag(CLI::App& app, bool& json) {
    app.add_flag("--json", json, "Put one JSON document on standard output");
    for (CLI::App* subcommand : app.get_subcommands([](const CLI::App*) { return true; }))
        add_json_flag(*subcommand, json);
}

// --- Help -------------------------------------------------------------------------------------------------------

constexpr std::size_t kIndent = 30, kColumns = 110;

/// "narpa bench render".
std::string full_name(const CLI::App& app) {
    return (app.get_parent() ? full_name(*app.get_parent()) + " " : "") + app.get_name();
}

/// `left` in a column of its own, `text` wrapped beside it.
std::string row(const std::string& left, const std::string& text) {
    std::string out = "  " + left;
    std::size_t column = out.size();
    if (column + 2 > kIndent) out += '\n', column = 0;
    out.append(kIndent - column, ' ');
    column = kIndent;
    std::istringstream words(text);
    for (std::string word; words >> word;) {
        if (column > kIndent && column + 1 + word.size() > kColumns) {
            out += '\n' + std::string(kIndent, ' ');
            column = kIndent;
        }
        if (column > kIndent) out += ' ', ++column;
        out += word;
        column += word.size();
    }
    return out + '\n';
}

/// An option's placeholder and its text.
struct Described {
    std::string placeholder, text;
};
Described describe(const CLI::Option& o) {
    Described d{{}, o.get_description()};
    if (!o.get_default_str().empty()) d.text += " (default: " + o.get_default_str() + ")";
    for (const CLI::Option* needed : o.get_needs()) d.text += " (with " + needed->get_name() + ")";
    // The parser appends its checks to the name of the type: "N:INT in [1 - 256]".
    const std::string type = o.get_type_name();
    if (o.get_items_expected_max() > 0) d.placeholder = type.substr(0, type.find(':'));
    return d;
}

/// Usage, arguments, options and commands by group; without the parser's own notation.
class HelpFormatter final : public CLI::FormatterBase {
public:
    std::string make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const override {
        return app->get_description() + "\n\n" + usage(*app) + positionals(*app) + commands(*app) + options(*app) +
               (app->get_footer().empty() ? "" : "\n" + app->get_footer() + "\n");
    }

private:
    static std::string usage(const CLI::App& app) {
        std::string out = "Usage: " + full_name(app);
        const bool any_command = !app.get_subcommands([](const CLI::App*) { return true; }).empty();
        if (any_command) out += " COMMAND ...";
        for (const CLI::Option* o : app.get_options()) {
            const Described d = describe(*o);
            if (o->nonpositional() && o->get_required())
                out += " " + (o->get_snames().empty() ? "--" + o->get_lnames()[0] : "-" + o->get_snames()[0]) +
                       " " + d.placeholder;
            if (o->get_positional() && !o->nonpositional()) {
                const std::string name = o->get_name() + (o->get_items_expected_max() > 1 ? "..." : "");
                out += o->get_required() ? " " + name : " [" + name + "]";
            }
        }
        return out + (any_command ? "\n" : " [options]\n");
    }

    static std::string positionals(const CLI::App& app) {
        std::string out;
        for (const CLI::Option* o : app.get_options())
            if (o->get_positional() && !o->nonpositional()) out += row(o->get_name(), o->get_description());
        return out.empty() ? "" : "\n" + out;
    }

    static std::string options(const CLI::App& app) {
        std::string out;
        for (const std::string& group : app.get_groups()) {
            std::string rows;
            for (const CLI::Option* o : app.get_options()) {
                if (!o->nonpositional() || o->get_group() != group) continue;
                const Described d = describe(*o);
                std::string names;
                for (const std::string& s : o->get_snames()) names += (names.empty() ? "-" : ", -") + s;
                for (const std::string& l : o->get_lnames()) names += (names.empty() ? "--" : ", --") + l;
                rows += row(names + (d.placeholder.empty() ? "" : " " + d.placeholder), d.text);
            }
            if (!rows.empty()) out += "\n" + group + ":\n" + rows;
        }
        return out;
    }

    static std::string commands(const CLI::App& app) {
        std::string out, group;
        for (const CLI::App* c : app.get_subcommands([](const CLI::App*) { return true; })) {
            if (c->get_group() != group) out += "\n" + (group = c->get_group()) + ":\n";
            out += row(c->get_name(), c->get_description());
        }
        return out;
    }
};

// --- Errors of the command line ---------------------------------------------------------------------------------

/// "narpa: there is no command "chek"; did you mean "check"?"; empty: all commands on the line exist.
std::string unknown_command(const CLI::App& app, std::span<char* const> words) {
    const CLI::App* at = &app;
    for (const std::string word : words) {
        const auto commands = at->get_subcommands([](const CLI::App*) { return true; });
        if (commands.empty()) break;
        if (word.starts_with("-")) continue;
        std::vector<std::string> names;
        for (const CLI::App* c : commands) names.push_back(c->get_name());
        const auto found = std::find(names.begin(), names.end(), word);
        if (found == names.end())
            return full_name(*at) + ": there is no command \"" + word + "\"" + did_you_mean(word, names) + "\n" +
                   full_name(*at) + " --help lists the commands";
        at = commands[static_cast<std::size_t>(found - names.begin())];
    }
    return {};
}

/// The command that was chosen on the line.
const CLI::App& chosen(const CLI::App& app) {
    const auto commands = app.get_subcommands();
    return commands.empty() ? app : chosen(*commands.front());
}

/// Names of narpa's options in other renderers and tools.
constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kOtherOptions{
    {{"--samples", "--spp"},
     {"--bounces", "--max-depth"},
     {"--resolution", "--size"},
     {"--interface", "--can"},
     {"--seconds", "--duration"},
     {"--integrator", "--method"}}};

std::string option_meant(const std::string& option, const std::vector<std::string>& known) {
    for (const auto& [others, ours] : kOtherOptions)
        if (option == others && std::ranges::find(known, ours) != known.end())
            return "; did you mean \"" + std::string(ours) + "\"?";
    return did_you_mean(option, known);
}

/// "narpa run: --can has an empty value ...": usually from an unset shell variable; it would count as an omitted
/// option. Empty: there is none.
std::string empty_value(const CLI::App& app, std::span<char* const> words) {
    const CLI::App& command = chosen(app);
    std::string option;  // whose value comes next
    for (const std::string word : words) {
        const bool is_long = word.starts_with("--");
        if (is_long && word.find('=') + 1 == word.size()) option = word.substr(0, word.size() - 1);
        if (word.empty() || option + "=" == word)
            return full_name(command) + ": " +
                   (option.empty() ? "an argument is empty, expected a value or no argument"
                                   : option + " has an empty value, expected a value or no " + option);
        const CLI::Option* const named = word.starts_with("-") ? command.get_option_no_throw(word) : nullptr;
        option = named && named->get_items_expected_max() > 0 ? word : "";
    }
    return {};
}

std::string line_error(const CLI::App& app, const CLI::ParseError& e, std::span<char* const> words) {
    const CLI::App& command = chosen(app);
    const std::string name = full_name(command), help = "\n" + name + " --help has all options, and examples";
    std::vector<std::string> known;
    for (const CLI::Option* o : command.get_options()) {
        for (const std::string& s : o->get_snames()) known.push_back("-" + s);
        for (const std::string& l : o->get_lnames()) known.push_back("--" + l);
    }
    for (const std::string word : words) {
        const std::string option = word.substr(0, word.find('='));
        if (option.starts_with("--") && std::find(known.begin(), known.end(), option) == known.end())
            return name + ": there is no option \"" + option + "\"" + option_meant(option, known) + help;
    }
    const auto commands = command.get_subcommands([](const CLI::App*) { return true; });
    if (!commands.empty() && command.get_subcommands().empty()) {
        std::string names;
        for (const CLI::App* c : commands) names += (names.empty() ? "" : ", ") + c->get_name();
        return name + ": expected one of the commands " + names + help;
    }
    if (const std::string empty = empty_value(app, words); !empty.empty()) return empty + help;
    return name + ": " + e.what() + help;
}

/// Opens /dev/null for each standard stream that is closed. Otherwise the next file that is opened would get its
/// descriptor, and messages would go into that file. Read-only, so that writing still fails.
void occupy_closed_streams() {
    for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (::fcntl(fd, F_GETFD) < 0) ::open("/dev/null", O_RDONLY);
}

}  // namespace

int parse_and_run(int argc, char** argv, const ProgramTexts& texts, const std::function<void(Parser)>& add_options,
                  const std::function<int()>& run, bool* json) {
    occupy_closed_streams();
    CLI::App app{texts.description, texts.name};
    app.set_version_flag("--version", texts.version);
    app.fallthrough();
    app.footer(texts.footer);
    app.formatter(std::make_shared<HelpFormatter>());
    add_options(Parser(app));
    if (json) add_json_flag(app, *json);
    const std::span<char* const> words(argv + 1, static_cast<std::size_t>(std::max(argc - 1, 0)));
    if (const std::string unknown = unknown_command(app, words); !unknown.empty()) {
        std::cerr << unknown << "\n";
        return exit_status(ErrorKind::bad_input);
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        if (e.get_exit_code() == 0) return app.exit(e, std::cout, std::cerr);  // --help, --version
        std::cerr << (words.empty() ? app.help() : line_error(app, e, words) + "\n");
        return exit_status(ErrorKind::bad_input);
    }
    if (const std::string empty = empty_value(app, words); !empty.empty()) {
        std::cerr << empty << "\n";
        return exit_status(ErrorKind::bad_input);
    }
    return run();
}

}  // namespace narpa::cli
