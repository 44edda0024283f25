#include "estimator/uncertainty/share.h"

#include <cmath>

namespace narpa {

bool share_is_more(std::size_t found, std::size_t n, double least) {
    if (static_cast<double>(found) < least * static_cast<double>(n)) return false;
    if (!(least > 0) || least >= 1) return true;
    // The binomial distribution from n downwards.
    double term = std::pow(least, static_cast<double>(n)), sum = term;
    for (std::size_t k = n; k > found && sum < 0.05; --k) {
        term *= static_cast<double>(k) / static_cast<double>(n - k + 1) * (1 - least) / least;
        sum += term;
    }
    return sum < 0.05;
}

std::size_t fewest_for_share(double least) {
    std::size_t n = 1;
    while (!share_is_more(n, n, least)) ++n;
    return n;
}

}  // namespace narpa
