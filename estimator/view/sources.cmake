target_sources(narpa_estimator PRIVATE view/measured_image.cpp view/model_view.cpp)
