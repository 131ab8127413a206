// SPDX-License-Identifier: BSD-3-Clause
// Dense Cholesky factor of a block matrix: one front with nothing remaining.
#include <algorithm>
#include <atomic>
#include <cstring>
#include <type_traits>
#include <vector>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/linear/cholesky_factor.h"
#include "holba/linear/front_inverse.h"
#include "holba/linear/panel_front.h"

namespace holba {
namespace {

// Below this, waiting for tiles costs more than a second thread gains.
constexpr int kMinSharedUnknowns = 256;

template <typename Real>
class DenseFactor : public CholeskyFactor {
 public:
  DenseFactor(const BlockPattern& pattern, int num_threads)
      : pattern_(pattern), num_threads_(NumThreads(num_threads)) {
    const int n = static_cast<int>(pattern.num_unknowns);
    front_.eliminated = PadToPanels<Real>(n);
    tiling_ = FrontTiling(front_.eliminated, 0, FrontTiling::TileSize(front_.eliminated, 0));
    factor_ = FactorMemory<Real>(PanelFront<Real>::FactorSize(front_.eliminated, 0));
    inverse_diagonal_ = FactorMemory<Real>(front_.eliminated);
    right_side_ = FactorMemory<Real>(front_.eliminated);
    lanes_ = FactorMemory<Real>(static_cast<size_t>(front_.eliminated) * kPanelRows<Real>);
    scale_.assign(n, 1.0);
    front_.factor = factor_.data();
    front_.inverse_diagonal = inverse_diagonal_.data();
    done_ = std::vector<std::atomic<uint32_t>>(tiling_.num_tiles());
    first_node_.resize(front_.num_panels());
    for (int a = 0, r = 0; r < front_.num_panels(); ++r) {
      while (pattern.offset[a + 1] <= static_cast<size_t>(r) * kPanelRows<Real>) ++a;
      first_node_[r] = a;
    }
  }

  bool Factorise(const BlockMatrix& S, const double* scale, double min_pivot) override {
    if (scale != nullptr) std::copy_n(scale, scale_.size(), scale_.data());
    scaled_ = scale != nullptr;
    constexpr int kPanelsATask = 8;
    const int num_panels = front_.num_panels();
    const int threads = num_panels > 16 ? num_threads_ : 1;
    ParallelTasks(threads, (num_panels + kPanelsATask - 1) / kPanelsATask, [&](size_t task) {
      const int begin = task * kPanelsATask;
      const int end = std::min(begin + kPanelsATask, num_panels);
      for (int r = begin; r < end; ++r) LoadPanel(S, r, scale);
    });
    const Real pivot = static_cast<Real>(min_pivot);
    const FlushTinyNumbers flush;
    if (num_threads_ == 1 || front_.eliminated < kMinSharedUnknowns) {
      return EliminateFront<Real>(front_, tiling_, pivot);
    }
    ++round_;
    std::atomic<bool> failed = false;
    ParallelTasks(num_threads_, tiling_.num_tiles(), [&](size_t index) {
      const FlushTinyNumbers flush_here;
      EliminateTile<Real>(front_, tiling_, index, pivot, done_.data(), round_, &failed);
    });
    return !failed;
  }

  void Solve(const double* b, double* x) override {
    const size_t n = pattern_.num_unknowns;
    Real* y = right_side_.data();
    const FlushTinyNumbers flush;
    for (size_t i = 0; i < n; ++i) y[i] = static_cast<Real>(scaled_ ? b[i] * scale_[i] : b[i]);
    std::fill(y + n, y + front_.eliminated, Real(0));
    SolveForward<Real>(front_, y, num_threads_);
    SolveBackward<Real>(front_, y, lanes_.data(), num_threads_);
    for (size_t i = 0; i < n; ++i) x[i] = scaled_ ? y[i] * scale_[i] : y[i];
  }

  void SelectedInverse(BlockMatrix* Z) override {
    if constexpr (std::is_same_v<Real, double>) {
      HOLBA_CHECK(!scaled_ && Z->pattern->num_unknowns == pattern_.num_unknowns);
      const PanelMatrix z = FrontInverse(front_, PanelMatrix(), num_threads_);
      ParallelTasks(num_threads_, pattern_.num_nodes(), [&](size_t a) {
        for (size_t k = pattern_.row_start[a]; k < pattern_.row_start[a + 1]; ++k) {
          const int b = pattern_.column[k];
          CopyBlock(z, pattern_.offset[a], pattern_.widths[a], pattern_.offset[b],
                    pattern_.widths[b], PaddedWidth(pattern_.widths[a]), Z->Block(k));
        }
      });
    } else {
      HOLBA_CHECK_MSG(false, "a selected inverse needs a factor in double");
    }
  }

  double Flops() const override {
    const double n = front_.eliminated;
    return n * n * n / 3.0;
  }

  size_t MemoryBytes() const override {
    return (factor_.size() + inverse_diagonal_.size() + right_side_.size() + lanes_.size()) *
               sizeof(Real) +
           scale_.size() * sizeof(double);
  }

 private:
  // Rows of panel r of the lower triangle of S, and ones on the diagonal past its end.
  void LoadPanel(const BlockMatrix& S, int r, const double* scale) {
    constexpr int kRows = kPanelRows<Real>;
    const PanelKernels<Real>& kernels = CurrentPanelKernels<Real>();
    const BlockPattern& p = pattern_;
    const ptrdiff_t begin = static_cast<ptrdiff_t>(r) * kRows;
    const ptrdiff_t end = begin + kRows;
    const ptrdiff_t n = p.num_unknowns;
    Real* panel = front_.FactorPanel(r);
    if (!p.full || end > n) std::memset(panel, 0, sizeof(Real) * kRows * end);
    for (ptrdiff_t i = std::max(begin, n); i < end; ++i) panel[i * kRows + (i - begin)] = Real(1);
    for (int a = first_node_[r]; a < p.num_nodes() && static_cast<ptrdiff_t>(p.offset[a]) < end;
         ++a) {
      const ptrdiff_t row = p.offset[a];
      const int first_lane = std::max<ptrdiff_t>(0, row - begin);
      const int end_lane = std::min<ptrdiff_t>(kRows, row + p.widths[a] - begin);
      const size_t stride = PaddedWidth(p.widths[a]);
      for (size_t k = p.row_start[a]; k < p.row_start[a + 1]; ++k) {
        const int b = p.column[k];
        const ptrdiff_t column = p.offset[b];
        const int num_columns = std::min<ptrdiff_t>(p.widths[b], end - column);
        kernels.load(S.Block(k) + (begin - row), stride, num_columns, first_lane, end_lane,
                     scale == nullptr ? nullptr : scale + begin,
                     scale == nullptr ? nullptr : scale + column, panel + column * kRows);
      }
    }
  }

  const BlockPattern& pattern_;
  int num_threads_;
  PanelFront<Real> front_;
  FrontTiling tiling_;
  FactorMemory<Real> factor_, inverse_diagonal_, right_side_, lanes_;
  std::vector<double> scale_;
  bool scaled_ = false;
  std::vector<std::atomic<uint32_t>> done_;
  uint32_t round_ = 0;
  std::vector<int> first_node_;  // with rows in each panel
};

}  // namespace

template <typename Real>
std::unique_ptr<CholeskyFactor> MakeDenseFactor(const BlockPattern& pattern, int num_threads) {
  return std::make_unique<DenseFactor<Real>>(pattern, num_threads);
}
template std::unique_ptr<CholeskyFactor> MakeDenseFactor<double>(const BlockPattern&, int);
template std::unique_ptr<CholeskyFactor> MakeDenseFactor<float>(const BlockPattern&, int);

}  // namespace holba
