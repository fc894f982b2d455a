#include "client/importers/coco_masks.h"

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "client/files/whole_number.h"
#include "client/importers/json_file.h"

namespace romap::importers {
namespace {

using Json = nlohmann::json;

constexpr int64_t kMaxMaskPixels = 1 << 27;

struct CocoFile {
  std::string path;
  Json root;
  std::map<int64_t, std::string> classes;
};

absl::StatusOr<cv::Mat> MaskOfRle(const Json& rle, const std::string& where) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<double> sides, JsonNumbers(rle, "size", where));
  if (sides.size() != 2) return InvalidArgument("{}: 'size' must be [height, width]", where);
  const auto counts = rle.find("counts");
  std::vector<uint32_t> runs;
  if (counts != rle.end() && counts->is_string()) {
    absl::StatusOr<std::vector<uint32_t>> decoded = DecodeCocoRuns(counts->get<std::string>());
    if (!decoded.ok()) return InvalidArgument("{}: {}", where, Message(decoded.status()));
    runs = *std::move(decoded);
  } else {
    ROMAP_ASSIGN_OR_RETURN(const std::vector<double> numbers, JsonNumbers(rle, "counts", where));
    for (const double number : numbers) {
      if (number < 0 || number > kMaxMaskPixels) return InvalidArgument("{}: 'counts' contains {}", where, number);
      runs.push_back(static_cast<uint32_t>(number));
    }
  }
  absl::StatusOr<cv::Mat> mask = MaskOfRuns(runs, cv::Size(files::SideOf_px(sides[1]), files::SideOf_px(sides[0])));
  if (!mask.ok()) return InvalidArgument("{}: {}", where, Message(mask.status()));
  return mask;
}

absl::StatusOr<cv::Mat> MaskOfAnnotation(const Json& annotation, cv::Size image_px, cv::Size size_px,
                                         const std::string& where) {
  const auto segmentation = annotation.find("segmentation");
  if (segmentation == annotation.end()) return InvalidArgument("{}: 'segmentation' is missing", where);
  if (segmentation->is_object()) {
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat mask, MaskOfRle(*segmentation, where));
    return mask.size() == size_px ? mask : ResizeNearest(mask, size_px);
  }
  if (!segmentation->is_array())
    return InvalidArgument("{}: 'segmentation' is neither polygons nor run lengths", where);
  const double scale_x = static_cast<double>(size_px.width) / image_px.width;
  const double scale_y = static_cast<double>(size_px.height) / image_px.height;
  cv::Mat mask(size_px, CV_8UC1, cv::Scalar(0));
  for (const Json& part : *segmentation) {
    ROMAP_ASSIGN_OR_RETURN(std::vector<double> xy_px, JsonNumbers(Json{{"polygon", part}}, "polygon", where));
    for (size_t k = 0; k < xy_px.size(); ++k) xy_px[k] *= k % 2 == 0 ? scale_x : scale_y;
    mask |= FillPolygon(xy_px, size_px);
  }
  return mask;
}

absl::StatusOr<EncodedMasks> LoadCocoImage(const CocoFile& file, const std::vector<size_t>& annotations,
                                           cv::Size image_px, cv::Size size_px) {
  std::vector<MaskLayer> layers;
  for (const size_t k : annotations) {
    const Json& annotation = file.root["annotations"][k];
    const std::string where = fmt::format("{}: annotation {}", file.path, k);
    ROMAP_ASSIGN_OR_RETURN(const int64_t category, JsonWhole(annotation, "category_id", where));
    ROMAP_ASSIGN_OR_RETURN(const double score, JsonNumberOr(annotation, "score", 1, where));
    ROMAP_ASSIGN_OR_RETURN(cv::Mat pixels, MaskOfAnnotation(annotation, image_px, size_px, where));
    const auto name = file.classes.find(category);
    if (name == file.classes.end()) {
      return InvalidArgument("{}: 'category_id' {} is not in 'categories'", where, category);
    }
    layers.push_back({std::move(pixels), name->second, score});
  }
  return EncodeLayers(layers, size_px);
}

}  // namespace

absl::StatusOr<std::vector<uint32_t>> DecodeCocoRuns(std::string_view text) {
  std::vector<uint32_t> runs;
  for (size_t k = 0; k < text.size();) {
    int64_t value = 0;
    int shift = 0;
    bool more = true;
    while (more) {
      if (k == text.size() || shift > 30) return InvalidArgument("the compressed run lengths are truncated");
      const int bits = text[k++] - '0';
      if (bits < 0 || bits > 63) return InvalidArgument("the compressed run lengths contain '{}'", text[k - 1]);
      value |= static_cast<int64_t>(bits & 31) << shift;
      shift += 5;
      more = (bits & 32) != 0;
      if (!more && (bits & 16) != 0) value -= int64_t{1} << shift;  // the sign
    }
    if (runs.size() > 2) value += runs[runs.size() - 2];
    if (value < 0) return InvalidArgument("the compressed run lengths contain a negative length");
    runs.push_back(static_cast<uint32_t>(value));
  }
  return runs;
}

absl::StatusOr<cv::Mat> MaskOfRuns(const std::vector<uint32_t>& runs, cv::Size size_px) {
  const int64_t area = static_cast<int64_t>(size_px.width) * size_px.height;
  if (size_px.width < 1 || size_px.height < 1 || area > kMaxMaskPixels) {
    return InvalidArgument("the size is {} x {} px", size_px.width, size_px.height);
  }
  const auto pixels = static_cast<uint64_t>(area);
  uint64_t sum = 0;
  for (const uint32_t run : runs) sum += run;
  if (sum != pixels) return InvalidArgument("the run lengths sum to {}; expected {} pixels", sum, pixels);
  cv::Mat columns(size_px.width, size_px.height, CV_8UC1);  // transposed
  uint8_t* at = columns.data;
  uint8_t value = 0;
  for (const uint32_t run : runs) {
    std::fill(at, at + run, value);
    at += run;
    value = static_cast<uint8_t>(255 - value);
  }
  return columns.t();
}

absl::StatusOr<std::vector<NamedMasks>> ReadCocoMasks(const std::string& path, cv::Size size_px) {
  auto file = std::make_shared<CocoFile>();
  file->path = path;
  ROMAP_ASSIGN_OR_RETURN(file->root, LoadJson(path));
  ROMAP_ASSIGN_OR_RETURN(const Json* const categories, JsonObjects(file->root, "categories", path));
  for (const Json& category : *categories) {
    ROMAP_ASSIGN_OR_RETURN(const int64_t id, JsonWhole(category, "id", path + ": categories"));
    ROMAP_ASSIGN_OR_RETURN(file->classes[id], JsonText(category, "name", path + ": categories"));
  }
  ROMAP_ASSIGN_OR_RETURN(const Json* const annotations, JsonObjects(file->root, "annotations", path));
  std::map<int64_t, std::vector<size_t>> by_image;
  for (size_t k = 0; k < annotations->size(); ++k) {
    ROMAP_ASSIGN_OR_RETURN(const int64_t id,
                           JsonWhole((*annotations)[k], "image_id", fmt::format("{}: annotation {}", path, k)));
    by_image[id].push_back(k);
  }
  ROMAP_ASSIGN_OR_RETURN(const Json* const images, JsonObjects(file->root, "images", path));
  std::vector<NamedMasks> all;
  for (const Json& image : *images) {
    const std::string where = path + ": images";
    ROMAP_ASSIGN_OR_RETURN(const int64_t id, JsonWhole(image, "id", where));
    ROMAP_ASSIGN_OR_RETURN(std::string name, JsonText(image, "file_name", where));
    ROMAP_ASSIGN_OR_RETURN(const int width_px, JsonSide(image, "width", where));
    ROMAP_ASSIGN_OR_RETURN(const int height_px, JsonSide(image, "height", where));
    const cv::Size image_px(width_px, height_px);
    all.push_back({std::move(name), path, [file, indices = by_image[id], image_px, size_px] {
                     return LoadCocoImage(*file, indices, image_px, size_px);
                   }});
  }
  return all;
}

}  // namespace romap::importers
