/// estimator/search/cloud_search.h - the pose of a target in a LiDAR's sweep without a guess: any attitude, near
/// the points.
///
/// From attitudes all over SO(3), fits to few points yield poses (cloud/cloud_icp.h); the best distinct ones are
/// fitted to all points. The answer is the most likely pose that is refuted neither by points nor by beams without
/// return; other poses that are as likely make it ambiguous.
#pragma once

#include <span>

#include "estimator/cloud/cloud_icp.h"

namespace narpa {

struct CloudSearchOptions {
    int attitudes = 500;  ///< grid attitudes tried with few points: 31 degrees apart
    int finished = 12;    ///< of these, the number fitted to all points
};

class CloudSearch {
public:
    /// `tracer` outlives it. `target`: index of the body whose pose is sought.
    CloudSearch(const Tracer& tracer, std::size_t target, const IcpSettings& settings = {})
        : tracer_(tracer), target_(target), icp_(tracer, target, settings) {}

    /// Like CloudIcp::align, without a guess. Refused if no pose has six points on the target. Errors: an unusable
    /// sweep or options.
    [[nodiscard]] Result<CloudEstimate> find(std::span<const RangePoint> points, const ApparentMotion& motion,
                                             std::span<const EmptyBeam> empty = {},
                                             const CloudSearchOptions& options = {});

private:
    const Tracer& tracer_;
    std::size_t target_;
    CloudIcp icp_;
};

}  // namespace narpa
