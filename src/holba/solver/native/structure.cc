// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/structure.h"

#include <algorithm>
#include <bit>
#include <set>
#include <string>
#include <utility>

#include "holba/base/check.h"
#include "holba/linear/padding.h"

namespace holba::native {
namespace {

// What a build may leave for the next one: enough for local adjustments. Larger problems need the
// memory for other things.
constexpr size_t kKeptScratchBytes = size_t{1} << 19;
// Blocks with the same kind and tangent share their columns.
struct Kind {
  std::string_view name;
  int tangent;
  uint32_t free = 0;  // coordinates that some block moves
  bool is_pose, is_camera;
};

Columns ColumnsOf(uint32_t free, int tangent) {
  Columns columns;
  for (int i = 0; i < tangent; ++i) {
    if (free >> i & 1) columns.tangent[columns.count++] = static_cast<uint8_t>(i);
  }
  return columns;
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
  scratch_.kind_of_block.resize(num_blocks);
  for (BlockId id = 0; id < num_blocks; ++id) {
    const ParameterBlock& block = problem.block(id);
    size_t k = 0;
    while (k < kinds.size() &&
           !(kinds[k].tangent == block.manifold->tangent && kinds[k].name == block.kind))
      ++k;
    if (k == kinds.size()) {
      HOLBA_CHECK_MSG(k < 255, "too many kinds of blocks");
      kinds.push_back(
          {block.kind, block.manifold->tangent, 0, block.kind == "pose", block.kind == "camera"});
    }
    scratch_.kind_of_block[id] = static_cast<uint8_t>(k);
    if (block.role == BlockRole::kKept) kinds[k].free |= block.FreeMask();
  }

  // Kinds that meet in one slot share their columns too. Which pose is the only one of a camera?
  constexpr uint32_t kSeveral = kNone - 1;
  std::vector<uint32_t> pose_of(num_blocks, kNone), camera_of(num_blocks, kNone);
  std::set<std::pair<uint8_t, uint8_t>> meetings;
  std::vector<uint8_t> used(num_blocks, 0);  // by a residual
  for (const auto& batch : problem.batches()) {
    const int slots = batch->num_slots();
    const BlockId* const blocks = batch->blocks().data();
    std::array<uint8_t, kMaxSlots> kind_of_slot{};
    const auto look_at_slots = [&](const BlockId* ids, int* pose_slot, int* camera_slot) {
      *pose_slot = *camera_slot = -1;
      for (int s = 0; s < slots; ++s) {
        kind_of_slot[s] = scratch_.kind_of_block[ids[s]];
        if (kinds[kind_of_slot[s]].is_pose) *pose_slot = s;
        if (kinds[kind_of_slot[s]].is_camera) *camera_slot = s;
      }
    };
    int pose_slot = -1, camera_slot = -1;
    look_at_slots(blocks, &pose_slot, &camera_slot);
    for (size_t i = 0; i < batch->size(); ++i) {
      const BlockId* ids = blocks + i * slots;
      bool as_before = true;
      for (int s = 0; s < slots; ++s) {
        used[ids[s]] = 1;
        as_before &= scratch_.kind_of_block[ids[s]] == kind_of_slot[s];
      }
      if (!as_before) {
        look_at_slots(ids, &pose_slot, &camera_slot);
        for (int s = 0; s < slots; ++s) {
          const uint8_t k = kind_of_slot[s], first = scratch_.kind_of_block[blocks[s]];
          if (k != first) meetings.insert({std::min(k, first), std::max(k, first)});
        }
      }
      const BlockId pose = pose_slot < 0 ? kNone : ids[pose_slot];
      const BlockId camera = camera_slot < 0 ? kNone : ids[camera_slot];
      if (camera == kNone) continue;
      if (pose == kNone) {
        pose_of[camera] = kSeveral;
        continue;
      }
      if (pose_of[camera] != pose) pose_of[camera] = pose_of[camera] == kNone ? pose : kSeveral;
      if (camera_of[pose] != camera) camera_of[pose] = camera_of[pose] == kNone ? camera : kSeveral;
    }
  }
  for (size_t round = 0; round < meetings.size(); ++round) {
    for (const auto& [a, b] : meetings)
      kinds[a].free = kinds[b].free = kinds[a].free | kinds[b].free;
  }
  merged_ = false;
  bool any_camera = false, all_alone = true;
  for (BlockId id = 0; id < num_blocks; ++id) {
    const ParameterBlock& block = problem.block(id);
    const Kind& kind = kinds[scratch_.kind_of_block[id]];
    if (!kind.is_camera || block.role != BlockRole::kKept || block.FreeTangent() == 0) continue;
    if (pose_of[id] == kNone) continue;  // no residual sees it
    any_camera = true;
    const bool alone = pose_of[id] != kSeveral && camera_of[pose_of[id]] == id &&
                       std::popcount(kind.free) + 6 <= kMaxBlockWidth;
    all_alone &= alone;
  }
  merged_ = any_camera && all_alone;

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
    const Kind& kind = kinds[scratch_.kind_of_block[id]];
    const Columns columns = ColumnsOf(kind.free, kind.tangent);
    block_columns[id] = columns;
    kept[id] = {static_cast<uint32_t>(node_width.size() - 1), node_width.back()};
    node_blocks.push_back(id);
    node_width.back() += columns.count;
  };
  const auto moves = [&](BlockId id) {
    return used[id] != 0 && problem.block(id).role == BlockRole::kKept &&
           problem.block(id).FreeTangent() > 0;
  };
  for (BlockId id = 0; id < num_blocks; ++id) {
    if (!kinds[scratch_.kind_of_block[id]].is_pose || problem.block(id).role != BlockRole::kKept)
      continue;
    const BlockId camera =
        merged_ && camera_of[id] < kSeveral && moves(camera_of[id]) ? camera_of[id] : kNone;
    if (!moves(id) && camera == kNone) continue;
    begin_node();
    if (kinds[scratch_.kind_of_block[id]].free != 0) add_block(id);
    if (camera != kNone) add_block(camera);
  }
  num_pose_nodes = static_cast<uint32_t>(node_width.size());
  for (BlockId id = 0; id < num_blocks; ++id) {
    if (!moves(id) || kept[id].node != kNone) continue;
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
    const int slots = batch.num_slots();
    // Of each slot (and, last, of none): the residuals whose feature it is.
    std::array<size_t, kMaxSlots + 1> counts{};
    std::array<bool, kMaxSlots> feature_role{};
    for (int s = 0; s < slots; ++s) {
      for (size_t i = 0; i < batch.size() && !feature_role[s]; ++i)
        feature_role[s] = problem.block(batch.block(i, s)).role == BlockRole::kFeature;
    }
    const auto feature_slot_of = [&](size_t i) {
      for (int s = 0; s < slots; ++s) {
        if (!feature_role[s]) continue;
        const ParameterBlock& block = problem.block(batch.block(i, s));
        if (block.role == BlockRole::kFeature && block.FreeTangent() > 0) return s;
      }
      return -1;
    };
    std::vector<int8_t> slot_of(batch.size());
    for (size_t i = 0; i < batch.size(); ++i) {
      const int s = feature_slot_of(i);
      slot_of[i] = static_cast<int8_t>(s);
      ++counts[s < 0 ? kMaxSlots : s];
    }
    for (int feature_slot = -1; feature_slot < slots; ++feature_slot) {
      const size_t count = counts[feature_slot < 0 ? kMaxSlots : feature_slot];
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
      // A slot gets a segment if any of its blocks moves.
      std::array<BlockId, kMaxSlots> example;
      example.fill(kNone);
      for (int s = 0; s < slots; ++s) {
        if (s == feature_slot) continue;
        for (size_t i = 0; i < count && example[s] == kNone; ++i) {
          const BlockId id = batch.block(part.residuals[i], s);
          if (kept[id].node != kNone) example[s] = id;
        }
      }
      if (feature_slot >= 0) part.wanted[feature_slot] = true;
      part.row_stride = 8;
      std::array<int, kMaxSlots> segment_of;
      segment_of.fill(-1);
      const auto add_to_segment = [&](int s, int segment_idx) {
        const BlockId id = example[s];
        Segment& segment = part.segments[segment_idx];
        SegmentPart& piece = segment.parts[segment.num_parts++];
        piece = {s, batch.tangent(s), segment.width, block_columns[id]};
        segment.width += piece.columns.count;
        segment.padded = PaddedWidth(segment.width);
        segment_of[s] = segment_idx;
        part.wanted[s] = true;
      };
      for (int s = 0; s < slots; ++s) {
        if (example[s] == kNone || segment_of[s] >= 0) continue;
        const int idx = part.num_segments++;
        part.segments[idx] = {};
        add_to_segment(s, idx);
        if (!merged_) continue;
        for (int other = s + 1; other < slots; ++other) {
          if (example[other] == kNone) continue;
          // Merged nodes: pose and camera of one residual share theirs.
          for (size_t i = 0; i < count; ++i) {
            const uint32_t a = kept[batch.block(part.residuals[i], s)].node;
            const uint32_t c = kept[batch.block(part.residuals[i], other)].node;
            if (a == kNone || c == kNone) continue;
            if (a == c) add_to_segment(other, idx);
            break;
          }
        }
      }
      for (int k = 0; k < part.num_segments; ++k) part.row_stride += part.segments[k].padded;
    }
  }
  parts.resize(used);
}

void Structure::FindHeld(const Problem& problem) {
  scratch_.still.assign(problem.num_blocks(), 0);
  bool any = false;
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    const ParameterBlock& block = problem.block(id);
    if (block.role == BlockRole::kFeature) {
      if (!block.constant) scratch_.still[id] = block.held;
    } else if (kept[id].node != kNone) {
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
