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
  kRotation,  // the rotation of a hand at the first viewpoint of the orbit, without other motion
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
  int width_px = 640;                      // 32..4096
  int height_px = 480;                     // 32..4096
  SynthLens lens = SynthLens::kPinhole;    // applies to images, masks and depth
  ImageFormat format = ImageFormat::kPng;  // of the color images
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
  double exposure_stops = 0;             // maximal jump of the gain every second or two, with a change of gamma; 0..4
  double duplicate_share = 0;            // probability that a frame repeats the previous image, 0..1
};

// INVALID_ARGUMENT names every option that is out of range.
absl::Status ValidateSynthOptions(const SynthOptions& options);

}  // namespace romap::synth
