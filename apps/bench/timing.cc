// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/timing.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <limits>

#include "holba/base/check.h"
#include "holba/base/log.h"
#include "holba/base/timer.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/evaluation/statistics.h"

namespace holba {
namespace {

std::string NameOf(LinearSolver solver) {
  switch (solver) {
    case LinearSolver::kDense:
      return "dense";
    case LinearSolver::kSparse:
      return "sparse";
    case LinearSolver::kIterative:
      return "iterative";
    case LinearSolver::kAuto:
      break;
  }
  return "auto";
}

double CpuSeconds() {
  timespec now;
  HOLBA_CHECK(clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now) == 0);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Runs `iterations` iterations and adds what they showed to `timing`.
void RunOnce(SolverOptions solver, int iterations, TimingClock clock, BundleProblem* bundle,
             Timing* timing) {
  Problem& problem = bundle->problem;
  const std::vector<double> start = problem.state();
  timing->iterations = 0;
  std::vector<double> seconds;
  double cpu_before = 0.0;
  solver.on_iteration = [&](const IterationRecord& record) {
    const double cpu = CpuSeconds();
    // The first iteration includes the symbolic analysis; a rejected step has no new Jacobian.
    if (record.iteration > 1 && record.accepted) {
      seconds.push_back(clock == TimingClock::kWall ? record.seconds : cpu - cpu_before);
    }
    cpu_before = cpu;
    return true;
  };
  for (int left = iterations; left > 0;) {
    problem.state() = start;
    solver.max_num_iterations = left;
    solver.analyse_reduced_system = timing->reduced_system.size == 0;
    const SolverSummary summary = Solve(solver, &problem);
    timing->used_solver = summary.linear_solver;
    if (solver.analyse_reduced_system) timing->reduced_system = summary.reduced_system;
    HOLBA_CHECK_MSG(summary.iterations > 0, "the benchmark's problem has nothing to adjust");
    left -= summary.iterations;
    timing->iterations += summary.iterations;
  }
  problem.state() = start;
  if (const auto stats = Summarise(seconds)) {
    timing->seconds_per_iteration = std::min(timing->seconds_per_iteration, stats->median);
  }
}

const Timing& Find(const std::vector<Timing>& timings, int num_images, LinearSolver solver,
                   const std::string& name) {
  const auto it = std::find_if(timings.begin(), timings.end(), [&](const Timing& t) {
    return t.num_images == num_images && t.linear_solver == solver && t.name == name;
  });
  HOLBA_CHECK(it != timings.end());
  return *it;
}

Table TimeTable(const TimingOptions& options, const std::vector<TimingCase>& cases,
                const std::vector<Timing>& timings) {
  Table table = {
      fmt::format("Milliseconds{} per iteration, in parentheses relative to {}:",
                  options.clock == TimingClock::kCpu ? " of processor time" : "", cases[0].name),
      {"images, Schur complement"},
      {}};
  for (const TimingCase& c : cases) table.header.push_back(c.name);
  for (const LinearSolver solver : options.linear_solvers) {
    for (const int num_images : options.num_images) {
      const double first = Find(timings, num_images, solver, cases[0].name).seconds_per_iteration;
      std::vector<std::string> row = {fmt::format("{}, {}", num_images, NameOf(solver))};
      for (const TimingCase& c : cases) {
        const double seconds = Find(timings, num_images, solver, c.name).seconds_per_iteration;
        row.push_back(fmt::format("{} ({:.2f})", ThreeDigits(1e3 * seconds), seconds / first));
      }
      table.rows.push_back(row);
    }
    if (options.num_images.size() < 2) continue;
    std::vector<std::string> growth = {fmt::format("growth with n images, {}", NameOf(solver))};
    for (const TimingCase& c : cases) {
      std::vector<double> sizes, seconds;
      for (const int num_images : options.num_images) {
        sizes.push_back(num_images);
        seconds.push_back(Find(timings, num_images, solver, c.name).seconds_per_iteration);
      }
      const auto exponent = GrowthExponent(sizes, seconds);
      growth.push_back(exponent ? fmt::format("n^{:.2f}", *exponent) : "-");
    }
    table.rows.push_back(growth);
  }
  return table;
}

Table SystemTable(const TimingOptions& options, const std::vector<TimingCase>& cases,
                  const std::vector<Timing>& timings) {
  Table table = {
      "Unknowns of the reduced system, and the part of its entries that is not structurally zero:",
      {"images"},
      {}};
  for (const TimingCase& c : cases) table.header.push_back(c.name);
  for (const int num_images : options.num_images) {
    std::vector<std::string> row = {std::to_string(num_images)};
    for (const TimingCase& c : cases) {
      const ReducedSystem& system =
          Find(timings, num_images, options.linear_solvers[0], c.name).reduced_system;
      row.push_back(fmt::format("{}, {:.1f} %", system.size, 100.0 * system.density));
    }
    table.rows.push_back(row);
  }
  return table;
}

}  // namespace

std::vector<TimingCase> ConfigCases(const BundleOptions& bundle) {
  std::vector<TimingCase> cases = {
      {"Point", bundle}, {"Point-Line", bundle}, {"Groups", bundle}, {"Holistic", bundle}};
  cases[0].bundle.config = BundleConfig::kPoint;
  cases[1].bundle.config = BundleConfig::kPointLine;
  cases[2].bundle.config = BundleConfig::kGroups;
  cases[3].bundle.config = BundleConfig::kHolistic;
  return cases;
}

std::vector<TimingCase> WireframeFormCases(const BundleOptions& bundle) {
  std::vector<TimingCase> cases = {{"2D wireframe", bundle}, {"3D wireframe", bundle}};
  for (TimingCase& c : cases) c.bundle.config = BundleConfig::kHolistic;
  cases[0].bundle.wireframe_form = StructureForm::k2d;
  cases[1].bundle.wireframe_form = StructureForm::k3d;
  return cases;
}

std::vector<Timing> TimeIterations(const TimingOptions& options,
                                   const std::vector<TimingCase>& cases) {
  std::vector<Timing> timings;
  SolverOptions solver = options.solver;
  solver.function_tolerance = solver.gradient_tolerance = solver.parameter_tolerance = 0.0;
  for (const int num_images : options.num_images) {
    BundleProblemOptions scene = options.scene;
    scene.num_images = num_images;
    const Reconstruction model = MakeBundleProblem(scene).perturbed;
    std::vector<BundleProblem> bundles;
    for (const TimingCase& c : cases) bundles.push_back(BuildProblem(model, c.bundle));

    const size_t first = timings.size();
    for (const LinearSolver linear_solver : options.linear_solvers) {
      for (size_t i = 0; i < cases.size(); ++i) {
        timings.push_back({.num_images = num_images,
                           .linear_solver = linear_solver,
                           .name = cases[i].name,
                           .seconds_per_iteration = std::numeric_limits<double>::infinity(),
                           .num_residuals = bundles[i].problem.num_residuals()});
      }
    }
    std::vector<double> longest_run(timings.size() - first, 0.0);
    for (int repetition = 0; repetition < options.repetitions; ++repetition) {
      for (size_t t = first; t < timings.size(); ++t) {
        Timing& timing = timings[t];
        double& run_seconds = longest_run[t - first];
        if (run_seconds > options.max_repeated_seconds) continue;
        const Timer timer;
        solver.linear_solver = timing.linear_solver;
        RunOnce(solver, options.iterations, options.clock, &bundles[(t - first) % cases.size()],
                &timing);
        run_seconds = std::max(run_seconds, timer.Seconds());
        LogInfo("{} images, {}, {}: {} ms per iteration (repetition {} of {})", num_images,
                NameOf(timing.linear_solver), timing.name,
                ThreeDigits(1e3 * timing.seconds_per_iteration), repetition + 1,
                options.repetitions);
      }
    }
  }
  return timings;
}

std::vector<Table> TimingTables(const TimingOptions& options, const std::vector<TimingCase>& cases,
                                const std::vector<Timing>& timings) {
  return {TimeTable(options, cases, timings), SystemTable(options, cases, timings)};
}

nlohmann::json TimingsToJson(const std::vector<Timing>& timings) {
  nlohmann::json list = nlohmann::json::array();
  for (const Timing& t : timings) {
    list.push_back({{"images", t.num_images},
                    {"case", t.name},
                    {"schur", NameOf(t.linear_solver)},
                    {"linear_solver", t.used_solver},
                    {"iterations", t.iterations},
                    {"seconds_per_iteration", t.seconds_per_iteration},
                    {"residuals", t.num_residuals},
                    {"reduced_system",
                     {{"size", t.reduced_system.size},
                      {"density", t.reduced_system.density},
                      {"pose_density", t.reduced_system.pose_density}}}});
  }
  return list;
}

}  // namespace holba
