target_sources(narpa_estimator PRIVATE cloud/beam_association.cpp cloud/cloud_icp.cpp cloud/observability.cpp
                                       cloud/sweep_points.cpp)
