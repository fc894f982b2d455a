#include "server/session/encoded_image.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "common/color_image.h"
#include "common/image_bytes.h"
#include "common/label_png.h"
#include "common/status.h"

namespace romap::session {
namespace {

absl::Status CheckSize(const char* field, const EncodedSize& size, const CameraModel& camera) {
  if (size.width_px == camera.width_px && size.height_px == camera.height_px) return absl::OkStatus();
  return InvalidArgument("{}: must be {}x{} px like the session's camera, is {}x{} px", field, camera.width_px,
                         camera.height_px, size.width_px, size.height_px);
}

// The size in the header is checked before decoding, so that a small file cannot allocate a huge image.
absl::Status CheckFile(const char* field, const char* format, const std::string& bytes,
                       const std::optional<EncodedSize>& size, bool is_complete, const CameraModel& camera) {
  if (!size) return InvalidArgument("{}: {} bytes are not a {} file", field, bytes.size(), format);
  ROMAP_RETURN_IF_ERROR(CheckSize(field, *size, camera));
  if (!is_complete) return InvalidArgument("{}: {} file is truncated ({} bytes)", field, format, bytes.size());
  return absl::OkStatus();
}

absl::Status CheckPng(const char* field, const std::string& bytes, const CameraModel& camera) {
  return CheckFile(field, "PNG", bytes, PngHeader(bytes), IsCompletePng(bytes), camera);
}

absl::StatusOr<cv::Mat> DecodeColorFile(const FrameInput& input, const CameraModel& camera, SampleRange* range) {
  const bool is_jpeg = input.image_encoding == ImageEncoding::kJpeg;
  ROMAP_RETURN_IF_ERROR(
      is_jpeg ? CheckFile("image", "JPEG", input.image, JpegHeader(input.image), IsCompleteJpeg(input.image), camera)
              : CheckPng("image", input.image, camera));
  cv::Mat image = DecodeColor(input.image, range);
  if (image.empty()) return InvalidArgument("image: {} file is damaged", is_jpeg ? "JPEG" : "PNG");
  return image;
}

absl::StatusOr<cv::Mat> DecodeDepthPng(const std::string& bytes) {
  cv::Mat decoded;
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
    decoded = cv::imdecode(buffer, cv::IMREAD_UNCHANGED);  // ignores orientation tags
  } catch (const cv::Exception& e) {
    return InvalidArgument("depth: PNG file cannot be decoded: {}", e.err);
  }
  if (decoded.empty()) return InvalidArgument("depth: PNG file is damaged");
  return decoded;
}

absl::StatusOr<cv::Mat> DecodeRawColor(const FrameInput& input, const CameraModel& camera) {
  const int channels = input.image_encoding == ImageEncoding::kRawGray8 ? 1 : 3;
  ROMAP_RETURN_IF_ERROR(CheckSize("image", {.width_px = input.raw_width_px, .height_px = input.raw_height_px}, camera));
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

absl::StatusOr<cv::Mat> DecodeColorImage(const FrameInput& input, const CameraModel& camera, SampleRange* range) {
  switch (input.image_encoding) {
    case ImageEncoding::kJpeg:
    case ImageEncoding::kPng:
      return DecodeColorFile(input, camera, range);
    default:
      return DecodeRawColor(input, camera);
  }
}

absl::StatusOr<cv::Mat> DecodeLabels(const EncodedMasks& masks, const CameraModel& camera) {
  if (masks.mask_encoding == MaskEncoding::kNone) return cv::Mat();
  if (masks.mask_encoding == MaskEncoding::kRunLength) return ExpandRuns(masks.label_runs, camera);
  ROMAP_RETURN_IF_ERROR(CheckPng("masks", masks.label_png, camera));
  absl::StatusOr<cv::Mat> labels = DecodeLabelPng(masks.label_png, int64_t{camera.width_px} * camera.height_px);
  if (!labels.ok()) return InvalidArgument("masks: {}", Message(labels.status()));
  return labels;
}

absl::StatusOr<cv::Mat> DecodeDepth(const FrameInput& input, const CameraModel& camera) {
  if (input.depth_encoding == DepthEncoding::kNone) return cv::Mat();
  if (!std::isfinite(input.depth_scale_mu) || input.depth_scale_mu <= 0) {
    return InvalidArgument("depth: scale_mu must be a positive number, is {}", input.depth_scale_mu);
  }
  cv::Mat raw;
  if (input.depth_encoding == DepthEncoding::kPng16) {
    ROMAP_RETURN_IF_ERROR(CheckPng("depth", input.depth, camera));
    ROMAP_ASSIGN_OR_RETURN(raw, DecodeDepthPng(input.depth));
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
