#include "server/masks/mask_thumbnail.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "common/label_image.h"

namespace romap::masks {
namespace {

constexpr int kColumns = 160;  // of a thumbnail, about

int StrideOf(int width_px) { return std::max(1, width_px / kColumns); }

using Regions = std::map<uint16_t, MaskRegion>;

bool IsInstance(uint16_t label) { return label != 0 && label != kIgnoreLabel; }

void AddContact(uint16_t inside, uint16_t outside, Regions& regions) {
  if (inside == outside || !IsInstance(inside) || outside == kIgnoreLabel) return;
  MaskRegion& region = regions[inside];
  ++region.outline;
  ++region.contacts[outside];
}

// Number of sides of which the label covers at least kMinSideShare.
int SidesOf(uint16_t label, const cv::Mat& labels) {
  std::array<int, 4> covered{};  // top, bottom, left, right
  for (int u = 0; u < labels.cols; ++u) {
    covered[0] += labels.at<uint16_t>(0, u) == label ? 1 : 0;
    covered[1] += labels.at<uint16_t>(labels.rows - 1, u) == label ? 1 : 0;
  }
  for (int v = 0; v < labels.rows; ++v) {
    covered[2] += labels.at<uint16_t>(v, 0) == label ? 1 : 0;
    covered[3] += labels.at<uint16_t>(v, labels.cols - 1) == label ? 1 : 0;
  }
  int sides = 0;
  for (size_t k = 0; k < covered.size(); ++k) {
    sides += covered[k] >= kMinSideShare * (k < 2 ? labels.cols : labels.rows) ? 1 : 0;
  }
  return sides;
}

std::vector<MaskRegion> MeasureRegions(const cv::Mat& labels) {
  Regions regions;
  for (int v = 0; v < labels.rows; ++v) {
    const auto* row = labels.ptr<uint16_t>(v);
    const auto* below = v + 1 < labels.rows ? labels.ptr<uint16_t>(v + 1) : nullptr;
    for (int u = 0; u < labels.cols; ++u) {
      const uint16_t label = row[u];
      if (IsInstance(label)) {
        MaskRegion& region = regions[label];
        region.label = label;
        ++region.area;
        region.box = region.area == 1 ? cv::Rect(u, v, 1, 1) : region.box | cv::Rect(u, v, 1, 1);
      }
      if (u + 1 < labels.cols) {
        AddContact(label, row[u + 1], regions);
        AddContact(row[u + 1], label, regions);
      }
      if (below != nullptr) {
        AddContact(label, below[u], regions);
        AddContact(below[u], label, regions);
      }
    }
  }
  std::vector<MaskRegion> measured;
  for (auto& [label, region] : regions) {
    region.sides = SidesOf(label, labels);
    measured.push_back(std::move(region));
  }
  return measured;
}

}  // namespace

const MaskRegion* MaskThumbnail::Find(uint16_t label) const {
  const auto found = std::lower_bound(regions.begin(), regions.end(), label,
                                      [](const MaskRegion& region, uint16_t l) { return region.label < l; });
  return found == regions.end() || found->label != label ? nullptr : &*found;
}

cv::Mat MakeGray(const cv::Mat& image_bgr) {
  const int stride = StrideOf(image_bgr.cols);
  const cv::Size size((image_bgr.cols + stride - 1) / stride, (image_bgr.rows + stride - 1) / stride);
  cv::Mat small, gray;
  cv::resize(image_bgr, small, size, 0, 0, cv::INTER_AREA);
  cv::cvtColor(small, gray, cv::COLOR_BGR2GRAY);
  return gray;
}

MaskThumbnail MakeThumbnail(const cv::Mat& labels, const cv::Mat& gray) {
  MaskThumbnail thumbnail;
  thumbnail.stride_px = StrideOf(labels.cols);
  thumbnail.gray = gray;
  const int stride = thumbnail.stride_px;
  thumbnail.labels.create((labels.rows + stride - 1) / stride, (labels.cols + stride - 1) / stride, CV_16UC1);
  for (int v = 0; v < thumbnail.labels.rows; ++v) {
    const auto* from = labels.ptr<uint16_t>(v * stride);
    auto* to = thumbnail.labels.ptr<uint16_t>(v);
    for (int u = 0; u < thumbnail.labels.cols; ++u) to[u] = from[u * stride];
  }
  thumbnail.regions = MeasureRegions(thumbnail.labels);
  return thumbnail;
}

double MaskIou(const MaskThumbnail& first, uint16_t a, const MaskThumbnail& second, uint16_t b) {
  if (first.labels.size() != second.labels.size()) return 0;
  const cv::Mat in_first = first.labels == a;
  const cv::Mat in_second = second.labels == b;
  const int either = cv::countNonZero(in_first | in_second);
  return either > 0 ? static_cast<double>(cv::countNonZero(in_first & in_second)) / either : 0;
}

}  // namespace romap::masks
