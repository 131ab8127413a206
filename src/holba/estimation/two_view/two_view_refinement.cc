// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/two_view_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <optional>

#include "holba/geometry/rigid3d.h"
#include "holba/geometry/types.h"

namespace holba {
namespace {

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Vector9d = Eigen::Matrix<double, 9, 1>;
// Derivatives of the 9 entries, row by row, by up to 8 parameters.
using Tangents = Eigen::Matrix<double, 9, Eigen::Dynamic, Eigen::ColMajor, 9, 8>;
using Step = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 8, 1>;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 8, 8>;

Vector9d Flat(const RowMajor3& m) { return Eigen::Map<const Vector9d>(m.data()); }

// U diag(1, s, 0) V'.
class EpipolarState {
 public:
  static std::optional<EpipolarState> Make(TwoViewKind kind, const Eigen::Matrix3d& start) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(start, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Vector3d singular = svd.singularValues();
    if (!(singular[1] > 0.0) || !std::isfinite(singular[0])) return std::nullopt;
    EpipolarState state;
    state.is_essential_ = kind == TwoViewKind::kEssential;
    state.U_ = svd.matrixU();
    state.V_ = svd.matrixV();
    state.s_ = state.is_essential_ ? 1.0 : singular[1] / singular[0];
    return state;
  }

  Eigen::Matrix3d Model() const {
    const Eigen::Vector3d diagonal(1.0, s_, 0.0);
    return U_ * (diagonal / diagonal.norm()).asDiagonal() * V_.transpose();
  }

  // U -> U exp(u), V -> V exp(v), s -> s + ds. Essential: a common rotation about the third axis
  // changes nothing, so that v has two components and s none.
  Tangents ModelTangents() const {
    const Eigen::Vector3d diagonal(1.0, s_, 0.0);
    const double inverse_norm = 1.0 / diagonal.norm();
    const Eigen::Matrix3d S = diagonal.asDiagonal();
    const int num_v = is_essential_ ? 2 : 3;
    Tangents tangents(9, is_essential_ ? 5 : 7);
    for (int k = 0; k < 3; ++k) {
      const Eigen::Matrix3d cross = CrossMatrix<double>(Eigen::Vector3d::Unit(k));
      tangents.col(k) = Flat(inverse_norm * U_ * cross * S * V_.transpose());
      if (k < num_v) tangents.col(3 + k) = Flat(-inverse_norm * U_ * S * cross * V_.transpose());
    }
    if (!is_essential_) {
      // Of the matrix of unit norm, so with what keeps the norm.
      const Eigen::Vector3d by_s =
          inverse_norm * (Eigen::Vector3d::Unit(1) - s_ * inverse_norm * inverse_norm * diagonal);
      tangents.col(6) = Flat(U_ * by_s.asDiagonal() * V_.transpose());
    }
    return tangents;
  }

  EpipolarState Moved(const Step& step) const {
    EpipolarState moved = *this;
    Eigen::Vector3d v = Eigen::Vector3d::Zero();
    v.head(is_essential_ ? 2 : 3) = step.segment(3, is_essential_ ? 2 : 3);
    moved.U_ = U_ * ExpRotation(step.head<3>()).normalized().toRotationMatrix();
    moved.V_ = V_ * ExpRotation(v).normalized().toRotationMatrix();
    if (!is_essential_) moved.s_ += step[6];
    return moved;
  }

  void Evaluate(const MatchedRays& matches, double max_error_px,
                MatrixNormalEquations* normal) const {
    const RowMajor3 model = Model();
    HOLBA_SIMD_CHOOSE(EpipolarNormal)(matches.Columns(), model.data(), max_error_px, normal);
  }

 private:
  bool is_essential_ = false;
  Eigen::Matrix3d U_, V_;
  double s_ = 1.0;
};

class HomographyState {
 public:
  static std::optional<HomographyState> Make(TwoViewKind, const Eigen::Matrix3d& start) {
    HomographyState state;
    state.H_ = start / start.norm();
    if (!state.Invert()) return std::nullopt;
    return state;
  }

  Eigen::Matrix3d Model() const { return H_; }

  // The 8 directions that keep the norm.
  Tangents ModelTangents() const {
    const Vector9d h = Flat(H_);
    // Householder reflection that takes h to an axis: its other columns are orthogonal to h.
    Vector9d w = h;
    w[0] += std::copysign(1.0, h[0]);
    const Eigen::Matrix<double, 9, 9> reflection =
        Eigen::Matrix<double, 9, 9>::Identity() - 2.0 / w.squaredNorm() * w * w.transpose();
    return reflection.rightCols<8>();
  }

  HomographyState Moved(const Step& step) const {
    HomographyState moved = *this;
    const Vector9d h = (Flat(H_) + ModelTangents() * step).normalized();
    moved.H_ = Eigen::Map<const RowMajor3>(h.data());
    if (!moved.Invert()) return *this;
    return moved;
  }

  void Evaluate(const MatchedRays& matches, double max_error_px,
                MatrixNormalEquations* normal) const {
    const RowMajor3 model = H_, inverse = inverse_;
    HOLBA_SIMD_CHOOSE(HomographyNormal)
    (matches.Columns(), model.data(), inverse.data(), max_error_px, normal);
  }

 private:
  bool Invert() {
    bool invertible = false;
    H_.computeInverseWithCheck(inverse_, invertible, 1e-12);
    return invertible && inverse_.allFinite();
  }

  Eigen::Matrix3d H_, inverse_;
};

template <typename State>
RefinedModel Refine(TwoViewKind kind, const Eigen::Matrix3d& start, const MatchedRays& matches,
                    double max_error_px, int max_iterations) {
  const double start_gain = GainOf(kind, start, matches, max_error_px);
  const RefinedModel unchanged = {start / start.norm(), start_gain};
  std::optional<State> state = State::Make(kind, start);
  if (!state) return unchanged;

  MatrixNormalEquations at;
  state->Evaluate(matches, max_error_px, &at);
  double damping = 1e-4;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Tangents tangents = state->ModelTangents();
    const Eigen::Map<const Eigen::Matrix<double, 9, 9>> H9(at.H);
    const Eigen::Map<const Vector9d> g9(at.g);
    Normal H = tangents.transpose() * H9 * tangents;
    const Step g = tangents.transpose() * g9;
    H.diagonal() *= 1.0 + damping;
    H.diagonal().array() += 1e-12 * H.diagonal().maxCoeff();
    const Step step = H.ldlt().solve(-g);
    if (!step.allFinite()) break;
    const State trial = state->Moved(step);
    MatrixNormalEquations at_trial;
    trial.Evaluate(matches, max_error_px, &at_trial);
    if (at_trial.gain > at.gain) {
      // Gains are numbers of matches: less than a thousandth of one decides nothing.
      const bool finished = at_trial.gain - at.gain < 1e-3;
      state = trial;
      at = at_trial;
      damping = std::max(damping * 0.1, 1e-12);
      if (finished) break;
    } else {
      damping *= 10.0;
      if (damping > 1e4) break;
    }
  }
  if (at.gain < start_gain) return unchanged;
  return {state->Model(), at.gain};
}

}  // namespace

int MinimalSize(TwoViewKind kind) {
  switch (kind) {
    case TwoViewKind::kEssential:
      return 5;
    case TwoViewKind::kFundamental:
      return 7;
    case TwoViewKind::kHomography:
      return 4;
  }
  return 0;
}

double GainOf(TwoViewKind kind, const Eigen::Matrix3d& model, const MatchedRays& matches,
              double max_error_px, double to_beat) {
  const RowMajor3 M = model;
  if (kind != TwoViewKind::kHomography)
    return HOLBA_SIMD_CHOOSE(EpipolarGain)(matches.Columns(), M.data(), max_error_px, to_beat);
  const RowMajor3 inverse = model.inverse();
  if (!inverse.allFinite()) return to_beat < 0.0 ? 0.0 : -1.0;
  return HOLBA_SIMD_CHOOSE(HomographyGain)(matches.Columns(), M.data(), inverse.data(),
                                           max_error_px, to_beat);
}

void ErrorsOf(TwoViewKind kind, const Eigen::Matrix3d& model, const MatchedRays& matches,
              std::vector<double>* squared_px) {
  const MatchColumns columns = matches.Columns();
  squared_px->resize(columns.size);
  const RowMajor3 M = model;
  if (kind != TwoViewKind::kHomography) {
    HOLBA_SIMD_CHOOSE(EpipolarErrors)(columns, M.data(), squared_px->data());
  } else {
    const RowMajor3 inverse = model.inverse();
    HOLBA_SIMD_CHOOSE(HomographyErrors)(columns, M.data(), inverse.data(), squared_px->data());
  }
  squared_px->resize(matches.size());
}

RefinedModel RefineModel(TwoViewKind kind, const Eigen::Matrix3d& start, const MatchedRays& matches,
                         double max_error_px, int max_iterations) {
  if (kind == TwoViewKind::kHomography)
    return Refine<HomographyState>(kind, start, matches, max_error_px, max_iterations);
  return Refine<EpipolarState>(kind, start, matches, max_error_px, max_iterations);
}

}  // namespace holba
