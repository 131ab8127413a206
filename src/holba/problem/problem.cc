// SPDX-License-Identifier: BSD-3-Clause
#include "holba/problem/problem.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "holba/base/check.h"

namespace holba {

uint32_t ParameterBlock::FreeMask() const {
  if (constant) return 0;
  return ~held & ((uint32_t{1} << manifold->tangent) - 1);
}

int ParameterBlock::FreeTangent() const { return std::popcount(FreeMask()); }

BlockId Problem::AddBlock(std::string_view kind, const ManifoldOps& manifold, BlockRole role,
                          std::span<const double> values) {
  HOLBA_CHECK_MSG(static_cast<int>(values.size()) == manifold.ambient, std::string(kind));
  blocks_.push_back({kind, &manifold, role, false, 0});
  offsets_.push_back(state_.size());
  state_.insert(state_.end(), values.begin(), values.end());
  return static_cast<BlockId>(blocks_.size() - 1);
}

void Problem::Reserve(size_t num_blocks, size_t num_values) {
  blocks_.reserve(num_blocks);
  offsets_.reserve(num_blocks);
  state_.reserve(num_values);
}

void Problem::AddBatch(std::unique_ptr<ResidualBatch> batch) {
  if (batch->size() == 0) return;
  HOLBA_CHECK(batch->num_slots() <= kMaxSlots && batch->dim() <= kMaxResidualDim);
  for (size_t i = 0; i < batch->size(); ++i) {
    std::string_view first_feature;
    for (int s = 0; s < batch->num_slots(); ++s) {
      HOLBA_CHECK_MSG(batch->block(i, s) < blocks_.size(), batch->term());
      const ParameterBlock& b = blocks_[batch->block(i, s)];
      HOLBA_CHECK_MSG(b.manifold->tangent == batch->tangent(s),
                      fmt::format("term {}, slot {}: a {} does not fit", batch->term(), s, b.kind));
      if (IsKept(b.role)) continue;
      HOLBA_CHECK_MSG(
          first_feature.empty(),
          fmt::format("residual {} of term '{}' holds two features, a {} and a {}: the feature "
                      "blocks would no longer be independent; keep one of them instead",
                      i, batch->term(), first_feature, b.kind));
      first_feature = b.kind;
    }
  }
  batches_.push_back(std::move(batch));
}

size_t Problem::num_residuals() const {
  size_t n = 0;
  for (const auto& batch : batches_) n += batch->size();
  return n;
}

namespace {

// Calls visit(batch, residual vector, dim, present) for every residual, in order.
template <typename Visitor>
void ForEachResidual(const Problem& problem, const Visitor& visit) {
  const ParameterReader reader = problem.Reader();
  for (const auto& batch : problem.batches()) {
    double residual[kMaxResidualDim];
    bool present = false;
    ResidualPanel panel;
    panel.residuals = residual;
    panel.present = &present;
    for (size_t i = 0; i < batch->size(); ++i) {
      batch->Evaluate(i, i + 1, reader, panel);
      visit(*batch, residual, present);
    }
  }
}

double SquaredNorm(const double* r, int dim) {
  double s = 0.0;
  for (int k = 0; k < dim; ++k) s += r[k] * r[k];
  return s;
}

// Symmetric pattern over kept variable blocks, one bit per pair.
class PairPattern {
 public:
  explicit PairPattern(size_t n) : words_((n + 63) / 64), bits_(n * words_) {}
  void Couple(const std::vector<uint32_t>& members) {
    for (uint32_t a : members) {
      uint64_t* row = &bits_[a * words_];
      for (uint32_t b : members) row[b / 64] |= uint64_t{1} << (b % 64);
    }
  }
  bool At(size_t a, size_t b) const { return bits_[a * words_ + b / 64] >> (b % 64) & 1; }

 private:
  size_t words_;
  std::vector<uint64_t> bits_;
};

PairPattern CoupleKeptBlocks(const Problem& problem, const std::vector<uint32_t>& kept_index,
                             size_t num_kept, bool with_wireframe) {
  constexpr uint32_t kNone = ~uint32_t{0};
  PairPattern pattern(num_kept);
  std::vector<std::vector<uint32_t>> of_feature(problem.num_blocks());
  std::vector<uint32_t> members;
  for (const auto& batch : problem.batches()) {
    if (!with_wireframe && batch->term().starts_with("wireframe")) continue;
    for (size_t i = 0; i < batch->size(); ++i) {
      members.clear();
      uint32_t feature = kNone;
      for (int s = 0; s < batch->num_slots(); ++s) {
        const BlockId id = batch->block(i, s);
        if (kept_index[id] != kNone) members.push_back(kept_index[id]);
        const ParameterBlock& b = problem.block(id);
        if (!IsKept(b.role) && b.IsVariable()) feature = id;
      }
      if (feature == kNone) {
        pattern.Couple(members);
      } else {
        auto& list = of_feature[feature];
        list.insert(list.end(), members.begin(), members.end());
      }
    }
  }
  for (auto& list : of_feature) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    pattern.Couple(list);
  }
  return pattern;
}

}  // namespace

std::vector<TermCost> EvaluateTerms(const Problem& problem) {
  std::vector<TermCost> terms;
  const ResidualBatch* current = nullptr;
  size_t index = 0;
  ForEachResidual(problem, [&](const ResidualBatch& batch, const double* r, bool present) {
    if (&batch != current) {
      current = &batch;
      const auto it = std::find_if(terms.begin(), terms.end(),
                                   [&](const TermCost& t) { return t.term == batch.term(); });
      index = it - terms.begin();
      if (it == terms.end()) terms.push_back({batch.term(), batch.angular});
    }
    TermCost& term = terms[index];
    ++term.residuals;
    if (!present) {
      ++term.absent;
      return;
    }
    const double s = SquaredNorm(r, batch.dim());
    term.sum_squares += s;
    term.cost += 0.5 * batch.weight * batch.loss.Cost(s);
  });
  return terms;
}

std::vector<double> ResidualNorms(const Problem& problem, std::string_view term, bool components) {
  std::vector<double> norms;
  ForEachResidual(problem, [&](const ResidualBatch& batch, const double* r, bool present) {
    if (!present || batch.term() != term) return;
    if (components) {
      for (int k = 0; k < batch.dim(); ++k) norms.push_back(std::abs(r[k]));
    } else {
      norms.push_back(std::sqrt(SquaredNorm(r, batch.dim())));
    }
  });
  return norms;
}

size_t NumKeptUnknowns(const Problem& problem) {
  size_t size = 0;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    if (IsKept(block.role)) size += block.FreeTangent();
  }
  return size;
}

ReducedSystem AnalyseReducedSystem(const Problem& problem) {
  constexpr uint32_t kNone = ~uint32_t{0};
  ReducedSystem system;
  std::vector<uint32_t> kept_index(problem.num_blocks(), kNone);
  std::vector<BlockId> kept;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& b = problem.block(id);
    if (!IsKept(b.role) || !b.IsVariable()) continue;
    kept_index[id] = static_cast<uint32_t>(kept.size());
    kept.push_back(id);
    system.size += b.FreeTangent();
  }
  if (kept.empty()) return system;
  const PairPattern pattern = CoupleKeptBlocks(problem, kept_index, kept.size(), true);
  const PairPattern bare = CoupleKeptBlocks(problem, kept_index, kept.size(), false);
  double entries = 0.0;
  size_t poses = 0, pairs = 0, bare_pairs = 0;
  for (size_t a = 0; a < kept.size(); ++a) {
    const ParameterBlock& block_a = problem.block(kept[a]);
    entries += static_cast<double>(block_a.FreeTangent()) * block_a.FreeTangent();
    const bool pose_a = block_a.role == BlockRole::kPose;
    poses += pose_a;
    for (size_t b = 0; b < a; ++b) {
      if (!pattern.At(a, b)) continue;
      const ParameterBlock& block_b = problem.block(kept[b]);
      entries += 2.0 * block_a.FreeTangent() * block_b.FreeTangent();
      if (pose_a && block_b.role == BlockRole::kPose) {
        ++pairs;
        bare_pairs += bare.At(a, b);
      }
    }
  }
  system.density = entries / (static_cast<double>(system.size) * static_cast<double>(system.size));
  if (poses > 1) {
    const double all = 0.5 * static_cast<double>(poses) * static_cast<double>(poses - 1);
    system.pose_density = static_cast<double>(pairs) / all;
    system.pose_density_without_wireframe = static_cast<double>(bare_pairs) / all;
  }
  return system;
}

}  // namespace holba
