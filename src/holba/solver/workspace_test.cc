// SPDX-License-Identifier: BSD-3-Clause
// What a workspace keeps from one solve to the next changes no bit, and saves the memory of all but
// the first.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <new>
#include <string>

#include "holba/solver/small_bundle_testing.h"
#include "holba/solver/solver.h"

namespace {
std::atomic<size_t> allocated_bytes = 0;

void* Allocate(size_t size, size_t alignment) {
  allocated_bytes += size;
  void* memory = nullptr;
  if (posix_memalign(&memory, std::max(alignment, sizeof(void*)), size) != 0)
    throw std::bad_alloc();
  return memory;
}
}  // namespace

void* operator new(size_t size) { return Allocate(size, __STDCPP_DEFAULT_NEW_ALIGNMENT__); }
void* operator new(size_t size, std::align_val_t alignment) {
  return Allocate(size, static_cast<size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, size_t, std::align_val_t) noexcept { std::free(memory); }

namespace holba {
namespace {

class Workspace : public testing::TestWithParam<LinearSolver> {
 protected:
  Workspace() {
    options.linear_solver = GetParam();
    options.num_threads = 2;
    options.max_num_iterations = 6;
    options.function_tolerance = options.gradient_tolerance = options.parameter_tolerance = 0.0;
  }
  SolverOptions options;
};
std::string NameOfForm(const testing::TestParamInfo<LinearSolver>& info) {
  const char* const names[] = {"Auto", "Dense", "Sparse", "Iterative"};
  return names[static_cast<size_t>(info.param)];
}
INSTANTIATE_TEST_SUITE_P(Forms, Workspace,
                         testing::Values(LinearSolver::kAuto, LinearSolver::kDense,
                                         LinearSolver::kSparse, LinearSolver::kIterative),
                         NameOfForm);

TEST_P(Workspace, ChangesNoBitWhateverWasSolvedBefore) {
  SolverWorkspace workspace;
  // The same structure with other values; another loss; other blocks held; other sizes; back again.
  const auto make = [](int variant) {
    auto bundle = variant == 4 ? std::make_unique<SmallBundle>(0.5, true, LossType::kTrivial, 90, 9)
                               : std::make_unique<SmallBundle>(
                                     0.5, variant != 3,
                                     variant == 2 ? LossType::kCauchy : LossType::kTrivial);
    bundle->Perturb(variant == 1 ? 8 : 7);
    return bundle;
  };
  for (int variant : {0, 0, 1, 2, 3, 4, 4, 0}) {
    const auto with = make(variant), without = make(variant);
    const SolverSummary a = Solve(options, &with->problem, &workspace);
    const SolverSummary b = Solve(options, &without->problem);
    EXPECT_EQ(with->problem.state(), without->problem.state()) << variant;
    EXPECT_EQ(a.final_cost, b.final_cost);
    EXPECT_EQ(a.linear_solver, b.linear_solver);
    EXPECT_LT(a.final_cost, 0.5 * a.initial_cost);
  }
}

TEST_P(Workspace, LeavesNextToNothingToAllocateForTheSameStructure) {
  SolverWorkspace workspace;
  SmallBundle bundle(0.5, true, LossType::kTrivial, 400, 8);
  bundle.Perturb(1);
  const std::vector<double> start = bundle.problem.state();
  const auto bytes_of_a_solve = [&] {
    bundle.problem.state() = start;
    const size_t before = allocated_bytes;
    Solve(options, &bundle.problem, &workspace);
    return allocated_bytes - before;
  };
  EXPECT_GT(bytes_of_a_solve(), 100'000u) << "the first one lays out its memory";
  // The summary, and what it reports of terms and iterations.
  EXPECT_LT(bytes_of_a_solve(), 4'000u);
  EXPECT_LT(bytes_of_a_solve(), 4'000u);
}

}  // namespace
}  // namespace holba
