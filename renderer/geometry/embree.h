/// renderer/geometry/embree.h - the few Embree calls that differ between its versions 3 and 4.
#pragma once

#include <limits>
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

// The calls differ in where the context goes; the context's only use here is the coherent flag.

inline void intersect(RTCScene scene, RTCRayHit& ray) noexcept {
#if NARPA_EMBREE_MAJOR >= 4
    rtcIntersect1(scene, &ray);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, &ray);
#endif
}

/// Whether the rays of a packet are coherent.
enum class Run { together, apart };

/// Sixteen rays. `valid`: -1 for the lanes to trace, 0 for those to skip.
inline void intersect(RTCScene scene, const int* valid, RTCRayHit16& rays, Run run) noexcept {
#if NARPA_EMBREE_MAJOR >= 4
    RTCIntersectArguments arguments;
    rtcInitIntersectArguments(&arguments);
    if (run == Run::together) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    rtcIntersect16(valid, scene, &rays, &arguments);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    if (run == Run::together) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid, scene, &context, &rays);
#endif
}

/// The value of ray.tfar after an occluded ray.
inline constexpr float kOccluded = -std::numeric_limits<float>::infinity();

inline void occluded(RTCScene scene, RTCRay& ray) noexcept {
#if NARPA_EMBREE_MAJOR >= 4
    rtcOccluded1(scene, &ray);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, &ray);
#endif
}

/// Sixteen shadow rays. With instances in the scene the coherent flag must not be set here: Embree 3.13 then loops
/// for ever where there is AVX-512. narpa uses no instances.
inline void occluded(RTCScene scene, const int* valid, RTCRay16& rays, Run run) noexcept {
#if NARPA_EMBREE_MAJOR >= 4
    RTCOccludedArguments arguments;
    rtcInitOccludedArguments(&arguments);
    if (run == Run::together) arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
    rtcOccluded16(valid, scene, &rays, &arguments);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    if (run == Run::together) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcOccluded16(valid, scene, &context, &rays);
#endif
}

}  // namespace narpa::embree
