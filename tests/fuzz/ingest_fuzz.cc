// The first stage of a session: decodes and checks frames, masks and depth. The first byte selects the camera; then
// come the messages of the stream.

#include "common/wire/frame.h"
#include "server/session/ingest.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/parts.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/fuzz/repair.h"
#include "tests/fuzz/sample_images.h"

namespace romap::fuzz::ingest_fuzz {
namespace {

CameraModel CameraOf(uint8_t kind) {
  CameraModel camera;
  camera.width_px = camera.height_px = kSide_px;
  camera.fx_px = camera.fy_px = 14;
  camera.cx_px = camera.cy_px = 7.5;
  if (kind % 3 == 1) camera.distortion = {0.1, -0.05, 0.001, 0.002, 0.01};
  if (kind % 3 == 2) {
    camera.lens = LensModel::kFisheye;
    camera.distortion = {0.02, 0.01, 0, 0, 0};
  }
  return camera;
}

void Repair(EncodedMasks* masks) { RepairPng(&masks->label_png); }

void CheckSize(const cv::Mat& image, const char* what) {
  if (!image.empty()) Require(image.cols == kSide_px && image.rows == kSide_px, what);
}

void AcceptFrame(v1::Frame proto, session::Ingest* ingest) {
  auto input = wire::FromProto(std::move(proto));
  if (!input.ok()) return;
  RepairPng(&input->image);
  RepairPng(&input->depth);
  Repair(&*input);
  (void)ingest->IsDuplicate(*input);
  const auto frame = ingest->Accept(*input);
  if (!frame.ok()) return;
  Require((*frame)->image_bgr.type() == CV_8UC3, "an accepted frame has colors");
  CheckSize((*frame)->image_bgr, "the image has the size of the camera");
  CheckSize((*frame)->labels, "the labels have the size of the camera");
  CheckSize((*frame)->depth_mu, "the depth image has the size of the camera");
}

void AcceptMasks(v1::LateMasks proto, session::Ingest* ingest) {
  auto input = wire::FromProto(std::move(proto));
  if (!input.ok()) return;
  Repair(&*input);
  (void)ingest->IsDuplicate(*input);
  const auto masks = ingest->AcceptMasks(*input);
  if (masks.ok()) CheckSize(masks->labels, "late labels have the size of the camera");
}

FrameInput SampleFrame(uint64_t id, ImageEncoding encoding, const std::string& image) {
  FrameInput frame;
  frame.frame_id = id;
  frame.timestamp_ns = static_cast<int64_t>(id) * 33'000'000;
  frame.image_encoding = encoding;
  frame.image = image;
  frame.raw_width_px = frame.raw_height_px = kSide_px;
  frame.T_world_camera.emplace();
  frame.gravity_camera = Eigen::Vector3d(0, 9.8, 0);
  return frame;
}

std::string FrameBytes(const FrameInput& frame) {
  v1::MapRequest request;
  *request.mutable_frame() = wire::ToProto(frame);
  return request.SerializeAsString();
}

std::string MasksBytes(const MasksInput& masks) {
  v1::MapRequest request;
  *request.mutable_late_masks() = wire::ToProto(masks);
  return request.SerializeAsString();
}

}  // namespace
}  // namespace romap::fuzz::ingest_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  using namespace ingest_fuzz;
  FrameInput jpeg = SampleFrame(1, ImageEncoding::kJpeg, SampleJpeg(false));
  jpeg.mask_encoding = MaskEncoding::kRunLength;
  jpeg.label_runs = {0, 100, 7, 56, 65535, 100};
  jpeg.instances = {{.label = 7, .class_name = "mug", .score = 0.5, .track_id = 3}};
  FrameInput png = SampleFrame(2, ImageEncoding::kPng, SamplePng(3, 8));
  png.depth_encoding = DepthEncoding::kPng16;
  png.depth = SamplePng(1, 16);
  png.depth_scale_mu = 0.001;
  FrameInput raw = SampleFrame(3, ImageEncoding::kRawGray8, std::string(kSide_px * kSide_px, 'x'));
  raw.depth_encoding = DepthEncoding::kRawUint16;
  raw.depth = std::string(2 * kSide_px * kSide_px, '\x02');
  raw.depth_scale_mu = 0.001;
  std::vector<std::string> seeds;
  for (const std::string& labels : SampleLabelPngs()) {
    MasksInput late;
    late.frame_id = 2;
    late.mask_encoding = MaskEncoding::kLabelPng;
    late.label_png = labels;
    const auto camera = static_cast<char>(seeds.size() % 3);
    seeds.push_back(camera + JoinParts({FrameBytes(jpeg), FrameBytes(png), MasksBytes(late), FrameBytes(raw)}));
  }
  seeds.push_back('\0' + JoinParts({FrameBytes(raw)}));
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  if (size == 0) return 0;
  session::Ingest ingest(fuzz::ingest_fuzz::CameraOf(data[0]), /*max_mask_delay_s=*/2);
  for (const std::string& part : fuzz::SplitParts(fuzz::TextOf(data + 1, size - 1))) {
    v1::MapRequest request;
    if (!request.ParseFromString(part)) continue;
    if (request.has_frame()) fuzz::ingest_fuzz::AcceptFrame(std::move(*request.mutable_frame()), &ingest);
    if (request.has_late_masks()) fuzz::ingest_fuzz::AcceptMasks(std::move(*request.mutable_late_masks()), &ingest);
  }
  (void)ingest.Diagnostics();
  return 0;
}
