#include "client/files/sequence.h"

#include "client/files/image_file.h"
#include "client/files/native_sequence.h"
#include "client/files/permute_labels.h"

namespace romap::files {

absl::StatusOr<Sequence> Sequence::Open(const std::string& dir, const SequenceOptions& options) {
  ROMAP_ASSIGN_OR_RETURN(SequenceContents contents, ReadNativeSequence(dir, options));
  return Sequence(std::move(contents), options.permute_labels_seed);
}

Sequence::Sequence(SequenceContents contents, std::optional<uint64_t> permute_labels_seed)
    : contents_(std::move(contents)), permute_labels_seed_(permute_labels_seed) {}

absl::StatusOr<FrameInput> Sequence::Load(size_t index) const {
  std::vector<UnreadableFile> unreadable;
  ROMAP_ASSIGN_OR_RETURN(FrameInput frame, LoadReadable(index, &unreadable));
  if (!unreadable.empty()) return unreadable.front().reason;
  return frame;
}

absl::StatusOr<EncodedMasks> Sequence::LoadMasks(size_t index) const {
  const FrameRecord& record = contents_.frames[index];
  EncodedMasks masks;
  if (record.load_masks) {
    ROMAP_ASSIGN_OR_RETURN(masks, record.load_masks());
  } else {
    ROMAP_ASSIGN_OR_RETURN(masks.label_png, ReadPngFile(record.paths.mask));
    masks.mask_encoding = MaskEncoding::kLabelPng;
    masks.instances = record.instances;
  }
  if (!permute_labels_seed_) return masks;
  // Any odd multiplier gives different seeds; this one is 2^64 divided by the golden ratio.
  const uint64_t seed = *permute_labels_seed_ + 0x9e3779b97f4a7c15 * (index + 1);
  if (absl::Status status = PermuteLabels(seed, &masks.label_png, &masks.instances); !status.ok()) {
    return InvalidArgument("{}: {}", record.paths.mask, Message(status));
  }
  return masks;
}

absl::StatusOr<FrameInput> Sequence::LoadReadable(size_t index, std::vector<UnreadableFile>* unreadable) const {
  if (index >= size()) {
    return InvalidArgument("{}: frame index {} is out of range; the sequence has {} frames", dir(), index, size());
  }
  const FrameRecord& record = contents_.frames[index];
  FrameInput frame;
  frame.frame_id = index + 1;
  frame.timestamp_ns = record.timestamp_ns;
  ROMAP_ASSIGN_OR_RETURN(ImageFile image, record.load_image ? record.load_image() : ReadImageFile(record.paths.image));
  frame.image = std::move(image.bytes);
  frame.image_encoding = image.encoding;
  if (!record.paths.mask.empty()) {
    absl::StatusOr<EncodedMasks> masks = LoadMasks(index);
    if (masks.ok()) {
      static_cast<EncodedMasks&>(frame) = *std::move(masks);
    } else {
      unreadable->push_back({FileKind::kMask, masks.status()});
    }
  }
  if (!record.paths.depth.empty()) {
    absl::StatusOr<std::string> depth = record.load_depth ? record.load_depth() : ReadPngFile(record.paths.depth);
    if (depth.ok()) {
      frame.depth = *std::move(depth);
      frame.depth_encoding = DepthEncoding::kPng16;
      frame.depth_scale_mu = record.depth_scale_mu > 0 ? record.depth_scale_mu : depth_scale();
    } else {
      unreadable->push_back({FileKind::kDepth, depth.status()});
    }
  }
  frame.T_world_camera = record.T_world_camera;
  return frame;
}

}  // namespace romap::files
