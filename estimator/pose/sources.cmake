target_sources(narpa_estimator PRIVATE
  pose/crp.cpp pose/pnp.cpp pose/pnp_bound.cpp pose/pnp_ceres.cpp pose/pnp_points.cpp pose/pnp_ransac.cpp
  pose/pnp_refine.cpp pose/pnp_start.cpp pose/pnp_start_opencv.cpp pose/pose_estimate.cpp)
target_link_libraries(narpa_estimator PRIVATE Ceres::ceres opencv_core opencv_calib3d)
# OpenCV 4.6's headers warn in C++20.
target_include_directories(narpa_estimator SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
