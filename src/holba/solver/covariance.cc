// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/covariance.h"

#include <algorithm>
#include <limits>

#include "holba/base/threads.h"
#include "holba/linear/reduced_solver.h"
#include "holba/solver/native/native_workspace.h"

namespace holba {

using native::kNoFeature, native::kNoNode;

struct Covariance::Data {
  const Problem* problem = nullptr;
  std::vector<native::KeptBlock> kept;
  std::vector<native::Columns> block_columns;
  BlockPattern pattern;
  BlockMatrix Z;  // of `pattern`
  std::vector<uint32_t> feature_of_block;
  std::vector<size_t> begin;
  std::vector<double> features;
};

namespace {

void ClearPadding(BlockMatrix* matrix) {
  const BlockPattern& pattern = *matrix->pattern;
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    const int width = pattern.widths[a], padded = PaddedWidth(width);
    if (width == padded) continue;
    for (size_t k = pattern.row_start[a]; k < pattern.row_start[a + 1]; ++k) {
      double* column = matrix->Block(k);
      for (int c = 0; c < pattern.widths[pattern.column[k]]; ++c, column += padded)
        std::fill(column + width, column + padded, 0.0);
    }
  }
}

}  // namespace

Covariance::Covariance(std::unique_ptr<Data> data) : data_(std::move(data)) {}
Covariance::Covariance(Covariance&&) noexcept = default;
Covariance::~Covariance() = default;

std::optional<Covariance> Covariance::Compute(const Problem& problem, int num_threads,
                                              SolverWorkspace* workspace) {
  auto data = std::make_unique<Data>();
  data->problem = &problem;
  SolverWorkspace own;
  NativeWorkspace& native = (workspace ? workspace : &own)->Native();
  ReducedSolver* const solver = native.BeginExplicit(problem, NumThreads(num_threads));
  native::NormalEquations& equations = native.equations();
  native::Linearisation linearisation;
  equations.Linearise(std::numeric_limits<double>::infinity(), &linearisation);
  const native::Structure& structure = equations.structure();
  data->kept = structure.kept;
  data->block_columns = structure.block_columns;
  data->pattern = equations.pattern();
  data->Z = BlockMatrix(&data->pattern);
  if (structure.num_nodes() > 0) {
    if (!solver->Factorise(equations.matrix()) || !solver->SelectedInverse(&data->Z))
      return std::nullopt;
    ClearPadding(&data->Z);
  }
  equations.FeatureCovariances(data->Z, &data->begin, &data->features);
  data->feature_of_block.assign(problem.num_blocks(), kNoFeature);
  for (uint32_t f = 0; f < structure.features.size(); ++f)
    data->feature_of_block[structure.features[f]] = f;
  return Covariance(std::move(data));
}

Eigen::MatrixXd Covariance::Of(BlockId id) const {
  const ParameterBlock& block = data_->problem->block(id);
  const int n = block.manifold->tangent;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  const uint32_t feature = data_->feature_of_block[id];
  if (feature != kNoFeature) {
    const double* from = data_->features.data() + data_->begin[feature];
    for (int r = 0; r < n; ++r) {
      for (int c = 0; c < n; ++c) out(r, c) = from[r * n + c];
    }
  } else if (const auto kept = Between(id, id)) {
    out = *kept;
  }
  for (int i = 0; i < n; ++i) {
    if (!block.constant && !(block.held >> i & 1)) continue;
    out.row(i).setZero();
    out.col(i).setZero();
  }
  return out;
}

std::optional<Eigen::MatrixXd> Covariance::Between(BlockId a, BlockId b) const {
  const native::KeptBlock place_a = data_->kept[a], place_b = data_->kept[b];
  if (place_a.node == kNoNode || place_b.node == kNoNode) return std::nullopt;
  const bool swap = place_a.node < place_b.node;
  const auto& rows = swap ? place_b : place_a;
  const auto& cols = swap ? place_a : place_b;
  const BlockPattern& pattern = data_->pattern;
  const size_t k = pattern.Find(static_cast<int>(rows.node), static_cast<int>(cols.node));
  if (k == pattern.num_blocks()) return std::nullopt;
  const double* Z = data_->Z.Block(k);
  const int stride = PaddedWidth(pattern.widths[rows.node]);
  const auto entry = [&](int i, int j) { return Z[(cols.first + j) * stride + rows.first + i]; };
  const native::Columns &columns_a = data_->block_columns[a], &columns_b = data_->block_columns[b];
  const Problem& problem = *data_->problem;
  Eigen::MatrixXd out =
      Eigen::MatrixXd::Zero(problem.block(a).manifold->tangent, problem.block(b).manifold->tangent);
  for (int i = 0; i < columns_a.count; ++i) {
    for (int j = 0; j < columns_b.count; ++j) {
      out(columns_a.tangent[i], columns_b.tangent[j]) = swap ? entry(j, i) : entry(i, j);
    }
  }
  return out;
}

}  // namespace holba
