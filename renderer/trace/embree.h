/// renderer/trace/embree.h - the few Embree calls that differ between its versions 3 and 4.
#pragma once

#include <memory>
#include <type_traits>

#if NARPA_EMBREE_MAJOR >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace narpa::embree {

struct Release {
    void operator()(RTCDevice d) const noexcept { rtcReleaseDevice(d); }
    void operator()(RTCScene s) const noexcept { rtcReleaseScene(s); }
    void operator()(RTCGeometry g) const noexcept { rtcReleaseGeometry(g); }
};
template <class Handle>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

inline void intersect(RTCScene scene, RTCRayHit& ray) noexcept {
#if NARPA_EMBREE_MAJOR >= 4
    rtcIntersect1(scene, &ray);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, &ray);
#endif
}

/// Sets ray.tfar to -infinity when anything is hit.
inline void occluded(RTCScene scene, RTCRay& ray) noexcept {
#if NARPA_EMBREE_MAJOR >= 4
    rtcOccluded1(scene, &ray);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, &ray);
#endif
}

}  // namespace narpa::embree
