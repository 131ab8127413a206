// SPDX-License-Identifier: BSD-3-Clause
// A problem cut into parts has the residuals, the cost and the reduced system of the whole.
#include "holba/solver/distributed/cells.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "holba/solver/distributed/part_problem.h"
#include "holba/solver/small_bundle_testing.h"

namespace holba::distributed {
namespace {

using testing::Each;
using testing::Le;

double TotalCost(const Problem& problem) {
  double sum = 0.0;
  for (const TermCost& term : EvaluateTerms(problem)) sum += term.cost;
  return sum;
}

SmallBundle Street(bool refine_focal_length) {
  SmallBundle street(0.5, refine_focal_length, LossType::kCauchy, 300, 24, 4);
  street.Perturb(5);
  return street;
}

TEST(Partition, GivesEachResidualToThePartOfItsFeature) {
  const SmallBundle street = Street(true);
  const Partition partition = MakePartition(street.problem, 4);
  const ResidualBatch& batch = *street.problem.batches()[0];
  for (size_t i = 0; i < batch.size(); ++i) {
    const int part = partition.PartOfResidual(street.problem, batch, i);
    EXPECT_EQ(part, partition.part_of_block[batch.block(i, 0)]);
    EXPECT_GE(part, 0);
    EXPECT_LT(part, 4);
  }
}

TEST(Partition, BalancesWorkAndCutsAStreetAcross) {
  const SmallBundle street = Street(true);
  const Partition partition = MakePartition(street.problem, 3);
  EXPECT_LT(partition.Imbalance(), 1.15);
  // A cut of a street ends at the window of one feature: neighbours change parts twice.
  int changes = 0;
  for (size_t i = 1; i < street.poses.size(); ++i) {
    changes +=
        partition.part_of_block[street.poses[i]] != partition.part_of_block[street.poses[i - 1]];
  }
  EXPECT_EQ(changes, 2);
}

TEST(Partition, PutsWhatMostPartsTouchAtTheEndOfTheLastOne) {
  const SmallBundle street = Street(true);
  const Partition partition = MakePartition(street.problem, 3);
  EXPECT_TRUE(partition.is_border[street.camera]);
  EXPECT_EQ(partition.part_of_block[street.camera], 2);
  const CellLayout layout = MakeCellLayout(street.problem, partition);
  EXPECT_EQ(layout.num_border_cells, 1u);
  EXPECT_EQ(layout.place[street.camera].cell, layout.num_cells() - 1);
  EXPECT_EQ(layout.block_size, 6);
  EXPECT_THAT(layout.padded, Each(6)) << "two focal lengths are padded to the width of a pose";
}

TEST(Partition, HasEmptyPartsWhereThereAreMoreThanPoses) {
  const SmallBundle few(0.5, true, LossType::kTrivial, 3, 3);
  const Partition partition = MakePartition(few.problem, 8);
  size_t residuals = 0;
  for (int part = 0; part < 8; ++part)
    residuals += PartProblem(few.problem, partition, part).problem().num_residuals();
  EXPECT_EQ(residuals, few.problem.num_residuals());
}

TEST(PartProblem, CostsOfPartsAddUp) {
  const SmallBundle street = Street(false);
  const Partition partition = MakePartition(street.problem, 3);
  double sum = 0.0;
  for (int part = 0; part < 3; ++part)
    sum += TotalCost(PartProblem(street.problem, partition, part).problem());
  EXPECT_NEAR(sum, TotalCost(street.problem), 1e-12 * sum);
}

TEST(PartProblem, RenewTakesValuesAndLosses) {
  SmallBundle street = Street(false);
  const Partition partition = MakePartition(street.problem, 2);
  PartProblem part(street.problem, partition, 1);
  street.Perturb(6);
  street.problem.batches()[0]->loss.scale *= 3.0;
  street.problem.batches()[0]->weight = 2.0;
  part.Renew(street.problem);
  EXPECT_EQ(TotalCost(part.problem()),
            TotalCost(PartProblem(street.problem, partition, 1).problem()));
}

// Entries of the whole system in the order of cells, from its NormalEquations or from those of the
// parts.
struct WholeSystem {
  Eigen::MatrixXd S;
  Eigen::VectorXd gradient;
};
void AddPart(const Problem& whole, const Partition& partition, int part, const CellLayout& layout,
             WholeSystem* out) {
  PartProblem here(whole, partition, part);
  native::NormalEquations equations;
  equations.Begin(here.problem(), 1);
  equations.SetForm(native::SchurForm::kExplicit);
  native::Linearisation linearisation;
  equations.LinearisePart(10.0, &linearisation);
  const Contribution contribution(equations.structure(), equations.pattern(), here.block_of_whole(),
                                  layout);
  std::vector<double> blocks, gradient(contribution.cell_offset().back());
  contribution.PackBlocks(equations.matrix(), &blocks);
  for (size_t p = 0; p < contribution.pairs().size(); ++p) {
    const auto [row, column] = contribution.pairs()[p];
    for (int i = 0; i < layout.padded[row]; ++i) {
      for (int j = 0; j < layout.padded[column]; ++j) {
        const double value = blocks[contribution.pair_offset()[p] +
                                    static_cast<size_t>(i) * layout.padded[column] + j];
        out->S(layout.begin[row] + i, layout.begin[column] + j) += value;
        if (row != column) out->S(layout.begin[column] + j, layout.begin[row] + i) += value;
      }
    }
  }
  contribution.PackVector(equations.gradient().data(), gradient.data());
  for (size_t c = 0; c < contribution.cells().size(); ++c) {
    const uint32_t cell = contribution.cells()[c];
    for (int i = 0; i < layout.padded[cell]; ++i)
      out->gradient[layout.begin[cell] + i] += gradient[contribution.cell_offset()[c] + i];
  }
}

class Parts : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Numbers, Parts, testing::Values(2, 3, 5, 40));

TEST_P(Parts, AddUpToTheReducedSystemOfTheWhole) {
  for (const bool refine : {false, true}) {
    const SmallBundle street = Street(refine);
    const Partition partition = MakePartition(street.problem, GetParam());
    const CellLayout layout = MakeCellLayout(street.problem, partition);
    const auto n = static_cast<Eigen::Index>(layout.num_unknowns());
    WholeSystem sum{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
    WholeSystem one = sum;
    for (int part = 0; part < GetParam(); ++part)
      AddPart(street.problem, partition, part, layout, &sum);
    // The same layout, with all residuals in one part.
    const Partition whole = MakePartition(street.problem, 1);
    AddPart(street.problem, whole, 0, layout, &one);
    EXPECT_LT((sum.S - one.S).norm(), 1e-12 * one.S.norm());
    EXPECT_LT((sum.gradient - one.gradient).norm(), 1e-12 * one.gradient.norm());
    EXPECT_LT((one.S - one.S.transpose()).norm(), 1e-12 * one.S.norm());
  }
}

TEST_P(Parts, SendRowsToTheirOwners) {
  const SmallBundle street = Street(true);
  const Partition partition = MakePartition(street.problem, GetParam());
  const CellLayout layout = MakeCellLayout(street.problem, partition);
  for (int part = 0; part < GetParam(); ++part) {
    PartProblem here(street.problem, partition, part);
    native::NormalEquations equations;
    equations.Begin(here.problem(), 1);
    const BlockPattern& pattern = equations.FindPattern();
    const Contribution c(equations.structure(), pattern, here.block_of_whole(), layout);
    for (int to = 0; to < GetParam(); ++to) {
      for (size_t p = c.pairs_of_part[to]; p < c.pairs_of_part[to + 1]; ++p)
        EXPECT_EQ(layout.part[c.pairs()[p].row], to);
      for (size_t i = c.cells_of_part[to]; i < c.cells_of_part[to + 1]; ++i)
        EXPECT_EQ(layout.part[c.cells()[i]], to);
    }
  }
}

}  // namespace
}  // namespace holba::distributed
