#include "client/importers/video_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>

#include "client/importers/any_image.h"
#include "client/importers/folder.h"

namespace romap::importers {
namespace {

constexpr size_t kTextBytes = 256;
// Frames that are skipped by decoding them. Seeking decodes from the last key frame, which is often as far.
constexpr size_t kMaxSkipped = 100;
constexpr double kUnknownRate_hz = 30;

bool IsText(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes(kTextBytes, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(in.gcount()));
  return std::ranges::all_of(bytes, [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte >= 0x80 || std::isprint(byte) || std::isspace(byte);
  });
}

std::unique_ptr<cv::VideoCapture> OpenCapture(const std::string& path) {
  // FFmpeg and OpenCV would print what they think of damaged files.
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  try {
    auto capture = std::make_unique<cv::VideoCapture>(path, cv::CAP_FFMPEG);
    if (capture->isOpened()) return capture;
  } catch (const cv::Exception&) {
  }
  return nullptr;
}

int64_t Time_ns(const cv::VideoCapture& capture) { return std::llround(1e6 * capture.get(cv::CAP_PROP_POS_MSEC)); }

}  // namespace

VideoFile::VideoFile(std::string path) : path_(std::move(path)) {}
VideoFile::~VideoFile() = default;

bool VideoFile::IsVideo(const std::string& path) {
  if (!IsFile(path) || LooksLikeImage(path) || IsText(path)) return false;
  const std::unique_ptr<cv::VideoCapture> capture = OpenCapture(path);
  return capture && capture->grab();
}

absl::StatusOr<std::shared_ptr<VideoFile>> VideoFile::Open(const std::string& path) {
  std::shared_ptr<VideoFile> video(new VideoFile(path));
  ROMAP_RETURN_IF_ERROR(video->Scan());
  return video;
}

absl::Status VideoFile::Scan() {
  if (!Reopen()) return InvalidArgument("{}: not a video that FFmpeg can read", path_);
  const double rate_hz = capture_->get(cv::CAP_PROP_FPS);
  while (capture_->grab()) {
    if (times_ns_.empty()) {
      cv::Mat first;
      if (capture_->retrieve(first)) size_px_ = first.size();
    }
    times_ns_.push_back(Time_ns(*capture_));
  }
  if (times_ns_.empty() || size_px_.empty()) return InvalidArgument("{}: the video has no frame to decode", path_);
  has_times_ = std::ranges::adjacent_find(times_ns_, std::ranges::greater_equal()) == times_ns_.end();
  for (size_t k = 0; !has_times_ && k < times_ns_.size(); ++k) {
    times_ns_[k] = std::llround(1e9 * static_cast<double>(k) / (rate_hz > 0 ? rate_hz : kUnknownRate_hz));
  }
  Reopen();
  return absl::OkStatus();
}

bool VideoFile::Reopen() {
  capture_ = OpenCapture(path_);
  next_ = 0;
  return capture_ != nullptr;
}

bool VideoFile::MoveForwardTo(size_t index) {
  while (next_ <= index) {
    if (!capture_->grab()) return false;
    ++next_;
  }
  return true;
}

bool VideoFile::MoveTo(size_t index) {
  if (capture_ && index >= next_ && index - next_ <= kMaxSkipped) return MoveForwardTo(index);
  if (has_times_ && Reopen() && index > kMaxSkipped) {
    // Seeking is not exact, but the time of the frame that it finds is. It must be one of the known frames.
    capture_->set(cv::CAP_PROP_POS_MSEC, 1e-6 * static_cast<double>(times_ns_[index]));
    if (capture_->grab()) {
      const auto found = std::ranges::lower_bound(times_ns_, Time_ns(*capture_));
      const auto found_index = static_cast<size_t>(found - times_ns_.begin());
      if (found != times_ns_.end() && *found == Time_ns(*capture_) && found_index <= index) {
        next_ = found_index + 1;
        return MoveForwardTo(index);
      }
    }
  }
  return Reopen() && MoveForwardTo(index);
}

absl::StatusOr<cv::Mat> VideoFile::Read(size_t index) {
  std::lock_guard lock(mutex_);
  cv::Mat frame;
  if (!MoveTo(index) || !capture_->retrieve(frame) || frame.empty()) {
    capture_.reset();
    return InvalidArgument("{}: frame {} cannot be decoded", path_, index + 1);
  }
  return frame.clone();
}

}  // namespace romap::importers
