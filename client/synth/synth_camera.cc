#include "client/synth/synth_camera.h"

namespace romap::synth {

CameraModel UncroppedCamera(const SynthOptions& options) {
  CameraModel camera;
  camera.width_px = options.width_px;
  camera.height_px = options.height_px;
  switch (options.lens) {
    case SynthLens::kPinhole:
      camera.fx_px = 0.9 * options.width_px;
      break;
    case SynthLens::kRadialTangential:
      camera.fx_px = 0.6 * options.width_px;
      camera.distortion = {-0.28, 0.07, 4e-4, 2e-4, 0};
      break;
    case SynthLens::kFisheye:
      camera.fx_px = 0.45 * options.width_px;
      camera.lens = LensModel::kFisheye;
      camera.distortion = {3.4e-3, 7e-4, -2e-3, 2e-4, 0};
      break;
  }
  if (options.fx_px > 0) camera.fx_px = options.fx_px;
  camera.fy_px = options.fy_px > 0 ? options.fy_px : camera.fx_px;
  camera.cx_px = 0.5 * (options.width_px - 1);
  camera.cy_px = 0.5 * (options.height_px - 1);
  camera.readout_s = options.readout / options.fps;
  return camera;
}

CameraModel SynthCamera(const SynthOptions& options) {
  CameraModel camera = UncroppedCamera(options);
  if (options.crop == ImageCrop{}) return camera;
  camera.width_px = options.crop.width_px;
  camera.height_px = options.crop.height_px;
  camera.cx_px -= options.crop.x_px;
  camera.cy_px -= options.crop.y_px;
  return camera;
}

}  // namespace romap::synth
