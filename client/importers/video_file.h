#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "common/status.h"

namespace cv {
class VideoCapture;
}

namespace romap::importers {

// A video file that is decoded with FFmpeg. Its frames are upright: a rotation tag is applied. Frames are fast to read
// in ascending order. Thread-safe.
class VideoFile {
 public:
  // Whether a file is a video with at least one frame. Texts are refused, because playlists refer to other files.
  static bool IsVideo(const std::string& path);

  // Decodes the video once to find the times of its frames. INVALID_ARGUMENT: it cannot be decoded.
  static absl::StatusOr<std::shared_ptr<VideoFile>> Open(const std::string& path);

  ~VideoFile();

  // From the start of the video; strictly increasing. If the file has no usable times, they follow from its frame rate.
  const std::vector<int64_t>& times_ns() const { return times_ns_; }
  cv::Size size_px() const { return size_px_; }

  // CV_8UC3, BGR. INVALID_ARGUMENT: the frame cannot be decoded.
  absl::StatusOr<cv::Mat> Read(size_t index);

 private:
  explicit VideoFile(std::string path);

  absl::Status Scan();
  // Moves to the frame `index`, so that retrieve() returns it.
  bool MoveTo(size_t index);
  bool MoveForwardTo(size_t index);
  bool Reopen();

  const std::string path_;
  std::vector<int64_t> times_ns_;
  bool has_times_ = true;  // the file states the times
  cv::Size size_px_;
  std::mutex mutex_;
  std::unique_ptr<cv::VideoCapture> capture_;
  size_t next_ = 0;  // index of the frame that the next grab() takes
};

}  // namespace romap::importers
