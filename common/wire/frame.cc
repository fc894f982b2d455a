#include "common/wire/frame.h"

#include <cmath>
#include <string>
#include <unordered_set>
#include <utility>

#include "common/status.h"
#include "common/wire/enums.h"
#include "common/wire/geometry.h"

namespace romap::wire {
namespace {

constexpr uint32_t kMaxSide_px = 8192;
constexpr uint32_t kMaxLabel = 65535;

bool IsRaw(ImageEncoding encoding) { return encoding != ImageEncoding::kJpeg && encoding != ImageEncoding::kPng; }

v1::Instance ToProto(Instance instance) {
  v1::Instance proto;
  proto.set_label(instance.label);
  proto.set_class_name(std::move(instance.class_name));
  proto.set_score(instance.score);
  if (instance.track_id) proto.set_track_id(*instance.track_id);
  return proto;
}

// Moves the contents of `masks`.
v1::Masks MasksToProto(EncodedMasks& masks) {
  v1::Masks proto;
  if (masks.mask_encoding == MaskEncoding::kLabelPng) {
    proto.set_label_png(std::move(masks.label_png));
  } else if (masks.mask_encoding == MaskEncoding::kRunLength) {
    proto.mutable_label_runs()->mutable_label_length_pairs()->Add(masks.label_runs.begin(), masks.label_runs.end());
  }
  for (Instance& instance : masks.instances) *proto.add_instances() = ToProto(std::move(instance));
  return proto;
}

absl::Status ReadImage(v1::Image& proto, FrameInput& frame) {
  ROMAP_ASSIGN_OR_RETURN(frame.image_encoding,
                         EnumFromProto(kImageEncodings, proto.encoding(), "frame.image.encoding"));
  if (proto.data().empty()) return InvalidArgument("frame.image.data: missing");
  frame.image = std::move(*proto.mutable_data());
  if (!IsRaw(frame.image_encoding)) return absl::OkStatus();
  const auto bad_side = [](uint32_t side_px) { return side_px < 1 || side_px > kMaxSide_px; };
  if (bad_side(proto.width_px()) || bad_side(proto.height_px())) {
    return InvalidArgument("frame.image: raw size must be in 1..{} px, is {}x{} px", kMaxSide_px, proto.width_px(),
                           proto.height_px());
  }
  frame.raw_width_px = static_cast<int>(proto.width_px());
  frame.raw_height_px = static_cast<int>(proto.height_px());
  return absl::OkStatus();
}

absl::StatusOr<Instance> InstanceFromProto(v1::Instance& proto, const std::string& where) {
  if (proto.label() < 1 || proto.label() > kMaxLabel) {
    return InvalidArgument("{}.label: must be in 1..{}, is {}", where, kMaxLabel, proto.label());
  }
  Instance instance;
  instance.label = proto.label();
  instance.class_name = proto.class_name().empty() ? "object" : std::move(*proto.mutable_class_name());
  if (proto.has_score()) {
    ROMAP_RETURN_IF_ERROR(CheckRange(proto.score(), 0, 1, where + ".score"));
    instance.score = proto.score();
  }
  if (proto.has_track_id()) instance.track_id = proto.track_id();
  return instance;
}

absl::Status ReadMasks(v1::Masks& proto, const std::string& where, EncodedMasks& masks) {
  switch (proto.labels_case()) {
    case v1::Masks::kLabelPng:
      masks.mask_encoding = MaskEncoding::kLabelPng;
      if (proto.label_png().empty()) return InvalidArgument("{}.label_png: missing", where);
      masks.label_png = std::move(*proto.mutable_label_png());
      break;
    case v1::Masks::kLabelRuns: {
      const auto& pairs = proto.label_runs().label_length_pairs();
      if (pairs.empty() || pairs.size() % 2 != 0) {
        return InvalidArgument("{}.label_runs: must be (label, length) pairs, has {} numbers", where, pairs.size());
      }
      masks.mask_encoding = MaskEncoding::kRunLength;
      masks.label_runs.assign(pairs.begin(), pairs.end());
      break;
    }
    default:
      return InvalidArgument("{}: must have label_png or label_runs", where);
  }
  std::unordered_set<uint32_t> labels;
  for (int i = 0; i < proto.instances_size(); ++i) {
    const std::string which = fmt::format("{}.instances[{}]", where, i);
    ROMAP_ASSIGN_OR_RETURN(Instance instance, InstanceFromProto(*proto.mutable_instances(i), which));
    if (!labels.insert(instance.label).second) {
      return InvalidArgument("{}.label: {} is listed twice", which, instance.label);
    }
    masks.instances.push_back(std::move(instance));
  }
  return absl::OkStatus();
}

absl::Status ReadDepth(v1::Depth& proto, FrameInput& frame) {
  ROMAP_ASSIGN_OR_RETURN(frame.depth_encoding,
                         EnumFromProto(kDepthEncodings, proto.encoding(), "frame.depth.encoding"));
  if (proto.data().empty()) return InvalidArgument("frame.depth.data: missing");
  if (!std::isfinite(proto.scale_mu()) || proto.scale_mu() <= 0) {
    return InvalidArgument("frame.depth.scale_mu: must be finite and positive, is {}", proto.scale_mu());
  }
  frame.depth = std::move(*proto.mutable_data());
  frame.depth_scale_mu = proto.scale_mu();
  return absl::OkStatus();
}

}  // namespace

v1::Frame ToProto(FrameInput frame) {
  v1::Frame proto;
  proto.set_frame_id(frame.frame_id);
  proto.set_timestamp_ns(frame.timestamp_ns);
  v1::Image& image = *proto.mutable_image();
  image.set_encoding(EnumToProto(kImageEncodings, frame.image_encoding));
  image.set_data(std::move(frame.image));
  if (IsRaw(frame.image_encoding)) {
    image.set_width_px(static_cast<uint32_t>(frame.raw_width_px));
    image.set_height_px(static_cast<uint32_t>(frame.raw_height_px));
  }
  if (frame.mask_encoding != MaskEncoding::kNone) *proto.mutable_masks() = MasksToProto(frame);
  if (frame.T_world_camera) *proto.mutable_t_world_camera() = ToProto(*frame.T_world_camera);
  if (frame.depth_encoding != DepthEncoding::kNone) {
    proto.mutable_depth()->set_encoding(EnumToProto(kDepthEncodings, frame.depth_encoding));
    proto.mutable_depth()->set_data(std::move(frame.depth));
    proto.mutable_depth()->set_scale_mu(frame.depth_scale_mu);
  }
  if (frame.gravity_camera) *proto.mutable_gravity_camera() = ToProto(*frame.gravity_camera);
  proto.set_resent(frame.resent);
  return proto;
}

absl::StatusOr<FrameInput> FromProto(v1::Frame proto) {
  FrameInput frame;
  frame.frame_id = proto.frame_id();
  frame.timestamp_ns = proto.timestamp_ns();
  if (!proto.has_image()) return InvalidArgument("frame.image: missing");
  ROMAP_RETURN_IF_ERROR(ReadImage(*proto.mutable_image(), frame));
  if (proto.has_masks()) ROMAP_RETURN_IF_ERROR(ReadMasks(*proto.mutable_masks(), "frame.masks", frame));
  if (proto.has_t_world_camera()) {
    ROMAP_ASSIGN_OR_RETURN(frame.T_world_camera,
                           (TransformFromProto<World, Camera>(proto.t_world_camera(), "frame.t_world_camera")));
  }
  if (proto.has_depth()) ROMAP_RETURN_IF_ERROR(ReadDepth(*proto.mutable_depth(), frame));
  if (proto.has_gravity_camera()) {
    ROMAP_ASSIGN_OR_RETURN(const auto gravity, VectorFromProto(proto.gravity_camera(), "frame.gravity_camera"));
    if (gravity.squaredNorm() == 0) return InvalidArgument("frame.gravity_camera: must not be zero");
    frame.gravity_camera = gravity;
  }
  frame.resent = proto.resent();
  return frame;
}

v1::LateMasks ToProto(MasksInput masks) {
  v1::LateMasks proto;
  proto.set_frame_id(masks.frame_id);
  *proto.mutable_masks() = MasksToProto(masks);
  proto.set_resent(masks.resent);
  return proto;
}

absl::StatusOr<MasksInput> FromProto(v1::LateMasks proto) {
  MasksInput masks;
  masks.frame_id = proto.frame_id();
  if (!proto.has_masks()) return InvalidArgument("late_masks.masks: missing");
  ROMAP_RETURN_IF_ERROR(ReadMasks(*proto.mutable_masks(), "late_masks.masks", masks));
  masks.resent = proto.resent();
  return masks;
}

}  // namespace romap::wire
