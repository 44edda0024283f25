// The shared library that renderer/assets/images/image_codecs.h loads. It alone is linked to OpenCV's codecs and
// libtiff.
#include "renderer/assets/images/image_codecs.h"

#include <opencv2/imgcodecs.hpp>

#include "renderer/image_codecs/tiff_decoder.h"

extern "C" __attribute__((visibility("default"))) const narpa::ImageCodecs narpa_image_codecs{
    .imdecode = cv::imdecode, .imencode = cv::imencode, .decode_tiff = narpa::decode_tiff};
