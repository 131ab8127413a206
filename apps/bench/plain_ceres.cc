// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/plain_ceres.h"

#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <vector>

#include "apps/bench/solver_problems.h"
#include "holba/base/check.h"
#include "holba/base/timer.h"
#include "holba/camera/snavely.h"

namespace holba {
namespace {

class BalResidual final : public ceres::SizedCostFunction<2, 9, 3> {
 public:
  explicit BalResidual(const Eigen::Vector2d& observed) : observed_(observed) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    return EvaluateBalResidual(parameters[0], parameters[1], observed_, residuals,
                               jacobians ? jacobians[0] : nullptr,
                               jacobians ? jacobians[1] : nullptr);
  }

 private:
  Eigen::Vector2d observed_;
};

class Watch final : public ceres::IterationCallback {
 public:
  Watch(const SolverOptions& options, SolverSummary* summary)
      : options_(options), summary_(summary) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& it) override {
    IterationRecord record;
    record.iteration = it.iteration;
    record.accepted = it.iteration == 0 || it.step_is_successful;
    record.cost = it.cost;
    record.cost_change = it.cost_change;
    record.gradient_max_norm = it.gradient_max_norm;
    record.step_norm = it.step_norm;
    record.trust_radius = it.trust_region_radius;
    record.seconds = it.iteration_time_in_seconds;
    if (it.iteration > 0) {
      summary_->iteration_seconds.push_back(record.seconds);
      summary_->accepted_steps += record.accepted;
    }
    if (!options_.on_iteration || options_.on_iteration(record)) return ceres::SOLVER_CONTINUE;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

 private:
  const SolverOptions& options_;
  SolverSummary* summary_;
};

// A value per image or point, side by side as Ceres wants them.
struct BalState {
  std::vector<std::array<double, 9>> cameras;
  std::vector<std::array<double, 3>> points;

  explicit BalState(const Reconstruction& model) {
    for (const auto& [image_id, image] : model.images) {
      const std::vector<double>& p = model.cameras.at(image.camera_id).params;
      const Eigen::Vector3d w = LogRotation(image.cam_from_world.rotation);
      const Eigen::Vector3d& t = image.cam_from_world.translation;
      cameras.push_back({w.x(), w.y(), w.z(), t.x(), t.y(), t.z(), p[0], p[3], p[4]});
    }
    for (const auto& [id, point] : model.points3D) {
      points.push_back({point.xyz.x(), point.xyz.y(), point.xyz.z()});
    }
  }
};

}  // namespace

bool EvaluateBalResidual(const double* camera, const double* point, const Eigen::Vector2d& observed,
                         double* residual, double* d_camera, double* d_point) {
  const Eigen::Vector3d w(camera[0], camera[1], camera[2]), X(point[0], point[1], point[2]);
  const double f = camera[6], k1 = camera[7], k2 = camera[8];
  const double angle2 = w.squaredNorm(), angle = std::sqrt(angle2);
  // sin(a)/a, (1 - cos(a))/a^2 and (a - sin(a))/a^3, from their series where these lose digits.
  double s = 1.0 - angle2 / 6.0, c = 0.5 - angle2 / 24.0, d = 1.0 / 6.0 - angle2 / 120.0;
  if (angle > 1e-3) {
    s = std::sin(angle) / angle;
    c = (1.0 - std::cos(angle)) / angle2;
    d = (1.0 - s) / angle2;
  }
  const Eigen::Vector3d wX = w.cross(X);
  const Eigen::Vector3d rotated = X + s * wX + c * w.cross(wX);
  const Eigen::Vector3d p(rotated.x() + camera[3], rotated.y() + camera[4],
                          rotated.z() + camera[5]);
  if (p.z() == 0.0) return false;
  const double inverse_z = 1.0 / p.z();
  const double u = p.x() * inverse_z, v = p.y() * inverse_z, r2 = u * u + v * v;
  const double distortion = 1.0 + r2 * (k1 + k2 * r2);
  residual[0] = f * distortion * u - observed.x();
  residual[1] = f * distortion * v - observed.y();
  if (!d_camera && !d_point) return true;

  const double slope = 2.0 * (k1 + 2.0 * k2 * r2);
  const double uu = f * (distortion + slope * u * u), uv = f * slope * u * v;
  const double vv = f * (distortion + slope * v * v);
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_p;
  by_p << uu, uv, -(uu * u + uv * v), uv, vv, -(uv * u + vv * v);
  by_p *= inverse_z;
  const Eigen::Matrix3d W = CrossMatrix(w);
  if (d_camera) {
    // d(R X)/dw = -[R X] Jl(w), the left Jacobian of the rotation.
    const Eigen::Matrix3d left = Eigen::Matrix3d::Identity() + c * W + d * W * W;
    Eigen::Map<Eigen::Matrix<double, 2, 9, Eigen::RowMajor>> J(d_camera);
    J.leftCols<3>().noalias() = -(by_p * CrossMatrix(rotated)) * left;
    J.middleCols<3>(3) = by_p;
    J(0, 6) = distortion * u;
    J(1, 6) = distortion * v;
    J(0, 7) = f * r2 * u;
    J(1, 7) = f * r2 * v;
    J(0, 8) = f * r2 * r2 * u;
    J(1, 8) = f * r2 * r2 * v;
  }
  if (d_point) {
    const Eigen::Matrix3d R = Eigen::Matrix3d::Identity() + s * W + c * W * W;
    Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(d_point).noalias() = by_p * R;
  }
  return true;
}

SolverSummary SolveBalWithPlainCeres(const SolverOptions& options, const Reconstruction& model) {
  HOLBA_CHECK(IsBalModel(model));
  FLAGS_minloglevel = google::GLOG_ERROR;
  SolverSummary summary;
  summary.backend = "plain ceres";
  const Timer timer;
  BalState state(model);
  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  ceres::Problem problem(problem_options);
  std::deque<BalResidual> residuals;
  const auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  size_t point_idx = 0;
  for (const auto& [id, point] : model.points3D) {
    double* values = state.points[point_idx++].data();
    for (const PointObservation& o : point.track) {
      residuals.emplace_back(model.images.at(o.image_id).points2D[o.point2D_idx].xy);
      problem.AddResidualBlock(&residuals.back(), nullptr,
                               state.cameras[model.images.IndexOf(o.image_id)].data(), values);
    }
    if (point.track.empty()) continue;
    ordering->AddElementToGroup(values, 0);
  }
  size_t num_cameras = 0;
  for (auto& camera : state.cameras) {
    if (!problem.HasParameterBlock(camera.data())) continue;
    ordering->AddElementToGroup(camera.data(), 1);
    ++num_cameras;
  }

  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_ordering = ordering;
  LinearSolver linear = options.linear_solver;
  if (linear == LinearSolver::kAuto) {
    linear = num_cameras <= 50     ? LinearSolver::kDense
             : num_cameras <= 1000 ? LinearSolver::kSparse
                                   : LinearSolver::kIterative;
  }
  switch (linear) {
    case LinearSolver::kAuto:
    case LinearSolver::kDense: {
      constexpr size_t kMinSizeLapack = 600;
      const bool lapack = options.ceres_dense_library == CeresDenseLibrary::kAuto
                              ? 9 * num_cameras >= kMinSizeLapack
                              : options.ceres_dense_library == CeresDenseLibrary::kLapack;
      ceres_options.linear_solver_type = ceres::DENSE_SCHUR;
      ceres_options.dense_linear_algebra_library_type = lapack ? ceres::LAPACK : ceres::EIGEN;
      summary.linear_solver = lapack ? "DENSE_SCHUR (LAPACK)" : "DENSE_SCHUR (Eigen)";
      break;
    }
    case LinearSolver::kSparse:
      ceres_options.linear_solver_type = ceres::SPARSE_SCHUR;
      summary.linear_solver = "SPARSE_SCHUR";
      break;
    case LinearSolver::kIterative:
      ceres_options.linear_solver_type = ceres::ITERATIVE_SCHUR;
      ceres_options.preconditioner_type = ceres::SCHUR_JACOBI;
      summary.linear_solver = "ITERATIVE_SCHUR (SCHUR_JACOBI)";
      break;
  }
  ceres_options.num_threads = summary.num_threads = std::max(1, options.num_threads);
  ceres_options.max_num_iterations = options.max_num_iterations;
  ceres_options.max_linear_solver_iterations = options.max_linear_solver_iterations;
  ceres_options.max_solver_time_in_seconds = options.max_seconds;
  ceres_options.function_tolerance = options.function_tolerance;
  ceres_options.gradient_tolerance = options.gradient_tolerance;
  ceres_options.parameter_tolerance = options.parameter_tolerance;
  ceres_options.initial_trust_region_radius = options.initial_trust_radius;
  ceres_options.eta = options.eta;
  ceres_options.max_num_consecutive_invalid_steps = 10;
  ceres_options.logging_type = ceres::SILENT;
  Watch watch(options, &summary);
  ceres_options.callbacks.push_back(&watch);
  summary.build_seconds = timer.Seconds();

  ceres::Solver::Summary ceres_summary;
  ceres::Solve(ceres_options, &problem, &ceres_summary);
  summary.stop_reason =
      ceres_summary.termination_type == ceres::CONVERGENCE         ? StopReason::kConverged
      : ceres_summary.termination_type == ceres::USER_SUCCESS      ? StopReason::kCallback
      : ceres_summary.termination_type != ceres::NO_CONVERGENCE    ? StopReason::kNoStep
      : ceres_summary.total_time_in_seconds >= options.max_seconds ? StopReason::kMaxTime
                                                                   : StopReason::kMaxIterations;
  summary.message = ceres_summary.message;
  summary.initial_cost = ceres_summary.initial_cost;
  summary.final_cost = ceres_summary.final_cost;
  summary.iterations = static_cast<int>(summary.iteration_seconds.size());
  summary.linearise_seconds = ceres_summary.jacobian_evaluation_time_in_seconds +
                              ceres_summary.residual_evaluation_time_in_seconds;
  summary.eliminate_seconds = ceres_summary.linear_solver_time_in_seconds;
  summary.build_seconds += ceres_summary.preprocessor_time_in_seconds;
  summary.total_seconds = timer.Seconds();
  return summary;
}

}  // namespace holba
