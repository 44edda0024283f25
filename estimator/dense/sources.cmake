target_sources(narpa_estimator PRIVATE dense/dense_alignment.cpp dense/descent.cpp dense/image_derivative.cpp
  dense/level_view.cpp dense/photometric_fit.cpp dense/pixel_patch.cpp)
find_package(TBB REQUIRED)
target_link_libraries(narpa_estimator PRIVATE TBB::tbb)
