/// estimator/uncertainty/share.h - whether few draws show that a share is large.
#pragma once

#include <cstddef>

namespace narpa {

/// True if `found` or more of n would occur with a chance below 5 % if the true share were `least` (exact binomial
/// test: Clopper and Pearson 1934). With few, nearly all must be found.
[[nodiscard]] bool share_is_more(std::size_t found, std::size_t n, double least);
/// The smallest number for which it is true if all are found; `least` < 1.
[[nodiscard]] std::size_t fewest_for_share(double least);

}  // namespace narpa
