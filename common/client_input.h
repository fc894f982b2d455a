#pragma once

// What a client sends into a session, as plain values. The wire form is proto/romap/v1/mapping.proto.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/geometry.h"

namespace romap {

enum class ImageEncoding { kJpeg, kPng, kRawRgb8, kRawBgr8, kRawGray8 };
enum class MaskEncoding { kNone, kLabelPng, kRunLength };
enum class DepthEncoding { kNone, kPng16, kRawUint16 };

// How the session uses the camera poses that come with the frames.
enum class PoseUse {
  kGiven,   // poses are taken as exact; frames without a pose are tracked from the image
  kPrior,   // poses initialize tracking from the image and may be corrected
  kIgnore,  // the camera is tracked from the images alone
};

// The meaning of one label of a mask image, valid for that frame only: labels may change from frame to frame.
struct Instance {
  uint32_t label = 0;  // value in the mask image, 1..65535
  std::string class_name;
  double score = 1.0;                // detector's confidence, 0..1
  std::optional<uint64_t> track_id;  // from the detector's tracker, if it has one; used as a hint only
};

// The instance label of every pixel of a frame, still encoded.
struct EncodedMasks {
  MaskEncoding mask_encoding = MaskEncoding::kNone;
  std::string label_png;             // kLabelPng: gray or palette, 1 to 16 bits, 0 = no instance, size of the image
  std::vector<uint32_t> label_runs;  // kRunLength: (label, length) pairs in row-major order; lengths sum to
                                     // width * height
  std::vector<Instance> instances;   // labels of the mask that are not listed get class "object" and score 1
};

// An input is `resent` if it was sent before on an earlier stream, or waited while a stream was broken. One that the
// session has already is acknowledged as a duplicate. A live session never drops it, but processes it as in a replay.

// One frame as the client sends it, still encoded. mask_encoding kNone: no masks, or they follow in a MasksInput.
struct FrameInput : EncodedMasks {
  uint64_t frame_id = 0;     // chosen by the client, strictly increasing within a session
  int64_t timestamp_ns = 0;  // capture time, strictly increasing within a session
  ImageEncoding image_encoding = ImageEncoding::kJpeg;
  std::string image;     // JPEG or PNG bytes, or rows of raw pixels without padding
  int raw_width_px = 0;  // raw encodings only
  int raw_height_px = 0;
  std::optional<SE3<World, Camera>> T_world_camera;
  DepthEncoding depth_encoding = DepthEncoding::kNone;
  std::string depth;                              // z depth (not ray length) registered to the image, size of the image
  double depth_scale_mu = 0;                      // map units per depth unit
  std::optional<Eigen::Vector3d> gravity_camera;  // direction of gravity (down) in the camera frame, any length > 0
  bool resent = false;                            // it comes late because of a broken stream, see below
};

// The masks of a frame that was sent without masks, for detectors that are slower than the camera.
struct MasksInput : EncodedMasks {
  uint64_t frame_id = 0;  // of an accepted frame
  bool resent = false;    // as FrameInput::resent
};

// Everything a client can send on a Map stream. Masks must follow their frame.
using SessionInput = std::variant<FrameInput, MasksInput>;

}  // namespace romap
