#include <algorithm>
#include <filesystem>
#include <memory>

#include "client/importers/any_image.h"
#include "client/importers/colmap_model.h"
#include "client/importers/folder.h"
#include "client/importers/frame_times.h"
#include "client/importers/join_masks.h"
#include "client/importers/readers.h"

namespace romap::importers {
namespace {

std::optional<std::string> FindModel(const std::string& source) {
  for (const char* name : {"", "/sparse/0", "/sparse", "/colmap/sparse/0", "/dense/sparse", "/dense/0/sparse", "/0"}) {
    if (HasColmapModel(source + name)) return source + name;
  }
  return std::nullopt;
}

// The folder in which the image `name` is.
absl::StatusOr<std::string> FindImageFolder(const std::string& source, const std::string& model,
                                            const std::string& name) {
  std::vector<std::string> tried;
  std::string parent = model;
  for (int level = 0; level < 3; ++level, parent += "/..") {
    for (const char* folder : {"/images", "/input", "/rgb", "/color", ""}) {
      const std::string path = parent + folder;
      if (IsFile(path + "/" + name)) return std::filesystem::path(path).lexically_normal().string();
      if (level == 2 || parent == source) tried.push_back(std::filesystem::path(path).lexically_normal().string());
    }
  }
  return NotFound("{}/{} does not exist, nor in {}: the first image of the model", source, name,
                  fmt::join(tried, ", "));
}

class ColmapReader : public SequenceReader {
 public:
  std::string Name() const override { return "COLMAP model"; }
  std::string Expected() const override {
    return "cameras and images, .bin or .txt, also in sparse/0/, with the images in images/";
  }
  bool Fits(const std::string& source) const override { return FindModel(source).has_value(); }

  absl::StatusOr<RecordingContents> Read(const std::string& source, const ReadOptions& options) const override {
    const std::string folder = *FindModel(source);
    ROMAP_ASSIGN_OR_RETURN(ColmapModel model, ReadColmapModel(folder));
    if (model.images.empty()) {
      return InvalidArgument("{}: the COLMAP model has no images; expected at least one registered image", folder);
    }
    std::ranges::sort(model.images, [](const auto& a, const auto& b) { return NaturalLess(a.name, b.name); });
    ROMAP_ASSIGN_OR_RETURN(const std::string images, FindImageFolder(source, folder, model.images.front().name));
    RecordingContents contents{.source = source};
    std::vector<std::string> masks;
    for (const ColmapImage& image : model.images) {
      const auto camera = model.cameras.find(image.camera_id);
      if (camera == model.cameras.end()) {
        return InvalidArgument("{}: image {} has camera {}, which is not in the list of cameras", folder, image.name,
                               image.camera_id);
      }
      RecordedFrame& frame = contents.frames.emplace_back();
      SetImage(images + "/" + image.name, &frame);
      frame.T_world_camera = image.T_world_camera;
      frame.camera = camera->second;
      masks.push_back(MaskOf(source, image.name));
    }
    contents.camera.camera = *contents.frames.front().camera;
    contents.camera.world_up = "auto";  // the world of a reconstruction has any orientation
    SetMasks(masks, &contents);
    SetTimesByRate(options, &contents);
    return contents;
  }

 private:
  static std::string MaskOf(const std::string& source, const std::string& name) {
    const std::string stem = std::filesystem::path(name).replace_extension().string();
    for (const std::string& file : {name + ".png", stem + ".png"}) {
      if (IsFile(source + "/masks/" + file)) return source + "/masks/" + file;
    }
    return "";
  }
};

}  // namespace

std::unique_ptr<SequenceReader> MakeColmapReader() { return std::make_unique<ColmapReader>(); }

}  // namespace romap::importers
