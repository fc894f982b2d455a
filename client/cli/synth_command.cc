#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>
#include <memory>
#include <type_traits>

#include "client/cli/command.h"
#include "client/cli/progress.h"
#include "client/synth/synth.h"

namespace romap::cli {
namespace {

struct SynthCommandOptions {
  synth::SynthOptions synth;
  std::string out;
  // Texts from the command line; empty = default.
  std::string table_texture;
  std::string jump;
  std::string crop;
  std::string gain_steps;
  // Ranges FIRST:LAST.
  std::vector<std::string> cuts;
  std::vector<std::string> black;
  std::vector<std::string> blurred;
};

template <class Value>
using Parser = absl::StatusOr<Value> (*)(const std::string& text);

template <class Value>
absl::Status ReadText(const char* option, const std::string& text, std::type_identity_t<Parser<Value>> parse,
                      Value* value) {
  const absl::StatusOr<Value> parsed = parse(text);
  if (!parsed.ok()) return InvalidArgument("{}: {}", option, Message(parsed.status()));
  *value = *parsed;
  return absl::OkStatus();
}

// An empty text leaves `value` unchanged.
template <class Value>
absl::Status ReadOptional(const char* option, const std::string& text, std::type_identity_t<Parser<Value>> parse,
                          Value* value) {
  return text.empty() ? absl::OkStatus() : ReadText(option, text, parse, value);
}

absl::Status ReadRanges(const char* option, const std::vector<std::string>& texts,
                        std::vector<synth::FrameRange>* ranges) {
  for (const std::string& text : texts) {
    ROMAP_RETURN_IF_ERROR(ReadText(option, text, synth::ParseFrameRange, &ranges->emplace_back()));
  }
  return absl::OkStatus();
}

// Parses the options that the command line holds as text.
absl::Status ReadTexts(SynthCommandOptions& options) {
  synth::SynthOptions& synth = options.synth;
  ROMAP_RETURN_IF_ERROR(
      ReadOptional("--table-texture", options.table_texture, synth::ParseTableTexture, &synth.surroundings.table));
  ROMAP_RETURN_IF_ERROR(ReadOptional("--jump", options.jump, synth::ParseCameraJump, &synth.jump));
  ROMAP_RETURN_IF_ERROR(ReadOptional("--crop", options.crop, synth::ParseImageCrop, &synth.crop));
  ROMAP_RETURN_IF_ERROR(ReadOptional("--gain-steps", options.gain_steps, synth::ParseGainRange, &synth.gain_steps));
  ROMAP_RETURN_IF_ERROR(ReadRanges("--cut", options.cuts, &synth.cuts));
  ROMAP_RETURN_IF_ERROR(ReadRanges("--black", options.black, &synth.black));
  return ReadRanges("--blur", options.blurred, &synth.blurred);
}

absl::Status RunSynth(SynthCommandOptions options) {
  ROMAP_RETURN_IF_ERROR(ReadTexts(options));
  Progress progress("rendering");
  const absl::Status status = synth::MakeSequence(options.synth, options.out, [&](int done, int total) {
    progress.Show(static_cast<double>(done) / total, fmt::format("frame {}/{}", done, total));
  });
  progress.Done();
  if (status.ok()) {
    fmt::print("wrote {} frames of {} objects with ground truth to {}\n", options.synth.frames, options.synth.objects,
               options.out);
  }
  return status;
}

// The options of one group in the help text.
class OptionGroup {
 public:
  OptionGroup(CLI::App* command, const char* name) : command_(command), name_(name) {}

  template <class Value>
  void Add(const char* name, Value& value, const char* help) const {
    command_->add_option(name, value, help)->capture_default_str()->group(name_);
  }
  template <class Choice>
  void AddChoice(const char* name, Choice& value, const std::map<std::string, Choice>& choices,
                 const char* help) const {
    std::string names;
    for (const auto& [choice, _] : choices) names += (names.empty() ? "" : "|") + choice;
    // Without description: the help text lists the names only.
    command_->add_option(name, value, help)
        ->transform(CLI::CheckedTransformer(choices, CLI::ignore_case).description(""))
        ->type_name(names)
        ->group(name_);
  }
  template <class Text>
  void AddText(const char* name, Text& text, const char* format, const char* help) const {
    command_->add_option(name, text, help)->type_name(format)->group(name_);
  }
  void AddFlag(const char* name, bool& value, const char* help) const {
    command_->add_flag(name, value, help)->group(name_);
  }

 private:
  CLI::App* command_;
  const char* name_;
};

void AddSceneOptions(SynthCommandOptions& options, CLI::App* command) {
  synth::SynthOptions& synth = options.synth;
  const OptionGroup scene(command, "Scene");
  scene.Add("--seed", synth.seed, "Random seed; determines the whole sequence");
  scene.Add("--objects", synth.objects, "Number of objects, 1 to 16");
  scene.Add("--identical-pairs", synth.identical_pairs, "Number of pairs of identical objects");
  scene.AddText(
      "--table-texture", options.table_texture, "distinct|repeat:N|plain|faint",
      "Texture of the table: distinct = random (default), repeat:N = N x N identical tiles, plain = one light "
      "color, faint = one light color with 2 % grain");
  scene.AddChoice<synth::Walls>(
      "--walls", synth.surroundings.walls,
      {{"distinct", synth::Walls::kDistinct}, {"identical", synth::Walls::kIdentical}, {"none", synth::Walls::kNone}},
      "Walls: distinct (default), identical (four equal walls) or none (black, without "
      "ceiling)");
  scene.AddChoice<synth::Background>(
      "--background", synth.surroundings.background,
      {{"room", synth::Background::kRoom}, {"black", synth::Background::kBlack}, {"gray", synth::Background::kGray}},
      "Background of the objects: room with table (default), or black or gray pixels "
      "without depth");
}

void AddPathOptions(SynthCommandOptions& options, CLI::App* command) {
  synth::SynthOptions& synth = options.synth;
  const OptionGroup path(command, "Camera path");
  path.Add("--frames", synth.frames, "Number of frames");
  path.Add("--fps", synth.fps, "Frames per second");
  path.AddChoice<synth::PathKind>("--path", synth.path,
                                  {{"orbit", synth::PathKind::kOrbit},
                                   {"handheld", synth::PathKind::kHandheld},
                                   {"tworounds", synth::PathKind::kTwoRounds},
                                   {"rotation", synth::PathKind::kRotation}},
                                  "Camera path: orbit (level circle), handheld (arc with hand motion), tworounds (two "
                                  "laps through a larger room), or rotation (fast hand-held rotation in place)");
  path.Add("--rounds", synth.rounds,
           "Number of circles (orbit), passes along the arc (handheld), or pairs of laps (tworounds)");
  path.Add("--arc", synth.arc_deg,
           "Angle of one circle (orbit) or one pass (handheld) [deg]; up to 300 visits no place twice, 720 makes two "
           "rounds; 0 = 360 (orbit) or random 120 to 200 (handheld)");
  path.Add("--hand-motion", synth.hand_motion,
           "Amplitude of the hand-held motion in height, distance, viewing direction and roll; 1 = steady hand");
  path.Add("--elevation", synth.elevation_deg, "Elevation of the camera above the table [deg]");
  path.Add("--rotate-first", synth.rotation.first_frames,
           "Number of frames that only rotate the camera before the path starts");
  path.Add("--rotation-speed", synth.rotation.speed_deg,
           "Peak speed of the rotation in place [deg/frame], for --path rotation and --rotate-first");
  path.Add("--rotation-range", synth.rotation.range_deg, "Amplitude of the rotation in place [deg]");
  path.Add("--sway", synth.rotation.sway_mm, "Displacement of the camera during the rotation in place [mm]");
  path.Add("--shake-deg", synth.shake_deg, "Peak rotation of a fast random shake, added to any path [deg/frame]");
  path.Add("--shake-mm", synth.shake_mm, "Peak translation of a fast random shake, added to any path [mm/frame]");
  path.AddText("--jump", options.jump, "FRAME:DEGREES",
               "Turn the camera by this angle about the vertical axis from this frame on; 180 = view a part of the "
               "room that was not visible before");
}

void AddCameraOptions(SynthCommandOptions& options, CLI::App* command) {
  synth::SynthOptions& synth = options.synth;
  const OptionGroup camera(command, "Camera");
  camera.Add("--width", synth.width_px, "Image width [px]");
  camera.Add("--height", synth.height_px, "Image height [px]");
  camera.AddChoice<synth::SynthLens>("--lens", synth.lens,
                                     {{"pinhole", synth::SynthLens::kPinhole},
                                      {"radtan", synth::SynthLens::kRadialTangential},
                                      {"fisheye", synth::SynthLens::kFisheye}},
                                     "Camera lens: pinhole, radtan or fisheye");
  camera.Add("--fx", synth.fx_px, "Horizontal focal length [px]; 0 = default of the lens; larger = narrower view");
  camera.Add("--fy", synth.fy_px, "Vertical focal length [px]; 0 = the same as --fx");
  camera.AddText("--crop", options.crop, "X:Y:WIDTH:HEIGHT",
                 "Render only this part of the image [px], from the same viewpoints");
  camera.Add("--rolling-shutter", synth.readout,
             "Time between the first and last image row, as a fraction of the frame interval, 0 to 1; the true pose is "
             "that of the middle row");
  camera.Add("--exposure", synth.exposure,
             "Exposure time as a fraction of the frame interval, 0 to 1: motion blur as the mean of images during the "
             "exposure; the true pose is that at its middle");
  camera.AddChoice<synth::ImageFormat>("--format", synth.format,
                                       {{"png", synth::ImageFormat::kPng}, {"jpeg", synth::ImageFormat::kJpeg}},
                                       "Format of the color images: png or jpeg");
  camera.Add("--jpeg-quality", synth.jpeg_quality, "Quality of JPEG images, 1 to 100");
}

void AddFaultOptions(SynthCommandOptions& options, CLI::App* command) {
  synth::SynthOptions& synth = options.synth;
  const OptionGroup faults(command, "Faults");
  faults.Add("--occluder", synth.occluder_share,
             "Fraction of the image that a textured blob covers while it moves across, 0 to 0.9");
  faults.Add("--gripper", synth.gripper_share,
             "Fraction of the image that a textured object fixed to the camera covers, 0 to 0.9");
  faults.Add("--depth-noise", synth.depth_noise_mm,
             "Standard deviation of the depth at 1 m [mm]; grows with the square of the depth");
  faults.Add("--mask-jitter", synth.mask_jitter_px, "Typical displacement of mask borders [px]");
  faults.Add("--mask-drop", synth.mask_drop_share, "Fraction of masks to drop, 0 to 1");
  faults.AddFlag("--permute-labels", synth.permute_labels, "Permute the labels at random in each frame");
  faults.Add("--noise", synth.noise_sigma, "Standard deviation of the image noise [8-bit levels]");
  faults.Add("--motion-blur", synth.motion_blur_px,
             "Length of motion blur of constant length along the image motion [px]; see also --exposure");
  faults.Add("--defocus", synth.defocus_px, "Standard deviation of the defocus blur [px]");
  faults.AddText("--cut", options.cuts, "FIRST:LAST", "Omit these frames, simulating an abrupt camera motion");
  faults.AddText("--black", options.black, "FIRST:LAST", "Make these frames black (covered lens)");
  faults.AddText("--blur", options.blurred, "FIRST:LAST", "Blur these frames so strongly that tracking fails");
  faults.Add("--exposure-jumps", synth.exposure_stops,
             "Maximum size of the exposure jumps, which occur every one to two seconds [stops]");
  faults.AddText("--gain-steps", options.gain_steps, "LOW:HIGH",
                 "Change the gain in steps within this range every one to two seconds, e.g. 0.3:1.6");
  faults.Add("--duplicates", synth.duplicate_share, "Fraction of frames that repeat the previous image, 0 to 1");
}

}  // namespace

void AddSynthCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<SynthCommandOptions>();
  CLI::App* command = app.add_subcommand(
      "synth", "Render a synthetic sequence of textured objects on a table, with exact ground truth");
  command->add_option("--out", options->out, "Output folder")->required();
  AddSceneOptions(*options, command);
  AddPathOptions(*options, command);
  AddCameraOptions(*options, command);
  AddFaultOptions(*options, command);
  command->callback([options, chosen] { *chosen = [options] { return RunSynth(*options); }; });
}

}  // namespace romap::cli
