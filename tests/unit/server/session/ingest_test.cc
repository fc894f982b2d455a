#include "server/session/ingest.h"

#include <gmock/gmock.h>

#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stop_token>

#include "common/status.h"
#include "tests/support/test_jpeg.h"
#include "tests/support/test_png.h"

namespace romap::session::ingest_test {

using ::testing::HasSubstr;

const CameraModel kCamera{
    .width_px = 64, .height_px = 48, .fx_px = 60, .fy_px = 60, .cx_px = 31.5, .cy_px = 23.5, .distortion = {}};

constexpr double kMaxMaskDelay_s = 1;

std::string Encode(const char* extension, const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

cv::Mat Gradient(int width, int height) {
  cv::Mat image(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image.at<cv::Vec3b>(y, x) = cv::Vec3b(10, static_cast<uint8_t>(3 * x), static_cast<uint8_t>(5 * y));
  }
  return image;
}

FrameInput ValidFrame(uint64_t id = 1) {
  FrameInput input;
  input.frame_id = id;
  input.timestamp_ns = static_cast<int64_t>(id) * 40'000'000;
  input.image_encoding = ImageEncoding::kPng;
  input.image = Encode(".png", Gradient(64, 48));
  input.T_world_camera = SE3<World, Camera>();
  return input;
}

std::string ErrorOf(Ingest& ingest, const FrameInput& input) {
  const auto frame = ingest.Accept(input);
  if (frame.ok()) return "accepted";
  EXPECT_EQ(frame.status().code(), absl::StatusCode::kInvalidArgument);
  return Message(frame.status());
}

TEST(IngestTest, DecodesEveryImageEncoding) {
  const cv::Mat image = Gradient(64, 48);
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  FrameInput png = ValidFrame(1);
  auto frame = ingest.Accept(png);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(cv::norm((*frame)->image_bgr, image, cv::NORM_INF), 0);

  FrameInput jpeg = ValidFrame(2);
  jpeg.image_encoding = ImageEncoding::kJpeg;
  jpeg.image = Encode(".jpg", image);
  frame = ingest.Accept(jpeg);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_LT(cv::norm((*frame)->image_bgr, image, cv::NORM_L1) / image.total(), 10);

  FrameInput raw = ValidFrame(3);
  raw.image_encoding = ImageEncoding::kRawRgb8;
  raw.raw_width_px = 64;
  raw.raw_height_px = 48;
  cv::Mat rgb;
  cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  raw.image.assign(reinterpret_cast<const char*>(rgb.data), rgb.total() * 3);
  frame = ingest.Accept(raw);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(cv::norm((*frame)->image_bgr, image, cv::NORM_INF), 0);
}

TEST(IngestTest, ReadsMasksAsPngAndAsRuns) {
  cv::Mat labels = cv::Mat::zeros(48, 64, CV_8UC1);
  labels(cv::Rect(10, 10, 20, 8)) = 7;
  FrameInput png = ValidFrame(1);
  png.mask_encoding = MaskEncoding::kLabelPng;
  png.label_png = Encode(".png", labels);
  FrameInput runs = ValidFrame(2);
  runs.mask_encoding = MaskEncoding::kRunLength;
  for (int i = 0; i < 48 * 64;) {
    const uint8_t label = labels.data[i];
    int end = i;
    while (end < 48 * 64 && labels.data[end] == label) ++end;
    runs.label_runs.insert(runs.label_runs.end(), {label, static_cast<uint32_t>(end - i)});
    i = end;
  }
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  for (const FrameInput& input : {png, runs}) {
    const auto frame = ingest.Accept(input);
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_TRUE((*frame)->has_masks);
    EXPECT_EQ(cv::countNonZero((*frame)->labels == 7), 160);
    ASSERT_EQ((*frame)->instances.size(), 1u) << "ingest adds labels that are not listed";
    EXPECT_EQ((*frame)->instances[0].label, 7u);
    EXPECT_EQ((*frame)->instances[0].class_name, "object");
  }
}

TEST(IngestTest, ReadsMasksWithPalette) {
  cv::Mat labels = cv::Mat::zeros(48, 64, CV_8UC1);
  labels(cv::Rect(10, 10, 20, 8)) = 3;
  FrameInput input = ValidFrame();
  input.mask_encoding = MaskEncoding::kLabelPng;
  input.label_png = testing_support::EncodeLabels(labels, testing_support::PngKind::kPalette, 2);
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  const auto frame = ingest.Accept(input);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(cv::countNonZero((*frame)->labels == 3), 160);

  input = ValidFrame(2);
  input.mask_encoding = MaskEncoding::kLabelPng;
  input.label_png = Encode(".png", Gradient(64, 48));
  EXPECT_THAT(ErrorOf(ingest, input), HasSubstr("masks: PNG has 3 channels; expected one channel"));
}

TEST(IngestTest, OrientationTagsAreIgnored) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  uint64_t id = 0;
  for (const int orientation : {6, 3}) {
    for (const ImageEncoding encoding : {ImageEncoding::kPng, ImageEncoding::kJpeg}) {
      FrameInput input = ValidFrame(++id);
      const std::string plain = Encode(encoding == ImageEncoding::kPng ? ".png" : ".jpg", Gradient(64, 48));
      input.image_encoding = encoding;
      input.image = testing_support::WithOrientation(plain, orientation);
      const auto frame = ingest.Accept(input);
      ASSERT_TRUE(frame.ok()) << frame.status();
      EXPECT_LT(cv::norm((*frame)->image_bgr, Gradient(64, 48), cv::NORM_L1) / (64 * 48 * 3), 5);
    }
  }
}

TEST(IngestTest, TheRangeOf16BitImagesIsThatOfTheSession) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  FrameInput bright = ValidFrame(1);
  bright.image = Encode(".png", cv::Mat(48, 64, CV_16UC3, cv::Scalar(1000, 2000, 4095)));
  FrameInput dark = ValidFrame(2);
  dark.image = Encode(".png", cv::Mat(48, 64, CV_16UC3, cv::Scalar(160, 160, 160)));
  EXPECT_EQ((*ingest.Accept(bright))->image_bgr.at<cv::Vec3b>(5, 5), cv::Vec3b(62, 125, 255));
  EXPECT_EQ((*ingest.Accept(dark))->image_bgr.at<cv::Vec3b>(5, 5), cv::Vec3b(10, 10, 10));
}

TEST(IngestTest, DepthIsConvertedToMapUnits) {
  const cv::Mat depth(48, 64, CV_16UC1, cv::Scalar(1500));
  FrameInput input = ValidFrame();
  input.depth_encoding = DepthEncoding::kPng16;
  input.depth = Encode(".png", depth);
  input.depth_scale_mu = 0.001;
  const auto frame = Ingest(kCamera, kMaxMaskDelay_s).Accept(input);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_FLOAT_EQ((*frame)->depth_mu.at<float>(20, 20), 1.5f);
}

TEST(IngestTest, TruncatedImagesAreRejected) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  FrameInput png = ValidFrame();
  png.image.resize(png.image.size() / 2);
  EXPECT_THAT(ErrorOf(ingest, png), HasSubstr("image: PNG file is truncated"));
  FrameInput jpeg = ValidFrame();
  jpeg.image_encoding = ImageEncoding::kJpeg;
  jpeg.image = Encode(".jpg", Gradient(64, 48));
  jpeg.image.resize(jpeg.image.size() / 2);
  EXPECT_THAT(ErrorOf(ingest, jpeg), HasSubstr("image: JPEG file is truncated"));
  jpeg.image = "not an image";
  EXPECT_THAT(ErrorOf(ingest, jpeg), HasSubstr("image: 12 bytes are not a JPEG file"));
  jpeg.image.clear();
  EXPECT_THAT(ErrorOf(ingest, jpeg), HasSubstr("image: 0 bytes are not a JPEG file"));
  EXPECT_EQ(ErrorOf(ingest, ValidFrame()), "accepted") << "a rejected frame must have no effect";
}

TEST(IngestTest, ErrorsNameWrongSizes) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  FrameInput image = ValidFrame();
  image.image = Encode(".png", Gradient(32, 48));
  EXPECT_THAT(ErrorOf(ingest, image), HasSubstr("image: must be 64x48 px like the session's camera, is 32x48 px"));
  FrameInput mask = ValidFrame();
  mask.mask_encoding = MaskEncoding::kLabelPng;
  mask.label_png = Encode(".png", cv::Mat(48, 65, CV_8UC1, cv::Scalar(0)));
  EXPECT_THAT(ErrorOf(ingest, mask), HasSubstr("masks: must be 64x48 px like the session's camera, is 65x48 px"));
  FrameInput runs = ValidFrame();
  runs.mask_encoding = MaskEncoding::kRunLength;
  runs.label_runs = {0, 100};
  EXPECT_THAT(ErrorOf(ingest, runs), HasSubstr("masks: run lengths must add up to 64x48"));
  runs.label_runs = {0, 4294967295u, 1, 2};
  EXPECT_THAT(ErrorOf(ingest, runs), HasSubstr("masks: run lengths must add up to 64x48"));
  runs.label_runs = {0};
  EXPECT_THAT(ErrorOf(ingest, runs), HasSubstr("pairs"));
  runs.label_runs.assign(2 * 4000, 0);  // empty runs
  EXPECT_THAT(ErrorOf(ingest, runs), HasSubstr("label_runs must have at most one run per pixel (3072), has 4000"));
  FrameInput raw = ValidFrame();
  raw.image_encoding = ImageEncoding::kRawGray8;
  raw.raw_width_px = 64;
  raw.raw_height_px = 48;
  raw.image = "abc";
  EXPECT_THAT(ErrorOf(ingest, raw), HasSubstr("image: raw pixels must have 64x48x1 = 3072 bytes, have 3"));
}

TEST(IngestTest, HugeSizeInTheHeaderIsRejectedBeforeDecoding) {
  FrameInput input = ValidFrame();
  for (size_t at : {16, 20}) input.image.replace(at, 4, "\x00\x01\x00\x00", 4);
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  EXPECT_THAT(ErrorOf(ingest, input), HasSubstr("65536x65536"));
}

TEST(IngestTest, InvalidNumbersAreRejected) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  FrameInput pose = ValidFrame();
  pose.T_world_camera = SE3<World, Camera>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, std::nan(""), 0));
  EXPECT_THAT(ErrorOf(ingest, pose), HasSubstr("t_world_camera: all numbers must be finite"));
  pose.T_world_camera = SE3<World, Camera>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 2e8, 0));
  EXPECT_THAT(ErrorOf(ingest, pose), HasSubstr("t_world_camera: must be within 1e+08 map units of the origin"));
  FrameInput gravity = ValidFrame();
  gravity.gravity_camera = Eigen::Vector3d::Zero();
  EXPECT_THAT(ErrorOf(ingest, gravity), HasSubstr("gravity_camera: must have a length in 1e-9..1e9, has"));
  FrameInput depth = ValidFrame();
  depth.depth_encoding = DepthEncoding::kPng16;
  depth.depth_scale_mu = -1;
  EXPECT_THAT(ErrorOf(ingest, depth), HasSubstr("depth: scale_mu must be in 1e-12..1e+03 map units, is -1"));
  depth.depth_scale_mu = 1e308;
  EXPECT_THAT(ErrorOf(ingest, depth), HasSubstr("depth: scale_mu must be in 1e-12..1e+03 map units, is 1e+308"));
  FrameInput score = ValidFrame();
  score.instances = {{.label = 3, .class_name = "cup", .score = std::nan(""), .track_id = std::nullopt}};
  EXPECT_THAT(ErrorOf(ingest, score), HasSubstr("masks: score of label 3 must be in 0..1"));
}

TEST(IngestTest, FrameIdAndTimestampMustIncrease) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  ASSERT_EQ(ErrorOf(ingest, ValidFrame(5)), "accepted");
  EXPECT_THAT(ErrorOf(ingest, ValidFrame(5)), HasSubstr("frame_id must increase: got 5 after 5"));
  FrameInput back = ValidFrame(6);
  back.timestamp_ns = 10;
  EXPECT_THAT(ErrorOf(ingest, back), HasSubstr("timestamp_ns must increase: got 10 after 200000000"));
  EXPECT_EQ(ErrorOf(ingest, ValidFrame(6)), "accepted");
}

TEST(IngestTest, ImageIsUndistorted) {
  CameraModel distorted = kCamera;
  distorted.distortion = {-0.2, 0.05, 0.001, -0.001, 0};
  // A white dot at the distorted pixel of the ray (0.2, -0.15, 1).
  const double x = 0.2, y = -0.15, r2 = x * x + y * y;
  const auto& d = distorted.distortion;
  const double radial = 1 + d[0] * r2 + d[1] * r2 * r2;
  const double xd = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x);
  const double yd = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y;
  cv::Mat image = cv::Mat::zeros(48, 64, CV_8UC3);
  cv::circle(image,
             cv::Point(static_cast<int>(std::lround(60 * xd + 31.5)), static_cast<int>(std::lround(60 * yd + 23.5))), 1,
             cv::Scalar::all(255), -1);
  FrameInput input = ValidFrame();
  input.image = Encode(".png", image);
  const auto frame = Ingest(distorted, kMaxMaskDelay_s).Accept(input);
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_FALSE((*frame)->camera.HasDistortion());
  cv::Mat gray;
  cv::cvtColor((*frame)->image_bgr, gray, cv::COLOR_BGR2GRAY);
  const cv::Moments moments = cv::moments(gray);
  EXPECT_NEAR(moments.m10 / moments.m00, 60 * x + 31.5, 0.8);
  EXPECT_NEAR(moments.m01 / moments.m00, 60 * y + 23.5, 0.8);
}

// A frame of kCamera's size with a white dot at `center`, accepted by a session with `camera`.
std::shared_ptr<const Frame> AcceptDot(const CameraModel& camera, const Eigen::Vector2d& center) {
  cv::Mat image = cv::Mat::zeros(48, 64, CV_8UC3);
  cv::circle(image, cv::Point(static_cast<int>(std::lround(center.x())), static_cast<int>(std::lround(center.y()))), 1,
             cv::Scalar::all(255), -1);
  FrameInput input = ValidFrame();
  input.image = Encode(".png", image);
  return Ingest(camera, kMaxMaskDelay_s).Accept(input).value();
}

TEST(IngestTest, FisheyeImageBecomesAPinholeImage) {
  CameraModel fisheye = kCamera;
  fisheye.lens = LensModel::kFisheye;
  fisheye.distortion = {0.05, -0.01, 0, 0, 0};
  const double theta = 0.35;  // of a ray to the right
  const double bent = theta * (1 + 0.05 * theta * theta - 0.01 * std::pow(theta, 4));
  const auto frame = AcceptDot(fisheye, {60 * bent + 31.5, 23.5});
  EXPECT_EQ(frame->camera, kCamera);
  cv::Mat gray;
  cv::cvtColor(frame->image_bgr, gray, cv::COLOR_BGR2GRAY);
  const cv::Moments moments = cv::moments(gray);
  EXPECT_NEAR(moments.m10 / moments.m00, 60 * std::tan(theta) + 31.5, 0.8);
}

TEST(IngestTest, SourceImageIsKeptForALensWithDistortion) {
  CameraModel distorted = kCamera;
  distorted.distortion = {-0.2, 0.05, 0.001, -0.001, 0};
  const auto frame = AcceptDot(distorted, {50, 10});
  EXPECT_EQ(frame->source_camera, distorted);
  ASSERT_EQ(frame->source_gray.type(), CV_8UC1);
  ASSERT_EQ(frame->source_gray.size(), cv::Size(64, 48));
  EXPECT_EQ(frame->source_gray.at<uint8_t>(10, 50), 255);
  EXPECT_TRUE(AcceptDot(kCamera, {50, 10})->source_gray.empty());
}

// ------------------------------------------------------------------------------------------------ late masks

MasksInput ValidMasks(uint64_t frame_id) {
  cv::Mat labels = cv::Mat::zeros(48, 64, CV_8UC1);
  labels(cv::Rect(10, 10, 20, 8)) = 7;
  labels(cv::Rect(40, 10, 5, 5)) = 9;
  MasksInput input;
  input.frame_id = frame_id;
  input.mask_encoding = MaskEncoding::kLabelPng;
  input.label_png = Encode(".png", labels);
  input.instances = {{.label = 7, .class_name = "mug", .score = 0.5, .track_id = std::nullopt}};
  return input;
}

// Of more work than an image of this size needs, and one with a misleading header.
TEST(IngestTest, RejectsHostileImages) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  FrameInput scans = ValidFrame();
  scans.image_encoding = ImageEncoding::kJpeg;
  std::vector<uint8_t> progressive;
  cv::imencode(".jpg", Gradient(64, 48), progressive, {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  scans.image = testing_support::WithScans({progressive.begin(), progressive.end()}, 1000);
  EXPECT_THAT(ErrorOf(ingest, scans), HasSubstr("image: JPEG file has 51 or more scans; must have at most 50"));

  // TEM has no length. A reader that takes the next bytes for a length finds the size of the session in the comment.
  FrameInput misleading = scans;
  const std::string other = Encode(".jpg", Gradient(256, 256));
  const std::string claim("\xff\xfe\x00\x0d\xff\xc0\x00\x11\x08\x00\x30\x00\x40\x03\x01", 15);
  misleading.image = other.substr(0, 2) + std::string("\xff\x01", 2) + claim + other.substr(2);
  EXPECT_THAT(ErrorOf(ingest, misleading),
              HasSubstr("image: must be 64x48 px like the session's camera, is 256x256 px"));
  EXPECT_EQ(ErrorOf(ingest, ValidFrame()), "accepted");
}

TEST(IngestTest, AStopEndsDecoding) {
  std::stop_source stop;
  Ingest ingest(kCamera, kMaxMaskDelay_s, stop.get_token());
  ASSERT_TRUE(ingest.Accept(ValidFrame(1)).ok());
  stop.request_stop();
  EXPECT_EQ(ingest.Accept(ValidFrame(2)).status().code(), absl::StatusCode::kCancelled);
}

std::string MaskErrorOf(Ingest& ingest, const MasksInput& input) {
  const auto masks = ingest.AcceptMasks(input);
  if (masks.ok()) return "accepted";
  EXPECT_EQ(masks.status().code(), absl::StatusCode::kInvalidArgument);
  return Message(masks.status());
}

TEST(IngestTest, LateMasksEqualMasksSentWithTheFrame) {
  CameraModel lens = kCamera;
  lens.distortion = {-0.2, 0.05, 0, 0, 0};
  for (const CameraModel& camera : {kCamera, lens}) {
    FrameInput whole = ValidFrame();
    static_cast<EncodedMasks&>(whole) = ValidMasks(1);
    const auto frame = Ingest(camera, kMaxMaskDelay_s).Accept(whole).value();
    Ingest ingest(camera, kMaxMaskDelay_s);
    ASSERT_EQ(ErrorOf(ingest, ValidFrame()), "accepted");
    const auto masks = ingest.AcceptMasks(ValidMasks(1));
    ASSERT_TRUE(masks.ok()) << masks.status();
    EXPECT_EQ(masks->frame_id, 1u);
    EXPECT_EQ(masks->labels.type(), CV_16UC1);
    EXPECT_EQ(cv::norm(masks->labels, frame->labels, cv::NORM_INF), 0);
    ASSERT_EQ(masks->instances.size(), 2u) << "ingest adds labels that are not listed";
    EXPECT_EQ(masks->instances[0].class_name, "mug");
    EXPECT_EQ(masks->instances[1].label, 9u);
  }
}

TEST(IngestTest, LateMasksNeedAFrameWithoutMasks) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  EXPECT_THAT(MaskErrorOf(ingest, ValidMasks(1)), HasSubstr("no accepted frame has id 1"));
  FrameInput with_masks = ValidFrame(2);
  static_cast<EncodedMasks&>(with_masks) = ValidMasks(2);
  FrameInput bad = ValidFrame(3);
  bad.image.clear();
  EXPECT_EQ(ErrorOf(ingest, ValidFrame(1)), "accepted");
  EXPECT_EQ(ErrorOf(ingest, with_masks), "accepted");
  EXPECT_NE(ErrorOf(ingest, bad), "accepted");
  EXPECT_EQ(ErrorOf(ingest, ValidFrame(4)), "accepted");
  EXPECT_EQ(MaskErrorOf(ingest, ValidMasks(1)), "accepted");
  EXPECT_THAT(MaskErrorOf(ingest, ValidMasks(1)), HasSubstr("already has masks"));
  EXPECT_THAT(MaskErrorOf(ingest, ValidMasks(2)), HasSubstr("already has masks"));
  EXPECT_THAT(MaskErrorOf(ingest, ValidMasks(3)), HasSubstr("no accepted frame has id 3"));
  EXPECT_THAT(MaskErrorOf(ingest, ValidMasks(5)), HasSubstr("no accepted frame has id 5"));
}

TEST(IngestTest, InvalidLateMasksHaveNoEffect) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  ASSERT_EQ(ErrorOf(ingest, ValidFrame()), "accepted");
  MasksInput none;
  none.frame_id = 1;
  EXPECT_THAT(MaskErrorOf(ingest, none), HasSubstr("masks: missing"));
  MasksInput small = ValidMasks(1);
  small.label_png = Encode(".png", cv::Mat::zeros(24, 32, CV_8UC1));
  EXPECT_THAT(MaskErrorOf(ingest, small), HasSubstr("masks: must be 64x48 px like the session's camera, is 32x24 px"));
  MasksInput twice = ValidMasks(1);
  twice.instances.push_back(twice.instances[0]);
  EXPECT_THAT(MaskErrorOf(ingest, twice), HasSubstr("listed twice"));
  EXPECT_EQ(MaskErrorOf(ingest, ValidMasks(1)), "accepted");
}

// Frames are 40 ms apart, so kMaxMaskDelay_s is 25 frames.
TEST(IngestTest, LateMasksAreAcceptedUpToTheMaximumDelay) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  for (uint64_t id = 1; id <= 30; ++id) ASSERT_EQ(ErrorOf(ingest, ValidFrame(id)), "accepted");
  EXPECT_THAT(MaskErrorOf(ingest, ValidMasks(4)), HasSubstr("more than 1 s (objects.max_mask_delay_s) older"));
  EXPECT_EQ(MaskErrorOf(ingest, ValidMasks(5)), "accepted");
  EXPECT_EQ(MaskErrorOf(ingest, ValidMasks(30)), "accepted");
  Ingest no_delay(kCamera, 0);
  for (uint64_t id = 1; id <= 2; ++id) ASSERT_EQ(ErrorOf(no_delay, ValidFrame(id)), "accepted");
  EXPECT_THAT(MaskErrorOf(no_delay, ValidMasks(1)), HasSubstr("too late"));
  EXPECT_EQ(MaskErrorOf(no_delay, ValidMasks(2)), "accepted");
}

TEST(IngestTest, ExtremeTimestampsDoNotOverflow) {
  Ingest ingest(kCamera, kMaxMaskDelay_s);
  FrameInput first = ValidFrame(1), last = ValidFrame(2);
  first.timestamp_ns = std::numeric_limits<int64_t>::min();
  last.timestamp_ns = std::numeric_limits<int64_t>::max();
  EXPECT_EQ(ErrorOf(ingest, first), "accepted");
  EXPECT_EQ(ErrorOf(ingest, last), "accepted");
  EXPECT_THAT(MaskErrorOf(ingest, ValidMasks(1)), HasSubstr("too late"));
}

}  // namespace romap::session::ingest_test
