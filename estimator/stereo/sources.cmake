target_sources(narpa_estimator PRIVATE stereo/triangulation.cpp)
