// SPDX-License-Identifier: BSD-3-Clause
// A batch has residuals of one kind: they have the same dimension and the same kinds of blocks in
// the same slots. One call evaluates a range of them into structure-of-arrays panels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "holba/problem/loss.h"
#include "holba/problem/vector_work.h"

namespace holba {

using BlockId = uint32_t;

inline constexpr int kMaxSlots = 5;
inline constexpr int kMaxResidualDim = 6;
inline constexpr int kMaxTangent = 16;

// The parameters that a batch reads.
class ParameterReader {
 public:
  // Parameters in a state vector, with an offset for each block id.
  ParameterReader(const double* state, const size_t* block_offsets)
      : state_(state), offsets_(block_offsets) {}
  // Parameters of a single residual, by slot.
  explicit ParameterReader(const double* const* slots) : slots_(slots) {}

  const double* At(int slot, BlockId block) const {
    return slots_ ? slots_[slot] : state_ + offsets_[block];
  }
  // Null if the parameters are those of a single residual.
  const double* state() const { return state_; }
  const size_t* offsets() const { return offsets_; }

 private:
  const double* state_ = nullptr;
  const size_t* offsets_ = nullptr;
  const double* const* slots_ = nullptr;
};

// Residuals of a batch: those of the list or, without a list, begin, begin + 1, ...
struct ResidualRange {
  size_t begin = 0;
  size_t count = 0;
  const uint32_t* list = nullptr;

  size_t operator[](size_t j) const { return list ? list[j] : begin + j; }
};

// Panels whose stride is a multiple of this are evaluated in vectors where the kernel can.
inline constexpr size_t kPanelLanes = 8;

// Entry k of the j-th residual of the range is at [k * stride + j]. Jacobians are with respect to
// the tangent of the block's manifold, row-major (entry row * tangent + column). If the stride is a
// multiple of kPanelLanes, an evaluation may overwrite the entries from the count of the range up
// to the next multiple of kPanelLanes.
struct ResidualPanel {
  size_t stride = 1;
  double* residuals = nullptr;
  std::array<double*, kMaxSlots> jacobians{};  // null: not wanted
  // False: the residual is undefined (behind the camera, degenerate projection) and its entries are
  // 0.
  bool* present = nullptr;
};

class ResidualBatch {
 public:
  // tangents: tangent size of each slot's block.
  ResidualBatch(std::string term, int dim, std::vector<int> tangents)
      : term_(std::move(term)), dim_(dim), tangents_(std::move(tangents)) {}
  virtual ~ResidualBatch() = default;

  const std::string& term() const { return term_; }
  int dim() const { return dim_; }
  int num_slots() const { return static_cast<int>(tangents_.size()); }
  int tangent(int slot) const { return tangents_[slot]; }
  size_t size() const { return size_; }
  BlockId block(size_t i, int slot) const { return blocks_[i * tangents_.size() + slot]; }
  std::span<const BlockId> blocks() const { return blocks_; }

  virtual void EvaluateRange(const ResidualRange& range, const ParameterReader& parameters,
                             const ResidualPanel& panel) const = 0;
  void Evaluate(size_t begin, size_t end, const ParameterReader& parameters,
                const ResidualPanel& panel) const {
    EvaluateRange({begin, end - begin}, parameters, panel);
  }

  Loss loss;
  double weight = 1.0;
  // Angular terms are left out of the termination test (paper, "Convergence and Termination").
  bool angular = false;

 protected:
  void ReserveBlocks(size_t num_residuals) { blocks_.reserve(num_residuals * tangents_.size()); }
  // Adds the blocks of one residual, one for each slot.
  void AddBlocks(std::span<const BlockId> blocks) {
    blocks_.insert(blocks_.end(), blocks.begin(), blocks.end());
    ++size_;
  }

 private:
  std::string term_;
  int dim_;
  size_t size_ = 0;
  std::vector<int> tangents_;
  std::vector<BlockId> blocks_;
};

// A batch of a kernel: one residual is kernel.Evaluate(datum, parameters of its slots, residual,
// Jacobians), returning whether it is present. Jacobians: row-major dim x tangent, null where not
// wanted. A kernel may also have
//   bool EvaluateVectorised(const VectorWork& work) const;
// which does the same for a range in packs, or returns false and does nothing.
template <typename Kernel>
class KernelBatch final : public ResidualBatch {
 public:
  using Datum = typename Kernel::Datum;

  KernelBatch(std::string term, int dim, std::vector<int> tangents, Kernel kernel)
      : ResidualBatch(std::move(term), dim, std::move(tangents)), kernel_(std::move(kernel)) {}

  void Add(std::span<const BlockId> blocks, const Datum& datum) {
    AddBlocks(blocks);
    data_.push_back(datum);
  }
  // Reserves memory for this many residuals.
  void Reserve(size_t num) {
    ReserveBlocks(num);
    data_.reserve(num);
  }
  const Kernel& kernel() const { return kernel_; }

  void EvaluateRange(const ResidualRange& range, const ParameterReader& parameters,
                     const ResidualPanel& panel) const override {
    if constexpr (requires(const VectorWork& work) { kernel_.EvaluateVectorised(work); }) {
      if (range.count == 0) return;
      if (parameters.state() != nullptr && panel.stride % kPanelLanes == 0) {
        const VectorWork work{parameters.state(),
                              parameters.offsets(),
                              blocks().data(),
                              num_slots(),
                              data_.data(),
                              sizeof(Datum),
                              range.begin,
                              range.count,
                              range.list,
                              panel.stride,
                              panel.residuals,
                              {panel.jacobians[0], panel.jacobians[1], panel.jacobians[2],
                               panel.jacobians[3], panel.jacobians[4]},
                              panel.present};
        if (kernel_.EvaluateVectorised(work)) return;
      }
    }
    double residual[kMaxResidualDim];
    double storage[kMaxSlots][kMaxResidualDim * kMaxTangent];
    const int slots = num_slots();
    for (size_t j = 0; j < range.count; ++j) {
      const size_t i = range[j];
      const double* values[kMaxSlots] = {};
      double* jacobians[kMaxSlots] = {};
      const bool direct = panel.stride == 1;  // the kernel writes straight into the panel
      for (int s = 0; s < slots; ++s) {
        values[s] = parameters.At(s, block(i, s));
        if (panel.jacobians[s]) jacobians[s] = direct ? panel.jacobians[s] : storage[s];
      }
      double* r = direct ? panel.residuals : residual;
      const bool present = kernel_.Evaluate(data_[i], values, r, jacobians);
      panel.present[j] = present;
      if (!present) {
        for (int k = 0; k < dim(); ++k) panel.residuals[k * panel.stride + j] = 0.0;
      } else if (!direct) {
        for (int k = 0; k < dim(); ++k) panel.residuals[k * panel.stride + j] = r[k];
      }
      for (int s = 0; s < slots; ++s) {
        if (!jacobians[s] || (direct && present)) continue;
        for (int k = 0; k < dim() * tangent(s); ++k) {
          panel.jacobians[s][k * panel.stride + j] = present ? jacobians[s][k] : 0.0;
        }
      }
    }
  }

 private:
  Kernel kernel_;
  std::vector<Datum> data_;
};

}  // namespace holba
