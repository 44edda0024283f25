target_sources(narpa_estimator PRIVATE features/feature_alignment.cpp features/feature_matcher.cpp features/flow_noise.cpp)
target_link_libraries(narpa_estimator PRIVATE opencv_core opencv_imgproc opencv_features2d opencv_video)
# OpenCV 4.6's headers warn in C++20; they are met in the files that name its parts.
target_include_directories(narpa_estimator SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
