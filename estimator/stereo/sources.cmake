target_sources(narpa_estimator PRIVATE stereo/epipolar_warp.cpp stereo/patch_match.cpp stereo/spline_image.cpp stereo/stereo_matcher.cpp stereo/triangulation.cpp)
