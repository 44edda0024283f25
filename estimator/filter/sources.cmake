target_sources(narpa_estimator PRIVATE filter/motion_model.cpp filter/pose_filter.cpp)
