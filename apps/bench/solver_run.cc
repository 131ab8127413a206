// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_run.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <malloc.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/bench/plain_ceres.h"
#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/timer.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/solver/covariance.h"

namespace holba {
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(LoggedIteration, seconds, cost, accepted)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SolverRun, failure, used_solver, stop_reason,
                                   build_problem_seconds, build_seconds, total_seconds,
                                   peak_memory_mb, initial_cost, final_cost, num_iterations,
                                   linearise_seconds, eliminate_seconds, factorise_seconds,
                                   back_substitute_seconds, log, seconds, seconds_per_iteration)
namespace {

// A number of KiB of /proc/self/status; 0: not there.
double StatusKib(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(key + ":")) return std::stod(line.substr(key.size() + 1));
  }
  return 0.0;
}

// Growth of the memory from its construction on, at its largest: of the resident set without pages
// of files, or the first use of a piece of the program would count as memory of the solver.
class MemoryWatch {
 public:
  MemoryWatch() {
    // Free pages that are still resident would hide what is allocated next.
    malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5\n";  // the peak so far is forgotten
    const double resident_kib = StatusKib("VmRSS");
    is_reset_ = resident_kib > 0.0 && StatusKib("VmHWM") < resident_kib + 1024.0;
    before_kib_ = is_reset_ ? resident_kib - FilesKib() : PeakKib();
  }
  double PeakMb() const {
    const double peak_kib = is_reset_ ? StatusKib("VmHWM") - FilesKib() : PeakKib();
    return std::max(0.0, peak_kib - before_kib_) / 1024.0;
  }

 private:
  static double FilesKib() { return StatusKib("RssFile") + StatusKib("RssShmem"); }
  static double PeakKib() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss);
  }
  double before_kib_ = 0.0;
  bool is_reset_ = false;
};

// Ceres leaves dense and supernodal factorisations to LAPACK, whose BLAS has threads of its own.
void SetBlasThreadsFor(const Competitor& competitor) {
  const bool uses_blas = competitor.linear_solver == LinearSolver::kSparse ||
                         competitor.dense_library == CeresDenseLibrary::kLapack;
  if (competitor.backend != Backend::kCeres || !uses_blas) return;
  using Set = void (*)(int);
  if (const auto set = reinterpret_cast<Set>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) {
    set(competitor.num_threads);
  }
}

SolverOptions OptionsOf(const Competitor& competitor, const RunOptions& run) {
  SolverOptions options = run.solver;
  options.backend = competitor.backend;
  options.linear_solver = competitor.linear_solver;
  options.ceres_dense_library = competitor.dense_library;
  options.num_threads = competitor.num_threads;
  if (run.mode != RunMode::kCalls) {
    options.gradient_tolerance = options.parameter_tolerance = 0.0;
    options.max_seconds = run.max_seconds;
  }
  if (run.mode == RunMode::kTimed) options.function_tolerance = 0.0;
  return options;
}

// Solves from the same start as often as asked.
class Solves {
 public:
  Solves(const SolverProblem& problem, const Competitor& competitor,
         SolverWorkspace* workspace = nullptr)
      : model_(problem.start), competitor_(competitor), workspace_(workspace) {
    if (competitor.program == SolverProgram::kPlainCeres) return;
    bundle_ = BuildProblem(problem.start, problem.bundle);
    start_ = bundle_.problem.state();
  }
  void HoldPoint(size_t idx) {
    if (bundle_.points.empty()) return;
    bundle_.problem.block(bundle_.points[idx % bundle_.points.size()].second).constant = true;
  }
  SolverSummary Once(const SolverOptions& options) {
#if HOLBA_WITH_CERES
    if (competitor_.program == SolverProgram::kPlainCeres) {
      return SolveBalWithPlainCeres(options, model_);
    }
#endif
    bundle_.problem.state() = start_;
    return Solve(options, &bundle_.problem, workspace_);
  }

 private:
  const Reconstruction& model_;
  const Competitor& competitor_;
  SolverWorkspace* workspace_;
  BundleProblem bundle_;
  std::vector<double> start_;
};

void Add(double seconds, double* sum) {
  if (seconds < 0.0) return;
  *sum = std::max(0.0, *sum) + seconds;
}

void RunCalls(const SolverProblem& problem, const Competitor& competitor,
              const SolverOptions& solver, int calls, double max_seconds, SolverRun* run) {
  const Timer all_timer;
  SolverWorkspace workspace;
  for (int call = 0; call < calls && all_timer.Seconds() < max_seconds; ++call) {
    const Timer timer;
    Solves solves(problem, competitor, &workspace);
    // Another point each time: as in a mapper, no two problems have the same structure.
    solves.HoldPoint(static_cast<size_t>(call));
    const SolverSummary summary = solves.Once(solver);
    run->seconds.push_back(timer.Seconds());
    run->num_iterations += summary.iterations;
    run->initial_cost = summary.initial_cost;
    run->final_cost = summary.final_cost;
    run->used_solver = summary.linear_solver;
    run->stop_reason = NameOf(summary.stop_reason);
  }
}

void WriteAll(int file, const std::vector<uint8_t>& bytes) {
  size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t count = write(file, bytes.data() + written, bytes.size() - written);
    if (count <= 0) return;
    written += static_cast<size_t>(count);
  }
}

// What the child writes until it ends. False: it did not end in time.
bool ReadAll(int file, double max_seconds, std::vector<uint8_t>* bytes) {
  const Timer timer;
  for (;;) {
    const double left = max_seconds - timer.Seconds();
    if (left <= 0) return false;
    pollfd waiting = {file, POLLIN, 0};
    if (poll(&waiting, 1, static_cast<int>(std::min(left, 1000.0) * 1e3) + 1) <= 0) continue;
    uint8_t buffer[1 << 16];
    const ssize_t count = read(file, buffer, sizeof(buffer));
    if (count <= 0) return true;
    bytes->insert(bytes->end(), buffer, buffer + count);
  }
}

void RunCovariances(const SolverProblem& problem, const SolverOptions& solver, SolverRun* run) {
  BundleOptions bundle_options = problem.bundle;
  bundle_options.gauge = Gauge::kTwoCams;
  BundleProblem bundle = BuildProblem(problem.start, bundle_options);
  SolverWorkspace workspace;
  const SolverSummary summary = Solve(solver, &bundle.problem, &workspace);
  run->seconds_per_iteration = summary.MedianIterationSeconds();
  run->used_solver = summary.linear_solver;
  constexpr int kRepetitions = 5;
  for (int i = 0; i < kRepetitions; ++i) {
    const Timer timer;
    const auto covariance = Covariance::Compute(bundle.problem, solver.num_threads, &workspace);
    if (!covariance) return;  // nothing fixes some block
    run->seconds.push_back(timer.Seconds());
  }
}

}  // namespace

std::vector<Competitor> Competitors(std::span<const int> num_threads,
                                    std::span<const std::string> prefixes) {
  using enum LinearSolver;
  using Library = CeresDenseLibrary;
  constexpr SolverProgram kHolba = SolverProgram::kHolba, kPlain = SolverProgram::kPlainCeres;
  std::vector<Competitor> all = {
      {"native", kHolba, Backend::kNative, kAuto},
      {"native_dense", kHolba, Backend::kNative, kDense},
      {"native_sparse", kHolba, Backend::kNative, kSparse},
      {"native_iterative", kHolba, Backend::kNative, kIterative},
      {"ceres_dense_eigen", kHolba, Backend::kCeres, kDense, Library::kEigen},
      {"ceres_dense_lapack", kHolba, Backend::kCeres, kDense, Library::kLapack},
      {"ceres_sparse", kHolba, Backend::kCeres, kSparse},
      {"ceres_iterative", kHolba, Backend::kCeres, kIterative},
      {"plain_ceres_dense_eigen", kPlain, Backend::kCeres, kDense, Library::kEigen},
      {"plain_ceres_dense_lapack", kPlain, Backend::kCeres, kDense, Library::kLapack},
      {"plain_ceres_sparse", kPlain, Backend::kCeres, kSparse},
      {"plain_ceres_iterative", kPlain, Backend::kCeres, kIterative},
  };
#if !HOLBA_WITH_CERES
  std::erase_if(all, [](const Competitor& c) { return c.backend == Backend::kCeres; });
#endif
  for (const std::string& prefix : prefixes) {
    if (std::any_of(all.begin(), all.end(),
                    [&](const Competitor& c) { return c.name.starts_with(prefix); })) {
      continue;
    }
    std::string known;
    for (const Competitor& c : all) known += (known.empty() ? "" : ", ") + c.name;
    throw InputError(fmt::format("--solvers: expected one of {1}, found '{0}'", prefix, known));
  }
  std::vector<Competitor> chosen;
  for (Competitor competitor : all) {
    const bool wanted =
        prefixes.empty() || std::any_of(prefixes.begin(), prefixes.end(), [&](const auto& prefix) {
          return competitor.name.starts_with(prefix);
        });
    if (!wanted) continue;
    for (const int threads : num_threads) {
      competitor.num_threads = threads;
      chosen.push_back(competitor);
    }
  }
  return chosen;
}

std::string WhySkipped(const Competitor& competitor, bool is_bal, size_t num_kept_unknowns) {
  constexpr size_t kMaxDense = 6000, kMaxDenseEigen = 3000;
  if (competitor.program == SolverProgram::kPlainCeres && !is_bal) return "BAL problems only";
  if (competitor.linear_solver != LinearSolver::kDense) return "";
  if (num_kept_unknowns > kMaxDense) return fmt::format("dense over {} unknowns", kMaxDense);
  if (competitor.dense_library == CeresDenseLibrary::kEigen && num_kept_unknowns > kMaxDenseEigen) {
    return fmt::format("dense by Eigen over {} unknowns", kMaxDenseEigen);
  }
  return "";
}

bool TakesExactSteps(std::string_view used_solver) {
  return !used_solver.starts_with("conjugate gradients") && !used_solver.starts_with("ITERATIVE");
}

SolverRun RunSolver(const SolverProblem& problem, const Competitor& competitor,
                    const RunOptions& options) {
  SolverRun run;
  SolverOptions solver = OptionsOf(competitor, options);
  if (options.mode == RunMode::kCalls) {
    SetBlasThreadsFor(competitor);
    RunCalls(problem, competitor, solver, options.calls, options.max_seconds, &run);
    return run;
  }
  if (options.mode == RunMode::kCovariances) {
    solver.max_num_iterations = options.iterations;
    RunCovariances(problem, solver, &run);
    return run;
  }
  const Timer build_timer;
  Solves solves(problem, competitor);
  run.build_problem_seconds = build_timer.Seconds();

  SetBlasThreadsFor(competitor);
  const bool timed = options.mode == RunMode::kTimed;
  const MemoryWatch memory;
  const Timer timer;
  for (int left = timed ? options.iterations : 1; left > 0;) {
    const bool first = run.log.empty();
    solver.on_iteration = [&](const IterationRecord& record) {
      if (first) run.log.push_back({record.seconds, record.cost, record.accepted});
      // The first iteration includes the symbolic analysis; a rejected step has no new Jacobian.
      if (record.iteration > 1 && record.accepted) run.seconds.push_back(record.seconds);
      return true;
    };
    if (timed) solver.max_num_iterations = left;
    const SolverSummary summary = solves.Once(solver);
    if (first) {
      run.build_seconds = summary.build_seconds;
      run.initial_cost = summary.initial_cost;
      run.final_cost = summary.final_cost;
      run.used_solver = summary.linear_solver;
      run.stop_reason = NameOf(summary.stop_reason);
    }
    run.num_iterations += summary.iterations;
    Add(summary.linearise_seconds, &run.linearise_seconds);
    Add(summary.eliminate_seconds, &run.eliminate_seconds);
    Add(summary.factorise_seconds, &run.factorise_seconds);
    Add(summary.back_substitute_seconds, &run.back_substitute_seconds);
    run.total_seconds += summary.total_seconds;
    if (!timed) break;
    if (summary.iterations == 0) {
      run.failure =
          "no iteration: " + (summary.message.empty() ? run.stop_reason : summary.message);
      break;
    }
    left -= summary.iterations;
    if (timer.Seconds() > options.max_seconds) break;
  }
  run.peak_memory_mb = memory.PeakMb();
  return run;
}

SolverRun RunInChild(const std::function<SolverRun()>& run, double max_seconds) {
  int ends[2];
  HOLBA_CHECK_MSG(pipe(ends) == 0, "no pipe to a child process");
  std::fflush(nullptr);  // or the child would print what waits in our buffers
  const pid_t child = fork();
  HOLBA_CHECK_MSG(child >= 0, "no child process");
  if (child == 0) {
    close(ends[0]);
    SolverRun result;
    try {
      result = run();
    } catch (const std::exception& error) {
      result = {};
      result.failure = error.what();
    }
    WriteAll(ends[1], nlohmann::json::to_cbor(nlohmann::json(result)));
    _exit(0);
  }
  close(ends[1]);
  std::vector<uint8_t> bytes;
  const bool in_time = ReadAll(ends[0], max_seconds, &bytes);
  close(ends[0]);
  if (!in_time) kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  SolverRun result;
  if (!in_time) {
    result.failure = fmt::format("ended after {:.0f} s", max_seconds);
  } else if (WIFSIGNALED(status)) {
    result.failure = fmt::format("ended by signal {}", WTERMSIG(status));
  } else {
    const nlohmann::json json = nlohmann::json::from_cbor(bytes, true, false);
    if (json.is_discarded()) {
      result.failure = "no result";
    } else {
      result = json.get<SolverRun>();
    }
  }
  return result;
}

std::optional<double> TimeToCost(double build_seconds, std::span<const LoggedIteration> log,
                                 double target) {
  double seconds = build_seconds;
  for (const LoggedIteration& iteration : log) {
    seconds += iteration.seconds;
    if (iteration.accepted && iteration.cost <= target) return seconds;
  }
  return std::nullopt;
}

}  // namespace holba
