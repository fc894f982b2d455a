#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "common/geometry.h"
#include "server/slam/geometry/pose_refiner.h"
#include "server/slam/rolling_shutter.h"

namespace romap::slam {

// How much longer the readout of the images takes than the camera states.
struct ReadoutError {
  double value_s = 0;
  double sigma_s = 0;
};

// Estimates the readout time of a rolling shutter from frames that were tracked against the map: the features of a
// moving camera are off by the image motion during the time between the middle row and their own. Each frame gives a
// linear equation, from which its pose, which absorbs a part of these errors, is eliminated. The map absorbs another
// part, so the estimate tends to be too low. Frames of different motion disagree by chance, and by how much determines
// the uncertainty.
class ReadoutEstimator {
 public:
  // A matched feature of the frame.
  struct Observation {
    PoseObservation observation;  // at its pixel in the global-shutter image
    double read_at = 0;           // share of the readout between the middle row and the feature's own, -0.5 .. 0.5
  };

  // `motion`: of the camera per second, as if the readout took one second.
  void AddFrame(const CameraModel& camera, const SE3<World, Camera>& T_world_camera,
                std::span<const Observation> observations, const ReadoutMotion& motion);
  // nullopt while the frames do not determine it.
  std::optional<ReadoutError> Estimate() const;

 private:
  // Frames in a row, whose errors are correlated: information about the readout error and its product with the
  // estimate.
  struct Block {
    int frames = 0;
    double information = 0;
    double weighted_s = 0;
  };
  std::vector<Block> blocks_;
};

}  // namespace romap::slam
