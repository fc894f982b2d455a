#include "client/exports/posed_images.h"

#include <fmt/format.h>

#include "client/files/text_file.h"

namespace romap::exports {

absl::StatusOr<std::vector<PosedImage>> WritePosedImages(const std::string& folder, const files::Sequence& sequence,
                                                         const std::vector<files::PosedFrame>& frames) {
  ROMAP_RETURN_IF_ERROR(files::MakeFolder(folder + "/images"));
  std::vector<PosedImage> images;
  for (const files::PosedFrame& posed : frames) {
    std::vector<files::UnreadableFile> unreadable;
    const absl::StatusOr<FrameInput> frame = sequence.LoadReadable(posed.index, &unreadable);
    if (!frame.ok()) continue;
    PosedImage image{.image = fmt::format("images/{:06}{}", frame->frame_id,
                                          frame->image_encoding == ImageEncoding::kPng ? ".png" : ".jpg"),
                     .mask = "",
                     .timestamp_ns = frame->timestamp_ns,
                     .T_world_camera = posed.T_world_camera};
    ROMAP_RETURN_IF_ERROR(files::WriteFile(folder + "/" + image.image, frame->image));
    if (frame->mask_encoding == MaskEncoding::kLabelPng) {
      image.mask = fmt::format("masks/{:06}.png", frame->frame_id);
      ROMAP_RETURN_IF_ERROR(files::MakeFolder(folder + "/masks"));
      ROMAP_RETURN_IF_ERROR(files::WriteFile(folder + "/" + image.mask, frame->label_png));
    }
    images.push_back(std::move(image));
  }
  return images;
}

}  // namespace romap::exports
