#include "server/session/encoded_image.h"

#include <algorithm>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "common/color_image.h"
#include "common/decode_limits.h"
#include "common/image_bytes.h"
#include "common/jpeg_reader.h"
#include "common/label_png.h"
#include "common/png_reader.h"
#include "common/status.h"

namespace romap::session {
namespace {

// Millimeters in a map in kilometers are 1e-6.
constexpr double kMinDepthScale_mu = 1e-12;
constexpr double kMaxDepthScale_mu = 1e3;

absl::Status CheckSize(const char* field, const EncodedSize& size, const CameraModel& camera) {
  if (size.width_px == camera.width_px && size.height_px == camera.height_px) return absl::OkStatus();
  return InvalidArgument("{}: must be {}x{} px like the session's camera, is {}x{} px", field, camera.width_px,
                         camera.height_px, size.width_px, size.height_px);
}

absl::Status InField(const char* field, const absl::Status& status) {
  return {status.code(), fmt::format("{}: {}", field, Message(status))};
}

// Checks the header before decoding, so that a small file cannot allocate a huge image.
absl::Status CheckJpeg(const char* field, const std::string& bytes, const CameraModel& camera) {
  const absl::StatusOr<EncodedSize> size = JpegHeader(bytes);
  if (!size.ok()) return InField(field, size.status());
  ROMAP_RETURN_IF_ERROR(CheckSize(field, *size, camera));
  if (!IsCompleteJpeg(bytes)) return InvalidArgument("{}: JPEG file is truncated ({} bytes)", field, bytes.size());
  return absl::OkStatus();
}

absl::Status CheckPng(const char* field, const std::string& bytes, const CameraModel& camera) {
  const std::optional<EncodedSize> size = PngHeader(bytes);
  if (!size) return InvalidArgument("{}: {} bytes are not a PNG file", field, bytes.size());
  ROMAP_RETURN_IF_ERROR(CheckSize(field, *size, camera));
  if (!IsCompletePng(bytes)) return InvalidArgument("{}: PNG file is truncated ({} bytes)", field, bytes.size());
  return absl::OkStatus();
}

DecodeLimits LimitsOf(const CameraModel& camera, const std::stop_token& stop) {
  return {.max_pixels = int64_t{camera.width_px} * camera.height_px, .stop = stop};
}

// The result of a decoder, with the name of the field in its error.
absl::StatusOr<cv::Mat> Checked(const char* field, absl::StatusOr<cv::Mat> decoded, const CameraModel& camera) {
  if (!decoded.ok()) return InField(field, decoded.status());
  ROMAP_RETURN_IF_ERROR(CheckSize(field, {.width_px = decoded->cols, .height_px = decoded->rows}, camera));
  return decoded;
}

absl::StatusOr<cv::Mat> DecodeColorFile(const FrameInput& input, const CameraModel& camera, SampleRange* range,
                                        const std::stop_token& stop) {
  const bool is_jpeg = input.image_encoding == ImageEncoding::kJpeg;
  ROMAP_RETURN_IF_ERROR(is_jpeg ? CheckJpeg("image", input.image, camera) : CheckPng("image", input.image, camera));
  return Checked("image", DecodeColor(input.image, range, LimitsOf(camera, stop)), camera);
}

absl::StatusOr<cv::Mat> DecodeDepthPng(const std::string& bytes, const CameraModel& camera,
                                       const std::stop_token& stop) {
  ROMAP_RETURN_IF_ERROR(CheckPng("depth", bytes, camera));
  const std::optional<EncodedSize> header = PngHeader(bytes);
  if (header->bits != 16 || header->channels != 1) {
    return InvalidArgument("depth: PNG must have one channel of 16 bits, has {} of {} bits", header->channels,
                           header->bits);
  }
  return Checked("depth", DecodePng(bytes, PngPixels::kStored, LimitsOf(camera, stop)), camera);
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
  if (runs.size() / 2 > total) {
    return InvalidArgument("masks: label_runs must have at most one run per pixel ({}), has {}", total,
                           runs.size() / 2);
  }
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

absl::StatusOr<cv::Mat> DecodeColorImage(const FrameInput& input, const CameraModel& camera, SampleRange* range,
                                         const std::stop_token& stop) {
  switch (input.image_encoding) {
    case ImageEncoding::kJpeg:
    case ImageEncoding::kPng:
      return DecodeColorFile(input, camera, range, stop);
    default:
      return DecodeRawColor(input, camera);
  }
}

absl::StatusOr<cv::Mat> DecodeLabels(const EncodedMasks& masks, const CameraModel& camera,
                                     const std::stop_token& stop) {
  if (masks.mask_encoding == MaskEncoding::kNone) return cv::Mat();
  if (masks.mask_encoding == MaskEncoding::kRunLength) return ExpandRuns(masks.label_runs, camera);
  ROMAP_RETURN_IF_ERROR(CheckPng("masks", masks.label_png, camera));
  return Checked("masks", DecodeLabelPng(masks.label_png, LimitsOf(camera, stop)), camera);
}

absl::StatusOr<cv::Mat> DecodeDepth(const FrameInput& input, const CameraModel& camera, const std::stop_token& stop) {
  if (input.depth_encoding == DepthEncoding::kNone) return cv::Mat();
  if (!(input.depth_scale_mu >= kMinDepthScale_mu && input.depth_scale_mu <= kMaxDepthScale_mu)) {  // NaN is invalid
    return InvalidArgument("depth: scale_mu must be in {:.0e}..{:.0e} map units, is {}", kMinDepthScale_mu,
                           kMaxDepthScale_mu, input.depth_scale_mu);
  }
  cv::Mat raw;
  if (input.depth_encoding == DepthEncoding::kPng16) {
    ROMAP_ASSIGN_OR_RETURN(raw, DecodeDepthPng(input.depth, camera, stop));
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
