#include "server/slam/up_estimator.h"

#include <algorithm>
#include <vector>

#include "common/statistics.h"

namespace romap::slam {
namespace {

constexpr size_t kWindowFrames = 150;
constexpr double kInlierCosine = 0.985;  // 10 degrees

Eigen::Vector3d ComponentwiseMedian(const std::deque<Eigen::Vector3d>& samples) {
  Eigen::Vector3d median;
  std::vector<double> values(samples.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::transform(samples.begin(), samples.end(), values.begin(), [axis](const auto& v) { return v[axis]; });
    median[axis] = Median(values);
  }
  return median;
}

}  // namespace

void UpEstimator::Add(const Frame& frame, const SE3<World, Camera>& T_world_camera) {
  if (!frame.gravity_camera) return;
  samples_.push_back(-(T_world_camera.rotation() * *frame.gravity_camera));
  if (samples_.size() > kWindowFrames) samples_.pop_front();

  const Eigen::Vector3d median = ComponentwiseMedian(samples_);
  if (median.norm() < 0.5) return;  // the samples contradict each other: keep the last estimate
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& sample : samples_) {
    if (sample.dot(median.normalized()) > kInlierCosine) sum += sample;
  }
  up_world_ = sum.isZero() ? median.normalized() : sum.normalized();
}

void UpEstimator::Rotate(const Eigen::Quaterniond& R_new_old) {
  for (Eigen::Vector3d& sample : samples_) sample = R_new_old * sample;
  up_world_ = R_new_old * up_world_;
}

}  // namespace romap::slam
