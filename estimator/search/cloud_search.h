/// estimator/search/cloud_search.h - the pose of a target in a LiDAR's sweep without a guess: any attitude, where
/// the points are.
///
/// From attitudes all over SO(3), few points lead to poses (cloud/cloud_icp.h); the best that lie apart are fitted
/// to all points. The answer is the most likely of those that neither points nor beams without return refute;
/// others that are as likely make it ambiguous.
#pragma once

#include <span>

#include "estimator/cloud/cloud_icp.h"

namespace narpa {

struct CloudSearchOptions {
    int attitudes = 500;  ///< tried with few points: 31 degrees apart
    int finished = 12;    ///< of them, fitted to all points
};

class CloudSearch {
public:
    /// `tracer` outlives it. `target`: index of the body whose pose is sought.
    CloudSearch(const Tracer& tracer, std::size_t target, const IcpSettings& settings = {})
        : tracer_(tracer), target_(target), icp_(tracer, target, settings) {}

    /// As CloudIcp::align. Errors: a sweep or options that are unusable, or fewer than six points on the target
    /// wherever it is taken to be.
    [[nodiscard]] Result<CloudEstimate> find(std::span<const RangePoint> points, const ApparentMotion& motion,
                                             std::span<const EmptyBeam> empty = {},
                                             const CloudSearchOptions& options = {});

private:
    const Tracer& tracer_;
    std::size_t target_;
    CloudIcp icp_;
};

}  // namespace narpa
