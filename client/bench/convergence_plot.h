#pragma once

#include <opencv2/core/mat.hpp>

#include "client/bench/paper_results.h"

namespace romap::bench {

// Plots accuracy and completion over training time side by side, as in Fig. 8 of the paper: one line per method of
// `results.curves` on logarithmic axes, and the final results of the paper as crosses at 2 s. Returns CV_8UC3.
cv::Mat DrawConvergence(const PaperResults& results);

}  // namespace romap::bench
