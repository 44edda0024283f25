// The shared library that renderer/assets/image_codecs.h loads. It alone is linked to OpenCV's codecs.
#include "renderer/assets/image_codecs.h"

#include <opencv2/imgcodecs.hpp>

extern "C" __attribute__((visibility("default")))
const narpa::ImageCodecs narpa_image_codecs{.imdecode = cv::imdecode, .imencode = cv::imencode};
