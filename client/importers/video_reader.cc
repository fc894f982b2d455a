#include <cmath>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "client/files/associate.h"
#include "client/importers/calibration_guess.h"
#include "client/importers/readers.h"
#include "client/importers/video_file.h"

namespace romap::importers {
namespace {

constexpr int kVideoJpegQuality = 95;

class VideoReader : public SequenceReader {
 public:
  std::string Name() const override { return "video"; }
  std::string Expected() const override { return "a video file"; }
  bool Fits(const std::string& source) const override { return VideoFile::IsVideo(source); }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    ROMAP_ASSIGN_OR_RETURN(const std::shared_ptr<VideoFile> video, VideoFile::Open(source));
    RecordingContents contents{.source = source};
    const std::string folder = std::filesystem::path(source).parent_path().string();
    ROMAP_RETURN_IF_ERROR(
        GuessCalibration(folder.empty() ? "." : folder, source, video->size_px(), options, &contents));
    if (const int64_t step_ns = files::MedianStep_ns(video->times_ns()); step_ns > 0) {
      contents.camera.fps = 1e9 / static_cast<double>(step_ns);
    }
    for (size_t k = 0; k < video->times_ns().size(); ++k) {
      RecordedFrame frame;
      frame.timestamp_ns = video->times_ns()[k];
      frame.name = fmt::format("{:06}", k + 1);
      frame.paths.image = fmt::format("{}, frame {}", source, k + 1);
      frame.load_image = [video, k]() -> absl::StatusOr<files::ImageFile> {
        ROMAP_ASSIGN_OR_RETURN(const cv::Mat image, video->Read(k));
        std::vector<uint8_t> bytes;
        cv::imencode(".jpg", image, bytes, {cv::IMWRITE_JPEG_QUALITY, kVideoJpegQuality});
        return files::ImageFile{{bytes.begin(), bytes.end()}, ImageEncoding::kJpeg};
      };
      contents.frames.push_back(std::move(frame));
    }
    return contents;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeVideoReader() { return std::make_unique<VideoReader>(); }

}  // namespace romap::importers
