#include "server/slam/optimize/bundle_solver.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>

#include "common/statistics.h"
#include "server/slam/optimize/bundle_state.h"
#include "server/slam/optimize/reprojection_cost.h"

namespace romap::slam {
namespace {

class AbortCallback : public ceres::IterationCallback {
 public:
  explicit AbortCallback(const std::atomic<bool>* abort) : abort_(abort) {}

  // SOLVER_TERMINATE_SUCCESSFULLY makes Ceres keep the state reached.
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    if (abort_ == nullptr || !abort_->load(std::memory_order_relaxed)) return ceres::SOLVER_CONTINUE;
    aborted_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }
  bool aborted() const { return aborted_; }

 private:
  const std::atomic<bool>* abort_;
  bool aborted_ = false;
};

bool IsUsable(const PosePrior& prior) {
  return prior.T_world_camera.IsFinite() && prior.rotation_sigma_rad > 0 && prior.translation_sigma_mu > 0 &&
         std::isfinite(prior.rotation_sigma_rad) && std::isfinite(prior.translation_sigma_mu);
}

// Solves a bundle problem with Ceres. The origin is moved to the first camera and lengths are divided by the typical
// distance from camera to point, so that the effect of tolerances and damping does not depend on the map's origin and
// unit.
class BundleSolver {
 public:
  BundleSolver(BundleProblem& problem, const std::vector<uint8_t>& use);

  void Run(const BundleOptions& options, int max_iterations, BundleRun& run);

 private:
  void MeasureUnit();
  SE3<World, Camera> ToSolver(const SE3<World, Camera>& pose) const {
    return {pose.rotation(), (pose.translation() - origin_world_) / unit_mu_};
  }
  Eigen::Vector3d FromSolver(const Eigen::Vector3d& position) const { return position * unit_mu_ + origin_world_; }
  void SelectPoints();
  void AddObservations();
  template <class Cost>
  void AddResidual(const BundleObservation& observation, std::deque<Cost>& costs, std::deque<LensedCost<Cost>>& lensed,
                   ceres::LossFunction* loss);
  void AddPriors();
  ceres::Solver::Options SolverOptions(const BundleOptions& options, int max_iterations, const BundleRun& run);
  bool WriteBack() const;

  static ceres::Problem::Options ProblemOptions(RefreshCameras* refresh);

  BundleProblem& problem_;
  std::vector<uint8_t> use_;
  Eigen::Vector3d origin_world_ = Eigen::Vector3d::Zero();
  double unit_mu_ = 1;

  std::vector<CameraState> cameras_;
  std::vector<std::array<double, 3>> points_;
  std::vector<uint8_t> varied_cameras_;  // per camera: has a free parameter block in the Ceres problem
  std::vector<uint8_t> varied_points_;   // per point
  double lens_k1_ = 0;                   // of RadialCorrection, if the problem has a lens

  RefreshCameras refresh_{&cameras_};
  ceres::HuberLoss loss_{std::sqrt(kChi2Bound2)};
  ceres::HuberLoss depth_loss_{std::sqrt(kChi2Bound3)};
  // In deques, because costs cannot be moved.
  std::deque<ReprojectionCost> costs_;
  std::deque<ReprojectionDepthCost> depth_costs_;
  std::deque<LensedCost<ReprojectionCost>> lensed_costs_;
  std::deque<LensedCost<ReprojectionDepthCost>> lensed_depth_costs_;
  std::deque<PosePriorCost> prior_costs_;
  std::unique_ptr<ceres::NormalPrior> lens_prior_;
  ceres::Problem ceres_;  // last, because it refers to the other members
};

ceres::Problem::Options BundleSolver::ProblemOptions(RefreshCameras* refresh) {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  options.evaluation_callback = refresh;
  return options;
}

BundleSolver::BundleSolver(BundleProblem& problem, const std::vector<uint8_t>& use)
    : problem_(problem), use_(use), ceres_(ProblemOptions(&refresh_)) {
  MeasureUnit();
  if (!problem.cameras.empty() && problem.cameras.front().T_world_camera.IsFinite()) {
    origin_world_ = problem.cameras.front().T_world_camera.translation();
  }
  cameras_.reserve(problem.cameras.size());
  for (const BundleCamera& camera : problem.cameras) cameras_.emplace_back(ToSolver(camera.T_world_camera));
  points_.resize(problem.points.size());
  for (size_t i = 0; i < points_.size(); ++i) {
    Eigen::Map<Eigen::Vector3d>(points_[i].data()) = (problem.points[i].position_world - origin_world_) / unit_mu_;
  }
  if (problem.lens) lens_k1_ = problem.lens->correction.k1;
  varied_cameras_.assign(cameras_.size(), 0);
  varied_points_.assign(points_.size(), 0);
  SelectPoints();
  AddObservations();
  AddPriors();
}

void BundleSolver::MeasureUnit() {
  std::vector<double> distances_mu;
  distances_mu.reserve(use_.size());
  for (size_t i = 0; i < use_.size(); ++i) {
    if (!use_[i]) continue;
    const BundleObservation& observation = problem_.observations[i];
    distances_mu.push_back((problem_.points[observation.point].position_world -
                            problem_.cameras[observation.camera].T_world_camera.translation())
                               .norm());
  }
  if (distances_mu.empty()) return;
  const double typical_mu = Median(std::move(distances_mu));
  if (typical_mu > 0) unit_mu_ = typical_mu;
}

// Omits points that only cost time or make the equations singular: points that no free camera observes have no effect
// on the cameras, and a single observation without depth does not determine a point.
void BundleSolver::SelectPoints() {
  struct Observations {
    int constraints = 0;
    bool from_free_camera = false;
  };
  std::vector<Observations> observations_of(points_.size());
  for (size_t i = 0; i < use_.size(); ++i) {
    if (!use_[i]) continue;
    const BundleObservation& observation = problem_.observations[i];
    Observations& point = observations_of[observation.point];
    point.constraints += HasDepth(observation) ? 2 : 1;
    if (!problem_.cameras[observation.camera].fixed) point.from_free_camera = true;
  }
  for (size_t i = 0; i < use_.size(); ++i) {
    if (!use_[i]) continue;  // its indices may be invalid
    const Observations& point = observations_of[problem_.observations[i].point];
    const bool fixed = problem_.points[problem_.observations[i].point].fixed;
    use_[i] = point.from_free_camera && (fixed || point.constraints >= 2);
  }
}

void BundleSolver::AddObservations() {
  for (size_t i = 0; i < use_.size(); ++i) {
    if (!use_[i]) continue;
    const BundleObservation& observation = problem_.observations[i];
    const bool camera_fixed = problem_.cameras[observation.camera].fixed;
    const bool point_fixed = problem_.points[observation.point].fixed;
    if (camera_fixed && point_fixed) continue;
    const CameraState* camera = &cameras_[observation.camera];
    if (HasDepth(observation)) {
      depth_costs_.emplace_back(problem_.camera, camera, observation.pixel_px, observation.sigma_px,
                                observation.depth_mu / unit_mu_, observation.depth_sigma_mu / unit_mu_);
      AddResidual(observation, depth_costs_, lensed_depth_costs_, &depth_loss_);
    } else {
      costs_.emplace_back(problem_.camera, camera, observation.pixel_px, observation.sigma_px);
      AddResidual(observation, costs_, lensed_costs_, &loss_);
    }
    if (camera_fixed) ceres_.SetParameterBlockConstant(cameras_[observation.camera].increment.data());
    if (point_fixed) ceres_.SetParameterBlockConstant(points_[observation.point].data());
    varied_cameras_[observation.camera] = !camera_fixed;
    varied_points_[observation.point] = !point_fixed;
  }
}

// Adds the last entry of `costs` as a residual, with the lens if the problem has one.
template <class Cost>
void BundleSolver::AddResidual(const BundleObservation& observation, std::deque<Cost>& costs,
                               std::deque<LensedCost<Cost>>& lensed, ceres::LossFunction* loss) {
  double* increment = cameras_[observation.camera].increment.data();
  double* point = points_[observation.point].data();
  if (!problem_.lens) {
    ceres_.AddResidualBlock(&costs.back(), loss, increment, point);
    return;
  }
  lensed.emplace_back(problem_.camera, observation.pixel_px, observation.sigma_px, &costs.back());
  ceres_.AddResidualBlock(&lensed.back(), loss, increment, point, &lens_k1_);
}

void BundleSolver::AddPriors() {
  if (problem_.lens && ceres_.HasParameterBlock(&lens_k1_)) {
    const ceres::Matrix weight = ceres::Matrix::Constant(1, 1, 1 / problem_.lens->sigma);
    lens_prior_ = std::make_unique<ceres::NormalPrior>(weight, ceres::Vector::Zero(1));
    ceres_.AddResidualBlock(lens_prior_.get(), nullptr, &lens_k1_);
  }
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const BundleCamera& camera = problem_.cameras[i];
    if (camera.fixed || !camera.prior || !IsUsable(*camera.prior) || !camera.T_world_camera.IsFinite()) continue;
    PosePrior prior = *camera.prior;
    prior.T_world_camera = ToSolver(prior.T_world_camera);
    prior.translation_sigma_mu /= unit_mu_;
    prior_costs_.emplace_back(&cameras_[i], prior);
    ceres_.AddResidualBlock(&prior_costs_.back(), nullptr, cameras_[i].increment.data());
    varied_cameras_[i] = 1;
  }
}

ceres::Solver::Options BundleSolver::SolverOptions(const BundleOptions& options, int max_iterations,
                                                   const BundleRun& run) {
  ceres::Solver::Options solver;
  solver.max_num_iterations = max_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.initial_trust_region_radius = run.trust_region_radius;
  solver.num_threads = std::max(1, options.threads);
  solver.linear_solver_type = options.dense ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver.logging_type = ceres::SILENT;
  // In the unit of the solver, the columns already have similar norms, and the damping is scaled by these norms.
  solver.jacobi_scaling = false;
  // The points are eliminated first. Without this ordering, Ceres would have to search for independent sets.
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (size_t i = 0; i < points_.size(); ++i) {
    if (varied_points_[i]) ordering->AddElementToGroup(points_[i].data(), 0);
  }
  for (CameraState& camera : cameras_) {
    if (ceres_.HasParameterBlock(camera.increment.data())) ordering->AddElementToGroup(camera.increment.data(), 1);
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    if (!varied_points_[i] && ceres_.HasParameterBlock(points_[i].data())) {
      ordering->AddElementToGroup(points_[i].data(), 1);
    }
  }
  if (ceres_.HasParameterBlock(&lens_k1_)) ordering->AddElementToGroup(&lens_k1_, 1);
  solver.linear_solver_ordering = ordering;
  return solver;
}

void BundleSolver::Run(const BundleOptions& options, int max_iterations, BundleRun& run) {
  if (ceres_.NumResidualBlocks() == 0) return;
  ceres::Solver::Options solver = SolverOptions(options, max_iterations, run);
  AbortCallback abort(options.abort);
  solver.callbacks.push_back(&abort);
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &ceres_, &summary);

  run.aborted = abort.aborted();
  run.iterations = std::max(0, static_cast<int>(summary.iterations.size()) - 1);
  run.converged = summary.termination_type == ceres::CONVERGENCE;
  if (!summary.iterations.empty()) run.trust_region_radius = summary.iterations.back().trust_region_radius;
  const bool has_started = run.iterations > 0 || !run.aborted;
  run.usable = has_started && summary.IsSolutionUsable() && WriteBack();
}

// Returns false and writes nothing if a number is not finite.
bool BundleSolver::WriteBack() const {
  if (!std::isfinite(lens_k1_)) return false;
  for (size_t i = 0; i < cameras_.size(); ++i) {
    if (varied_cameras_[i] && !cameras_[i].Pose().IsFinite()) return false;
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    const bool finite = std::isfinite(points_[i][0]) && std::isfinite(points_[i][1]) && std::isfinite(points_[i][2]);
    if (varied_points_[i] && !finite) return false;
  }
  if (problem_.lens) problem_.lens->correction.k1 = lens_k1_;
  for (size_t i = 0; i < cameras_.size(); ++i) {
    if (!varied_cameras_[i]) continue;
    const SE3<World, Camera> pose = cameras_[i].Pose();
    problem_.cameras[i].T_world_camera = SE3<World, Camera>(pose.rotation(), FromSolver(pose.translation()));
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    if (!varied_points_[i]) continue;
    problem_.points[i].position_world = FromSolver(Eigen::Map<const Eigen::Vector3d>(points_[i].data()));
  }
  return true;
}

}  // namespace

void RunBundle(BundleProblem& problem, const std::vector<uint8_t>& use, const BundleOptions& options,
               int max_iterations, BundleRun& run) {
  run.usable = run.converged = false;
  run.iterations = 0;
  run.aborted = options.abort != nullptr && options.abort->load(std::memory_order_relaxed);
  if (run.aborted || max_iterations <= 0) return;
  BundleSolver(problem, use).Run(options, max_iterations, run);
}

}  // namespace romap::slam
