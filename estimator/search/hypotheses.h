/// estimator/search/hypotheses.h - from all attitudes to the few that resemble the frame.
#pragma once

#include <vector>

#include "estimator/search/template_matcher.h"

namespace narpa {

/// `attitudes` of a grid and what is left of them: the `kept` best improved by steps of attitude, and of these the
/// `most` best that lie apart, best first. Counts the renders.
[[nodiscard]] std::vector<Hypothesis> find_hypotheses(const SearchView& known, const MeasuredImage& frame,
                                                      const BrightRegion& region, int attitudes, int kept, int most,
                                                      int& renders);

}  // namespace narpa
