/// dataset/gather/statistics.h - what a data set holds: distributions of its images, as a document of narpa-plot.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

namespace narpa::dataset {

/// Counts of values in equal intervals between the least and the greatest.
struct Histogram1d {
    std::vector<double> edges{};  ///< one more than counts; empty without values
    std::vector<std::uint64_t> counts{};
};
/// `logarithmic`: intervals are equal in the logarithm; the values are > 0.
[[nodiscard]] Histogram1d histogram_of(std::span<const double> values, int bins, bool logarithmic = false);

class DatasetStatistics {
public:
    void add(const nlohmann::json& label);
    /// Document of the plot "dataset": docs/datasets.md.
    [[nodiscard]] nlohmann::json document(const std::string& title) const;

private:
    std::vector<double> range_m_, phase_deg_, brightness_, visible_part_, target_share_;
    std::size_t images_ = 0, empty_ = 0;
};

}  // namespace narpa::dataset
