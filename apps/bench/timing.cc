// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/timing.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <limits>
#include <utility>

#include "apps/bench/plot.h"
#include "holba/base/check.h"
#include "holba/base/log.h"
#include "holba/base/timer.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/evaluation/statistics.h"

namespace holba {
namespace {

constexpr const char* kExponent = "exponent";

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

// "100 images, ms"
std::string AtSize(int num_images, const char* what) {
  return fmt::format("{} images, {}", num_images, what);
}

// What a timing shows, by row and size.
struct TimingShown {
  const char* table;  // added to the benchmark's name
  std::string title;
  const char* unit;
  BetterIs better;
  int digits;
  // `first`: of the first case with the same size and solver.
  double (*of)(const Timing& timing, const Timing& first);
};

SeedTable TableOf(const TimingShown& shown, const std::string& name, const TimingOptions& options,
                  const std::vector<TimingCase>& cases,
                  const std::vector<std::vector<Timing>>& of_seeds, bool with_exponents) {
  std::vector<std::string> rows, seeds;
  for (const LinearSolver solver : options.linear_solvers)
    for (const TimingCase& c : cases) rows.push_back(fmt::format("{}, {}", c.name, NameOf(solver)));
  for (size_t s = 0; s < of_seeds.size(); ++s)
    seeds.push_back(std::to_string(options.scene.seed + s));
  std::vector<SeedMeasure> measures;
  for (const int num_images : options.num_images)
    measures.push_back({AtSize(num_images, shown.unit), shown.better, shown.digits});
  if (with_exponents) measures.push_back({kExponent, BetterIs::kNeither, 2});
  SeedTable table(name + shown.table, shown.title, std::move(rows), std::move(seeds),
                  std::move(measures));
  for (size_t s = 0; s < of_seeds.size(); ++s) {
    for (size_t r = 0; r < table.rows.size(); ++r) {
      const LinearSolver solver = options.linear_solvers[r / cases.size()];
      std::vector<double> sizes, values;
      for (const int num_images : options.num_images) {
        sizes.push_back(num_images);
        values.push_back(
            shown.of(Find(of_seeds[s], num_images, solver, cases[r % cases.size()].name),
                     Find(of_seeds[s], num_images, solver, cases[0].name)));
      }
      if (with_exponents) {
        values.push_back(
            GrowthExponent(sizes, values).value_or(std::numeric_limits<double>::quiet_NaN()));
      }
      table.Set(r, s, values);
    }
  }
  return table;
}

// A panel for each solver, a line for each case, means over the seeds.
std::string PlotOf(const SeedTable& times, const TimingOptions& options, size_t num_cases) {
  std::vector<PlotPanel> panels;
  for (size_t i = 0; i < options.linear_solvers.size(); ++i) {
    PlotPanel& panel = panels.emplace_back();
    panel.title = NameOf(options.linear_solvers[i]) + " Schur complement";
    panel.x_label = "images";
    panel.y_label = "ms per iteration";
    for (size_t r = i * num_cases; r < (i + 1) * num_cases; ++r) {
      PlotLine& line = panel.lines.emplace_back();
      line.name = times.rows[r].substr(0, times.rows[r].rfind(','));
      for (size_t k = 0; k < options.num_images.size(); ++k) {
        if (const auto spread = SpreadOf(times.values[r][k]))
          line.points.push_back({static_cast<double>(options.num_images[k]), spread->mean});
      }
    }
  }
  return LogarithmicPlot(panels);
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

PaperBenchReport TimingReport(const std::string& name, const TimingOptions& options,
                              const std::vector<TimingCase>& cases,
                              const std::vector<std::vector<Timing>>& of_seeds) {
  const char* clock = options.clock == TimingClock::kCpu ? " of processor time" : "";
  const bool with_exponents = options.num_images.size() > 1;
  const TimingShown times = {
      "",
      fmt::format("Milliseconds{} per iteration:", clock),
      "ms",
      BetterIs::kNeither,  // differences stand as ratios
      2,
      [](const Timing& timing, const Timing&) { return 1e3 * timing.seconds_per_iteration; }};
  const TimingShown ratios = {"_ratio",
                              fmt::format("The same by that of {}:", cases[0].name),
                              "ratio",
                              BetterIs::kNeither,
                              2,
                              [](const Timing& timing, const Timing& first) {
                                return timing.seconds_per_iteration / first.seconds_per_iteration;
                              }};
  const TimingShown unknowns = {"_unknowns",
                                "Unknowns of the reduced system:",
                                "unknowns",
                                BetterIs::kNeither,
                                0,
                                [](const Timing& timing, const Timing&) {
                                  return static_cast<double>(timing.reduced_system.size);
                                }};
  const TimingShown densities = {
      "_density",
      "Part of its entries that is not structurally zero:",
      "%",
      BetterIs::kNeither,
      1,
      [](const Timing& timing, const Timing&) { return 100.0 * timing.reduced_system.density; }};
  PaperBenchReport report;
  report.tables.push_back(TableOf(times, name, options, cases, of_seeds, with_exponents));
  for (const TimingShown& shown : {ratios, unknowns, densities})
    report.tables.push_back(TableOf(shown, name, options, cases, of_seeds, false));
  report.plot = PlotOf(report.tables[0], options, cases.size());
  return report;
}

}  // namespace holba
