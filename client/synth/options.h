#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/status.h"

namespace romap::synth {

enum class PathKind {
  kOrbit,     // a level circle around the table
  kHandheld,  // an arc of 120 to 200 degrees with the motion of a hand
  // Two rounds through a larger room, ending at the start. The camera views the table at the start and end of each
  // round and the walls in between, including an almost textureless wall. 600 frames per round correspond to a brisk
  // walk.
  kTwoRounds,
  kRotation,  // hand-held rotation at the first viewpoint of the orbit, see RotationOptions
};

// An inclusive range of frame numbers, counted from 1 as in the file names.
struct FrameRange {
  int first = 1;
  int last = 1;

  bool Contains(int number) const { return first <= number && number <= last; }
  bool operator==(const FrameRange&) const = default;
};

// Parses "FIRST:LAST". INVALID_ARGUMENT if malformed.
absl::StatusOr<FrameRange> ParseFrameRange(const std::string& text);

enum class ImageFormat { kPng, kJpeg };

// Camera lens: no distortion, OpenCV's k1 k2 p1 p2 k3, or an equidistant fisheye with a field of view of 127 degrees.
enum class SynthLens { kPinhole, kRadialTangential, kFisheye };

// Cover of the table.
struct TableTexture {
  enum class Kind {
    kDistinct,  // a random texture
    kRepeated,  // repeats x repeats identical tiles of a random texture
    kPlain,     // one light color without texture
    kFaint,     // one light color with a texture of at most 2 % of the intensity
  };
  Kind kind = Kind::kDistinct;
  int repeats = 2;  // kRepeated only, 1..100

  bool operator==(const TableTexture&) const = default;
};

// Parses "distinct", "repeat:N", "plain" or "faint". INVALID_ARGUMENT if malformed.
absl::StatusOr<TableTexture> ParseTableTexture(const std::string& text);

enum class Walls {
  kDistinct,   // different textures, posters and furniture on each wall
  kIdentical,  // four equal walls: a rotation by 90 degrees about the room's vertical axis maps each to the next
  kNone,       // no walls and no ceiling: black
};

enum class Background {
  kRoom,
  kBlack,  // no table and no room: all pixels without objects are black and have no depth
  kGray,   // the same in gray
};

struct Surroundings {
  TableTexture table = {};
  Walls walls = Walls::kDistinct;
  Background background = Background::kRoom;
};

// Rotation of a hand-held camera in bursts: two oscillations about one axis, then about the next (roll, pitch, yaw),
// as in the sequence fr1_rpy of the TUM RGB-D benchmark.
struct RotationOptions {
  int first_frames = 0;   // number of frames with rotation at the first camera position before the path starts
  double speed_deg = 2;   // peak speed of a burst [deg/frame], 0.01..30; a random 70 to 100 % of it
  double range_deg = 30;  // amplitude of a burst, 1..90; a random 70 to 100 % of it
  double sway_mm = 10;    // approximate maximal displacement of the camera during the rotation [mm], 0..500
};

// A rectangle of image pixels.
struct ImageCrop {
  int x_px = 0, y_px = 0;           // of the upper left corner
  int width_px = 0, height_px = 0;  // 0 = the whole image

  bool operator==(const ImageCrop&) const = default;
};

// Parses "X:Y:WIDTH:HEIGHT". INVALID_ARGUMENT if malformed.
absl::StatusOr<ImageCrop> ParseImageCrop(const std::string& text);

// Range of the gain of an automatic exposure. The gain is constant for 0.8 to 2.2 s, then changes by at least a quarter
// of the range, on a logarithmic scale.
struct GainRange {
  double low = 1;   // 0.01..100
  double high = 1;  // low..100

  bool operator==(const GainRange&) const = default;
};

// Parses "LOW:HIGH". INVALID_ARGUMENT if malformed.
absl::StatusOr<GainRange> ParseGainRange(const std::string& text);

// A jump of the camera to new territory: from frame `frame` on, the camera is turned about the vertical axis through
// its own position.
struct CameraJump {
  int frame = 0;  // counted from 1; 0 = no jump
  double turn_deg = 180;
};

// Parses "FRAME:DEGREES". INVALID_ARGUMENT if malformed.
absl::StatusOr<CameraJump> ParseCameraJump(const std::string& text);

// The parameters of a synthetic sequence. They determine it completely.
struct SynthOptions {
  uint64_t seed = 1;
  int objects = 6;          // 1..16
  int identical_pairs = 0;  // number of pairs of identical objects; 2 * identical_pairs <= objects
  int frames = 300;         // 1..100000
  double fps = 25;          // frames per second, 0.1..1000
  PathKind path = PathKind::kOrbit;
  double rounds = 1;  // circles, passes along the arc (2 = back and forth), or pairs of rounds; 0.01..100
  // Azimuth of one circle (orbit) or one pass along the arc (handheld) [deg]; 0 = 360 (orbit), random 120 to 200
  // (handheld); 0..36000.
  double arc_deg = 0;
  double hand_motion = 1;     // amplitude of the hand motion in height, distance, aim and roll; 0..4
  double elevation_deg = 35;  // mean elevation of the camera above the table, 5..80
  RotationOptions rotation = {};
  // Peak speed of a fast random shake that is added to every path: rotation [deg/frame], 0..30, and translation
  // [mm/frame], 0..200.
  double shake_deg = 0;
  double shake_mm = 0;
  CameraJump jump = {};
  Surroundings surroundings = {};
  int width_px = 640;                    // 32..4096
  int height_px = 480;                   // 32..4096
  SynthLens lens = SynthLens::kPinhole;  // applies to images, masks and depth
  double fx_px = 0;                      // focal length, 10..100000; 0 = default of the lens, see SynthCamera()
  double fy_px = 0;                      // the same; 0 = fx_px
  ImageCrop crop = {};                   // the part of the image to render; the camera path does not depend on it
  // Rolling shutter: the time between the first and the last row, as a share of the frame interval, 0..1. Each row has
  // its own pose. The pose in the ground truth is that of the middle row.
  double readout = 0;
  // Exposure time of each row as a share of the frame interval, 0..1: motion blur as the mean of images during the
  // exposure. The pose in the ground truth is that at the middle of the exposure.
  double exposure = 0;
  ImageFormat format = ImageFormat::kPng;  // of the color images
  int jpeg_quality = 95;                   // 1..100
  // Objects in front of the camera, without label. They hide the scene in color, masks and depth.
  double gripper_share = 0;   // share of the image that a textured object fixed to the camera covers, 0..0.9
  double occluder_share = 0;  // share of the image that a textured blob covers while it moves across, 0..0.9
  // Faults, all disabled by default.
  double mask_jitter_px = 0;             // approximate maximal displacement of mask borders, 0..50
  double mask_drop_share = 0;            // probability that the mask of an object is missing in a frame, 0..1
  bool permute_labels = false;           // permutes labels in each frame; detections.csv assigns classes to them
  double noise_sigma = 0;                // standard deviation of Gaussian image noise [8-bit levels], 0..100
  double motion_blur_px = 0;             // length of the motion blur, 0..100
  double defocus_px = 0;                 // standard deviation of Gaussian blur, 0..20
  std::vector<FrameRange> cuts = {};     // omitted frames: the camera jumps
  std::vector<FrameRange> black = {};    // frames with a covered lens: black, without masks and depth
  std::vector<FrameRange> blurred = {};  // frames blurred so strongly that almost no corners remain
  GainRange gain_steps = {};             // steps of the gain without change of gamma; disabled if low = high = 1
  double depth_noise_mm = 0;   // standard deviation of the depth at 1 m; grows with the square of the depth; 0..100
  double exposure_stops = 0;   // maximal jump of the gain every second or two, with a change of gamma; 0..4
  double duplicate_share = 0;  // probability that a frame repeats the previous image, 0..1
};

// INVALID_ARGUMENT names every option that is out of range.
absl::Status ValidateSynthOptions(const SynthOptions& options);

}  // namespace romap::synth
