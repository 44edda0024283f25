find_package(OpenEXR REQUIRED)
target_sources(narpa_renderer PRIVATE image/image_file.cpp)
target_link_libraries(narpa_renderer PRIVATE OpenEXR::OpenEXR opencv_core opencv_imgproc opencv_imgcodecs)
