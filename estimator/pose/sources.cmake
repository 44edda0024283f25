target_sources(narpa_estimator PRIVATE
  pose/crp.cpp pose/pnp_points.cpp pose/pnp_refine.cpp pose/pose_estimate.cpp)
