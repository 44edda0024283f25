#include "dataset/recipe/distribution.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/keys/toml_reader.h"

namespace narpa::dataset {
namespace {

constexpr int kMaxChoices = 1000;

constexpr TableKey kUniformRows[]{{"between", rows::pair(), "[lowest, highest]"}};
constexpr TableKey kLogUniformRows[]{{"between", rows::pair(kPositive), "[lowest, highest]"}};
constexpr TableKey kChoiceRows[]{{"values", rows::numbers_up_to(kMaxChoices), "an array of numbers"}};

constexpr DistributionKind kUniform{"uniform", kUniformRows, [](const Distribution& d, double u) {
                                        return d.values[0] + u * (d.values[1] - d.values[0]);
                                    }};
constexpr DistributionKind kLogUniform{"log_uniform", kLogUniformRows, [](const Distribution& d, double u) {
                                           return d.values[0] * std::pow(d.values[1] / d.values[0], u);
                                       }};
constexpr DistributionKind kChoice{"choice", kChoiceRows, [](const Distribution& d, double u) {
                                       const auto n = static_cast<double>(d.values.size());
                                       return d.values[static_cast<std::size_t>(std::min(u * n, n - 1))];
                                   }};
constexpr std::array<const DistributionKind*, 3> kKinds{&kUniform, &kLogUniform, &kChoice};

constexpr TableKey kDistributionRows[]{{"kind", rows::kind("uniform")}};

}  // namespace

constinit const TableKeys kDistributionKeys{.rows = kDistributionRows, .kinds = kinds_of<distribution_kinds>};

std::span<const DistributionKind* const> distribution_kinds() {
    return kKinds;
}

Distribution uniform_between(double low, double high) {
    return {&kUniform, {low, high}};
}
Distribution log_uniform_between(double low, double high) {
    return {&kLogUniform, {low, high}};
}

std::optional<Distribution> read_distribution(TableReader& table, std::string_view key, const Range& allowed) {
    auto own = table.table(key);
    if (!own) return std::nullopt;
    const auto index = own->kind();
    if (!index) return std::nullopt;
    Distribution d{kKinds[*index]};
    const std::string_view values = d.kind->keys.front().name;
    const auto numbers = own->numbers(values);
    if (numbers) {
        d.values = *numbers;
        for (const double x : d.values)
            if (!allowed.holds(x)) {
                own->fail(values, fmt::format("got {:g}, expected {}", x, allowed.words()));
                break;
            }
        if (d.kind != &kChoice && d.values[0] > d.values[1])
            own->fail(values,
                      fmt::format("got {:g} and {:g}, expected the lower number first", d.values[0], d.values[1]));
    }
    own->finish();
    return numbers ? std::optional(std::move(d)) : std::nullopt;
}

}  // namespace narpa::dataset
