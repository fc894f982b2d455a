#include "client/files/permute_labels.h"

#include <algorithm>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <random>

namespace romap::files {
namespace {

template <class Pixel>
void ReplaceLabels(const std::vector<uint32_t>& new_labels, cv::Mat* labels) {
  for (int y = 0; y < labels->rows; ++y) {
    Pixel* row = labels->ptr<Pixel>(y);
    for (int x = 0; x < labels->cols; ++x) row[x] = static_cast<Pixel>(new_labels[row[x]]);
  }
}

}  // namespace

absl::Status PermuteLabels(uint64_t seed, std::string* label_png, std::vector<Instance>* instances) {
  try {
    cv::Mat labels =
        cv::imdecode(cv::Mat(1, static_cast<int>(label_png->size()), CV_8UC1, label_png->data()), cv::IMREAD_UNCHANGED);
    if (labels.type() != CV_8UC1 && labels.type() != CV_16UC1) {
      return InvalidArgument("mask is not an 8-bit or 16-bit single-channel image");
    }
    std::vector<uint32_t> new_labels(labels.type() == CV_8UC1 ? 256 : 65536);
    std::iota(new_labels.begin(), new_labels.end(), 0);
    std::mt19937_64 random(seed);
    std::shuffle(new_labels.begin() + 1, new_labels.end(), random);
    labels.type() == CV_8UC1 ? ReplaceLabels<uint8_t>(new_labels, &labels)
                             : ReplaceLabels<uint16_t>(new_labels, &labels);
    std::vector<uint8_t> bytes;
    cv::imencode(".png", labels, bytes);
    label_png->assign(bytes.begin(), bytes.end());
    for (Instance& instance : *instances) {
      if (instance.label < new_labels.size()) instance.label = new_labels[instance.label];
    }
  } catch (const cv::Exception& e) {
    return InvalidArgument("mask cannot be decoded: {}", e.what());
  }
  std::sort(instances->begin(), instances->end(),
            [](const Instance& a, const Instance& b) { return a.label < b.label; });
  return absl::OkStatus();
}

}  // namespace romap::files
