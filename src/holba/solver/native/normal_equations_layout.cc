// SPDX-License-Identifier: BSD-3-Clause
// NormalEquations: the analysis of a problem, the pattern of its reduced system, and the memory of
// a form.
#include <algorithm>
#include <cstring>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/threads.h"
#include "holba/solver/native/normal_equations_data.h"

namespace holba::native {
namespace {

// A pattern with this share of its blocks is completed: finding a block from its nodes alone saves
// more than the blocks of zeros cost.
constexpr double kFullDensity = 0.75;

// Pairs of nodes that residuals without a feature couple: (later, earlier), sorted.
std::vector<std::pair<uint32_t, uint32_t>> LoosePairs(const Structure& structure) {
  std::vector<std::pair<uint32_t, uint32_t>> pairs;
  for (const Part& part : structure.parts) {
    if (part.feature_slot >= 0 || part.num_segments < 2) continue;
    for (size_t j = 0; j < part.residuals.size(); ++j) {
      const uint32_t* nodes = &part.nodes[j * part.num_segments];
      for (int s = 0; s < part.num_segments; ++s) {
        for (int t = 0; t < s; ++t) {
          if (nodes[s] == kNoNode || nodes[t] == kNoNode || nodes[s] == nodes[t]) continue;
          pairs.emplace_back(std::max(nodes[s], nodes[t]), std::min(nodes[s], nodes[t]));
        }
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

// The cliques that contain each node: those of node n are cliques[begin[n]] to
// cliques[begin[n + 1] - 1].
struct CliquesOfNodes {
  std::vector<uint32_t> begin, cliques;

  explicit CliquesOfNodes(const Structure& structure)
      : begin(structure.num_nodes() + 1), cliques(structure.cliques.nodes.size()) {
    for (uint32_t node : structure.cliques.nodes) ++begin[node];
    uint32_t end = 0;
    for (uint32_t& of_node : begin) of_node = end += of_node;
    for (uint32_t c = 0; c < structure.cliques.size(); ++c) {
      for (uint32_t node : structure.cliques.Nodes(c)) cliques[--begin[node]] = c;
    }
  }
};

// The blocks of S in the rows of the nodes from `first_row` on; only the diagonal block in the rows
// before.
BlockPattern PatternFromRow(const Structure& structure, uint32_t first_row) {
  const uint32_t n = static_cast<uint32_t>(structure.num_nodes());
  const CliquesOfNodes of_nodes(structure);
  const std::vector<std::pair<uint32_t, uint32_t>> loose = LoosePairs(structure);
  BlockPattern pattern;
  pattern.widths.assign(structure.node_width.begin(), structure.node_width.end());
  pattern.row_start.assign(1, 0);
  std::vector<uint32_t> row_of(n, kNoNode);  // the last row that a node is coupled with
  size_t next_loose = 0;
  for (uint32_t a = 0; a < n; ++a) {
    const size_t row_begin = pattern.column.size();
    const auto couple = [&](uint32_t b) {
      if (std::exchange(row_of[b], a) != a) pattern.column.push_back(static_cast<int>(b));
    };
    while (next_loose < loose.size() && loose[next_loose].first < a) ++next_loose;
    if (a >= first_row) {
      for (uint32_t i = of_nodes.begin[a]; i < of_nodes.begin[a + 1]; ++i) {
        for (uint32_t b : structure.cliques.Nodes(of_nodes.cliques[i])) {
          if (b >= a) break;
          couple(b);
        }
      }
      for (; next_loose < loose.size() && loose[next_loose].first == a; ++next_loose)
        couple(loose[next_loose].second);
      std::sort(pattern.column.begin() + row_begin, pattern.column.end());
    }
    pattern.column.push_back(static_cast<int>(a));
    pattern.row_start.push_back(pattern.column.size());
  }
  return pattern;
}

void CompletePattern(BlockPattern* pattern) {
  pattern->column.clear();
  for (int a = 0; a < pattern->num_nodes(); ++a) {
    for (int b = 0; b <= a; ++b) pattern->column.push_back(b);
    pattern->row_start[a + 1] = pattern->column.size();
  }
}

}  // namespace

bool NormalEquations::Begin(const Problem& problem, int num_threads) {
  const Fingerprint fingerprint = FingerprintOf(problem);
  const bool known =
      problem_ != nullptr && fingerprint == fingerprint_ && num_threads_ == NumThreads(num_threads);
  if (known) {
    for (Part& part : structure_.parts) part.batch = problem.batches()[part.batch_idx].get();
  } else {
    problem_ = nullptr;  // should the analysis refuse the problem, nothing is known
    pattern_found_ = formed_ = false;
    num_threads_ = NumThreads(num_threads);
    structure_.Build(problem);
    fingerprint_ = fingerprint;
  }
  problem_ = &problem;
  memory_.assign(problem.batches().size(), {});
  AddFixedCosts();
  return known;
}

const BlockPattern& NormalEquations::FindPattern() {
  if (!pattern_found_) MakePattern(SchurForm::kExplicit);
  pattern_found_ = true;
  return pattern_;
}

void NormalEquations::MakePattern(SchurForm form) {
  formed_ = false;
  const bool all = form == SchurForm::kExplicit;
  BlockPattern pattern = PatternFromRow(structure_, all ? 0 : structure_.num_pose_nodes);
  const double n = static_cast<double>(pattern.num_nodes());
  if (all && static_cast<double>(pattern.column.size()) >= kFullDensity * 0.5 * n * (n + 1.0))
    CompletePattern(&pattern);
  if (pattern_version_ > 0 && pattern.widths == pattern_.widths &&
      pattern.row_start == pattern_.row_start && pattern.column == pattern_.column)
    return;
  pattern_ = std::move(pattern);
  pattern_.Finish();
  ++pattern_version_;
}

void NormalEquations::SetForm(SchurForm form) {
  if (formed_ && form == form_) return;
  form_ = form;
  if (form == SchurForm::kExplicit) {
    FindPattern();
  } else {
    MakePattern(form);
    pattern_found_ = false;
  }
  formed_ = true;
  S_ = BlockMatrix(&pattern_);
  U_ = IsImplicit() ? BlockMatrix(&pattern_) : BlockMatrix();

  PlaceSumBlocks();
  MakeSlices();
  for (size_t i = 0; i < num_slices_; ++i) MakeOffsets(slices_[i].get());
  ReserveBuffers();
}

// Places of the blocks in the sums of a slice with a full pattern.
void NormalEquations::PlaceSumBlocks() {
  const size_t n = structure_.num_nodes();
  row_offset_.resize(n + 1);
  unknown_offset_.resize(n);
  row_offset_[0] = 0;
  for (size_t a = 0; a < n; ++a) {
    size_t size = 0;
    if (pattern_.full) {
      const int width = structure_.node_width[a];
      size = pattern_.offset[a] * GroupedRows(width) +
             size_t{structure_.node_padded_offset[a]} * TailRows(width) +
             SumBlockSize(width, width);
    }
    row_offset_[a + 1] = row_offset_[a] + size;
    unknown_offset_[a] = static_cast<uint32_t>(pattern_.offset[a]);
  }
}

void NormalEquations::ReserveBuffers() {
  factors_.resize(structure_.factors_size + kPanelLanes);
  if (IsImplicit()) {
    stored_begin_.resize(structure_.chunks.size() + 1);
    stored_begin_[0] = 0;
    for (size_t c = 0; c < structure_.chunks.size(); ++c)
      stored_begin_[c + 1] = stored_begin_[c] + structure_.chunks[c].w_size;
    stored_.resize(stored_begin_.back() + kPanelLanes);
  } else {
    stored_.clear();
  }
  size_t max_parts = 1;
  for (const Chunk& chunk : structure_.chunks)
    max_parts = std::max<size_t>(max_parts, chunk.parts_end - chunk.parts_begin);
  const size_t num_scratches = std::min<size_t>(num_threads_, std::max<size_t>(num_slices_, 1));
  while (scratches_.size() < num_scratches) scratches_.push_back(std::make_unique<Scratch>());
  for (const auto& scratch : scratches_) scratch->Reserve(structure_, max_parts);
  const size_t padded = structure_.padded_size() + kMaxTangent + kPanelLanes;
  for (auto* vector : {&gradient_, &diagonal_, &reduction_, &damping_, &padded_step_, &padded_sum_})
    vector->assign(padded, 0.0);
  rhs_.assign(pattern_.num_unknowns, 0.0);
}

}  // namespace holba::native
