// What clients send: the messages of a stream and the request for a session.

#include "common/wire/frame.h"
#include "common/wire/sessions.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/support/streams.h"

namespace romap::fuzz::wire_input_fuzz {
namespace {

FrameInput FullFrame() {
  FrameInput frame = testing_support::MakeFrame(3, "mug");
  frame.image_encoding = ImageEncoding::kJpeg;
  frame.image = "jpeg";
  frame.gravity_camera = Eigen::Vector3d(0, 9.8, 0);
  frame.depth_encoding = DepthEncoding::kPng16;
  frame.depth = "png";
  frame.depth_scale_mu = 0.001;
  frame.instances[0].track_id = 5;
  return frame;
}

// An input: the kind of the message, 'm' or 's', and its bytes.
std::string Tagged(char kind, const google::protobuf::Message& message) {
  std::string input(1, kind);
  message.AppendToString(&input);
  return input;
}

// What was accepted must be accepted again, with the same result.
template <class Message>
void CheckRoundTrip(const Message& message) {
  const auto value = wire::FromProto(message);
  if (!value.ok()) return;
  const Message first = wire::ToProto(*value);
  const auto again = wire::FromProto(first);
  Require(again.ok(), "an accepted message can be sent on");
  // Quaternions are normalized again, which may change their last digit.
  Require(wire::ToProto(*again).ByteSizeLong() == first.ByteSizeLong(), "sending a message on does not change it");
}

}  // namespace
}  // namespace romap::fuzz::wire_input_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  v1::MapRequest start, frame, raw, masks;
  start.mutable_start()->set_session_id("12ab");
  *frame.mutable_frame() = wire::ToProto(wire_input_fuzz::FullFrame());
  *raw.mutable_frame() = wire::ToProto(testing_support::MakeFrame(1));
  raw.mutable_frame()->mutable_image()->set_data("raw");
  MasksInput late;
  late.frame_id = 3;
  static_cast<EncodedMasks&>(late) = wire_input_fuzz::FullFrame();
  *masks.mutable_late_masks() = wire::ToProto(late);
  SessionOptions options;
  options.name = "kitchen";
  options.camera = testing_support::SmallCamera();
  options.camera.distortion = {0.1, 0, 0, 0, 0.2};
  options.up_world = Eigen::Vector3d::UnitY();
  using wire_input_fuzz::Tagged;
  return {Tagged('m', start), Tagged('m', frame), Tagged('m', raw), Tagged('m', masks),
          Tagged('s', wire::ToProto(options))};
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace romap;
  if (size == 0) return 0;
  const int length = static_cast<int>(size - 1);
  if (data[0] == 's') {
    v1::CreateSessionRequest request;
    if (!request.ParseFromArray(data + 1, length)) return 0;
    const auto options = wire::FromProto(request);
    if (options.ok()) (void)ValidateCameraModel(options->camera);
    fuzz::wire_input_fuzz::CheckRoundTrip(request);
    return 0;
  }
  v1::MapRequest request;
  if (!request.ParseFromArray(data + 1, length)) return 0;
  if (request.has_frame()) fuzz::wire_input_fuzz::CheckRoundTrip(request.frame());
  if (request.has_late_masks()) fuzz::wire_input_fuzz::CheckRoundTrip(request.late_masks());
  return 0;
}
