// SPDX-License-Identifier: BSD-3-Clause
// Every piece of the fused pass against dense normal equations: the reduced system, its right hand
// side, the step of the features, what the model promises, covariances; for every instruction set,
// both forms of the Schur complement, and every number of threads.
#include "holba/solver/native/normal_equations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "holba/base/random.h"
#include "holba/linear/reduced_solver.h"
#include "holba/solver/covariance.h"

namespace holba::native {
namespace {

// r_k = sum over all coordinates x of c_k(x) sin(x) - 1, absent where the first one is above 2.
struct WavyKernel {
  struct Datum {
    uint64_t seed;
  };
  int dim;
  std::vector<int> tangents;
  bool Evaluate(const Datum& datum, const double* const* values, double* r,
                double* const* jacobians) const {
    if (values[0][0] > 2.0) return false;
    Random random(datum.seed);
    for (int k = 0; k < dim; ++k) r[k] = -1.0;
    for (size_t s = 0; s < tangents.size(); ++s) {
      for (int k = 0; k < dim; ++k) {
        for (int j = 0; j < tangents[s]; ++j) {
          const double c = random.Normal();
          r[k] += c * std::sin(values[s][j]);
          if (jacobians[s]) jacobians[s][k * tangents[s] + j] = c * std::cos(values[s][j]);
        }
      }
    }
    return true;
  }
};

// Features of 3, 4 and 2 degrees of freedom, poses, cameras (one each, or one for all), groups of
// several sizes; residuals with and without features, some of them absent; constant and held
// blocks. Or `plain`: many points and lines with their observations and little else, cameras held
// unless each pose has its own.
struct WavyProblem {
  Problem problem;
  std::vector<BlockId> poses, cameras, groups, features;

  WavyProblem(bool own_cameras, LossType loss, uint64_t seed, bool plain = false) {
    const int num_poses = 7;
    Random random(seed);
    const auto add = [&](std::string_view kind, int size, BlockRole role) {
      std::vector<double> values(size);
      for (double& v : values) v = random.Uniform(-0.8, 0.8);
      return problem.AddBlock(kind, EuclideanOps(size), role, values);
    };
    for (int i = 0; i < num_poses; ++i) {
      poses.push_back(add("pose", 6, BlockRole::kPose));
      if (own_cameras || i == 0) {
        cameras.push_back(add("camera", 5, BlockRole::kIntrinsics));
        problem.block(cameras.back()).held = 0b00110;
        problem.block(cameras.back()).constant = plain && !own_cameras;
      } else {
        cameras.push_back(cameras[0]);
      }
    }
    groups = {add("plane", 3, BlockRole::kGroup), add("plane", 3, BlockRole::kGroup),
              add("cuboid", 9, BlockRole::kGroup), add("plane", 3, BlockRole::kGroup)};
    problem.block(groups[3]).constant = true;
    problem.block(poses[0]).constant = !plain;
    problem.block(poses[1]).held = 0b001000;
    const auto batch_of = [&](const char* term, int dim, const std::vector<int>& tangents) {
      auto batch =
          std::make_unique<KernelBatch<WavyKernel>>(term, dim, tangents, WavyKernel{dim, tangents});
      batch->loss = {loss, 1.5};
      batch->weight = 1.7;
      return batch;
    };
    auto points = batch_of("point", 2, {3, 6, 5}), lines = batch_of("line", 4, {4, 6, 5}),
         small = batch_of("small", 1, {2, 6, 5}), on_plane = batch_of("group", 2, {3, 6, 5, 3}),
         on_cuboid = batch_of("group", 2, {3, 6, 5, 9}), vp = batch_of("vp", 3, {4, 3}),
         relation = batch_of("relation", 1, {3, 9}), prior = batch_of("prior", 6, {6}),
         intrinsics = batch_of("intrinsics", 5, {5}), sizes = batch_of("sizes", 3, {3}),
         box = batch_of("box", 6, {9});
    uint64_t datum = seed * 1000;
    for (int f = 0; f < (plain ? 300 : 60); ++f) {
      const int tangent = plain ? 3 + f % 2 : f % 3 == 0 ? 4 : f % 3 == 1 ? 3 : f % 2 == 0 ? 3 : 2;
      const BlockId feature = add("feature", tangent, BlockRole::kFeature);
      features.push_back(feature);
      if (f == 11) problem.block(feature).constant = true;
      if (f == 13) problem.block(feature).held = 0b010;
      if (f == 16) problem.values(feature)[0] = 2.5;  // absent
      KernelBatch<WavyKernel>& batch = tangent == 4 ? *lines : tangent == 3 ? *points : *small;
      for (int k = 0; k < num_poses; ++k) {
        const int i = f % 5 == 0 ? num_poses - 1 - k : k;
        if (i >= 3 && random.Uniform(0, 1) < 0.4) continue;
        batch.Add(std::array{feature, poses[i], cameras[i]}, {++datum});
        if (plain) continue;
        if (tangent == 3 && f % 2 == 1)
          on_plane->Add(std::array{feature, poses[i], cameras[i], groups[f % 4 == 3 ? 3 : f % 2]},
                        {++datum});
        if (tangent == 3 && f % 4 == 0)
          on_cuboid->Add(std::array{feature, poses[i], cameras[i], groups[2]}, {++datum});
      }
      if (tangent == 4 && !plain) vp->Add(std::array{feature, groups[f % 2]}, {++datum});
    }
    relation->Add(std::array{groups[0], groups[2]}, {++datum});
    relation->Add(std::array{groups[3], groups[2]}, {++datum});
    // Enough on their own for full rank.
    for (BlockId pose : poses) prior->Add(std::array{pose}, {++datum});
    // A camera that a residual sees without its pose is a node of its own.
    for (size_t i = 0; i < (plain ? 0 : own_cameras ? cameras.size() : 1); ++i)
      intrinsics->Add(std::array{cameras[i]}, {++datum});
    for (int g : {0, 1, 3}) sizes->Add(std::array{groups[g]}, {++datum});
    for (int repeat = 0; repeat < 2; ++repeat) box->Add(std::array{groups[2]}, {++datum});
    for (auto* batch : {&points, &lines, &small, &on_plane, &on_cuboid, &vp, &relation, &prior,
                        &intrinsics, &sizes, &box})
      problem.AddBatch(std::move(*batch));
  }
};

// The whole of J and r, weighted, over the free coordinates of all blocks; and the places of the
// blocks' coordinates among them (-1: none).
struct DenseSystem {
  Eigen::MatrixXd J;
  Eigen::VectorXd r;
  std::vector<std::vector<int>> place;
  double cost = 0.0;

  explicit DenseSystem(const Problem& problem) {
    int columns = 0;
    for (BlockId id = 0; id < problem.num_blocks(); ++id) {
      const ParameterBlock& block = problem.block(id);
      auto& of_block = place.emplace_back(block.manifold->tangent, -1);
      for (int i = 0; i < block.manifold->tangent; ++i) {
        if (!block.constant && !(block.held >> i & 1)) of_block[i] = columns++;
      }
    }
    int rows = 0;
    for (const auto& batch : problem.batches())
      rows += static_cast<int>(batch->size()) * batch->dim();
    J.setZero(rows, columns);
    r.setZero(rows);
    int row = 0;
    for (const auto& batch : problem.batches()) {
      for (size_t i = 0; i < batch->size(); ++i, row += batch->dim()) {
        double residual[kMaxResidualDim], jacobian[kMaxSlots][kMaxResidualDim * kMaxTangent];
        bool present = false;
        ResidualPanel panel;
        panel.residuals = residual;
        panel.present = &present;
        for (int s = 0; s < batch->num_slots(); ++s) panel.jacobians[s] = jacobian[s];
        batch->Evaluate(i, i + 1, problem.Reader(), panel);
        if (!present) continue;
        double squares = 0.0, rho[3];
        for (int k = 0; k < batch->dim(); ++k) squares += residual[k] * residual[k];
        batch->loss.Evaluate(squares, rho);
        cost += 0.5 * batch->weight * rho[0];
        const double w = std::sqrt(batch->weight * rho[1]);
        for (int k = 0; k < batch->dim(); ++k) {
          r(row + k) = w * residual[k];
          for (int s = 0; s < batch->num_slots(); ++s) {
            for (int j = 0; j < batch->tangent(s); ++j) {
              const int c = place[batch->block(i, s)][j];
              if (c >= 0) J(row + k, c) = w * jacobian[s][k * batch->tangent(s) + j];
            }
          }
        }
      }
    }
  }
};

// Of the plain vector of kept unknowns: its coordinate in the dense system, -1 for a held one.
std::vector<int> PlacesOfKept(const NormalEquations& equations, const DenseSystem& dense) {
  const Structure& structure = equations.structure();
  std::vector<int> places(equations.pattern().num_unknowns, -1);
  for (BlockId id : structure.node_blocks) {
    const Columns& columns = structure.block_columns[id];
    const size_t at =
        equations.pattern().offset[structure.kept[id].node] + structure.kept[id].first;
    for (int c = 0; c < columns.count; ++c) places[at + c] = dense.place[id][columns.tangent[c]];
  }
  return places;
}

struct Case {
  bool own_cameras;
  LossType loss;
  bool plain = false;
};

class NormalEquationsOf : public testing::TestWithParam<Case> {
 protected:
  void TearDown() override { SetSimdTarget(best_); }
  const SimdTarget best_ = CurrentSimdTarget();
};

std::vector<SimdTarget> SupportedTargets() {
  std::vector<SimdTarget> targets;
  for (SimdTarget target :
       {SimdTarget::kScalar, SimdTarget::kVec128, SimdTarget::kVec256, SimdTarget::kVec512}) {
    if (IsSupported(target)) targets.push_back(target);
  }
  return targets;
}

TEST_P(NormalEquationsOf, AreThoseOfTheDenseSystem) {
  WavyProblem wavy(GetParam().own_cameras, GetParam().loss, 3, GetParam().plain);
  const Problem& problem = wavy.problem;
  const DenseSystem dense(problem);
  const double radius = 20.0;
  Eigen::MatrixXd H = dense.J.transpose() * dense.J;
  const Eigen::VectorXd g = dense.J.transpose() * dense.r;
  for (int i = 0; i < H.rows(); ++i) {
    const double d = H(i, i);
    H(i, i) += std::max(d, 1e-6 * std::pow(1.0 + std::sqrt(d), 2)) / radius;
  }
  const Eigen::VectorXd step = -H.ldlt().solve(g);
  const double promised =
      0.5 * (dense.r + dense.J * step).squaredNorm() - 0.5 * dense.r.squaredNorm();
  // The Schur complement the slow way.
  std::vector<int> kept, eliminated;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    for (int c : dense.place[id]) {
      if (c >= 0) (IsKept(problem.block(id).role) ? kept : eliminated).push_back(c);
    }
  }
  const Eigen::MatrixXd V_inverse_W =
      Eigen::MatrixXd(H(eliminated, eliminated)).ldlt().solve(Eigen::MatrixXd(H(eliminated, kept)));
  const Eigen::MatrixXd S = H(kept, kept) - H(kept, eliminated) * V_inverse_W;
  const Eigen::VectorXd b = -(g(kept) - V_inverse_W.transpose() * g(eliminated));
  std::vector<int> kept_idx(H.rows(), -1);
  for (size_t i = 0; i < kept.size(); ++i) kept_idx[kept[i]] = static_cast<int>(i);

  for (SimdTarget target : SupportedTargets()) {
    SCOPED_TRACE(std::string(NameOf(target)));
    SetSimdTarget(target);
    for (SchurForm form :
         {SchurForm::kExplicit, SchurForm::kImplicit, SchurForm::kImplicitWithBorder}) {
      NormalEquations equations;
      equations.Begin(problem, 2);
      equations.SetForm(form);
      // Plain chunks come in all shapes but for cameras of their own, whose lines take 9 unknowns.
      std::set<int> plain_tangents;
      for (const Chunk& chunk : equations.structure().chunks) {
        if (chunk.plain) plain_tangents.insert(chunk.feature_tangent);
      }
      EXPECT_EQ(plain_tangents, !GetParam().plain        ? std::set<int>()
                                : GetParam().own_cameras ? std::set<int>({3})
                                                         : std::set<int>({3, 4}));
      Linearisation linearisation;
      equations.Linearise(radius, &linearisation);
      EXPECT_NEAR(linearisation.cost.total, dense.cost, 1e-12 * dense.cost);
      EXPECT_NEAR(linearisation.max_gradient, g.cwiseAbs().maxCoeff(), 1e-11);
      const std::vector<int> places = PlacesOfKept(equations, dense);
      const size_t n = places.size();
      ASSERT_GT(n, 40u);
      // Its product with every unit vector; in implicit form from U and T.
      const double tolerance =
          form == SchurForm::kExplicit ? 1e-10 : 2e-5;  // T is single precision
      const Eigen::MatrixXd U =
          form != SchurForm::kExplicit ? equations.U().ToDense() : Eigen::MatrixXd();
      const Eigen::MatrixXd matrix = equations.matrix().ToDense();
      std::vector<double> unit(n), column(n);
      std::vector<int> node_of(n);
      for (int node = 0; node < equations.pattern().num_nodes(); ++node) {
        for (size_t i = equations.pattern().offset[node]; i < equations.pattern().offset[node + 1];
             ++i)
          node_of[i] = node;
      }
      for (size_t j = 0; j < n; ++j) {
        unit.assign(n, 0.0);
        unit[j] = 1.0;
        if (form != SchurForm::kExplicit) equations.MultiplyEliminated(unit.data(), column.data());
        for (size_t i = 0; i < n; ++i) {
          const double found = form == SchurForm::kExplicit ? matrix(i, j) : U(i, j) - column[i];
          const double expected = places[i] < 0 || places[j] < 0
                                      ? (i == j ? 1.0 : 0.0)
                                      : S(kept_idx[places[i]], kept_idx[places[j]]);
          ASSERT_NEAR(found, expected, tolerance * (1.0 + std::abs(expected))) << i << " " << j;
          // The preconditioner's blocks are those of S: the diagonal ones, and the border's.
          const bool is_preconditioned = form == SchurForm::kImplicitWithBorder
                                             ? matrix(i, j) != 0.0
                                             : node_of[i] == node_of[j];
          if (form != SchurForm::kExplicit && is_preconditioned && places[i] >= 0 &&
              places[j] >= 0) {
            ASSERT_NEAR(matrix(i, j), expected, 1e-10 * (1.0 + std::abs(expected)));
          }
        }
      }
      std::vector<double> kept_step(n);
      for (size_t i = 0; i < n; ++i) {
        if (places[i] < 0) {
          EXPECT_EQ(equations.rhs()[i], 0.0);
          continue;
        }
        EXPECT_NEAR(equations.rhs()[i], b(kept_idx[places[i]]), 1e-9);
        kept_step[i] = step(places[i]);
      }
      // The features follow, and all moves as the dense step says.
      Trial trial;
      equations.Step(kept_step, &trial);
      EXPECT_NEAR(trial.model_change, promised, 1e-9 * std::abs(promised));
      Problem* moved = &wavy.problem;
      const std::vector<double> start = moved->state();
      double step_squares = 0.0;
      for (BlockId id = 0; id < problem.num_blocks(); ++id) {
        const size_t at = problem.values(id) - problem.state().data();
        for (size_t i = 0; i < dense.place[id].size(); ++i) {
          const int c = dense.place[id][i];
          const double change = equations.trial_state()[at + i] - start[at + i];
          ASSERT_NEAR(change, c < 0 ? 0.0 : step(c), 1e-9) << problem.block(id).kind;
          step_squares += change * change;
        }
      }
      EXPECT_NEAR(trial.step_norm, std::sqrt(step_squares), 1e-12);
      moved->state() = equations.trial_state();
      double cost = 0.0;
      for (const TermCost& term : EvaluateTerms(*moved)) cost += term.cost;
      moved->state() = start;
      trial.cost.CountAppeared();
      EXPECT_NEAR(trial.cost.total, cost, 1e-11 * cost);
    }
  }
}

TEST_P(NormalEquationsOf, GiveTheCovariancesOfTheDenseSystem) {
  WavyProblem wavy(GetParam().own_cameras, GetParam().loss, 4, GetParam().plain);
  wavy.problem.values(wavy.features[16])[0] = 0.1;  // no longer absent
  const DenseSystem dense(wavy.problem);
  const Eigen::MatrixXd H = dense.J.transpose() * dense.J;
  const Eigen::MatrixXd expected = H.ldlt().solve(Eigen::MatrixXd::Identity(H.rows(), H.cols()));
  for (SimdTarget target : SupportedTargets()) {
    SetSimdTarget(target);
    const std::optional<Covariance> covariance = Covariance::Compute(wavy.problem, 2);
    ASSERT_TRUE(covariance.has_value());
    const auto expect_block = [&](BlockId a, BlockId b, const Eigen::MatrixXd& found) {
      for (int i = 0; i < found.rows(); ++i) {
        for (int j = 0; j < found.cols(); ++j) {
          const int p = dense.place[a][i], q = dense.place[b][j];
          const double value = p < 0 || q < 0 ? 0.0 : expected(p, q);
          const double scale = p < 0 || q < 0 ? 1.0 : std::sqrt(expected(p, p) * expected(q, q));
          EXPECT_NEAR(found(i, j), value, 1e-8 * scale)
              << wavy.problem.block(a).kind << " " << wavy.problem.block(b).kind;
        }
      }
    };
    for (BlockId id = 0; id < wavy.problem.num_blocks(); ++id)
      expect_block(id, id, covariance->Of(id));
    const BlockId other = GetParam().plain ? wavy.poses[3] : wavy.groups[2];
    const auto between = covariance->Between(wavy.poses[2], other);
    ASSERT_TRUE(between.has_value());
    expect_block(wavy.poses[2], other, *between);
    const auto turned = covariance->Between(other, wavy.poses[2]);
    EXPECT_EQ(*turned, between->transpose());
    EXPECT_FALSE(covariance->Between(wavy.features[0], wavy.poses[2]).has_value());
  }
  // A feature with more unknowns than residuals is nowhere, and leaves the others what they are.
  const double zeros[4] = {};
  const BlockId weak =
      wavy.problem.AddBlock("feature", EuclideanOps(4), BlockRole::kFeature, zeros);
  auto batch =
      std::make_unique<KernelBatch<WavyKernel>>("weak", 2, std::vector<int>{4}, WavyKernel{2, {4}});
  batch->Add(std::array{weak}, {1});
  wavy.problem.AddBatch(std::move(batch));
  const std::optional<Covariance> covariance = Covariance::Compute(wavy.problem, 2);
  ASSERT_TRUE(covariance.has_value());
  EXPECT_EQ(covariance->Of(weak)(0, 0), std::numeric_limits<double>::infinity());
  const int place = dense.place[wavy.poses[2]][1];
  EXPECT_NEAR(covariance->Of(wavy.poses[2])(1, 1), expected(place, place), 1e-8);
}

INSTANTIATE_TEST_SUITE_P(
    Cases, NormalEquationsOf,
    testing::Values(Case{false, LossType::kTrivial}, Case{true, LossType::kTrivial},
                    Case{false, LossType::kCauchy}, Case{true, LossType::kHuber},
                    Case{false, LossType::kTrivial, true}, Case{true, LossType::kCauchy, true}));

TEST(NormalEquations, HaveNoCovarianceWhereTheGaugeIsFree) {
  WavyProblem wavy(false, LossType::kTrivial, 5);
  // A pose that nothing but a single scalar residual sees.
  const double zeros[6] = {};
  const BlockId pose = wavy.problem.AddBlock("pose", EuclideanOps(6), BlockRole::kPose, zeros);
  auto batch =
      std::make_unique<KernelBatch<WavyKernel>>("weak", 1, std::vector<int>{6}, WavyKernel{1, {6}});
  batch->Add(std::array{pose}, {1});
  wavy.problem.AddBatch(std::move(batch));
  EXPECT_FALSE(Covariance::Compute(wavy.problem, -1).has_value());
}

TEST(NormalEquations, AreTheSameBitForBitForEveryNumberOfThreads) {
  for (SchurForm form : {SchurForm::kExplicit, SchurForm::kImplicit}) {
    std::vector<std::vector<double>> found;
    for (int threads : {1, 2, 3, 5}) {
      WavyProblem wavy(false, LossType::kCauchy, 6, 40);
      NormalEquations equations;
      equations.Begin(wavy.problem, threads);
      equations.SetForm(form);
      Linearisation linearisation;
      equations.Linearise(10.0, &linearisation);
      std::vector<double> all(equations.rhs().begin(), equations.rhs().end());
      const std::vector<double> step = all;
      all.insert(all.end(), equations.matrix().values.data(),
                 equations.matrix().values.data() + equations.matrix().values.size());
      Trial trial;
      equations.Step(step, &trial);
      all.insert(all.end(), equations.trial_state().begin(), equations.trial_state().end());
      all.push_back(trial.cost.total);
      all.push_back(trial.model_change);
      found.push_back(std::move(all));
    }
    for (const auto& other : found) {
      ASSERT_EQ(other.size(), found[0].size());
      EXPECT_EQ(std::memcmp(other.data(), found[0].data(), other.size() * sizeof(double)), 0);
    }
  }
}

}  // namespace
}  // namespace holba::native
