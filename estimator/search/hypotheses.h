/// estimator/search/hypotheses.h - reduces a grid of all attitudes to the few that resemble the frame.
#pragma once

#include <vector>

#include "estimator/search/template_matcher.h"

namespace narpa {

/// Renders a grid of `attitudes`, improves the `kept` best by steps of attitude, and returns the `most` best
/// distinct ones, best first. Adds the number of renders to `renders`.
[[nodiscard]] std::vector<Hypothesis> find_hypotheses(const SearchView& known, const MeasuredImage& frame,
                                                      const BrightRegion& region, int attitudes, int kept, int most,
                                                      int& renders);

}  // namespace narpa
