// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/solver_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "holba/base/log.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/evaluation/statistics.h"

namespace holba {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::string Label(const Competitor& competitor) {
  return fmt::format("{} {}t", competitor.name, competitor.num_threads);
}

std::optional<double> MedianOfAny(std::span<const double> values) {
  const auto stats = Summarise(values);
  if (!stats) return std::nullopt;
  return stats->median;
}

void Describe(const SolverProblem& problem, SolverBenchProblemResult* result) {
  const BundleProblem bundle = BuildProblem(problem.start, problem.bundle);
  result->num_images = problem.start.images.size();
  for (BlockId id = 0; id < bundle.problem.num_blocks(); ++id) {
    const ParameterBlock& block = bundle.problem.block(id);
    result->num_features += !IsKept(block.role) && block.IsVariable();
  }
  result->num_residuals = bundle.problem.num_residuals();
  const ReducedSystem system = AnalyseReducedSystem(bundle.problem);
  result->num_kept_unknowns = system.size;
  result->density = system.density;
  result->flops = CountIterationFlops(bundle.problem);
}

double Seconds(const SolverRun& run) { return run.build_problem_seconds + run.total_seconds; }

void RunAll(const SolverBenchOptions& options, const SolverProblem& problem,
            SolverBenchProblemResult* result) {
  const bool is_bal = IsBalModel(problem.start);
  for (const Competitor& competitor : options.competitors) {
    result->results.push_back(
        {competitor, WhySkipped(competitor, is_bal, result->num_kept_unknowns)});
  }
  RunOptions run_options;
  run_options.iterations = options.iterations;
  run_options.calls = options.calls;
  run_options.max_seconds = options.max_run_seconds;
  // One iteration beyond the limit may be a long one.
  const double patience = 5.0 * options.max_run_seconds + 60.0;
  const auto run = [&](const SolverResult& of, RunMode mode) {
    run_options.mode = mode;
    run_options.solver = options.solver;
    if (mode == RunMode::kConverged) {
      run_options.solver.function_tolerance = options.quality_function_tolerance;
      run_options.solver.max_num_iterations = options.quality_iterations;
    }
    if (mode == RunMode::kCalls) run_options.solver.max_num_iterations = options.call_iterations;
    return RunInChild([&] { return RunSolver(problem, of.competitor, run_options); }, patience);
  };
  for (int repetition = 0; repetition < options.repetitions; ++repetition) {
    for (SolverResult& of : result->results) {
      if (!of.skipped.empty()) continue;
      for (auto& [runs, mode] :
           {std::pair(&of.timed, RunMode::kTimed), std::pair(&of.converged, RunMode::kConverged)}) {
        if (!runs->empty() && (!runs->back().failure.empty() ||
                               Seconds(runs->back()) > options.max_repeated_seconds)) {
          continue;
        }
        runs->push_back(run(of, mode));
      }
      const SolverScore score = ScoreOf(of, kInfinity);
      LogInfo("{}: {}: {} (repetition {} of {})", result->name, Label(of.competitor),
              score.failure.empty()
                  ? fmt::format("{} ms per iteration",
                                ThreeDigits(1e3 * score.seconds_per_iteration.value_or(0.0)))
                  : score.failure,
              repetition + 1, options.repetitions);
    }
  }
  for (SolverResult& of : result->results) {
    if (of.competitor.IsNative() && of.competitor.linear_solver == LinearSolver::kAuto &&
        of.timed.front().failure.empty())
      of.covariances = run(of, RunMode::kCovariances);
  }
  if (!problem.is_local || options.calls == 0) return;
  for (SolverResult& of : result->results) {
    if (of.skipped.empty() && of.timed.front().failure.empty()) of.calls = run(of, RunMode::kCalls);
  }
}

std::string Milliseconds(const std::optional<double>& seconds) {
  return seconds ? ThreeDigits(1e3 * *seconds) : "-";
}

// The best of several results by one number; its label says which.
struct Best {
  double value = kInfinity;
  std::string label;

  void Offer(const std::optional<double>& candidate, const Competitor& competitor) {
    if (!candidate || !(*candidate < value)) return;
    value = *candidate;
    label = Label(competitor);
  }
  std::string Number() const { return label.empty() ? "-" : ThreeDigits(1e3 * value); }
  std::string Cell() const {
    return label.empty() ? "-" : fmt::format("{} ({})", ThreeDigits(1e3 * value), label);
  }
};
std::string RatioCell(const Best& ceres, const Best& native) {
  if (ceres.label.empty() || native.label.empty()) return "-";
  return fmt::format("{:.1f}", ceres.value / native.value);
}

Table ProblemsTable(const SolverBenchResult& result) {
  Table table = {
      fmt::format("Problems. This machine: {:.0f} GFLOP/s with one thread, {:.0f} with {}:",
                  result.peak_gflops_one, result.peak_gflops_all, result.all_threads),
      {"problem", "images", "features", "residuals", "unknowns of the reduced system", "not zero",
       "Mflop per iteration", "of these factor", "floor, ms (1 thread)",
       fmt::format("({} threads)", result.all_threads)},
      {}};
  for (const SolverBenchProblemResult& p : result.problems) {
    const double total = p.flops.Total();
    table.rows.push_back({p.name, std::to_string(p.num_images), std::to_string(p.num_features),
                          std::to_string(p.num_residuals), std::to_string(p.num_kept_unknowns),
                          fmt::format("{:.1f} %", 100.0 * p.density), ThreeDigits(1e-6 * total),
                          ThreeDigits(1e-6 * p.flops.Factor()),
                          ThreeDigits(1e-6 * total / result.peak_gflops_one),
                          ThreeDigits(1e-6 * total / result.peak_gflops_all)});
  }
  return table;
}

std::string PhaseCell(const SolverResult& result) {
  if (result.timed.empty() || result.timed.back().num_iterations == 0) return "-";
  const SolverRun& run = result.timed.back();
  const auto part = [&](double seconds) {
    return seconds < 0.0 ? "-" : ThreeDigits(1e3 * seconds / run.num_iterations);
  };
  return fmt::format("{} / {} / {} / {}", part(run.linearise_seconds), part(run.eliminate_seconds),
                     part(run.factorise_seconds), part(run.back_substitute_seconds));
}

Table DetailTable(const SolverBenchResult& bench, const SolverBenchProblemResult& problem) {
  const double best_cost = BestCost(problem);
  Table table = {fmt::format("{} (least cost {:.9g}):", problem.name, best_cost),
                 {"solver", "ms per iteration", "times the floor", "iterations", "to 1 %, ms",
                  "to 0.1 %, ms", "and BuildProblem, ms", "memory, MB", "final cost above least",
                  "linearise / eliminate / factorise / back substitute, ms"},
                 {}};
  for (const SolverResult& of : problem.results) {
    if (of.skipped == "BAL problems only") continue;
    std::vector<std::string> row = {Label(of.competitor)};
    const SolverScore score = ScoreOf(of, best_cost);
    if (!score.failure.empty()) {
      row.push_back(score.failure);
      row.resize(table.header.size(), "");
      table.rows.push_back(row);
      continue;
    }
    const double peak =
        of.competitor.num_threads == 1 ? bench.peak_gflops_one : bench.peak_gflops_all;
    const double floor_seconds = 1e-9 * problem.flops.Total() / peak;
    row.push_back(Milliseconds(score.seconds_per_iteration));
    row.push_back(score.seconds_per_iteration && score.is_exact
                      ? fmt::format("{:.1f}", *score.seconds_per_iteration / floor_seconds)
                      : "-");
    row.push_back(std::to_string(score.iterations));
    row.push_back(Milliseconds(score.seconds_to_1_percent));
    row.push_back(Milliseconds(score.seconds_to_01_percent));
    row.push_back(score.seconds_to_01_percent ? ThreeDigits(1e3 * (*score.seconds_to_01_percent +
                                                                   score.build_problem_seconds))
                                              : "-");
    row.push_back(ThreeDigits(score.peak_memory_mb));
    row.push_back(fmt::format("{:.1e}", score.final_cost / best_cost - 1.0));
    row.push_back(PhaseCell(of));
    table.rows.push_back(row);
  }
  return table;
}

std::optional<Table> CallsTable(const SolverBenchResult& bench) {
  Table table = {
      "Milliseconds of one adjustment, problem building included; median of calls in a row:",
      {"solver"},
      {}};
  std::vector<const SolverBenchProblemResult*> local;
  for (const SolverBenchProblemResult& p : bench.problems) {
    if (p.is_local) local.push_back(&p);
  }
  if (local.empty()) return std::nullopt;
  for (const auto* p : local) table.header.push_back(p->name);
  for (size_t c = 0; c < local[0]->results.size(); ++c) {
    std::vector<std::string> row = {Label(local[0]->results[c].competitor)};
    bool any = false;
    for (const auto* p : local) {
      const auto seconds = ScoreOf(p->results[c], kInfinity).seconds_per_call;
      any |= seconds.has_value();
      row.push_back(
          seconds
              ? fmt::format("{} ({} iterations)", ThreeDigits(1e3 * *seconds),
                            ThreeDigits(static_cast<double>(p->results[c].calls.num_iterations) /
                                        p->results[c].calls.seconds.size()))
              : "-");
    }
    if (any) table.rows.push_back(row);
  }
  if (table.rows.empty()) return std::nullopt;
  return table;
}

std::optional<Table> CovariancesTable(const SolverBenchResult& bench) {
  Table table = {
      "Covariances of all cameras, groups and features by the native solver, the gauge fixed; ms, "
      "in "
      "parentheses relative to one iteration:",
      {"problem"},
      {}};
  for (const SolverBenchProblemResult& p : bench.problems) {
    std::vector<std::string> row = {p.name};
    for (const SolverResult& of : p.results) {
      const auto seconds = MedianOfAny(of.covariances.seconds);
      if (!seconds) continue;
      if (table.rows.empty()) table.header.push_back(Label(of.competitor));
      row.push_back(fmt::format("{} ({:.1f})", ThreeDigits(1e3 * *seconds),
                                *seconds / of.covariances.seconds_per_iteration));
    }
    if (row.size() == table.header.size() && row.size() > 1) table.rows.push_back(row);
  }
  if (table.rows.empty()) return std::nullopt;
  return table;
}

Table SummaryTable(const SolverBenchResult& bench) {
  Table table = {
      "The best of the native solver's forms and the best of Ceres', whatever their dense algebra "
      "and "
      "threads; ms, to 0.1 % with all building; memory in MB:",
      {"problem", "images, residuals", "native", "Ceres, factorised", "ratio", "native, iterative",
       "Ceres, iterative", "ratio", "to 0.1 %: native", "Ceres", "ratio", "memory: native", "Ceres",
       "ratio"},
      {}};
  for (const SolverBenchProblemResult& p : bench.problems) {
    const double best_cost = BestCost(p);
    // By whether it is the native solver, and whether steps are exact.
    Best step[2][2], time[2], memory[2];
    for (const SolverResult& of : p.results) {
      const SolverScore score = ScoreOf(of, best_cost);
      if (!score.failure.empty()) continue;
      const bool native = of.competitor.IsNative();
      step[native][score.is_exact].Offer(score.seconds_per_iteration, of.competitor);
      if (score.seconds_to_01_percent) {
        time[native].Offer(*score.seconds_to_01_percent + score.build_problem_seconds,
                           of.competitor);
      }
      memory[native].Offer(1e-3 * score.peak_memory_mb, of.competitor);
    }
    table.rows.push_back({p.name, fmt::format("{}, {}", p.num_images, p.num_residuals),
                          step[1][1].Number(), step[0][1].Number(),
                          RatioCell(step[0][1], step[1][1]), step[1][0].Number(),
                          step[0][0].Number(), RatioCell(step[0][0], step[1][0]), time[1].Cell(),
                          time[0].Cell(), RatioCell(time[0], time[1]), memory[1].Number(),
                          memory[0].Number(), RatioCell(memory[0], memory[1])});
  }
  return table;
}

nlohmann::json OptionalToJson(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json();
}

nlohmann::json RunToJson(const SolverRun& run) {
  nlohmann::json log = nlohmann::json::array();
  for (const LoggedIteration& i : run.log) log.push_back({i.seconds, i.cost, i.accepted});
  return {{"build_problem_seconds", run.build_problem_seconds},
          {"build_seconds", run.build_seconds},
          {"total_seconds", run.total_seconds},
          {"peak_memory_mb", run.peak_memory_mb},
          {"stop_reason", run.stop_reason},
          {"iterations", run.num_iterations},
          {"linearise_seconds", run.linearise_seconds},
          {"eliminate_seconds", run.eliminate_seconds},
          {"factorise_seconds", run.factorise_seconds},
          {"back_substitute_seconds", run.back_substitute_seconds},
          {"seconds", run.seconds},
          {"log", log}};
}

nlohmann::json ResultToJson(const SolverResult& of, double best_cost) {
  const SolverScore score = ScoreOf(of, best_cost);
  nlohmann::json json = {{"solver", of.competitor.name}, {"threads", of.competitor.num_threads}};
  json["is_native"] = of.competitor.IsNative();
  if (!score.failure.empty()) {
    json["failure"] = score.failure;
    return json;
  }
  json["is_exact"] = score.is_exact;
  json["linear_solver"] = of.timed.front().used_solver;
  json["seconds_per_iteration"] = OptionalToJson(score.seconds_per_iteration);
  json["seconds_to_1_percent"] = OptionalToJson(score.seconds_to_1_percent);
  json["seconds_to_01_percent"] = OptionalToJson(score.seconds_to_01_percent);
  json["seconds_per_call"] = OptionalToJson(score.seconds_per_call);
  json["seconds_of_covariances"] = OptionalToJson(MedianOfAny(of.covariances.seconds));
  json["build_problem_seconds"] = score.build_problem_seconds;
  json["peak_memory_mb"] = score.peak_memory_mb;
  json["initial_cost"] = score.initial_cost;
  json["final_cost"] = score.final_cost;
  json["timed"] = json["converged"] = nlohmann::json::array();
  for (const SolverRun& run : of.timed) json["timed"].push_back(RunToJson(run));
  for (const SolverRun& run : of.converged) json["converged"].push_back(RunToJson(run));
  return json;
}

}  // namespace

SolverScore ScoreOf(const SolverResult& result, double best_cost) {
  SolverScore score;
  if (!result.skipped.empty()) {
    score.failure = "skipped: " + result.skipped;
    return score;
  }
  for (const auto* runs : {&result.timed, &result.converged}) {
    for (const SolverRun& run : *runs) {
      if (!run.failure.empty()) score.failure = "failed: " + run.failure;
    }
  }
  if (result.timed.empty()) score.failure = "not run";
  if (!score.failure.empty()) return score;

  score.is_exact = TakesExactSteps(result.timed.front().used_solver);
  for (const SolverRun& run : result.timed) {
    const auto median = MedianOfAny(run.seconds);
    if (median && !(score.seconds_per_iteration <= median && score.seconds_per_iteration)) {
      score.seconds_per_iteration = median;
    }
    score.peak_memory_mb = std::max(score.peak_memory_mb, run.peak_memory_mb);
  }
  std::vector<double> to_1, to_01, build;
  for (const SolverRun& run : result.converged) {
    build.push_back(run.build_problem_seconds);
    if (const auto t = TimeToCost(run.build_seconds, run.log, 1.01 * best_cost)) to_1.push_back(*t);
    if (const auto t = TimeToCost(run.build_seconds, run.log, 1.001 * best_cost)) {
      to_01.push_back(*t);
    }
  }
  if (!result.converged.empty()) {
    // Which cost is reached may hang on the order of additions in threads: then it was not reached.
    if (to_1.size() == result.converged.size()) score.seconds_to_1_percent = MedianOfAny(to_1);
    if (to_01.size() == result.converged.size()) score.seconds_to_01_percent = MedianOfAny(to_01);
    const SolverRun& last = result.converged.back();
    score.initial_cost = last.initial_cost;
    score.final_cost = last.final_cost;
    score.iterations = last.num_iterations;
    score.build_problem_seconds = MedianOfAny(build).value_or(0.0);
  }
  score.seconds_per_call = MedianOfAny(result.calls.seconds);
  return score;
}

double BestCost(const SolverBenchProblemResult& problem) {
  double best = kInfinity;
  for (const SolverResult& of : problem.results) {
    for (const auto* runs : {&of.timed, &of.converged}) {
      for (const SolverRun& run : *runs) {
        if (run.failure.empty()) best = std::min(best, run.final_cost);
      }
    }
  }
  return best;
}

SolverBenchResult BenchSolvers(const SolverBenchOptions& options) {
  SolverBenchResult result;
  for (const Competitor& c : options.competitors) {
    result.all_threads = std::max(result.all_threads, c.num_threads);
  }
  result.peak_gflops_one = MeasurePeakGflops(1);
  result.peak_gflops_all = MeasurePeakGflops(result.all_threads);
  for (const SolverProblemSource& source : SolverProblemSources(options.problems)) {
    const SolverProblem problem = source.make();
    SolverBenchProblemResult of;
    of.name = problem.name;
    of.is_local = problem.is_local;
    Describe(problem, &of);
    LogInfo("{}: {} images, {} features, {} residuals", of.name, of.num_images, of.num_features,
            of.num_residuals);
    RunAll(options, problem, &of);
    // What is measured is not lost if a later problem is interrupted.
    LogInfo("{}", DetailTable(result, of).Markdown());
    result.problems.push_back(std::move(of));
  }
  return result;
}

std::vector<Table> SolverTables(const SolverBenchResult& result) {
  std::vector<Table> tables = {ProblemsTable(result)};
  for (const SolverBenchProblemResult& problem : result.problems) {
    tables.push_back(DetailTable(result, problem));
  }
  if (auto calls = CallsTable(result)) tables.push_back(*std::move(calls));
  if (auto covariances = CovariancesTable(result)) tables.push_back(*std::move(covariances));
  tables.push_back(SummaryTable(result));
  return tables;
}

nlohmann::json SolverBenchToJson(const SolverBenchResult& result) {
  nlohmann::json problems = nlohmann::json::array();
  for (const SolverBenchProblemResult& p : result.problems) {
    const double best_cost = BestCost(p);
    nlohmann::json solvers = nlohmann::json::array();
    for (const SolverResult& of : p.results) solvers.push_back(ResultToJson(of, best_cost));
    problems.push_back(
        {{"name", p.name},
         {"images", p.num_images},
         {"features", p.num_features},
         {"residuals", p.num_residuals},
         {"reduced_unknowns", p.num_kept_unknowns},
         {"reduced_density", p.density},
         {"least_cost", std::isfinite(best_cost) ? nlohmann::json(best_cost) : nlohmann::json()},
         {"flops",
          {{"linearise", p.flops.linearise},
           {"eliminate", p.flops.eliminate},
           {"dense_factor", p.flops.dense_factor},
           {"sparse_factor", p.flops.sparse_factor},
           {"back_substitute", p.flops.back_substitute},
           {"total", p.flops.Total()}}},
         {"solvers", solvers}});
  }
  return {{"machine",
           {{"peak_gflops_one_thread", result.peak_gflops_one},
            {"peak_gflops_all_threads", result.peak_gflops_all},
            {"all_threads", result.all_threads}}},
          {"problems", problems}};
}

}  // namespace holba
