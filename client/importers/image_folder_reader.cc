#include <algorithm>
#include <memory>

#include "client/importers/any_image.h"
#include "client/importers/calibration_guess.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

constexpr size_t kMinImages = 2;

// The files of a folder that are images. Depth images beside them, as in "12.depth.png", are omitted.
std::vector<std::string> ImagesIn(const std::string& folder) {
  std::vector<std::string> images;
  for (const std::string& name : FileNames(folder)) {
    if (name.find(".depth.") != std::string::npos) continue;
    if (LooksLikeImage(folder + "/" + name)) images.push_back(folder + "/" + name);
  }
  return images;
}

// The folder itself, or one below it with a usual name.
std::vector<std::string> FindImages(const std::string& source) {
  if (!IsFolder(source)) return {};
  std::vector<std::string> images = ImagesIn(source);
  for (const char* name : {"images", "rgb", "color", "frames", "image", "img"}) {
    if (images.size() >= kMinImages) break;
    images = ImagesIn(source + "/" + name);
  }
  return images.size() >= kMinImages ? images : std::vector<std::string>();
}

class ImageFolderReader : public SequenceReader {
 public:
  std::string Name() const override { return "folder of images"; }
  std::string Expected() const override { return "at least two images, also in images/, rgb/, color/ or frames/"; }
  bool Fits(const std::string& source) const override { return !FindImages(source).empty(); }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    const std::vector<std::string> images = FindImages(source);
    if (images.empty()) return NotFound("{}: no images; expected JPEG or PNG files", source);
    RecordingContents contents{.source = source};
    for (const std::string& path : images) SetImage(path, &contents.frames.emplace_back());
    ROMAP_ASSIGN_OR_RETURN(const cv::Size size_px, ImageSize(images.front()));
    ROMAP_RETURN_IF_ERROR(GuessCalibration(source, images.front(), size_px, options, &contents));
    SetTimesByRate(options, &contents);
    return contents;
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeImageFolderReader() { return std::make_unique<ImageFolderReader>(); }

}  // namespace romap::importers
