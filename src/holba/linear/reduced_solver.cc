// SPDX-License-Identifier: BSD-3-Clause
#include "holba/linear/reduced_solver.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/linear/cholesky_factor.h"
#include "holba/linear/elimination.h"

namespace holba {
namespace {

// Solve stops at this residual relative to b, with S scaled to a unit diagonal.
constexpr double kResidual = 1e-12;
// The same relative to x: the rounding of a factor in double.
constexpr double kRounding = 1e-15;
// Conjugate gradients with a float factor need 2 to 4 iterations. Above this number the factor
// counts as broken.
constexpr int kMaxIterations = 40;
// Up to this number of iterations the recurrence of the residual differs from it by rounding only.
constexpr int kTrustedIterations = 8;
// Pivots of a matrix of unit diagonal that float cannot tell from rounding.
constexpr double kMinFloatPivot = 1e-6;
// After a breakdown of float the next factors, this many, are computed in double at once.
constexpr int kNumDoubleAfterBreakdown = 3;

// With four partial sums.
double DotOfFour(const std::vector<double>& a, const std::vector<double>& b) {
  double sum[4] = {};
  const size_t n = a.size();
  size_t i = 0;
  for (; i + 4 <= n; i += 4) {
    for (int l = 0; l < 4; ++l) sum[l] += a[i + l] * b[i + l];
  }
  for (; i < n; ++i) sum[0] += a[i] * b[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

using MakeFactor = std::function<std::unique_ptr<CholeskyFactor>()>;

class FactorSolver : public ReducedSolver {
 public:
  FactorSolver(const BlockPattern& pattern, int num_threads, std::string name, MakeFactor in_float,
               MakeFactor in_double)
      : pattern_(pattern),
        num_threads_(NumThreads(num_threads)),
        name_(std::move(name)),
        make_double_(std::move(in_double)) {
    if (in_float) {
      const size_t n = pattern.num_unknowns;
      float_ = in_float();
      scale_.assign(n + 2 * CholeskyFactor::kScaleMargin, 1.0);
      for (std::vector<double>* v : {&x_, &r_, &z_, &p_, &q_}) v->assign(n, 0.0);
      BlockMatrix::ReserveScratch(pattern, &scratch_);
    } else {
      double_ = make_double_();
    }
  }

  bool Factorise(const BlockMatrix& S) override {
    HOLBA_CHECK(S.pattern->num_blocks() == pattern_.num_blocks() &&
                S.pattern->num_unknowns == pattern_.num_unknowns);
    S_ = &S;
    state_ = State::kNone;
    if (float_ != nullptr && double_only_ == 0) {
      if (!SetScale(S)) return false;
      if (float_->Factorise(S, scale(), kMinFloatPivot)) {
        state_ = State::kFloat;
        return true;
      }
      double_only_ = kNumDoubleAfterBreakdown;
    } else if (double_only_ > 0) {
      --double_only_;
    }
    return FactoriseDouble();
  }

  void Reset() override {
    state_ = State::kNone;
    double_only_ = 0;
  }

  bool Solve(const double* b, double* x) override {
    HOLBA_CHECK_MSG(state_ != State::kNone, "Solve needs a factor");
    if (state_ == State::kFloat) {
      if (SolveByConjugateGradients(b, x)) return true;
      double_only_ = kNumDoubleAfterBreakdown;
      if (!FactoriseDouble()) return false;
    }
    double_->Solve(b, x);
    return std::all_of(x, x + pattern_.num_unknowns, [](double v) { return std::isfinite(v); });
  }

  bool SelectedInverse(BlockMatrix* Z) override {
    HOLBA_CHECK_MSG(state_ != State::kNone, "SelectedInverse needs a factor");
    if (state_ != State::kDouble && !FactoriseDouble()) return false;
    double_->SelectedInverse(Z);
    for (int a = 0; a < pattern_.num_nodes(); ++a) {
      const size_t k = pattern_.row_start[a + 1] - 1;
      for (int i = 0; i < pattern_.widths[a]; ++i) {
        if (!std::isfinite(Z->Block(k)[i * PaddedWidth(pattern_.widths[a]) + i])) return false;
      }
    }
    return true;
  }

  double FactorFlops() const override { return float_ ? float_->Flops() : double_->Flops(); }

  size_t MemoryBytes() const override {
    return (float_ ? float_->MemoryBytes() : 0) + (double_ ? double_->MemoryBytes() : 0) +
           (scale_.size() + 5 * x_.size() + scratch_.size()) * sizeof(double);
  }

  std::string Name() const override { return name_; }

 private:
  enum class State { kNone, kFloat, kDouble };

  bool FactoriseDouble() {
    state_ = State::kNone;
    if (double_ == nullptr) double_ = make_double_();
    if (!double_->Factorise(*S_, nullptr, 0.0)) return false;
    state_ = State::kDouble;
    return true;
  }

  // 1 / sqrt of the diagonal; false: not positive or not finite.
  bool SetScale(const BlockMatrix& S) {
    for (int a = 0; a < pattern_.num_nodes(); ++a) {
      const double* block = S.Block(pattern_.row_start[a + 1] - 1);
      const int width = pattern_.widths[a];
      for (int i = 0; i < width; ++i) {
        const double d = block[i * PaddedWidth(width) + i];
        if (!(d > 0.0 && std::isfinite(d))) return false;
        scale()[pattern_.offset[a] + i] = 1.0 / std::sqrt(d);
      }
    }
    return true;
  }

  // Works in the unknowns of S; the norms of the tests are those of the scaled system.
  bool SolveByConjugateGradients(const double* b, double* x) {
    const size_t n = pattern_.num_unknowns;
    std::copy_n(b, n, r_.begin());
    std::fill(x_.begin(), x_.end(), 0.0);
    const double b_norm = ScaledNorm(r_);
    if (!std::isfinite(b_norm)) return false;
    bool restarted = false;
    double rho = 0.0;
    for (int iteration = 0; b_norm > 0.0; ++iteration) {
      double x_norm = 0.0;
      for (size_t i = 0; i < n; ++i) x_norm += (x_[i] / scale()[i]) * (x_[i] / scale()[i]);
      const double allowed = std::max(kResidual * b_norm, kRounding * std::sqrt(x_norm));
      bool restart = iteration == 0;
      if (ScaledNorm(r_) <= allowed) {
        if (iteration <= kTrustedIterations) break;
        S_->Multiply(x_.data(), q_.data(), num_threads_, &scratch_);
        for (size_t i = 0; i < n; ++i) r_[i] = b[i] - q_[i];
        if (ScaledNorm(r_) <= 4.0 * allowed) break;
        if (restarted) return false;
        restart = restarted = true;
      }
      if (iteration == kMaxIterations) return false;
      float_->Solve(r_.data(), z_.data());
      const double next_rho = DotOfFour(r_, z_);
      if (!(next_rho > 0.0 && std::isfinite(next_rho))) return false;
      if (restart) {
        p_ = z_;
      } else {
        const double beta = next_rho / rho;
        for (size_t i = 0; i < n; ++i) p_[i] = z_[i] + beta * p_[i];
      }
      rho = next_rho;
      S_->Multiply(p_.data(), q_.data(), num_threads_, &scratch_);
      const double curvature = DotOfFour(p_, q_);
      if (!(curvature > 0.0 && std::isfinite(curvature))) return false;
      const double alpha = rho / curvature;
      for (size_t i = 0; i < n; ++i) x_[i] += alpha * p_[i];
      for (size_t i = 0; i < n; ++i) r_[i] -= alpha * q_[i];
    }
    std::copy_n(x_.begin(), n, x);
    return true;
  }

  double* scale() { return scale_.data() + CholeskyFactor::kScaleMargin; }
  const double* scale() const { return scale_.data() + CholeskyFactor::kScaleMargin; }

  double ScaledNorm(const std::vector<double>& v) const {
    double sum = 0.0;
    for (size_t i = 0; i < v.size(); ++i) sum += (v[i] * scale()[i]) * (v[i] * scale()[i]);
    return std::sqrt(sum);
  }

  const BlockPattern& pattern_;
  int num_threads_;
  std::string name_;
  MakeFactor make_double_;
  std::unique_ptr<CholeskyFactor> float_, double_;
  const BlockMatrix* S_ = nullptr;
  State state_ = State::kNone;
  int double_only_ = 0;
  std::vector<double> scale_, x_, r_, z_, p_, q_, scratch_;
};

}  // namespace

std::unique_ptr<ReducedSolver> MakeDenseSolver(const BlockPattern& pattern, Precision precision,
                                               int num_threads) {
  const bool mixed = precision == Precision::kMixed;
  const MakeFactor in_float = [&pattern, num_threads] {
    return MakeDenseFactor<float>(pattern, num_threads);
  };
  return std::make_unique<FactorSolver>(
      pattern, num_threads, mixed ? "dense, mixed" : "dense, double",
      mixed ? in_float : MakeFactor(),
      [&pattern, num_threads] { return MakeDenseFactor<double>(pattern, num_threads); });
}

std::unique_ptr<ReducedSolver> MakeSparseSolver(const BlockPattern& pattern, Precision precision,
                                                int num_threads) {
  const bool mixed = precision == Precision::kMixed;
  const std::shared_ptr<const Elimination> elimination = PlanElimination(pattern);
  const MakeFactor in_float = [&pattern, elimination, num_threads] {
    return MakeSparseFactor<float>(pattern, elimination, num_threads);
  };
  return std::make_unique<FactorSolver>(
      pattern, num_threads, mixed ? "sparse, mixed" : "sparse, double",
      mixed ? in_float : MakeFactor(), [&pattern, elimination, num_threads] {
        return MakeSparseFactor<double>(pattern, elimination, num_threads);
      });
}

double PredictDenseFlops(const BlockPattern& pattern) {
  const double n = static_cast<double>(pattern.num_unknowns);
  return n * n * n / 3.0;
}

}  // namespace holba
