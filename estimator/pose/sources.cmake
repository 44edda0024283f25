target_sources(narpa_estimator PRIVATE pose/pose_estimate.cpp)
