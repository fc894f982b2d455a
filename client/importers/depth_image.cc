#include "client/importers/depth_image.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "client/files/image_file.h"
#include "client/importers/any_image.h"
#include "client/importers/mask_layers.h"
#include "client/importers/one_camera.h"
#include "common/png_reader.h"

namespace romap::importers {

absl::StatusOr<std::string> LoadDepthImage(const std::string& path, const DepthRules& rules, const CameraModel& color) {
  ROMAP_ASSIGN_OR_RETURN(std::string png, files::ReadPngFile(path));
  const absl::StatusOr<cv::Mat> decoded = DecodePng(png, PngPixels::kStored, {});
  if (!decoded.ok()) return InvalidArgument("{}: {}", path, Message(decoded.status()));
  if (decoded->type() != CV_16UC1) return InvalidArgument("{}: expected a depth image of 16 bits", path);
  cv::Mat depth = *decoded;
  bool is_changed = false;
  for (const uint16_t value : rules.unknown) {
    const cv::Mat unknown = depth == static_cast<int>(value);
    if (cv::countNonZero(unknown) == 0) continue;
    depth.setTo(0, unknown);
    is_changed = true;
  }
  if (!rules.confidence.empty()) {
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat confidence, ReadLabels(rules.confidence, cv::Size()));
    if (confidence.size() != depth.size()) {
      return InvalidArgument("{}: {}x{} px; expected {}x{} px as {}", rules.confidence, confidence.cols,
                             confidence.rows, depth.cols, depth.rows, path);
    }
    depth.setTo(0, confidence < rules.min_confidence);
    is_changed = true;
  }
  const cv::Size size_px(color.width_px, color.height_px);
  if (rules.camera) {
    depth = ResampleFor(depth, *rules.camera, color, cv::INTER_NEAREST);
    is_changed = true;
  } else if (depth.size() != size_px) {
    depth = ResizeNearest(depth, size_px);
    is_changed = true;
  }
  return is_changed ? EncodePng(depth) : std::move(png);
}

void SetDepth(const std::string& path, const DepthRules& rules, const CameraModel& color, RecordedFrame* frame) {
  frame->paths.depth = path;
  frame->load_depth = [path, rules, color] { return LoadDepthImage(path, rules, color); };
}

}  // namespace romap::importers
