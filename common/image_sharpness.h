#pragma once

#include <opencv2/core/mat.hpp>

namespace romap {

// Sharpness of an image (CV_8UC3): the variance of the Laplacian of its gray values, in squared gray levels. Small for
// blurred images. It also depends on the texture, so compare only images of the same scene or object. Source: J. L.
// Pech-Pacheco et al., "Diatom autofocusing in brightfield microscopy", ICPR 2000.
double ImageSharpness(const cv::Mat& image_bgr);

}  // namespace romap
