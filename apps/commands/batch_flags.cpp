#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "apps/commands/estimate_batch.h"

namespace narpa::cli {
namespace {

std::string names_of_unknowns(const BatchValues* known) {
    std::string names;
    std::string_view last;
    for (std::size_t i = 0; i < kBatchUnknowns; ++i) {
        const BatchUnknownRow& row = batch_unknowns()[i];
        if (group_of(row.name) == last || (known && (*known)[i] == 0)) continue;
        last = group_of(row.name);
        names += (names.empty() ? "" : ", ") + std::string(last);
    }
    return names;
}

}  // namespace

Result<BatchValues> batch_values(const std::string& text, const std::string& option, const BatchValues* known,
                                 bool may_be_negative) {
    BatchValues values{};
    for (std::size_t from = 0; from < text.size();) {
        const std::size_t end = std::min(text.find(',', from), text.size());
        const std::string item = text.substr(from, end - from);
        from = end + 1;
        const std::size_t equals = item.find('=');
        const std::string name = item.substr(0, equals);
        const bool is_lone = equals == std::string::npos;
        double value = 0;
        if (!is_lone) {
            const char* const last = item.data() + item.size();
            const auto [read, error] = std::from_chars(item.data() + equals + 1, last, value);
            if (error != std::errc{} || read != last || !std::isfinite(value) || (value < 0 && !may_be_negative))
                return Error{fmt::format("{} \"{}\": expected {}=NUMBER{}", option, item, name,
                                         may_be_negative ? "" : ", 0 or more")};
        }
        bool found = false;
        for (std::size_t i = 0; i < kBatchUnknowns; ++i) {
            const BatchUnknownRow& row = batch_unknowns()[i];
            if ((name != row.name && name != group_of(row.name)) || (known && (*known)[i] == 0)) continue;
            found = true;
            values[i] = is_lone && known ? (*known)[i] : row.unit * value;
        }
        if (!found || (is_lone && !known))
            return Error{fmt::format("{} \"{}\": expected NAME=VALUE with one of {}", option, item,
                                     names_of_unknowns(known))};
    }
    return values;
}

void BatchFlags::add_to(Parser app) {
    const std::string group = "All frames and sweeps at once";
    app.flag("--batch", on,
             "Of a logged run: trajectory and errors of the model by one least-squares problem of all frames and "
             "sweeps, with covariance")
        .group(group);
    app.option(
           "--unknowns", unknowns,
           "Errors of the model that are estimated, with the standard deviation of their priors, in place of: " +
               help_of_batch_unknowns() + "; none: the trajectory alone")
        .type_name("NAME[=SIGMA],...")
        .group(group);
    app.option("--path-sigma", path_sigma,
               "The run's poses are those commanded, to within these standard deviations: tells mounts and clock "
               "from the trajectory")
        .type_name("DEG,METRES")
        .group(group);
    app.option(
           "--model-error", model_error,
           "Estimate with a model that is wrong by this much, to see what is found of it; names as of --unknowns")
        .type_name("NAME=VALUE,...")
        .group(group);
}

}  // namespace narpa::cli
