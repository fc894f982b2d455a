#include "server/slam/optimize/bundle_covariance.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "common/statistics.h"
#include "server/slam/optimize/lie.h"

namespace romap::slam {
namespace {

constexpr double kMinNoiseFactor = 0.2;  // of the claimed sigmas
constexpr double kMaxNoiseFactor = 3;
constexpr double kMinFreeShare = 0.25;
// The orientations take part in the alignment with this weight, relative to positions at the typical distance of the
// points, so that it is determined for two cameras and for cameras on a line.
constexpr double kOrientationWeight = 1e-3;
constexpr double kGaugeInformation = 1e13;
constexpr double kPointDamping = 1e-9;  // of the trace of a point's information

using Matrix3 = Eigen::Matrix3d;
using Matrix36 = Eigen::Matrix<double, 3, 6>;
using Matrix63 = Eigen::Matrix<double, 6, 3>;

// The derivatives of one observation's normalized errors (x, y, depth).
struct Derivatives {
  int camera = 0;                         // among the selected ones
  Matrix36 by_camera = Matrix36::Zero();  // position, then rotation vector, world axes
  Matrix3 by_point = Matrix3::Zero();
  Eigen::Vector3d by_lens = Eigen::Vector3d::Zero();
};

// Every n-th index, so that at most `max` are selected.
int StrideFor(size_t count, int max) { return std::max(1, static_cast<int>((count + max - 1) / max)); }

// The share of the observations' variance that is left in the residuals: adjusted cameras and points follow the errors
// of their observations.
double FreeShare(const BundleProblem& problem) {
  double errors = 0;
  for (const BundleObservation& observation : problem.observations) {
    if (!observation.outlier) errors += observation.depth_mu > 0 ? 3 : 2;
  }
  const double parameters =
      6 * static_cast<double>(problem.cameras.size()) + 3 * static_cast<double>(problem.points.size());
  return errors > 0 ? std::max(kMinFreeShare, 1 - parameters / errors) : 1;
}

// The information of the selected cameras (six parameters each, position first) and the lens (one, the last).
// Lengths are in units of the typical distance of the points.
class CameraInformation {
 public:
  CameraInformation(const BundleProblem& problem, const BundleCovarianceOptions& options);

  std::vector<CameraCovariance> Covariances() const;

 private:
  void Select(const BundleCovarianceOptions& options);
  void MeasureUnit();
  std::vector<std::vector<const BundleObservation*>> ObservationsByPoint() const;
  bool Differentiate(const BundleObservation& observation, Derivatives& derivatives) const;
  void AddPoint(const std::vector<Derivatives>& observations, double weight);
  void AddPriors();
  Eigen::MatrixXd GaugeMotions() const;

  const BundleProblem& problem_;
  double noise_ = 1;
  double unit_mu_ = 1;
  bool has_depth_ = false;
  bool has_priors_ = false;
  std::vector<int> selected_of_;  // per camera: -1 = not selected
  std::vector<int> cameras_;      // the selected ones
  Eigen::Index lens_ = 0;         // index of its parameter
  Eigen::MatrixXd information_;   // lower triangle
};

CameraInformation::CameraInformation(const BundleProblem& problem, const BundleCovarianceOptions& options)
    : problem_(problem) {
  noise_ = std::clamp(MeasureNoise(problem) / std::sqrt(FreeShare(problem)), kMinNoiseFactor, kMaxNoiseFactor);
  Select(options);
  MeasureUnit();
  lens_ = 6 * static_cast<Eigen::Index>(cameras_.size());
  information_.setZero(lens_ + 1, lens_ + 1);
  const double lens_sigma = problem.lens ? problem.lens->sigma : 1;
  information_(lens_, lens_) = 1 / (lens_sigma * lens_sigma);

  const std::vector<std::vector<const BundleObservation*>> by_point = ObservationsByPoint();
  const int stride = StrideFor(by_point.size(), options.max_points);
  std::vector<Derivatives> derivatives;
  for (size_t p = 0; p < by_point.size(); p += static_cast<size_t>(stride)) {
    derivatives.clear();
    for (const BundleObservation* observation : by_point[p]) {
      Derivatives& added = derivatives.emplace_back();
      if (!Differentiate(*observation, added)) derivatives.pop_back();
    }
    AddPoint(derivatives, stride);
  }
  AddPriors();
}

void CameraInformation::Select(const BundleCovarianceOptions& options) {
  const int stride = StrideFor(problem_.cameras.size(), options.max_cameras);
  selected_of_.assign(problem_.cameras.size(), -1);
  for (size_t i = 0; i < problem_.cameras.size(); i += static_cast<size_t>(stride)) {
    selected_of_[i] = static_cast<int>(cameras_.size());
    cameras_.push_back(static_cast<int>(i));
  }
}

void CameraInformation::MeasureUnit() {
  std::vector<double> distances_mu;
  for (const BundleObservation& observation : problem_.observations) {
    if (observation.outlier) continue;
    const BundleCamera& camera = problem_.cameras[static_cast<size_t>(observation.camera)];
    const BundlePoint& point = problem_.points[static_cast<size_t>(observation.point)];
    distances_mu.push_back((point.position_world - camera.T_world_camera.translation()).norm());
    has_depth_ |= observation.depth_mu > 0;
  }
  if (!distances_mu.empty()) unit_mu_ = Median(std::move(distances_mu));
  for (const BundleCamera& camera : problem_.cameras) has_priors_ |= camera.prior.has_value();
}

// The points that at least two selected cameras observe.
std::vector<std::vector<const BundleObservation*>> CameraInformation::ObservationsByPoint() const {
  std::vector<std::vector<const BundleObservation*>> by_point(problem_.points.size());
  for (const BundleObservation& observation : problem_.observations) {
    if (observation.outlier || selected_of_[static_cast<size_t>(observation.camera)] < 0) continue;
    by_point[static_cast<size_t>(observation.point)].push_back(&observation);
  }
  std::erase_if(by_point, [](const auto& observations) { return observations.size() < 2; });
  return by_point;
}

bool CameraInformation::Differentiate(const BundleObservation& observation, Derivatives& derivatives) const {
  const SE3<World, Camera>& T_world_camera = problem_.cameras[static_cast<size_t>(observation.camera)].T_world_camera;
  const Eigen::Vector3d offset =
      (problem_.points[static_cast<size_t>(observation.point)].position_world - T_world_camera.translation()) /
      unit_mu_;
  const Matrix3 R_camera_world = T_world_camera.RotationMatrix().transpose();
  const Eigen::Vector3d p_camera = R_camera_world * offset;
  if (!(p_camera.z() > 1e-3)) return false;
  const double inverse_z = 1 / p_camera.z();
  const Eigen::Vector2d pinhole = inverse_z * p_camera.head<2>();
  const Eigen::Vector2d weight =
      Eigen::Vector2d(problem_.camera.fx_px, problem_.camera.fy_px) / (noise_ * observation.sigma_px);
  Matrix3 projection = Matrix3::Zero();
  projection.row(0) << weight.x() * inverse_z, 0, -weight.x() * inverse_z * pinhole.x();
  projection.row(1) << 0, weight.y() * inverse_z, -weight.y() * inverse_z * pinhole.y();
  if (observation.depth_mu > 0 && observation.depth_sigma_mu > 0) {
    projection(2, 2) = unit_mu_ / observation.depth_sigma_mu;
  }
  derivatives.camera = selected_of_[static_cast<size_t>(observation.camera)];
  derivatives.by_point = projection * R_camera_world;
  derivatives.by_camera.leftCols<3>() = -derivatives.by_point;
  derivatives.by_camera.rightCols<3>() = derivatives.by_point * Hat(offset);
  if (problem_.lens) derivatives.by_lens.head<2>() = weight.cwiseProduct(pinhole) * pinhole.squaredNorm();
  return true;
}

// Eliminates the point.
void CameraInformation::AddPoint(const std::vector<Derivatives>& observations, double weight) {
  if (observations.size() < 2) return;
  Matrix3 of_point = Matrix3::Zero();
  Eigen::Vector3d point_lens = Eigen::Vector3d::Zero();
  double of_lens = 0;
  for (const Derivatives& d : observations) {
    of_point.noalias() += d.by_point.transpose() * d.by_point;
    point_lens.noalias() += d.by_point.transpose() * d.by_lens;
    of_lens += d.by_lens.squaredNorm();
  }
  of_point.diagonal().array() += kPointDamping * of_point.trace();
  const Matrix3 covariance = of_point.inverse();
  if (!covariance.allFinite()) return;
  for (size_t i = 0; i < observations.size(); ++i) {
    const Derivatives& a = observations[i];
    const Matrix63 camera_point = a.by_camera.transpose() * a.by_point;
    const Matrix63 gain = camera_point * covariance;
    const Eigen::Index row = 6 * a.camera;
    information_.block<6, 6>(row, row).noalias() += weight * (a.by_camera.transpose() * a.by_camera);
    information_.block<1, 6>(lens_, row).noalias() +=
        weight * (a.by_camera.transpose() * a.by_lens - gain * point_lens).transpose();
    for (size_t k = 0; k <= i; ++k) {
      const Derivatives& b = observations[k];
      const Matrix36 point_camera = b.by_point.transpose() * b.by_camera;
      if (a.camera >= b.camera) {
        information_.block<6, 6>(row, 6 * b.camera).noalias() -= weight * (gain * point_camera);
      } else {
        information_.block<6, 6>(6 * b.camera, row).noalias() -= weight * (gain * point_camera).transpose();
      }
    }
  }
  information_(lens_, lens_) += weight * (of_lens - point_lens.dot(covariance * point_lens));
}

void CameraInformation::AddPriors() {
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const std::optional<PosePrior>& prior = problem_.cameras[static_cast<size_t>(cameras_[i])].prior;
    if (!prior) continue;
    const double translation_sigma = prior->translation_sigma_mu / unit_mu_;
    const Eigen::Index row = 6 * static_cast<Eigen::Index>(i);
    information_.diagonal().segment<3>(row).array() += 1 / (translation_sigma * translation_sigma);
    information_.diagonal().segment<3>(row + 3).array() += 1 / (prior->rotation_sigma_rad * prior->rotation_sigma_rad);
  }
}

// Per column: the change of all parameters by a motion of the world: translation, rotation and, without depth, scale.
Eigen::MatrixXd CameraInformation::GaugeMotions() const {
  Eigen::MatrixXd motions = Eigen::MatrixXd::Zero(lens_ + 1, has_depth_ ? 6 : 7);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int camera : cameras_) {
    mean += problem_.cameras[static_cast<size_t>(camera)].T_world_camera.translation() /
            (unit_mu_ * static_cast<double>(cameras_.size()));
  }
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const Eigen::Vector3d center =
        problem_.cameras[static_cast<size_t>(cameras_[i])].T_world_camera.translation() / unit_mu_ - mean;
    const Eigen::Index row = 6 * static_cast<Eigen::Index>(i);
    motions.block<3, 3>(row, 0).setIdentity();
    motions.block<3, 3>(row, 3) = -Hat(center);
    motions.block<3, 3>(row + 3, 3).setIdentity();
    if (!has_depth_) motions.block<3, 1>(row, 6) = center;
  }
  return motions;
}

std::vector<CameraCovariance> CameraInformation::Covariances() const {
  if (cameras_.size() < 2) return {};
  const Eigen::MatrixXd motions = GaugeMotions();
  Eigen::MatrixXd aligned = motions;  // columns: the linear functions of the errors that the alignment makes zero
  for (Eigen::Index i = 0; i < lens_; i += 6) aligned.middleRows<3>(i + 3) *= kOrientationWeight * kOrientationWeight;
  const Eigen::MatrixXd constraints = Eigen::HouseholderQR<Eigen::MatrixXd>(aligned).householderQ() *
                                      Eigen::MatrixXd::Identity(aligned.rows(), aligned.cols());
  Eigen::MatrixXd constrained = information_;
  constrained.selfadjointView<Eigen::Lower>().rankUpdate(constraints, kGaugeInformation);
  const Eigen::LLT<Eigen::MatrixXd> factors(constrained);
  if (factors.info() != Eigen::Success) return {};
  const Eigen::MatrixXd covariance = factors.solve(Eigen::MatrixXd::Identity(lens_ + 1, lens_ + 1));
  // What is left of the motions of the world.
  Eigen::MatrixXd gauge = motions * (constraints.transpose() * motions).inverse() / std::sqrt(kGaugeInformation);
  if (has_priors_) gauge.setZero();

  std::vector<CameraCovariance> result(problem_.cameras.size());
  for (size_t i = 0; i < result.size(); ++i) {
    // Of the selected camera before it.
    const int selected = selected_of_[i];
    if (selected < 0) {
      result[i] = result[i - 1];
      continue;
    }
    const auto at = [&](Eigen::Index row) -> Matrix3 {
      const auto rows = gauge.middleRows<3>(row);
      return covariance.block<3, 3>(row, row) - rows * rows.transpose();
    };
    result[i] = {.position_mu2 = unit_mu_ * unit_mu_ * at(6 * selected), .rotation_rad2 = at(6 * selected + 3)};
    if (!result[i].position_mu2.allFinite() || !result[i].rotation_rad2.allFinite()) return {};
  }
  return result;
}

}  // namespace

std::vector<CameraCovariance> BundleCovariances(const BundleProblem& problem, const BundleCovarianceOptions& options) {
  return CameraInformation(problem, options).Covariances();
}

}  // namespace romap::slam
