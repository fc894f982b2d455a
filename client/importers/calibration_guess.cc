#include "client/importers/calibration_guess.h"

#include <libexif/exif-data.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "client/importers/folder.h"

namespace romap::importers {
namespace {

constexpr double kFilmDiagonal_mm = 43.2666;  // of 36 mm x 24 mm
constexpr double kGuessedView_rad = std::numbers::pi / 3;

struct FocalGuess {
  double focal_px = 0;
  std::string source;
};

FocalGuess GuessFocal(const std::string& first_image, cv::Size size_px, double focal_px) {
  if (focal_px > 0) return {focal_px, "given with --focal"};
  if (const std::optional<double> focal_mm = FocalLength35mm(first_image)) {
    return {*focal_mm * std::hypot(size_px.width, size_px.height) / kFilmDiagonal_mm,
            fmt::format("guessed from the Exif data of {} ({:g} mm for film of 35 mm)", first_image, *focal_mm)};
  }
  return {0.5 * std::max(size_px.width, size_px.height) / std::tan(0.5 * kGuessedView_rad),
          "guessed from a field of view of 60 degrees"};
}

}  // namespace

std::optional<double> FocalLength35mm(const std::string& path) {
  const std::unique_ptr<ExifData, decltype(&exif_data_unref)> data(exif_data_new_from_file(path.c_str()),
                                                                   &exif_data_unref);
  if (!data) return std::nullopt;
  const ExifEntry* entry = exif_content_get_entry(data->ifd[EXIF_IFD_EXIF], EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (entry == nullptr || entry->data == nullptr) return std::nullopt;
  const ExifByteOrder order = exif_data_get_byte_order(data.get());
  double focal_mm = 0;
  if (entry->format == EXIF_FORMAT_SHORT && entry->size >= 2) focal_mm = exif_get_short(entry->data, order);
  if (entry->format == EXIF_FORMAT_LONG && entry->size >= 4) focal_mm = exif_get_long(entry->data, order);
  return focal_mm >= 1 && focal_mm <= 5000 ? std::optional(focal_mm) : std::nullopt;  // 0: unknown
}

absl::Status GuessCalibration(const std::string& folder, const std::string& first_image, cv::Size size_px,
                              const ReadOptions& options, RecordingContents* contents) {
  CameraModel& camera = contents->camera.camera;
  if (const std::string path = folder + "/camera.yaml"; IsFile(path)) {
    ROMAP_ASSIGN_OR_RETURN(files::CameraYaml calibration, files::ReadCameraYaml(path));
    if (calibration.camera.width_px != size_px.width || calibration.camera.height_px != size_px.height) {
      return InvalidArgument("{}: the size is {}x{} px; the images have {}x{} px", path, calibration.camera.width_px,
                             calibration.camera.height_px, size_px.width, size_px.height);
    }
    contents->camera = calibration;
    return absl::OkStatus();
  }
  const FocalGuess guess = GuessFocal(first_image, size_px, options.focal_px);
  camera.width_px = size_px.width;
  camera.height_px = size_px.height;
  camera.fx_px = camera.fy_px = guess.focal_px;
  camera.cx_px = 0.5 * (size_px.width - 1);
  camera.cy_px = 0.5 * (size_px.height - 1);
  contents->diagnostics.push_back(
      {.code = "calibration_guessed",
       .severity = options.focal_px > 0 ? Severity::kInfo : Severity::kWarning,
       .text = fmt::format("no calibration: focal length {:.1f} px {}; the principal point is the center of the image",
                           guess.focal_px, guess.source),
       .advice = "write camera.yaml into the folder, or give the focal length with --focal"});
  return absl::OkStatus();
}

}  // namespace romap::importers
