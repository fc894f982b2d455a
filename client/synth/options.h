#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/status.h"

namespace romap::synth {

enum class PathKind {
  kOrbit,     // a level circle around the table
  kHandheld,  // an arc of 120 to 200 degrees with the unrest of a hand
  // Twice around a larger room, back to the start: the table is seen at the start and end of each round, walls in
  // between, and on a part of the way little else than a plain wall. About 600 frames a round are a brisk walk.
  kTwoRounds,
};

// Frames by their numbers, counted from 1 as in the names of their files, both ends included.
struct FrameRange {
  int first = 1;
  int last = 1;

  bool Contains(int number) const { return first <= number && number <= last; }
  bool operator==(const FrameRange&) const = default;
};

// Reads "FIRST:LAST". INVALID_ARGUMENT says what it should look like.
absl::StatusOr<FrameRange> ParseFrameRange(const std::string& text);

enum class ImageFormat { kPng, kJpeg };

// What bends the rays: nothing, OpenCV's k1 k2 p1 p2 k3, or an equidistant fisheye that sees 127 degrees across.
enum class SynthLens { kPinhole, kRadialTangential, kFisheye };

// What sequence to make. Everything in it follows from these numbers.
struct SynthOptions {
  uint64_t seed = 1;
  int objects = 6;          // 1..16
  int identical_pairs = 0;  // so many pairs of objects are twins; 2 * pairs <= objects
  int frames = 300;         // 1..100000
  double fps = 25;          // frames per second, 0.1..1000
  PathKind path = PathKind::kOrbit;
  double rounds = 1;          // circles, passes along the arc (2 = there and back), or pairs of rounds; 0.01..100
  double unrest = 1;          // of the hand: how far it wanders in height, distance, aim and roll; 0..4
  double elevation_deg = 35;  // of the camera above the table, 5..80; the hand wanders about it
  int width_px = 640;         // 32..4096
  int height_px = 480;        // 32..4096
  SynthLens lens = SynthLens::kPinhole;    // colours, masks and depth are all as the lens shows them
  ImageFormat format = ImageFormat::kPng;  // of the colour images
  // Faults, all off by default.
  double mask_jitter_px = 0;          // the masks' borders are displaced by up to about so much, 0..50
  double mask_drop_share = 0;         // share of the objects' masks that are missing, each by chance, 0..1
  bool permute_labels = false;        // a mask's labels are shuffled in every frame; detections.csv says what they mean
  double noise_sigma = 0;             // of Gaussian image noise, in 8-bit levels, 0..100
  double motion_blur_px = 0;          // length of the smear along the camera's motion, 0..100
  double defocus_px = 0;              // sigma of a Gaussian blur, 0..20
  std::vector<FrameRange> cuts = {};  // frames that are missing, as if the camera had been carried off
  std::vector<FrameRange> black = {};    // frames with a covered lens: no light, no masks, no depth
  std::vector<FrameRange> blurred = {};  // frames in which hardly any corner survives the motion
  double exposure_stops = 0;   // gain jumps every second or two by up to so much up or down, gamma with it; 0..4
  double duplicate_share = 0;  // share of the frames that show the picture before them once more, by chance, 0..1
};

// INVALID_ARGUMENT naming each option that is out of its range.
absl::Status ValidateSynthOptions(const SynthOptions& options);

}  // namespace romap::synth
