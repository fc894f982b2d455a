#pragma once

#include <opencv2/core/mat.hpp>

#include "client/bench/paper_results.h"

namespace romap::bench {

// Accuracy and completion over training time as in the paper's Fig. 8, side by side: one line per method of
// `results.curves`, both axes logarithmic, the paper's own end results as crosses at its 2 s. CV_8UC3; without
// curves it has the crosses alone.
cv::Mat DrawConvergence(const PaperResults& results);

}  // namespace romap::bench
