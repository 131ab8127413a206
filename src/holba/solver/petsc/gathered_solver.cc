// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <utility>

#include "holba/linear/reduced_solver.h"
#include "holba/solver/native/linear_choice.h"
#include "holba/solver/petsc/distributed_solver.h"

namespace holba::distributed {
namespace {

// As linear_choice.cc has them, in operations of a factorisation per predicted cycle of the
// elimination.
constexpr double kFlopsPerCycle = 4.0;
// A factor of so few operations, about a second, is worth its exact steps whatever the elimination
// takes: conjugate gradients on few unknowns wait for messages.
constexpr double kFreeFlops = 1e10;
// A pattern with more blocks than this (20 MB of indices) is not collected to predict anything.
constexpr double kMaxGatheredPairs = 2.5e6;
// From this number of unknowns on a factor in single precision is faster (native_workspace.cc).
constexpr size_t kMinMixedUnknowns = 600;

// The pattern of the whole system, which is the same on all ranks.
struct WholePattern {
  std::vector<CellPair> pairs;
  std::vector<size_t> begin;  // by rank; one entry more
  BlockPattern pattern;
  std::vector<size_t> block_of_pair;

  explicit WholePattern(const DistributedSystem& system) {
    const CellLayout& layout = system.layout();
    pairs = system.communicator().GatherLists<CellPair>(system.pairs(), &begin);
    std::vector<std::pair<CellPair, size_t>> lower;  // (later, earlier cell), and which pair it is
    for (size_t p = 0; p < pairs.size(); ++p) lower.push_back({{pairs[p].column, pairs[p].row}, p});
    std::sort(lower.begin(), lower.end());
    pattern.widths.assign(layout.width.begin(), layout.width.end());
    pattern.row_start.assign(1, 0);
    block_of_pair.resize(pairs.size());
    for (const auto& [pair, p] : lower) {
      while (pattern.row_start.size() <= pair.row)
        pattern.row_start.push_back(pattern.column.size());
      block_of_pair[p] = pattern.column.size();
      pattern.column.push_back(static_cast<int>(pair.column));
    }
    pattern.row_start.push_back(pattern.column.size());
    pattern.Finish();
  }
};

// For problems without kept unknowns.
class EmptySolver final : public DistributedSolver {
 public:
  bool Solve(const DistributedSystem&, std::vector<double>* solution) override {
    solution->clear();
    return true;
  }
  std::string Name() const override { return "none: features only"; }
};

class GatheredSolver final : public DistributedSolver {
 public:
  GatheredSolver(const DistributedSystem& system, WholePattern whole, const SolverOptions& options,
                 int num_threads)
      : whole_(std::move(whole)) {
    const CellLayout& layout = system.layout();
    Communicator& communicator = system.communicator();
    const int n = communicator.size();
    size_t total = 0;
    for (int r = 0; r < n; ++r) {
      size_t size = 0;
      for (size_t p = whole_.begin[r]; p < whole_.begin[r + 1]; ++p)
        size += static_cast<size_t>(layout.padded[whole_.pairs[p].row]) *
                layout.padded[whole_.pairs[p].column];
      const size_t unknowns =
          layout.begin[layout.first_of_part[r + 1]] - layout.begin[layout.first_of_part[r]];
      total += size;
      HOLBA_CHECK_MSG(total < (size_t{1} << 31), "a reduced system too large to be collected");
      value_counts_.push_back(static_cast<int>(size));
      unknown_counts_.push_back(static_cast<int>(unknowns));
    }
    value_begin_.assign(1, 0);
    unknown_begin_.assign(1, 0);
    for (int r = 0; r < n; ++r) {
      value_begin_.push_back(value_begin_.back() + value_counts_[r]);
      unknown_begin_.push_back(unknown_begin_.back() + unknown_counts_[r]);
    }
    const bool dense =
        options.linear_solver == LinearSolver::kDense ||
        (options.linear_solver != LinearSolver::kSparse && !native::IsSparseFaster(whole_.pattern));
    const bool mixed = options.precision == FactorPrecision::kMixed ||
                       (options.precision == FactorPrecision::kAuto &&
                        whole_.pattern.num_unknowns > kMinMixedUnknowns);
    name_ = std::string(dense ? "dense" : "sparse") + (mixed ? ", mixed" : ", double") +
            ", on the first rank";
    if (communicator.rank() != 0) return;
    const Precision precision = mixed ? Precision::kMixed : Precision::kDouble;
    solver_ = dense ? MakeDenseSolver(whole_.pattern, precision, num_threads)
                    : MakeSparseSolver(whole_.pattern, precision, num_threads);
    matrix_ = BlockMatrix(&whole_.pattern);
  }

  bool Solve(const DistributedSystem& system, std::vector<double>* solution) override {
    Communicator& communicator = system.communicator();
    const bool first = communicator.rank() == 0;
    std::vector<double>& values = collected_;
    std::vector<double> rhs;
    if (first) {
      values.resize(static_cast<size_t>(value_begin_.back()));
      rhs.resize(static_cast<size_t>(unknown_begin_.back()));
    }
    Collect(system.values(), value_counts_, value_begin_, &values, &communicator);
    Collect(system.rhs(), unknown_counts_, unknown_begin_, &rhs, &communicator);
    bool solved = true;
    if (first) {
      SetMatrix(system.layout(), values);
      solved = SolveHere(system.layout(), &rhs);
    }
    if (!communicator.Agree(solved)) return false;
    solution->resize(system.num_own_unknowns());
    CheckMpi(MPI_Scatterv(rhs.data(), unknown_counts_.data(), unknown_begin_.data(), MPI_DOUBLE,
                          solution->data(), unknown_counts_[communicator.rank()], MPI_DOUBLE, 0,
                          communicator.comm()),
             "MPI_Scatterv");
    return true;
  }
  std::string Name() const override { return name_; }

 private:
  static void Collect(const std::vector<double>& mine, const std::vector<int>& counts,
                      const std::vector<int>& begin, std::vector<double>* all,
                      Communicator* communicator) {
    CheckMpi(MPI_Gatherv(mine.data(), counts[communicator->rank()], MPI_DOUBLE, all->data(),
                         counts.data(), begin.data(), MPI_DOUBLE, 0, communicator->comm()),
             "MPI_Gatherv");
    if (communicator->rank() == 0) return;
    ++communicator->traffic().messages;
    communicator->traffic().bytes += mine.size() * sizeof(double);
  }

  // Rows of the upper triangle are columns of the lower one.
  void SetMatrix(const CellLayout& layout, const std::vector<double>& values) {
    size_t at = 0;
    for (size_t p = 0; p < whole_.pairs.size(); ++p) {
      const auto [row, column] = whole_.pairs[p];
      double* block = matrix_.Block(whole_.block_of_pair[p]);
      const int stride = PaddedWidth(layout.width[column]);
      for (int i = 0; i < layout.width[row]; ++i) {
        std::copy_n(values.data() + at + static_cast<size_t>(i) * layout.padded[column],
                    layout.width[column], block + i * stride);
      }
      at += static_cast<size_t>(layout.padded[row]) * layout.padded[column];
    }
  }

  bool SolveHere(const CellLayout& layout, std::vector<double>* rhs) {
    std::vector<double> plain(whole_.pattern.num_unknowns);
    const auto for_each_cell = [&](const auto& visit) {
      for (size_t c = 0; c < layout.num_cells(); ++c)
        visit(rhs->begin() + layout.begin[c], plain.begin() + whole_.pattern.offset[c],
              layout.width[c]);
    };
    for_each_cell([](auto padded, auto to, int width) { std::copy_n(padded, width, to); });
    if (!solver_->Factorise(matrix_) || !solver_->Solve(plain.data(), plain.data())) return false;
    std::fill(rhs->begin(), rhs->end(), 0.0);
    for_each_cell([](auto padded, auto from, int width) { std::copy_n(from, width, padded); });
    return true;
  }

  WholePattern whole_;
  std::vector<int> value_counts_, value_begin_, unknown_counts_, unknown_begin_;
  std::unique_ptr<ReducedSolver> solver_;
  BlockMatrix matrix_;
  std::vector<double> collected_;
  std::string name_;
};

}  // namespace

std::unique_ptr<DistributedSolver> MakeGatheredSolver(const DistributedSystem& system,
                                                      const SolverOptions& options,
                                                      int num_threads) {
  return std::make_unique<GatheredSolver>(system, WholePattern(system), options, num_threads);
}

std::unique_ptr<DistributedSolver> MakeDistributedSolver(const DistributedSystem& system,
                                                         const SolverOptions& options,
                                                         int num_threads,
                                                         double elimination_cycles) {
  if (system.layout().num_cells() == 0) return std::make_unique<EmptySolver>();
  if (!options.petsc_options.empty() || options.linear_solver == LinearSolver::kIterative)
    return MakePetscSolver(system, options);
  if (options.linear_solver != LinearSolver::kAuto)
    return MakeGatheredSolver(system, options, num_threads);
  double num_pairs[1] = {static_cast<double>(system.pairs().size())};
  system.communicator().Sum(num_pairs);
  if (num_pairs[0] > kMaxGatheredPairs) return MakePetscSolver(system, options);
  WholePattern whole(system);
  double flops = 0.0;
  if (system.communicator().rank() == 0) {
    flops = std::min(PredictDenseFlops(whole.pattern), PredictSparseFlops(whole.pattern));
  }
  flops = system.communicator().FromFirst(flops);
  if (flops > std::max(kFreeFlops, kFlopsPerCycle * elimination_cycles))
    return MakePetscSolver(system, options);
  return std::make_unique<GatheredSolver>(system, std::move(whole), options, num_threads);
}

}  // namespace holba::distributed
