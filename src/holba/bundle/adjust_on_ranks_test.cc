// SPDX-License-Identifier: BSD-3-Clause
// Whole adjustments, with their rounds of losses and associations, by the backend petsc on any
// number of ranks: the optimum of the native solver, and the same after a stop. ctest runs this
// program alone and under mpirun. In builds without PETSc the native backend is stopped alone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>

#include "holba/base/error.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/solver/backend.h"
#include "holba/solver/ranks.h"
#include "holba/solver/solve_journal.h"
#include "holba/synthetic/bundle_problem.h"
#include "holba/synthetic/point_graph.h"

namespace holba {
namespace {

using testing::HasSubstr;

bool HasPetsc() {
  for (const BackendEntry& entry : AllBackends()) {
    if (entry.backend == Backend::kPetsc) return true;
  }
  return false;
}

SolverOptions Tight(Backend backend) {
  SolverOptions options;
  options.backend = backend;
  options.num_threads = 1;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-13;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 0.0;
  return options;
}

// Largest difference of a coordinate of a pose; positions in units of the scene.
double PoseDifference(const Reconstruction& a, const Reconstruction& b) {
  double largest = 0.0;
  for (const auto& [id, frame] : a.frames) {
    const Rigid3d &p = frame.rig_from_world, &q = b.frames.at(id).rig_from_world;
    const double sign = p.rotation.coeffs().dot(q.rotation.coeffs()) < 0.0 ? -1.0 : 1.0;
    largest =
        std::max({largest, (p.rotation.coeffs() - sign * q.rotation.coeffs()).cwiseAbs().maxCoeff(),
                  (p.translation - q.translation).cwiseAbs().maxCoeff()});
  }
  return largest;
}

struct Scene {
  std::string name;
  LinearSolver linear_solver = LinearSolver::kAuto;
  SyntheticProblem (*make)();
};

class OnRanks : public testing::TestWithParam<Scene> {
 protected:
  void SetUp() override {
    if (!HasPetsc()) GTEST_SKIP() << "this build has no PETSc";
  }
};

TEST_P(OnRanks, AdjustmentsFindTheOptimumOfTheNativeSolver) {
  const SyntheticProblem scene = GetParam().make();
  SolverOptions solver = Tight(Backend::kPetsc);
  solver.linear_solver = GetParam().linear_solver;
  const BundleOptions bundle;
  Reconstruction with = scene.perturbed, again = scene.perturbed, native = scene.perturbed;
  const BundleSummary a = AdjustBundle(bundle, solver, &with);
  const BundleSummary b = AdjustBundle(bundle, solver, &again);
  const BundleSummary c = AdjustBundle(bundle, Tight(Backend::kNative), &native);
  EXPECT_NEAR(a.solver.final_cost, c.solver.final_cost, 1e-9 * c.solver.final_cost);
  EXPECT_LT(PoseDifference(with, native), 1e-6);
  EXPECT_EQ(a.groups_dropped, c.groups_dropped);
  // Repeatable for a number of ranks.
  EXPECT_EQ(a.solver.final_cost, b.solver.final_cost);
  EXPECT_EQ(PoseDifference(with, again), 0.0);
  EXPECT_EQ(a.solver.ranks.size(), ranks::Size() > 1 ? static_cast<size_t>(ranks::Size()) : 0u);
  size_t residuals = 0, of_terms = 0;
  for (const RankShare& rank : a.solver.ranks) residuals += rank.residuals;
  for (const TermCost& term : a.solver.final_terms) of_terms += term.residuals;
  if (ranks::Size() > 1) {
    EXPECT_EQ(residuals, of_terms);
  }
}

// Planes, vanishing points and primitives that features of all ranks belong to.
SyntheticProblem SharedStructure() {
  return MakeBundleProblem({.num_images = 30, .vps = true, .primitives = 1});
}
SyntheticProblem Corridor() {
  return MakeBundleProblem({.num_images = 30,
                            .layout = SceneLayout::kCorridor,
                            .visibility = Visibility::kNear,
                            .vps = true});
}
SyntheticProblem Rigs() {
  return MakeBundleProblem({.num_images = 24, .vps = true, .rig_size = 2});
}
SyntheticProblem Street() {
  return MakePointGraph({.num_images = 80, .observations_per_image = 100.0});
}
// As in BAL: each image has its own camera.
SyntheticProblem Collection() {
  return MakePointGraph({.kind = PointGraphKind::kCollection,
                         .num_images = 40,
                         .observations_per_image = 100.0,
                         .camera_per_image = true});
}

INSTANTIATE_TEST_SUITE_P(Scenes, OnRanks,
                         testing::Values(Scene{"SharedStructure", LinearSolver::kAuto,
                                               SharedStructure},
                                         Scene{"Corridor", LinearSolver::kAuto, Corridor},
                                         Scene{"Rigs", LinearSolver::kAuto, Rigs},
                                         Scene{"Street", LinearSolver::kSparse, Street},
                                         Scene{"Collection", LinearSolver::kAuto, Collection}),
                         [](const auto& info) { return info.param.name; });

// Records in memory. `most`: writes from this number on fail, as on a disk that is full.
struct MemoryStore {
  std::map<std::string, std::string> records;
  int writes = 0;

  SolveJournal::Store Get(int most = 1 << 30) {
    return {.folder = "checkpoint",
            .write =
                [this, most](const std::string& name, const std::string& bytes) {
                  if (++writes > most) throw InputError("checkpoint", "the disk is full");
                  records[name] = bytes;
                },
            .read = [this](const std::string& name) -> std::optional<std::string> {
              const auto it = records.find(name);
              return it == records.end() ? std::nullopt : std::optional(it->second);
            }};
  }
};

class Journal : public testing::TestWithParam<Backend> {
 protected:
  void SetUp() override {
    if (GetParam() == Backend::kPetsc && !HasPetsc()) GTEST_SKIP() << "this build has no PETSc";
  }
  static SyntheticProblem Make() { return MakeBundleProblem({.num_images = 10, .vps = true}); }
  SolverOptions Options(SolveJournal* journal) const {
    SolverOptions options;
    options.backend = GetParam();
    options.num_threads = 1;
    options.journal = journal;
    return options;
  }
};
INSTANTIATE_TEST_SUITE_P(Backends, Journal, testing::Values(Backend::kNative, Backend::kPetsc),
                         [](const auto& info) {
                           return info.param == Backend::kNative ? "Native" : "Petsc";
                         });

TEST_P(Journal, GoesOnToTheSameBits) {
  const SyntheticProblem scene = Make();
  Reconstruction undisturbed = scene.perturbed;
  const BundleSummary whole = AdjustBundle({}, Options(nullptr), &undisturbed);
  // Stopped at every third write of a record, in solves and between them.
  for (int stop = 1; stop < 40; stop += 3) {
    MemoryStore store;
    Reconstruction model = scene.perturbed;
    SolveJournal first(store.Get(stop), 2, false);
    bool stopped = false;
    try {
      AdjustBundle({}, Options(&first), &model);
    } catch (const InputError&) {
      stopped = true;
    }
    model = scene.perturbed;
    SolveJournal second(store.Get(), 2, true);
    const BundleSummary resumed = AdjustBundle({}, Options(&second), &model);
    EXPECT_EQ(PoseDifference(model, undisturbed), 0.0) << stop;
    EXPECT_EQ(resumed.solver.final_cost, whole.solver.final_cost) << stop;
    EXPECT_EQ(resumed.solver.iterations, whole.solver.iterations) << stop;
    EXPECT_EQ(resumed.rounds, whole.rounds);
    if (!stopped) {
      EXPECT_GT(stop, 4) << "there was nothing to stop";
      break;
    }
  }
}

TEST_P(Journal, RefusesRecordsThatAreCutDamagedOrOfAnotherAdjustment) {
  const SyntheticProblem scene = Make();
  MemoryStore store;
  Reconstruction model = scene.perturbed;
  SolveJournal first(store.Get(3), 2, false);
  EXPECT_THROW(AdjustBundle({}, Options(&first), &model), InputError);
  const auto resume = [&](MemoryStore with, const Reconstruction& start) -> std::string {
    Reconstruction copy = start;
    SolveJournal journal(with.Get(), 2, true);
    try {
      AdjustBundle({}, Options(&journal), &copy);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(resume(store, scene.perturbed), "");
  for (const auto& [name, bytes] : store.records) {
    for (const size_t size :
         {size_t{0}, size_t{10}, size_t{30}, bytes.size() / 2, bytes.size() - 1}) {
      MemoryStore cut = store;
      cut.records[name].resize(size);
      EXPECT_THAT(resume(cut, scene.perturbed), HasSubstr("cut short")) << name << " " << size;
    }
    MemoryStore damaged = store;
    damaged.records[name][bytes.size() / 2] ^= 1;
    EXPECT_THAT(resume(damaged, scene.perturbed), HasSubstr("damaged"));
  }
  Reconstruction other = scene.perturbed;
  other.points3D.begin()->second.xyz.x() += 0.1;
  EXPECT_THAT(resume(store, other), HasSubstr("another adjustment"));
}

}  // namespace
}  // namespace holba
