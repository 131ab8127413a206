// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/structure.h"

#include <algorithm>
#include <bit>
#include <set>
#include <utility>

#include "holba/base/check.h"
#include "holba/linear/padding.h"

namespace holba::native {
namespace {

// Scratch memory that a build leaves for the next one: enough for local adjustments, while a large
// problem needs the memory for its solver.
constexpr size_t kKeptScratchBytes = size_t{1} << 19;

// Blocks of one role and manifold share their columns.
struct Kind {
  BlockRole role;
  const ManifoldOps* manifold;
  uint32_t free = 0;  // coordinates that are variable in some kept block
};

uint8_t FindOrAddKind(const ParameterBlock& block, std::vector<Kind>* kinds) {
  size_t k = 0;
  while (k < kinds->size() &&
         !((*kinds)[k].role == block.role && (*kinds)[k].manifold == block.manifold))
    ++k;
  if (k == kinds->size()) {
    HOLBA_CHECK_MSG(k < 255, "too many kinds of blocks");
    kinds->push_back({block.role, block.manifold});
  }
  return static_cast<uint8_t>(k);
}

Columns ColumnsOf(const Kind& kind) {
  Columns columns;
  for (int i = 0; i < kind.manifold->tangent; ++i) {
    if (kind.free >> i & 1) columns.tangent[columns.count++] = static_cast<uint8_t>(i);
  }
  return columns;
}

// What the residuals say about the blocks that they hold.
struct BlockUse {
  static constexpr BlockId kNoPartner = ~BlockId{0}, kSeveral = kNoPartner - 1;

  std::vector<uint8_t> used;  // by block: whether a residual holds it
  // By block: the pose that all residuals of an intrinsics block hold, and the intrinsics block
  // that all residuals of a pose hold.
  std::vector<BlockId> pose_of, intrinsics_of;
  // Kinds that stand in one slot of one batch.
  std::set<std::pair<uint8_t, uint8_t>> meetings;

  BlockUse(const Problem& problem, const std::vector<Kind>& kinds,
           const std::vector<uint8_t>& kind_of_block)
      : used(problem.num_blocks(), 0),
        pose_of(problem.num_blocks(), kNoPartner),
        intrinsics_of(problem.num_blocks(), kNoPartner) {
    for (const auto& batch : problem.batches()) AddBatch(*batch, kinds, kind_of_block);
  }

 private:
  // Kinds of the slots of one residual, and where its pose and its intrinsics are (-1: nowhere).
  struct Slots {
    std::array<uint8_t, kMaxSlots> kind{};
    int pose = -1, intrinsics = -1;
  };
  static Slots SlotsOf(const BlockId* ids, int num_slots, const std::vector<Kind>& kinds,
                       const std::vector<uint8_t>& kind_of_block) {
    Slots slots;
    for (int s = 0; s < num_slots; ++s) {
      slots.kind[s] = kind_of_block[ids[s]];
      const BlockRole role = kinds[slots.kind[s]].role;
      if (role == BlockRole::kPose) slots.pose = s;
      if (role == BlockRole::kIntrinsics) slots.intrinsics = s;
    }
    return slots;
  }

  void AddBatch(const ResidualBatch& batch, const std::vector<Kind>& kinds,
                const std::vector<uint8_t>& kind_of_block) {
    const int num_slots = batch.num_slots();
    const BlockId* const blocks = batch.blocks().data();
    Slots slots = SlotsOf(blocks, num_slots, kinds, kind_of_block);
    for (size_t i = 0; i < batch.size(); ++i) {
      const BlockId* ids = blocks + i * num_slots;
      bool as_before = true;
      for (int s = 0; s < num_slots; ++s) {
        used[ids[s]] = 1;
        as_before &= kind_of_block[ids[s]] == slots.kind[s];
      }
      if (!as_before) {
        slots = SlotsOf(ids, num_slots, kinds, kind_of_block);
        for (int s = 0; s < num_slots; ++s) {
          const uint8_t k = slots.kind[s], first = kind_of_block[blocks[s]];
          if (k != first) meetings.insert({std::min(k, first), std::max(k, first)});
        }
      }
      if (slots.intrinsics < 0) continue;
      const BlockId intrinsics = ids[slots.intrinsics];
      if (slots.pose < 0) {
        pose_of[intrinsics] = kSeveral;
        continue;
      }
      const BlockId pose = ids[slots.pose];
      NotePartner(pose, &pose_of[intrinsics]);
      NotePartner(intrinsics, &intrinsics_of[pose]);
    }
  }
  static void NotePartner(BlockId partner, BlockId* noted) {
    if (*noted != partner) *noted = *noted == kNoPartner ? partner : kSeveral;
  }
};

// Kinds that meet in one slot share their columns, so that a slot has one set of columns.
void ShareColumnsOfMeetings(const BlockUse& use, std::vector<Kind>* kinds) {
  for (size_t round = 0; round < use.meetings.size(); ++round) {
    for (const auto& [a, b] : use.meetings)
      (*kinds)[a].free = (*kinds)[b].free = (*kinds)[a].free | (*kinds)[b].free;
  }
}

// Whether every variable intrinsics block belongs to one pose only, which has no other, and fits
// into a node with it.
bool EachPoseHasItsOwnIntrinsics(const Problem& problem, const BlockUse& use,
                                 const std::vector<Kind>& kinds,
                                 const std::vector<uint8_t>& kind_of_block) {
  bool any = false, all_own = true;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    if (block.role != BlockRole::kIntrinsics || !block.IsVariable()) continue;
    const BlockId pose = use.pose_of[id];
    if (pose == BlockUse::kNoPartner) continue;  // no residual holds it
    any = true;
    all_own &= pose != BlockUse::kSeveral && use.intrinsics_of[pose] == id &&
               std::popcount(kinds[kind_of_block[id]].free) + 6 <= kMaxBlockWidth;
  }
  return any && all_own;
}

// The feature slot of each residual of a batch; -1: none of its features is variable.
std::vector<int8_t> FeatureSlots(const Problem& problem, const ResidualBatch& batch) {
  const int slots = batch.num_slots();
  std::array<bool, kMaxSlots> holds_features{};
  for (int s = 0; s < slots; ++s) {
    for (size_t i = 0; i < batch.size() && !holds_features[s]; ++i)
      holds_features[s] = !IsKept(problem.block(batch.block(i, s)).role);
  }
  std::vector<int8_t> slot_of(batch.size(), -1);
  for (size_t i = 0; i < batch.size(); ++i) {
    for (int s = 0; s < slots; ++s) {
      if (!holds_features[s]) continue;
      const ParameterBlock& block = problem.block(batch.block(i, s));
      if (IsKept(block.role) || !block.IsVariable()) continue;
      slot_of[i] = static_cast<int8_t>(s);
      break;
    }
  }
  return slot_of;
}

}  // namespace

void Structure::Build(const Problem& problem) {
  FindNodes(problem);
  FindParts(problem);
  OrderFeatures(problem);
  MakeChunks(problem);
  FindHeld(problem);
  if (scratch_.Bytes() > kKeptScratchBytes) scratch_ = {};
}

size_t Structure::Scratch::Bytes() const {
  const auto bytes = [](const auto&... vectors) {
    return ((vectors.capacity() * sizeof(vectors[0])) + ...);
  };
  return bytes(kind_of_block, touched, feature_of_block, list_begin, list_size, lists, rank,
               part_start, still, keys, other_keys);
}

void Structure::FindNodes(const Problem& problem) {
  const size_t num_blocks = problem.num_blocks();
  std::vector<Kind> kinds;
  std::vector<uint8_t>& kind_of_block = scratch_.kind_of_block;
  kind_of_block.resize(num_blocks);
  for (BlockId id = 0; id < num_blocks; ++id) {
    const ParameterBlock& block = problem.block(id);
    kind_of_block[id] = FindOrAddKind(block, &kinds);
    if (IsKept(block.role)) kinds[kind_of_block[id]].free |= block.FreeMask();
  }
  const BlockUse use(problem, kinds, kind_of_block);
  ShareColumnsOfMeetings(use, &kinds);
  merged_ = EachPoseHasItsOwnIntrinsics(problem, use, kinds, kind_of_block);

  kept.assign(num_blocks, {});
  block_columns.assign(num_blocks, {});
  node_begin.clear();
  node_blocks.clear();
  node_width.clear();
  const auto begin_node = [&] {
    node_begin.push_back(static_cast<uint32_t>(node_blocks.size()));
    node_width.push_back(0);
  };
  const auto add_block = [&](BlockId id) {
    const Columns columns = ColumnsOf(kinds[kind_of_block[id]]);
    block_columns[id] = columns;
    kept[id] = {static_cast<uint32_t>(node_width.size() - 1), node_width.back()};
    node_blocks.push_back(id);
    node_width.back() += columns.count;
  };
  const auto moves = [&](BlockId id) {
    const ParameterBlock& block = problem.block(id);
    return use.used[id] != 0 && IsKept(block.role) && block.IsVariable();
  };
  for (BlockId id = 0; id < num_blocks; ++id) {
    if (problem.block(id).role != BlockRole::kPose) continue;
    const BlockId partner = use.intrinsics_of[id];
    const bool takes_intrinsics = merged_ && partner < BlockUse::kSeveral && moves(partner);
    if (!moves(id) && !takes_intrinsics) continue;
    begin_node();
    if (kinds[kind_of_block[id]].free != 0) add_block(id);
    if (takes_intrinsics) add_block(partner);
  }
  num_pose_nodes = static_cast<uint32_t>(node_width.size());
  for (BlockId id = 0; id < num_blocks; ++id) {
    if (!moves(id) || kept[id].node != kNoNode) continue;
    begin_node();
    add_block(id);
  }
  node_padded_offset.resize(node_width.size() + 1);
  node_padded_offset[0] = 0;
  for (size_t n = 0; n < node_width.size(); ++n) {
    node_padded_offset[n + 1] =
        node_padded_offset[n] + static_cast<uint32_t>(PaddedWidth(node_width[n]));
  }
  node_begin.push_back(static_cast<uint32_t>(node_blocks.size()));
}

void Structure::FindParts(const Problem& problem) {
  // Parts keep their buffers from the last problem.
  size_t used = 0;
  const auto next_part = [&]() -> Part& {
    if (used == parts.size()) parts.emplace_back();
    Part& part = parts[used++];
    part.residuals.clear();
    part.local_feature.clear();
    part.positions.clear();
    part.nodes.clear();
    part.wanted = {};
    part.num_segments = 0;
    part.held.clear();
    return part;
  };
  for (size_t b = 0; b < problem.batches().size(); ++b) {
    const ResidualBatch& batch = *problem.batches()[b];
    const std::vector<int8_t> slot_of = FeatureSlots(problem, batch);
    std::array<size_t, kMaxSlots + 1> counts{};  // [slot + 1]: residuals whose feature it is
    for (int8_t slot : slot_of) ++counts[slot + 1];
    for (int feature_slot = -1; feature_slot < batch.num_slots(); ++feature_slot) {
      const size_t count = counts[feature_slot + 1];
      if (count == 0) continue;
      Part& part = next_part();
      part.batch = &batch;
      part.batch_idx = static_cast<int>(b);
      part.feature_slot = feature_slot;
      part.feature_tangent = feature_slot < 0 ? 0 : batch.tangent(feature_slot);
      HOLBA_CHECK_MSG(part.feature_tangent <= kMaxFeatureTangent,
                      batch.term() + ": features of more than 6 degrees of freedom");
      part.residuals.reserve(count);
      for (size_t i = 0; i < batch.size(); ++i) {
        if (slot_of[i] == feature_slot) part.residuals.push_back(static_cast<uint32_t>(i));
      }
      MakeSegments(&part);
    }
  }
  parts.resize(used);
}

void Structure::MakeSegments(Part* part) const {
  const ResidualBatch& batch = *part->batch;
  const int slots = batch.num_slots();
  // A block with a place for each slot that is in a segment: those where some block is variable.
  std::array<const BlockId*, kMaxSlots> example{};
  for (int s = 0; s < slots; ++s) {
    if (s == part->feature_slot) continue;
    for (uint32_t i : part->residuals) {
      const BlockId* id = &batch.blocks()[size_t{i} * slots + s];
      if (kept[*id].node == kNoNode) continue;
      example[s] = id;
      break;
    }
  }
  if (part->feature_slot >= 0) part->wanted[part->feature_slot] = true;
  std::array<bool, kMaxSlots> in_segment{};
  const auto add_to_segment = [&](int s, Segment* segment) {
    SegmentPart& piece = segment->parts[segment->num_parts++];
    piece = {s, batch.tangent(s), segment->width, block_columns[*example[s]]};
    segment->width += piece.columns.count;
    segment->padded = PaddedWidth(segment->width);
    part->wanted[s] = in_segment[s] = true;
  };
  part->row_stride = kFeatureRow;
  for (int s = 0; s < slots; ++s) {
    if (example[s] == nullptr || in_segment[s]) continue;
    Segment& segment = part->segments[part->num_segments++] = {};
    add_to_segment(s, &segment);
    for (int other = s + 1; merged_ && other < slots; ++other) {
      if (example[other] != nullptr && ShareNode(*part, s, other)) add_to_segment(other, &segment);
    }
    part->row_stride += segment.padded;
  }
}

// Whether two slots of a part hold the pose and the intrinsics of one node: the first residual that
// has both says so for all.
bool Structure::ShareNode(const Part& part, int slot, int other) const {
  for (uint32_t i : part.residuals) {
    const uint32_t a = kept[part.batch->block(i, slot)].node;
    const uint32_t b = kept[part.batch->block(i, other)].node;
    if (a != kNoNode && b != kNoNode) return a == b;
  }
  return false;
}

// Held coordinates that have a column, in padded vectors and by residual.
void Structure::FindHeld(const Problem& problem) {
  scratch_.still.assign(problem.num_blocks(), 0);
  bool any = false;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    if (!IsKept(block.role)) {
      if (!block.constant) scratch_.still[id] = block.held;
    } else if (kept[id].node != kNoNode) {
      const Columns& columns = block_columns[id];
      for (int c = 0; c < columns.count; ++c)
        scratch_.still[id] |= uint32_t{1} << columns.tangent[c];
      scratch_.still[id] &= ~block.FreeMask();
    }
    any |= scratch_.still[id] != 0;
  }
  held_column.assign(padded_size(), 0);
  for (BlockId id : node_blocks) {
    const Columns& columns = block_columns[id];
    for (int c = 0; c < columns.count; ++c) {
      held_column[node_padded_offset[kept[id].node] + kept[id].first + c] =
          scratch_.still[id] >> columns.tangent[c] & 1;
    }
  }
  if (!any) return;
  for (Part& part : parts) {
    for (uint32_t j = 0; j < part.residuals.size(); ++j) {
      for (int s = 0; s < part.batch->num_slots(); ++s) {
        if (!part.wanted[s]) continue;
        const uint32_t still = scratch_.still[part.batch->block(part.residuals[j], s)];
        if (still != 0) part.held.push_back({j, s, still});
      }
    }
  }
}

}  // namespace holba::native
