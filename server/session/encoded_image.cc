#include "server/session/encoded_image.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "common/status.h"

namespace romap::session {
namespace {

struct Size {
  int width_px = 0;
  int height_px = 0;
};

uint32_t BigEndian(const std::string& bytes, size_t at, size_t count) {
  uint32_t value = 0;
  for (size_t i = 0; i < count; ++i) value = value << 8 | static_cast<uint8_t>(bytes[at + i]);
  return value;
}

// Width and height from the IHDR chunk (PNG specification, section 11.2.2).
std::optional<Size> PngSize(const std::string& bytes) {
  static const char kMagic[] = "\x89PNG\r\n\x1a\n";
  if (bytes.size() < 33 || bytes.compare(0, 8, kMagic, 8) != 0 || bytes.compare(12, 4, "IHDR") != 0)
    return std::nullopt;
  return Size{static_cast<int>(BigEndian(bytes, 16, 4)), static_cast<int>(BigEndian(bytes, 20, 4))};
}

// Width and height from the first start-of-frame segment (ITU-T T.81, annex B.2.2).
std::optional<Size> JpegSize(const std::string& bytes) {
  if (bytes.size() < 4 || BigEndian(bytes, 0, 2) != 0xFFD8) return std::nullopt;
  for (size_t at = 2; at + 9 < bytes.size();) {
    if (static_cast<uint8_t>(bytes[at]) != 0xFF) return std::nullopt;
    const auto marker = static_cast<uint8_t>(bytes[at + 1]);
    if (marker == 0xFF) {  // fill byte
      ++at;
      continue;
    }
    const bool start_of_frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (start_of_frame) {
      return Size{static_cast<int>(BigEndian(bytes, at + 7, 2)), static_cast<int>(BigEndian(bytes, at + 5, 2))};
    }
    at += 2 + BigEndian(bytes, at + 2, 2);
  }
  return std::nullopt;
}

// libjpeg and libpng fill the missing part of a truncated file with gray, so the end markers are checked instead.
bool HasPngEnd(const std::string& bytes) {
  return bytes.find("IEND", bytes.size() - std::min<size_t>(bytes.size(), 64)) != std::string::npos;
}
// A thumbnail in the metadata ends with the same marker, so only a marker after the start of the last scan counts.
bool HasJpegEnd(const std::string& bytes) {
  const size_t end = bytes.rfind("\xFF\xD9");
  const size_t scan = bytes.rfind("\xFF\xDA");
  return end != std::string::npos && scan != std::string::npos && end > scan;
}

absl::Status CheckSize(const char* field, const Size& size, const CameraModel& camera) {
  if (size.width_px == camera.width_px && size.height_px == camera.height_px) return absl::OkStatus();
  return InvalidArgument("{}: must be {}x{} px like the session's camera, is {}x{} px", field, camera.width_px,
                         camera.height_px, size.width_px, size.height_px);
}

absl::StatusOr<cv::Mat> DecodeFile(const char* field, const char* format, const std::string& bytes,
                                   const std::optional<Size>& size, bool has_end, int flags,
                                   const CameraModel& camera) {
  if (!size) return InvalidArgument("{}: {} bytes are not a {} file", field, bytes.size(), format);
  ROMAP_RETURN_IF_ERROR(CheckSize(field, *size, camera));
  if (!has_end) return InvalidArgument("{}: {} file is truncated ({} bytes)", field, format, bytes.size());
  cv::Mat decoded;
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
    decoded = cv::imdecode(buffer, flags);
  } catch (const cv::Exception& e) {
    return InvalidArgument("{}: {} file cannot be decoded: {}", field, format, e.err);
  }
  if (decoded.empty()) return InvalidArgument("{}: {} file is damaged", field, format);
  return decoded;
}

absl::StatusOr<cv::Mat> DecodePng(const char* field, const std::string& bytes, int flags, const CameraModel& camera) {
  return DecodeFile(field, "PNG", bytes, PngSize(bytes), HasPngEnd(bytes), flags, camera);
}

absl::StatusOr<cv::Mat> DecodeRawColor(const FrameInput& input, const CameraModel& camera) {
  const int channels = input.image_encoding == ImageEncoding::kRawGray8 ? 1 : 3;
  ROMAP_RETURN_IF_ERROR(CheckSize("image", {input.raw_width_px, input.raw_height_px}, camera));
  const size_t expected = static_cast<size_t>(camera.width_px) * camera.height_px * channels;
  if (input.image.size() != expected) {
    return InvalidArgument("image: raw pixels must have {}x{}x{} = {} bytes, have {}", camera.width_px,
                           camera.height_px, channels, expected, input.image.size());
  }
  const cv::Mat view(camera.height_px, camera.width_px, CV_8UC(channels), const_cast<char*>(input.image.data()));
  cv::Mat bgr;
  switch (input.image_encoding) {
    case ImageEncoding::kRawRgb8:
      cv::cvtColor(view, bgr, cv::COLOR_RGB2BGR);
      break;
    case ImageEncoding::kRawGray8:
      cv::cvtColor(view, bgr, cv::COLOR_GRAY2BGR);
      break;
    default:
      bgr = view.clone();
  }
  return bgr;
}

absl::StatusOr<cv::Mat> ExpandRuns(const std::vector<uint32_t>& runs, const CameraModel& camera) {
  const size_t total = static_cast<size_t>(camera.width_px) * camera.height_px;
  if (runs.size() % 2 != 0)
    return InvalidArgument("masks: label_runs must be (label, length) pairs, has {} numbers", runs.size());
  cv::Mat labels(camera.height_px, camera.width_px, CV_16UC1);
  auto* out = labels.ptr<uint16_t>();
  size_t filled = 0;
  for (size_t i = 0; i < runs.size(); i += 2) {
    if (runs[i] > 65535) return InvalidArgument("masks: label of run {} must be in 0..65535, is {}", i / 2, runs[i]);
    if (runs[i + 1] > total - filled) break;
    std::fill_n(out + filled, runs[i + 1], static_cast<uint16_t>(runs[i]));
    filled += runs[i + 1];
    if (i + 2 == runs.size() && filled == total) return labels;
  }
  return InvalidArgument("masks: run lengths must add up to {}x{} = {} pixels", camera.width_px, camera.height_px,
                         total);
}

}  // namespace

absl::StatusOr<cv::Mat> DecodeColorImage(const FrameInput& input, const CameraModel& camera) {
  switch (input.image_encoding) {
    case ImageEncoding::kJpeg:
      return DecodeFile("image", "JPEG", input.image, JpegSize(input.image), HasJpegEnd(input.image),
                        cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION, camera);
    case ImageEncoding::kPng:
      return DecodePng("image", input.image, cv::IMREAD_COLOR, camera);
    default:
      return DecodeRawColor(input, camera);
  }
}

absl::StatusOr<cv::Mat> DecodeLabels(const EncodedMasks& masks, const CameraModel& camera) {
  if (masks.mask_encoding == MaskEncoding::kNone) return cv::Mat();
  if (masks.mask_encoding == MaskEncoding::kRunLength) return ExpandRuns(masks.label_runs, camera);
  ROMAP_ASSIGN_OR_RETURN(cv::Mat decoded, DecodePng("masks", masks.label_png, cv::IMREAD_UNCHANGED, camera));
  if (decoded.channels() != 1 || (decoded.depth() != CV_8U && decoded.depth() != CV_16U)) {
    return InvalidArgument("masks: PNG must have one channel of 8 or 16 bits, has {} channels", decoded.channels());
  }
  cv::Mat labels;
  decoded.convertTo(labels, CV_16U);
  return labels;
}

absl::StatusOr<cv::Mat> DecodeDepth(const FrameInput& input, const CameraModel& camera) {
  if (input.depth_encoding == DepthEncoding::kNone) return cv::Mat();
  if (!std::isfinite(input.depth_scale_mu) || input.depth_scale_mu <= 0) {
    return InvalidArgument("depth: scale_mu must be a positive number, is {}", input.depth_scale_mu);
  }
  cv::Mat raw;
  if (input.depth_encoding == DepthEncoding::kPng16) {
    ROMAP_ASSIGN_OR_RETURN(raw, DecodePng("depth", input.depth, cv::IMREAD_UNCHANGED, camera));
    if (raw.type() != CV_16UC1) return InvalidArgument("depth: PNG must have one channel of 16 bits");
  } else {
    const size_t expected = static_cast<size_t>(camera.width_px) * camera.height_px * 2;
    if (input.depth.size() != expected) {
      return InvalidArgument("depth: {}x{} values of 16 bits must have {} bytes, have {}", camera.width_px,
                             camera.height_px, expected, input.depth.size());
    }
    raw = cv::Mat(camera.height_px, camera.width_px, CV_16UC1);
    std::memcpy(raw.data, input.depth.data(), expected);
  }
  cv::Mat depth_mu;
  raw.convertTo(depth_mu, CV_32F, input.depth_scale_mu);
  return depth_mu;
}

}  // namespace romap::session
