#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "common/client_input.h"
#include "common/diagnostic.h"

namespace romap::session {

// Gives a class to the labels of masks that the client lists no instance for, and says so if the client does list
// instances: then its labels and its masks do not fit together.
class UnlistedLabels {
 public:
  // Adds an instance of class "object" for every label of the mask that has none, so that later stages find one for
  // each label. `labels`: CV_16UC1. `eight_bit`: the mask was an 8-bit image, where 255 beside other labels is
  // "ignore".
  void Add(uint64_t frame_id, bool eight_bit, const cv::Mat& labels, std::vector<Instance>* instances);

  // labels_without_class. A warning if it concerns most masks.
  std::optional<Diagnostic> Check() const;

 private:
  uint64_t masks_ = 0;
  bool has_classes_ = false;  // the client lists instances
  uint64_t first_frame_id_ = 0;
  uint64_t count_ = 0;  // masks with such labels
  uint16_t first_label_ = 0;
  uint32_t first_absent_ = 0;  // a listed label without a pixel in that mask; 0: none
};

}  // namespace romap::session
