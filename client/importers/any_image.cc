#include "client/importers/any_image.h"

#include <array>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "client/files/text_file.h"
#include "client/importers/folder.h"
#include "common/color_image.h"
#include "common/image_bytes.h"
#include "common/jpeg_reader.h"

namespace romap::importers {
namespace {

constexpr size_t kMagicBytes = 12;

std::string FirstBytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes(kMagicBytes, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(in.gcount()));
  return bytes;
}

bool IsPngOrJpeg(std::string_view bytes) { return bytes.starts_with("\x89PNG") || bytes.starts_with("\xff\xd8\xff"); }

absl::StatusOr<cv::Mat> DecodeOther(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(std::string bytes, files::ReadFile(path));
  cv::Mat image;
  try {
    image = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, bytes.data()),
                         cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
  }
  if (image.empty()) return InvalidArgument("{}: not an image that can be read; expected JPEG or PNG", path);
  return image;
}

}  // namespace

bool LooksLikeImage(const std::string& path) {
  using std::string_view_literals::operator""sv;
  constexpr std::array kMagic = {"\x89PNG"sv, "\xff\xd8\xff"sv, "II*\0"sv, "MM\0*"sv, "BM"sv};
  const std::string bytes = FirstBytes(path);
  if (bytes.size() < 8) return false;
  for (const std::string_view magic : kMagic) {
    if (bytes.starts_with(magic)) return true;
  }
  if (bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' && (bytes[2] == '\n' || bytes[2] == ' ')) return true;
  return bytes.starts_with("RIFF") && bytes.substr(8) == "WEBP";
}

absl::StatusOr<cv::Size> ImageSize(const std::string& path) {
  if (!IsPngOrJpeg(FirstBytes(path))) {
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat image, DecodeOther(path));
    return image.size();
  }
  ROMAP_ASSIGN_OR_RETURN(const std::string bytes, files::ReadFile(path));
  if (const auto header = PngHeader(bytes)) return cv::Size(header->width_px, header->height_px);
  const absl::StatusOr<EncodedSize> header = JpegHeader(bytes);
  if (!header.ok()) return InvalidArgument("{}: {}", path, Message(header.status()));
  return cv::Size(header->width_px, header->height_px);
}

void SetImage(const std::string& path, RecordedFrame* frame) {
  frame->paths.image = path;
  if (!LooksLikeImage(path) || IsPngOrJpeg(FirstBytes(path))) return;
  frame->load_image = [path]() -> absl::StatusOr<files::ImageFile> {
    ROMAP_ASSIGN_OR_RETURN(const cv::Mat image, DecodeOther(path));
    return files::ImageFile{EncodePng(image), ImageEncoding::kPng};
  };
}

std::string EncodePng(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1});
  return {bytes.begin(), bytes.end()};
}

absl::StatusOr<cv::Mat> DecodeImage(const files::ImageFile& image, const std::string& path) {
  SampleRange range;
  absl::StatusOr<cv::Mat> color = DecodeColor(image.bytes, &range);
  if (!color.ok()) return InvalidArgument("{}: {}", path, Message(color.status()));
  return color;
}

}  // namespace romap::importers
