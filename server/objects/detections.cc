#include "server/objects/detections.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <map>

#include "common/label_image.h"

namespace romap::objects {
namespace {

struct Extent {
  int left = 1 << 30;
  int right = -1;
  int top = 1 << 30;
  int bottom = -1;
  int area_px = 0;
  int border_px = 0;
};

// Makes one pass over the runs of equal labels of each row.
std::map<uint16_t, Extent> MeasureLabels(const cv::Mat& labels) {
  std::map<uint16_t, Extent> extents;
  for (int v = 0; v < labels.rows; ++v) {
    const auto* row = labels.ptr<uint16_t>(v);
    const bool border_row = v == 0 || v == labels.rows - 1;
    for (int u = 0; u < labels.cols;) {
      const uint16_t label = row[u];
      const int start = u;
      while (u < labels.cols && row[u] == label) ++u;
      if (label == 0 || label == kIgnoreLabel) continue;
      Extent& extent = extents[label];
      extent.left = std::min(extent.left, start);
      extent.right = std::max(extent.right, u - 1);
      extent.top = std::min(extent.top, v);
      extent.bottom = v;
      extent.area_px += u - start;
      extent.border_px += border_row ? u - start : (start == 0 ? 1 : 0) + (u == labels.cols ? 1 : 0);
    }
  }
  return extents;
}

// The time of an association grows with the square of the number of masks. The limit bounds the time for detectors that
// label every patch of the image.
void KeepLargest(size_t count, uint64_t frame_id, std::vector<Detection>& detections) {
  if (detections.size() <= count) return;
  spdlog::debug("objects: frame {}: {} masks; only the {} largest are used", frame_id, detections.size(), count);
  std::nth_element(detections.begin(), detections.begin() + static_cast<std::ptrdiff_t>(count), detections.end(),
                   [](const Detection& a, const Detection& b) { return a.area_px > b.area_px; });
  detections.resize(count);
  std::sort(detections.begin(), detections.end(),
            [](const Detection& a, const Detection& b) { return a.label < b.label; });
}

}  // namespace

std::vector<Detection> ExtractDetections(const Frame& frame, const ObjectsConfig& config) {
  std::vector<Detection> detections;
  if (!frame.has_masks || frame.labels.empty()) return detections;
  const CameraModel& camera = frame.camera;
  if (frame.labels.type() != CV_16UC1 || frame.labels.cols != camera.width_px ||
      frame.labels.rows != camera.height_px) {
    spdlog::debug("objects: frame {}: label image of {}x{} px and type {} ignored, the camera has {}x{} px",
                  frame.frame_id, frame.labels.cols, frame.labels.rows, frame.labels.type(), camera.width_px,
                  camera.height_px);
    return detections;
  }
  const double max_area_px = config.max_mask_area_share * frame.labels.rows * frame.labels.cols;
  for (const auto& [label, extent] : MeasureLabels(frame.labels)) {
    if (extent.area_px < config.min_mask_area_px || extent.area_px > max_area_px) {
      spdlog::debug("objects: frame {}: label {} ignored, area {} px", frame.frame_id, label, extent.area_px);
      continue;
    }
    Detection detection{
        .label = label,
        .class_name = "object",
        .track_id = {},
        .area_px = extent.area_px,
        .box_px = {extent.left, extent.top, extent.right - extent.left + 1, extent.bottom - extent.top + 1},
        .border_px = extent.border_px};
    const auto instance = std::find_if(frame.instances.begin(), frame.instances.end(),
                                       [&](const Instance& i) { return i.label == detection.label; });
    if (instance != frame.instances.end()) {
      detection.class_name = instance->class_name;
      detection.score = std::clamp(instance->score, 0.05, 1.0);
      detection.track_id = instance->track_id;
    }
    detections.push_back(std::move(detection));
  }
  KeepLargest(static_cast<size_t>(config.max_detections), frame.frame_id, detections);
  return detections;
}

}  // namespace romap::objects
