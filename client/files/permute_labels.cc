#include "client/files/permute_labels.h"

#include <algorithm>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "common/image_bytes.h"
#include "common/label_png.h"

namespace romap::files {

absl::Status PermuteLabels(uint64_t seed, std::string* label_png, std::vector<Instance>* instances) {
  ROMAP_ASSIGN_OR_RETURN(const cv::Mat labels, DecodeLabelPng(*label_png));
  const bool two_bytes = PngHeader(*label_png)->bits == 16;
  std::vector<uint32_t> new_labels(two_bytes ? 65536 : 256);
  std::iota(new_labels.begin(), new_labels.end(), 0);
  std::mt19937_64 random(seed);
  std::shuffle(new_labels.begin() + 1, new_labels.end(), random);
  cv::Mat permuted(labels.size(), CV_16UC1);
  for (int y = 0; y < labels.rows; ++y) {
    const auto* row = labels.ptr<uint16_t>(y);
    auto* out = permuted.ptr<uint16_t>(y);
    for (int x = 0; x < labels.cols; ++x) out[x] = static_cast<uint16_t>(new_labels[row[x]]);
  }
  if (!two_bytes) permuted.convertTo(permuted, CV_8U);
  std::vector<uint8_t> bytes;
  cv::imencode(".png", permuted, bytes);
  label_png->assign(bytes.begin(), bytes.end());
  for (Instance& instance : *instances) {
    if (instance.label < new_labels.size()) instance.label = new_labels[instance.label];
  }
  std::sort(instances->begin(), instances->end(),
            [](const Instance& a, const Instance& b) { return a.label < b.label; });
  return absl::OkStatus();
}

}  // namespace romap::files
