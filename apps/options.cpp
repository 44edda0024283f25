#include "apps/options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "base/result.h"

namespace narpa::cli {

Option Option::required() const {
    return Option(option_->required());
}
Option Option::range(int least, int most) const {
    return Option(option_->check(CLI::Range(least, most)));
}
Option Option::range(double least, double most) const {
    return Option(option_->check(CLI::Range(least, most)));
}
Option Option::range(std::uint64_t least, std::uint64_t most) const {
    return Option(option_->check(CLI::Range(least, most)));
}
Option Option::finite() const {
    return check([](const std::string& text) {
        return std::isfinite(std::strtod(text.c_str(), nullptr)) ? "" : text + " is not a finite number";
    });
}
Option Option::one_of(const std::vector<std::string>& values) const {
    return Option(option_->check(CLI::IsMember(values)));
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
Option Option::comma_separated() const {
    return Option(option_->delimiter(',')->allow_extra_args(false));
}
Option Option::values(int least, int most) const {
    return Option(option_->expected(least, most));
}
Option Option::type_name(const std::string& name) const {
    return Option(option_->type_name(name));
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
    return Option(app_->add_option(names, value, help));
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

}  // namespace

int parse_and_run(int argc, char** argv, const ProgramTexts& texts, bool& json,
                  const std::function<void(Parser)>& add_subcommands, const std::function<int()>& run) {
    CLI::App app{texts.description};
    app.set_version_flag("--version", texts.version);
    app.fallthrough();
    app.footer(texts.footer);
    add_subcommands(Parser(app));
    add_json_flag(app, json);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        return app.exit(e, std::cout, std::cerr) == 0 ? 0 : exit_status(ErrorKind::bad_input);
    }
    return run();
}

}  // namespace narpa::cli
