// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/distributed/part_problem.h"

#include <algorithm>
#include <memory>

namespace holba::distributed {

// Residuals of a batch of the whole. Its kernel reads the state of the part through a table of the
// places of the whole's blocks, so that nothing of a batch is copied.
class PartProblem::PartBatch final : public ResidualBatch {
 public:
  PartBatch(const ResidualBatch& whole, const std::vector<uint32_t>& residuals,
            const std::vector<size_t>& offset_of_whole,
            const std::vector<BlockId>& part_block_of_whole)
      : ResidualBatch(whole.term(), whole.dim(), TangentsOf(whole)),
        residuals_(residuals),
        offset_of_whole_(offset_of_whole) {
    ReserveBlocks(residuals.size());
    BlockId ids[kMaxSlots];
    for (uint32_t i : residuals) {
      for (int s = 0; s < num_slots(); ++s) ids[s] = part_block_of_whole[whole.block(i, s)];
      AddBlocks({ids, static_cast<size_t>(num_slots())});
    }
    Renew(whole);
  }

  void Renew(const ResidualBatch& whole) {
    whole_ = &whole;
    loss = whole.loss;
    weight = whole.weight;
    angular = whole.angular;
  }

  void EvaluateRange(const ResidualRange& range, const ParameterReader& parameters,
                     const ResidualPanel& panel) const override {
    thread_local std::vector<uint32_t> list;
    list.resize(range.count);
    for (size_t j = 0; j < range.count; ++j) list[j] = residuals_[range[j]];
    ResidualRange of_whole{range.count > 0 ? list[0] : 0, range.count, nullptr};
    for (size_t j = 0; j < range.count; ++j) {
      if (list[j] == list[0] + j) continue;
      of_whole.list = list.data();
      break;
    }
    const bool of_single = parameters.state() == nullptr;
    whole_->EvaluateRange(
        of_whole,
        of_single ? parameters : ParameterReader(parameters.state(), offset_of_whole_.data()),
        panel);
  }

 private:
  static std::vector<int> TangentsOf(const ResidualBatch& batch) {
    std::vector<int> tangents;
    for (int s = 0; s < batch.num_slots(); ++s) tangents.push_back(batch.tangent(s));
    return tangents;
  }

  const ResidualBatch* whole_ = nullptr;
  const std::vector<uint32_t>& residuals_;
  const std::vector<size_t>& offset_of_whole_;
};

PartProblem::PartProblem(const Problem& whole, const Partition& partition, int part) {
  residuals_.resize(whole.batches().size());
  std::vector<uint8_t> used(whole.num_blocks(), 0);
  for (size_t b = 0; b < whole.batches().size(); ++b) {
    const ResidualBatch& batch = *whole.batches()[b];
    for (size_t i = 0; i < batch.size(); ++i) {
      if (partition.PartOfResidual(whole, batch, i) != part) continue;
      residuals_[b].push_back(static_cast<uint32_t>(i));
      for (int s = 0; s < batch.num_slots(); ++s) used[batch.block(i, s)] = 1;
    }
    residuals_[b].shrink_to_fit();
  }
  offset_of_whole_.assign(whole.num_blocks(), 0);
  std::vector<BlockId> part_block(whole.num_blocks(), 0);
  for (BlockId id = 0; id < whole.num_blocks(); ++id) {
    if (!used[id]) continue;
    const ParameterBlock& block = whole.block(id);
    const BlockId here =
        problem_.AddBlock(block.kind, *block.manifold, block.role,
                          {whole.values(id), static_cast<size_t>(block.manifold->ambient)});
    problem_.block(here).constant = block.constant;
    problem_.block(here).held = block.held;
    part_block[id] = here;
    block_of_whole_.push_back(id);
  }
  for (BlockId here = 0; here < problem_.num_blocks(); ++here)
    offset_of_whole_[block_of_whole_[here]] = problem_.Reader().offsets()[here];
  for (size_t b = 0; b < whole.batches().size(); ++b) {
    if (residuals_[b].empty()) continue;
    batch_of_whole_.push_back(b);
    auto batch = std::make_unique<PartBatch>(*whole.batches()[b], residuals_[b], offset_of_whole_,
                                             part_block);
    batches_.push_back(batch.get());
    problem_.AddBatch(std::move(batch));
  }
}

void PartProblem::Renew(const Problem& whole) {
  for (size_t b = 0; b < batches_.size(); ++b)
    batches_[b]->Renew(*whole.batches()[batch_of_whole_[b]]);
  for (BlockId here = 0; here < problem_.num_blocks(); ++here) {
    std::copy_n(whole.values(block_of_whole_[here]), problem_.block(here).manifold->ambient,
                problem_.values(here));
  }
}

void PartProblem::WriteBack(const std::vector<BlockId>& blocks, Problem* whole) const {
  for (BlockId here : blocks) {
    std::copy_n(problem_.values(here), problem_.block(here).manifold->ambient,
                whole->values(block_of_whole_[here]));
  }
}

}  // namespace holba::distributed
