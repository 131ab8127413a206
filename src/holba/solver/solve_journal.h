// SPDX-License-Identifier: BSD-3-Clause
// What a long adjustment has to remember to go on after it was stopped. An adjustment is a fixed
// sequence of solves with computations between them that only depend on their results. So the
// journal keeps the result of each solve that is done, and of the one under way the state of its
// loop every few iterations: run again with the journal, the adjustment takes the results that are
// there and goes on with the loop where it was, to the same end bit for bit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "holba/problem/problem.h"
#include "holba/solver/solver.h"

namespace holba {

// The value of a residual when it was last present (contract 5 of ARCHITECTURE.md).
struct RememberedResidual {
  uint32_t batch = 0, residual = 0;
  double values[kMaxResidualDim] = {};
};

// The state of Levenberg-Marquardt between two iterations.
struct LoopState {
  double radius = 0.0, shrink = 0.0;
  double cost = 0.0;
  std::vector<double> state;
  std::vector<RememberedResidual> remembered;
  SolverSummary summary;  // so far
};

class SolveJournal {
 public:
  // Where records are kept. `folder` is named in messages; write must replace a record as a whole
  // or not at all; read gives nothing where there is no such record.
  struct Store {
    std::filesystem::path folder;
    std::function<void(const std::string& name, const std::string& bytes)> write;
    std::function<std::optional<std::string>(const std::string& name)> read;
  };

  // Saves the loop every `interval` iterations. `resume`: goes on from the records that are there.
  SolveJournal(Store store, int interval, bool resume);

  // For Solve, in the order of the solves. The summary of a solve that is done, whose result is put
  // into the problem. Throws InputError for a record that is damaged or belongs to another problem.
  std::optional<SolverSummary> Begin(Problem* problem);
  void End(const Problem& problem, const SolverSummary& summary);

  // For the loop: where it was, of the solve that Begin was called for.
  const std::optional<LoopState>& loop() const { return loop_; }
  bool IsDue(int iteration) const { return iteration > 0 && iteration % interval_ == 0; }
  void Save(const LoopState& loop);

 private:
  struct Record;
  std::string SolveName() const;
  std::optional<Record> Read(const std::string& name) const;
  void Write(const std::string& name, const Record& record) const;

  Store store_;
  int interval_;
  bool resume_;
  uint64_t solve_idx_ = 0;
  uint64_t problem_hash_ = 0;  // of the problem at the beginning of the solve
  std::optional<LoopState> loop_;
};

}  // namespace holba
