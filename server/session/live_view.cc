#include "server/session/live_view.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "common/status.h"

namespace romap::session {
namespace {

constexpr int kJpegQuality = 80;

}  // namespace

void LiveView::SetImage(std::shared_ptr<const Frame> frame) {
  std::lock_guard lock(mutex_);
  frame_.swap(frame);
}

void LiveView::SetPoints(SparsePoints points) {
  auto shared = std::make_shared<SparsePoints>(std::move(points));
  std::lock_guard lock(mutex_);
  shared->revision = points_->revision + 1;
  points_ = std::move(shared);
}

absl::StatusOr<CameraImage> LiveView::Image(int max_side_px) const {
  std::shared_ptr<const Frame> frame;
  {
    std::lock_guard lock(mutex_);
    frame = frame_;
  }
  if (!frame) return NotFound("the session has no image yet");
  cv::Mat image = frame->image_bgr;
  const double scale = static_cast<double>(max_side_px) / std::max(image.cols, image.rows);
  if (scale < 1) {
    const cv::Size size(std::max(1, static_cast<int>(scale * image.cols)),
                        std::max(1, static_cast<int>(scale * image.rows)));
    cv::Mat scaled;
    cv::resize(image, scaled, size, 0, 0, cv::INTER_AREA);
    image = scaled;
  }
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, kJpegQuality})) {
    return Internal("frame {} cannot be encoded as JPEG", frame->frame_id);
  }
  return CameraImage{.frame_id = frame->frame_id, .jpeg = std::string(bytes.begin(), bytes.end())};
}

SparsePoints LiveView::Points() const {
  std::shared_ptr<const SparsePoints> points;
  {
    std::lock_guard lock(mutex_);
    points = points_;
  }
  return *points;
}

}  // namespace romap::session
