// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/petsc/petsc_backend.h"

#include <petscsys.h>

#include <algorithm>
#include <thread>

#include "holba/base/memory.h"
#include "holba/base/threads.h"
#include "holba/solver/distributed/part_problem.h"
#include "holba/solver/native/fingerprint.h"
#include "holba/solver/native/levenberg_marquardt.h"
#include "holba/solver/petsc/distributed_solver.h"
#include "holba/solver/ranks.h"

namespace holba {
namespace {

using distributed::Communicator;

// Threads of this rank: those that are asked for or, at -1, its share of the machine's.
int NumThreadsOfRank(int requested, MPI_Comm comm) {
  if (requested > 0) return requested;
  MPI_Comm node = MPI_COMM_NULL;
  int on_node = 1;
  distributed::CheckMpi(MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node),
                        "MPI_Comm_split_type");
  MPI_Comm_size(node, &on_node);
  MPI_Comm_free(&node);
  return std::max(1, NumThreads(requested) / on_node);
}

double PredictedCycles(const native::Structure& structure) {
  double cycles = 0.0;
  for (const native::Chunk& chunk : structure.chunks) cycles += structure.Work(chunk);
  return cycles;
}

}  // namespace

// A problem cut into parts, of which this rank has one.
class PetscWorkspace::Impl {
 public:
  Impl(const Problem& whole, const SolverOptions& options)
      : fingerprint_(native::FingerprintOf(whole)),
        communicator_(PETSC_COMM_WORLD),
        num_threads_(NumThreadsOfRank(options.num_threads, communicator_.comm())),
        partition_(distributed::MakePartition(whole, communicator_.size())),
        part_(whole, partition_, communicator_.rank()) {
    equations_.Begin(part_.problem(), num_threads_);
    equations_.SetForm(native::SchurForm::kExplicit);
    FindReported(whole);
    system_ = std::make_unique<distributed::DistributedSystem>(
        whole, partition_, part_.block_of_whole(), equations_, &communicator_);
    ChooseSolver(options);
  }

  // For a problem of the same structure.
  bool Renew(const Problem& whole, const SolverOptions& options) {
    if (native::FingerprintOf(whole) != fingerprint_) return false;
    part_.Renew(whole);
    equations_.Begin(part_.problem(), num_threads_);
    equations_.SetForm(native::SchurForm::kExplicit);
    ChooseSolver(options);
    return true;
  }

  Communicator& communicator() { return communicator_; }
  distributed::PartProblem& part() { return part_; }
  native::NormalEquations& equations() { return equations_; }
  distributed::DistributedSystem& system() { return *system_; }
  distributed::DistributedSolver& solver() { return *solver_; }
  int num_threads() const { return num_threads_; }

  // What each rank did in a solve of so many iterations.
  std::vector<RankShare> Shares(int iterations) {
    constexpr size_t kFields = 8;
    const double per_iteration = 1.0 / std::max(1, iterations);
    const distributed::Traffic& sent = communicator_.traffic();
    const native::Structure& structure = equations_.structure();
    const double mine[kFields] = {cycles_of_part(),
                                  static_cast<double>(structure.features.size()),
                                  static_cast<double>(part_.problem().num_residuals()),
                                  static_cast<double>(system_->num_own_unknowns()),
                                  static_cast<double>(system_->num_shared_unknowns()),
                                  static_cast<double>(sent.messages) * per_iteration,
                                  static_cast<double>(sent.bytes) * per_iteration,
                                  PeakMemoryMb()};
    const std::vector<double> all = communicator_.GatherFromAll(mine);
    std::vector<RankShare> shares;
    double cycles = 0.0;
    for (size_t r = 0; r * kFields < all.size(); ++r) {
      const double* of = all.data() + r * kFields;
      cycles += of[0];
      shares.push_back({of[0], static_cast<size_t>(of[1]), static_cast<size_t>(of[2]),
                        static_cast<size_t>(of[3]), static_cast<size_t>(of[4]), of[5], of[6],
                        of[7]});
    }
    for (RankShare& share : shares)
      share.work = cycles > 0.0 ? share.work * communicator_.size() / cycles : 1.0;
    return shares;
  }

  // Puts the state of all parts into the whole, on every rank.
  void CollectState(Problem* whole) {
    std::vector<double> mine;
    for (BlockId here : reported_) {
      const double* values = part_.problem().values(here);
      mine.insert(mine.end(), values, values + part_.problem().block(here).manifold->ambient);
    }
    std::vector<size_t> begin;
    const std::vector<double> all = communicator_.GatherLists<double>(mine, &begin);
    const double* from = all.data();
    for (BlockId id : all_reported_) {
      const int size = whole->block(id).manifold->ambient;
      std::copy_n(from, size, whole->values(id));
      from += size;
    }
  }

 private:
  // Each variable block is reported by one rank: a feature by its own, a kept block by the first
  // that has it, which also counts it in norms.
  void FindReported(const Problem& whole) {
    const Problem& problem = part_.problem();
    std::vector<BlockId> kept;
    for (BlockId here = 0; here < problem.num_blocks(); ++here) {
      if (IsKept(problem.block(here).role) && problem.block(here).IsVariable())
        kept.push_back(part_.block_of_whole()[here]);
    }
    std::vector<size_t> begin;
    const std::vector<BlockId> all_kept = communicator_.GatherLists<BlockId>(kept, &begin);
    std::vector<uint8_t> taken(whole.num_blocks(), 0);
    for (size_t i = 0; i < begin[communicator_.rank()]; ++i) taken[all_kept[i]] = 1;
    std::vector<uint8_t> elsewhere(problem.num_blocks(), 0);
    std::vector<BlockId> ids;
    for (BlockId here = 0; here < problem.num_blocks(); ++here) {
      const BlockId id = part_.block_of_whole()[here];
      elsewhere[here] = taken[id];
      if (!problem.block(here).IsVariable() || taken[id]) continue;
      reported_.push_back(here);
      ids.push_back(id);
    }
    equations_.SetCountedElsewhere(std::move(elsewhere));
    all_reported_ = communicator_.GatherLists<BlockId>(ids, &begin);
  }

  void ChooseSolver(const SolverOptions& options) {
    // One rank's share of the predicted work.
    double cycles[1] = {cycles_of_part()};
    communicator_.Sum(cycles);
    solver_ = distributed::MakeDistributedSolver(*system_, options, num_threads_,
                                                 cycles[0] / communicator_.size());
  }
  double cycles_of_part() const { return PredictedCycles(equations_.structure()); }

  native::Fingerprint fingerprint_;
  Communicator communicator_;
  int num_threads_;
  distributed::Partition partition_;
  distributed::PartProblem part_;
  native::NormalEquations equations_;
  std::unique_ptr<distributed::DistributedSystem> system_;
  std::unique_ptr<distributed::DistributedSolver> solver_;
  std::vector<BlockId> reported_;      // of the part
  std::vector<BlockId> all_reported_;  // of the whole, rank by rank
};

PetscWorkspace::PetscWorkspace() = default;
PetscWorkspace::~PetscWorkspace() = default;

namespace {

// The problem as the loop sees it: numbers are sums over ranks.
template <typename Workspace>
class DistributedProblem final : public native::LinearisedProblem {
 public:
  DistributedProblem(Problem* whole, Workspace* workspace)
      : whole_(whole),
        num_batches_(whole->batches().size()),
        workspace_(*workspace),
        communicator_(workspace->communicator()),
        step_(workspace->equations().pattern().num_unknowns) {
    double variable[1] = {static_cast<double>(workspace_.equations().structure().num_nodes() +
                                              workspace_.equations().structure().features.size())};
    communicator_.Sum(variable);
    is_empty_ = variable[0] == 0.0;
  }

  bool IsEmpty() const override { return is_empty_; }

  void Linearise(double radius, native::Linearisation* out) override {
    native::Linearisation mine;
    workspace_.equations().LinearisePart(radius, &mine);
    const double of_kept = workspace_.system().Assemble(workspace_.equations(), radius);
    // The negation lets a NaN through.
    if (!(of_kept <= mine.max_gradient)) mine.max_gradient = of_kept;
    SumCosts(mine.cost, {mine.max_gradient, mine.evaluation_share}, &out->cost);
    out->max_gradient = out->evaluation_share = 0.0;
    for (int r = 0; r < communicator_.size(); ++r) {
      const double* others = gathered_.data() + (r + 1) * message_size() - kExtras;
      if (!(others[0] <= out->max_gradient)) out->max_gradient = others[0];
      out->evaluation_share += others[1] / communicator_.size();
    }
  }

  bool SolveKept() override {
    if (!workspace_.solver().Solve(workspace_.system(), &solution_)) return false;
    workspace_.system().Distribute(solution_, step_);
    return true;
  }

  void Step(native::Trial* out) override {
    native::Trial mine;
    workspace_.equations().Step(step_, &mine);
    SumCosts(mine.cost, {mine.model_change, mine.squares.step, mine.squares.state}, &out->cost);
    out->model_change = 0.0;
    out->squares = {};
    for (int r = 0; r < communicator_.size(); ++r) {
      const double* others = gathered_.data() + (r + 1) * message_size() - kExtras;
      out->model_change += others[0];
      out->squares.step += others[1];
      out->squares.state += others[2];
    }
    out->SetNorms();
  }

  void Accept() override { workspace_.equations().Accept(&workspace_.part().problem()); }
  // With the indices of the whole, so that another number of ranks can go on.
  void Save(LoopState* loop) override {
    workspace_.CollectState(whole_);
    loop->state = whole_->state();
    std::vector<RememberedResidual> mine = workspace_.equations().Remembered();
    for (RememberedResidual& r : mine) {
      r.batch = static_cast<uint32_t>(workspace_.part().batch_of_whole()[r.batch]);
      r.residual = workspace_.part().residuals(r.batch)[r.residual];
    }
    std::vector<size_t> begin;
    loop->remembered = communicator_.GatherLists<RememberedResidual>(mine, &begin);
  }
  void Restore(const LoopState& loop) override {
    whole_->state() = loop.state;
    distributed::PartProblem& part = workspace_.part();
    part.Renew(*whole_);
    std::vector<RememberedResidual> mine;
    for (RememberedResidual r : loop.remembered) {
      const auto batch =
          std::find(part.batch_of_whole().begin(), part.batch_of_whole().end(), r.batch);
      if (batch == part.batch_of_whole().end()) continue;
      const std::vector<uint32_t>& residuals = part.residuals(r.batch);
      const auto it = std::lower_bound(residuals.begin(), residuals.end(), r.residual);
      if (it == residuals.end() || *it != r.residual) continue;
      r.batch = static_cast<uint32_t>(batch - part.batch_of_whole().begin());
      r.residual = static_cast<uint32_t>(it - residuals.begin());
      mine.push_back(r);
    }
    workspace_.equations().Remember(mine);
  }
  bool Agree(bool mine) override { return communicator_.Agree(mine); }

 private:
  // A message has six numbers for each batch, and up to three more.
  static constexpr size_t kOfBatch = 6, kExtras = 3;
  size_t message_size() const { return num_batches_ * kOfBatch + kExtras; }

  void SumCosts(const native::StateCost& mine, std::initializer_list<double> extras,
                native::StateCost* out) {
    std::vector<double> message(message_size(), 0.0);
    for (size_t b = 0; b < mine.batches.size(); ++b) {
      double* to = message.data() + workspace_.part().batch_of_whole()[b] * kOfBatch;
      to[0] = static_cast<double>(mine.batches[b].residuals);
      to[1] = static_cast<double>(mine.batches[b].absent);
      to[2] = mine.batches[b].sum_squares;
      to[3] = mine.batches[b].cost;
      to[4] = mine.appeared[b].sum_squares;
      to[5] = mine.appeared[b].cost;
    }
    std::copy(extras.begin(), extras.end(), message.end() - kExtras);
    gathered_ = communicator_.GatherFromAll(message);
    out->batches.assign(num_batches_, {});
    out->appeared.assign(num_batches_, {});
    out->total = 0.0;
    for (size_t b = 0; b < num_batches_; ++b) {
      TermCost &sum = out->batches[b], &appeared = out->appeared[b];
      for (int r = 0; r < communicator_.size(); ++r) {
        const double* from = gathered_.data() + r * message_size() + b * kOfBatch;
        sum.residuals += static_cast<size_t>(from[0]);
        sum.absent += static_cast<size_t>(from[1]);
        sum.sum_squares += from[2];
        sum.cost += from[3];
        appeared.sum_squares += from[4];
        appeared.cost += from[5];
      }
      out->total += sum.cost;
    }
  }

  Problem* const whole_;
  const size_t num_batches_;
  Workspace& workspace_;
  Communicator& communicator_;
  bool is_empty_ = false;
  std::vector<double> step_, solution_, gathered_;
};

}  // namespace

SolverSummary SolveWithPetsc(const SolverOptions& options, Problem* problem,
                             PetscWorkspace* workspace) {
  ranks::Begin();
  native::SolveLog log("petsc", options, *problem);
  if (workspace->impl_ == nullptr || !workspace->impl_->Renew(*problem, options))
    workspace->impl_ = std::make_unique<PetscWorkspace::Impl>(*problem, options);
  PetscWorkspace::Impl& impl = *workspace->impl_;
  log.EndBuild(impl.solver().Name());
  impl.communicator().traffic() = {};
  DistributedProblem system(problem, &impl);
  SolverSummary summary = native::Minimise(options, *problem, &system, &log);
  impl.CollectState(problem);
  if (impl.communicator().size() > 1) summary.ranks = impl.Shares(summary.iterations);
  summary.num_threads = impl.num_threads();
  return summary;
}

}  // namespace holba
