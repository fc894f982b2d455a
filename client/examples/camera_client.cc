// A live camera, or a video file, through OpenCV: the camera is tracked from the images. Ends with the video or Ctrl-C.
//
//   camera_client HOST:PORT DEVICE_OR_FILE FOCAL_LENGTH_PX
//
// The mask is a box in the middle of the image; replace MasksOf() by a detector.

#include <csignal>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "feed.h"

namespace {

volatile std::sig_atomic_t interrupted = 0;

// Run lengths (label, pixels) in row-major order: label 1 in the middle third of the image.
std::vector<uint32_t> MasksOf(const cv::Mat& image) {
  const auto width = static_cast<uint32_t>(image.cols), height = static_cast<uint32_t>(image.rows);
  const uint32_t left = width / 3, middle = width / 3, top = height / 3;
  std::vector<uint32_t> runs{0, top * width + left};
  for (uint32_t row = 0; row + 1 < top; ++row) runs.insert(runs.end(), {1, middle, 0, width - middle});
  const uint32_t sent = top * width + left + (top - 1) * width + middle;
  runs.insert(runs.end(), {1, middle, 0, width * height - sent});
  return runs;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return std::fprintf(stderr, "camera_client HOST:PORT DEVICE_OR_FILE FOCAL_LENGTH_PX\n"), 2;
  const std::string source = argv[2];
  const bool is_device = source.find_first_not_of("0123456789") == std::string::npos;
  cv::VideoCapture video;
  cv::Mat image;
  if (!(is_device ? video.open(std::stoi(source)) : video.open(source)) || !video.read(image)) {
    return std::fprintf(stderr, "%s gives no image\n", source.c_str()), 3;
  }
  romap::SessionOptions options;
  options.name = "camera";
  options.mode = is_device ? romap::FrameMode::kLive : romap::FrameMode::kReplay;
  options.pose_use = romap::PoseUse::kIgnore;
  options.camera.width_px = image.cols;
  options.camera.height_px = image.rows;
  options.camera.fx_px = options.camera.fy_px = std::atof(argv[3]);
  options.camera.cx_px = (image.cols - 1) / 2.0;
  options.camera.cy_px = (image.rows - 1) / 2.0;

  const auto server = Feed::Check(romap::client::RemoteMappingService::Connect(argv[1]));
  Feed feed(*server, options, is_device);
  std::signal(SIGINT, [](int) { interrupted = 1; });
  const auto start = std::chrono::steady_clock::now();
  for (uint64_t id = 1; interrupted == 0; ++id) {
    romap::FrameInput frame;
    frame.frame_id = id;
    const auto now = std::chrono::steady_clock::now() - start;
    frame.timestamp_ns = is_device ? std::chrono::nanoseconds(now).count()
                                   : std::llround(id * 1e9 / std::max(1.0, video.get(cv::CAP_PROP_FPS)));
    std::vector<uint8_t> jpeg;
    cv::imencode(".jpg", image, jpeg);
    frame.image.assign(jpeg.begin(), jpeg.end());
    frame.mask_encoding = romap::MaskEncoding::kRunLength;
    frame.label_runs = MasksOf(image);
    frame.instances.push_back({.label = 1, .class_name = "object", .track_id = {}});
    feed.Send(std::move(frame));
    if (!video.read(image)) break;
  }
  PrintObjects(feed.Finish());
}
