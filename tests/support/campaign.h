/// tests/support/campaign.h - how many trials a test makes: few that guard, or all, which take CPU minutes.
#pragma once

#include <cstdlib>
#include <vector>

namespace narpa::test {

/// The first `guards` of the trials; all of them under `scripts/campaign trials`.
inline std::vector<int> guards_or_all(std::vector<int> trials, std::size_t guards) {
    if (std::getenv("NARPA_CAMPAIGN") == nullptr && guards < trials.size()) trials.resize(guards);
    return trials;
}

/// `few` trials; `all` under `scripts/campaign trials`.
inline int trials(int few, int all) {
    return std::getenv("NARPA_CAMPAIGN") == nullptr ? few : all;
}

}  // namespace narpa::test
