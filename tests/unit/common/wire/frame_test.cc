#include "common/wire/frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "common/status.h"

namespace romap::wire::frame_test {

using ::testing::HasSubstr;

FrameInput FullFrame() {
  FrameInput frame;
  frame.frame_id = 42;
  frame.timestamp_ns = -5;
  frame.image_encoding = ImageEncoding::kRawBgr8;
  frame.raw_width_px = 2;
  frame.raw_height_px = 1;
  frame.image = std::string("\0\1\2\3\4\5", 6);
  frame.mask_encoding = MaskEncoding::kRunLength;
  frame.label_runs = {3, 1, 0, 1};
  frame.instances = {{.label = 3, .class_name = "mug", .score = 0.25, .track_id = 7},
                     {.label = 65535, .class_name = "book", .score = 1, .track_id = std::nullopt}};
  frame.T_world_camera.emplace(Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), Eigen::Vector3d(1, 2, 3));
  frame.depth_encoding = DepthEncoding::kRawUint16;
  frame.depth = "abcd";
  frame.depth_scale_mu = 0.001;
  frame.gravity_camera = Eigen::Vector3d(0, 9.81, 0);
  return frame;
}

TEST(WireFrame, EveryFieldRoundTrips) {
  const FrameInput sent = FullFrame();
  const auto got = FromProto(ToProto(sent));
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_EQ(got->frame_id, sent.frame_id);
  EXPECT_EQ(got->timestamp_ns, sent.timestamp_ns);
  EXPECT_EQ(got->image_encoding, sent.image_encoding);
  EXPECT_EQ(got->image, sent.image);
  EXPECT_EQ(got->raw_width_px, 2);
  EXPECT_EQ(got->raw_height_px, 1);
  EXPECT_EQ(got->mask_encoding, sent.mask_encoding);
  EXPECT_EQ(got->label_runs, sent.label_runs);
  ASSERT_EQ(got->instances.size(), 2u);
  EXPECT_EQ(got->instances[0].label, 3u);
  EXPECT_EQ(got->instances[0].class_name, "mug");
  EXPECT_EQ(got->instances[0].score, 0.25);
  EXPECT_EQ(got->instances[0].track_id, 7u);
  EXPECT_FALSE(got->instances[1].track_id.has_value());
  ASSERT_TRUE(got->T_world_camera.has_value());
  EXPECT_TRUE(got->T_world_camera->Matrix().isApprox(sent.T_world_camera->Matrix(), 1e-15));
  EXPECT_EQ(got->depth_encoding, sent.depth_encoding);
  EXPECT_EQ(got->depth, sent.depth);
  EXPECT_EQ(got->depth_scale_mu, sent.depth_scale_mu);
  ASSERT_TRUE(got->gravity_camera.has_value());
  EXPECT_EQ(*got->gravity_camera, *sent.gravity_camera);
}

TEST(WireFrame, AbsentPartsStayAbsent) {
  FrameInput sent;
  sent.image_encoding = ImageEncoding::kPng;
  sent.image = "png";
  const auto got = FromProto(ToProto(sent));
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_EQ(got->image_encoding, ImageEncoding::kPng);
  EXPECT_EQ(got->mask_encoding, MaskEncoding::kNone);
  EXPECT_EQ(got->depth_encoding, DepthEncoding::kNone);
  EXPECT_FALSE(got->T_world_camera.has_value());
  EXPECT_FALSE(got->gravity_camera.has_value());
}

TEST(WireFrame, MasksWithoutInstancesDifferFromNoMasks) {
  FrameInput sent = FullFrame();
  sent.instances.clear();
  sent.mask_encoding = MaskEncoding::kLabelPng;
  sent.label_png = "png of zeros";
  const auto got = FromProto(ToProto(sent));
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_EQ(got->mask_encoding, MaskEncoding::kLabelPng);
  EXPECT_EQ(got->label_png, sent.label_png);
}

TEST(WireFrame, LateMasksRoundTrip) {
  MasksInput sent;
  sent.frame_id = 42;
  static_cast<EncodedMasks&>(sent) = FullFrame();
  const auto runs = FromProto(ToProto(sent));
  ASSERT_TRUE(runs.ok()) << Message(runs.status());
  EXPECT_EQ(runs->frame_id, 42u);
  EXPECT_EQ(runs->mask_encoding, MaskEncoding::kRunLength);
  EXPECT_EQ(runs->label_runs, sent.label_runs);
  ASSERT_EQ(runs->instances.size(), 2u);
  EXPECT_EQ(runs->instances[0].class_name, "mug");
  EXPECT_EQ(runs->instances[0].track_id, 7u);
  sent.mask_encoding = MaskEncoding::kLabelPng;
  sent.label_png = "png";
  const auto png = FromProto(ToProto(sent));
  ASSERT_TRUE(png.ok()) << Message(png.status());
  EXPECT_EQ(png->mask_encoding, MaskEncoding::kLabelPng);
  EXPECT_EQ(png->label_png, "png");
}

TEST(WireFrame, ErrorsInLateMasksNameTheField) {
  MasksInput sent;
  static_cast<EncodedMasks&>(sent) = FullFrame();
  v1::LateMasks without = ToProto(sent), bad = without;
  without.clear_masks();
  EXPECT_THAT(Message(FromProto(without).status()), HasSubstr("late_masks.masks: missing"));
  EXPECT_THAT(Message(FromProto(ToProto(MasksInput{})).status()), HasSubstr("late_masks.masks: must have label_png"));
  bad.mutable_masks()->mutable_instances(1)->set_label(3);
  EXPECT_THAT(Message(FromProto(bad).status()), HasSubstr("late_masks.masks.instances[1].label: 3 is listed twice"));
}

TEST(WireFrame, AbsentFieldsOfAnInstanceHaveDefaults) {
  v1::Frame proto = ToProto(FullFrame());
  v1::Instance& instance = *proto.mutable_masks()->mutable_instances(0);
  instance.clear_score();
  instance.clear_class_name();
  const auto got = FromProto(proto);
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_EQ(got->instances[0].score, 1.0);
  EXPECT_EQ(got->instances[0].class_name, "object");
}

TEST(WireFrame, RotationWithRoundingErrorIsNormalized) {
  v1::Frame proto = ToProto(FullFrame());
  proto.mutable_t_world_camera()->mutable_rotation()->set_w(0.5004);
  const auto got = FromProto(proto);
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_NEAR(got->T_world_camera->rotation().norm(), 1, 1e-15);
}

struct InvalidFrame {
  const char* name;
  const char* message;  // part of the error
  std::function<void(v1::Frame&)> corrupt;
};

class WireFrameError : public ::testing::TestWithParam<InvalidFrame> {};

TEST_P(WireFrameError, NamesTheField) {
  v1::Frame proto = ToProto(FullFrame());
  GetParam().corrupt(proto);
  const auto got = FromProto(proto);
  EXPECT_EQ(got.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(Message(got.status()), HasSubstr(GetParam().message));
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

INSTANTIATE_TEST_SUITE_P(
    All, WireFrameError,
    ::testing::ValuesIn(std::vector<InvalidFrame>{
        {"NoImage", "frame.image: missing", [](v1::Frame& f) { f.clear_image(); }},
        {"EmptyImage", "frame.image.data: missing", [](v1::Frame& f) { f.mutable_image()->clear_data(); }},
        {"NoEncoding", "frame.image.encoding: must be one of IMAGE_ENCODING_JPEG",
         [](v1::Frame& f) { f.mutable_image()->clear_encoding(); }},
        {"NewEncoding", "IMAGE_ENCODING_RAW_GRAY8; is 99",
         [](v1::Frame& f) { f.mutable_image()->set_encoding(static_cast<v1::ImageEncoding>(99)); }},
        {"RawWithoutSize", "frame.image: raw size must be in 1..8192 px, is 0x1 px",
         [](v1::Frame& f) { f.mutable_image()->clear_width_px(); }},
        {"RawTooLarge", "is 2x4000000000 px", [](v1::Frame& f) { f.mutable_image()->set_height_px(4'000'000'000u); }},
        {"NoLabels", "frame.masks: must have label_png or label_runs",
         [](v1::Frame& f) { f.mutable_masks()->clear_label_runs(); }},
        {"HalfARun", "frame.masks.label_runs: must be (label, length) pairs, has 5 numbers",
         [](v1::Frame& f) { f.mutable_masks()->mutable_label_runs()->add_label_length_pairs(1); }},
        {"EmptyPng", "frame.masks.label_png: missing", [](v1::Frame& f) { f.mutable_masks()->set_label_png(""); }},
        {"LabelZero", "frame.masks.instances[1].label: must be in 1..65535, is 0",
         [](v1::Frame& f) { f.mutable_masks()->mutable_instances(1)->set_label(0); }},
        {"LabelTooLarge", "frame.masks.instances[0].label: must be in 1..65535, is 65536",
         [](v1::Frame& f) { f.mutable_masks()->mutable_instances(0)->set_label(65536); }},
        {"LabelTwice", "frame.masks.instances[1].label: 3 is listed twice",
         [](v1::Frame& f) { f.mutable_masks()->mutable_instances(1)->set_label(3); }},
        {"ScoreTooHigh", "frame.masks.instances[0].score: must be in 0..1, is 1.5",
         [](v1::Frame& f) { f.mutable_masks()->mutable_instances(0)->set_score(1.5); }},
        {"ScoreNaN", "frame.masks.instances[0].score: must be in 0..1, is nan",
         [](v1::Frame& f) { f.mutable_masks()->mutable_instances(0)->set_score(kNaN); }},
        {"NoRotation", "frame.t_world_camera.rotation: missing",
         [](v1::Frame& f) { f.mutable_t_world_camera()->clear_rotation(); }},
        {"NoTranslation", "frame.t_world_camera.translation: missing",
         [](v1::Frame& f) { f.mutable_t_world_camera()->clear_translation(); }},
        {"RotationNotUnit", "must be a unit quaternion",
         [](v1::Frame& f) { f.mutable_t_world_camera()->mutable_rotation()->set_w(0.51); }},
        {"RotationZero", "with norm 0", [](v1::Frame& f) { f.mutable_t_world_camera()->mutable_rotation()->Clear(); }},
        {"RotationNaN", "frame.t_world_camera.rotation",
         [](v1::Frame& f) { f.mutable_t_world_camera()->mutable_rotation()->set_x(kNaN); }},
        {"TranslationInfinite", "frame.t_world_camera.translation",
         [](v1::Frame& f) { f.mutable_t_world_camera()->mutable_translation()->set_z(kInfinity); }},
        {"NewDepthEncoding", "frame.depth.encoding",
         [](v1::Frame& f) { f.mutable_depth()->set_encoding(static_cast<v1::DepthEncoding>(-1)); }},
        {"NoDepth", "frame.depth.data: missing", [](v1::Frame& f) { f.mutable_depth()->clear_data(); }},
        {"DepthScaleZero", "frame.depth.scale_mu: must be finite and positive, is 0",
         [](v1::Frame& f) { f.mutable_depth()->set_scale_mu(0); }},
        {"DepthScaleInfinite", "frame.depth.scale_mu: must be finite and positive, is inf",
         [](v1::Frame& f) { f.mutable_depth()->set_scale_mu(kInfinity); }},
        {"GravityZero", "frame.gravity_camera: must not be zero",
         [](v1::Frame& f) { f.mutable_gravity_camera()->Clear(); }},
        {"GravityNaN", "frame.gravity_camera", [](v1::Frame& f) { f.mutable_gravity_camera()->set_y(kNaN); }},
    }),
    [](const auto& info) { return info.param.name; });

}  // namespace romap::wire::frame_test
