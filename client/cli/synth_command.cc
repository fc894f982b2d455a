#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>
#include <memory>

#include "client/cli/command.h"
#include "client/cli/progress.h"
#include "client/synth/synth.h"

namespace romap::cli {
namespace {

struct SynthCommandOptions {
  synth::SynthOptions synth;
  std::string out;
  // Ranges FIRST:LAST from the command line.
  std::vector<std::string> cuts;
  std::vector<std::string> black;
  std::vector<std::string> blurred;
};

absl::Status ReadRanges(const char* option, const std::vector<std::string>& texts,
                        std::vector<synth::FrameRange>* ranges) {
  for (const std::string& text : texts) {
    const absl::StatusOr<synth::FrameRange> range = synth::ParseFrameRange(text);
    if (!range.ok()) return InvalidArgument("{}: {}", option, Message(range.status()));
    ranges->push_back(*range);
  }
  return absl::OkStatus();
}

absl::Status RunSynth(SynthCommandOptions options) {
  ROMAP_RETURN_IF_ERROR(ReadRanges("--cut", options.cuts, &options.synth.cuts));
  ROMAP_RETURN_IF_ERROR(ReadRanges("--black", options.black, &options.synth.black));
  ROMAP_RETURN_IF_ERROR(ReadRanges("--blur", options.blurred, &options.synth.blurred));
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

void AddFaultOptions(SynthCommandOptions* options, CLI::App* command) {
  synth::SynthOptions& synth = options->synth;
  const auto add = [&](const char* name, auto& value, const char* help) {
    command->add_option(name, value, help)->capture_default_str();
  };
  add("--mask-jitter", synth.mask_jitter_px, "Typical displacement of mask borders [px]");
  add("--mask-drop", synth.mask_drop_share, "Fraction of masks to drop, 0 to 1");
  command->add_flag("--permute-labels", synth.permute_labels, "Permute the labels at random in each frame");
  add("--noise", synth.noise_sigma, "Standard deviation of the image noise [8-bit levels]");
  add("--motion-blur", synth.motion_blur_px, "Length of the motion blur [px]");
  add("--defocus", synth.defocus_px, "Standard deviation of the defocus blur [px]");
  const auto add_ranges = [&](const char* name, std::vector<std::string>& texts, const char* help) {
    command->add_option(name, texts, help)->type_name("FIRST:LAST");
  };
  add_ranges("--cut", options->cuts, "Omit these frames, simulating an abrupt camera motion");
  add_ranges("--black", options->black, "Make these frames black (covered lens)");
  add_ranges("--blur", options->blurred, "Blur these frames so strongly that tracking fails");
  add("--exposure-jumps", synth.exposure_stops,
      "Maximum size of the exposure jumps, which occur every one to two seconds [stops]");
  add("--duplicates", synth.duplicate_share, "Fraction of frames that repeat the previous image, 0 to 1");
}

}  // namespace

void AddSynthCommand(CLI::App& app, Command* chosen) {
  auto options = std::make_shared<SynthCommandOptions>();
  synth::SynthOptions& synth = options->synth;
  CLI::App* command = app.add_subcommand(
      "synth", "Render a synthetic sequence of textured objects on a table, with exact ground truth");
  command->add_option("--out", options->out, "Output folder")->required();
  const auto add = [&](const char* name, auto& value, const char* help) {
    command->add_option(name, value, help)->capture_default_str();
  };
  add("--seed", synth.seed, "Random seed; determines the whole sequence");
  add("--objects", synth.objects, "Number of objects, 1 to 16");
  add("--identical-pairs", synth.identical_pairs, "Number of pairs of identical objects");
  add("--frames", synth.frames, "Number of frames");
  add("--fps", synth.fps, "Frames per second");
  const std::map<std::string, synth::PathKind> paths = {{"orbit", synth::PathKind::kOrbit},
                                                        {"handheld", synth::PathKind::kHandheld},
                                                        {"tworounds", synth::PathKind::kTwoRounds}};
  command
      ->add_option("--path", synth.path, "Camera path: orbit, handheld, or tworounds (two laps through a larger room)")
      ->transform(CLI::CheckedTransformer(paths, CLI::ignore_case));
  add("--rounds", synth.rounds,
      "Number of circles (orbit), passes along the arc (handheld), or pairs of laps (tworounds)");
  add("--hand-motion", synth.hand_motion,
      "Amplitude of the hand-held motion in height, distance, viewing direction and roll; 1 = steady hand");
  add("--elevation", synth.elevation_deg, "Elevation of the camera above the table [deg]");
  add("--width", synth.width_px, "Image width [px]");
  add("--height", synth.height_px, "Image height [px]");
  const std::map<std::string, synth::SynthLens> lenses = {{"pinhole", synth::SynthLens::kPinhole},
                                                          {"radtan", synth::SynthLens::kRadialTangential},
                                                          {"fisheye", synth::SynthLens::kFisheye}};
  command->add_option("--lens", synth.lens, "Camera lens: pinhole, radtan or fisheye")
      ->transform(CLI::CheckedTransformer(lenses, CLI::ignore_case));
  const std::map<std::string, synth::ImageFormat> formats = {{"png", synth::ImageFormat::kPng},
                                                             {"jpeg", synth::ImageFormat::kJpeg}};
  command->add_option("--format", synth.format, "Format of the color images: png or jpeg")
      ->transform(CLI::CheckedTransformer(formats, CLI::ignore_case));
  AddFaultOptions(options.get(), command);
  command->callback([options, chosen] { *chosen = [options] { return RunSynth(*options); }; });
}

}  // namespace romap::cli
