// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/native/structure.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <set>
#include <string>
#include <utility>

#include "holba/base/check.h"
#include "holba/linear/block_matrix.h"

namespace holba::native {
namespace {

// Residuals of a chunk: enough to fill vectors and to hide a virtual call, few enough for their
// panels, rows and W to stay in the second level of cache.
constexpr size_t kChunkResiduals = 128;
constexpr size_t kMaxChunkFeatures = 1024;  // vp residuals: one a feature
constexpr int kMaxNodeWidth = 24;
// What a build may leave for the next one: enough for local adjustments. Larger problems need the
// memory for other things.
constexpr size_t kKeptScratchBytes = size_t{1} << 19;
// Of the keys that features are sorted by.
constexpr int kTangentBits = 3, kNodeBits = 64 - kTangentBits;

constexpr size_t RoundUp(size_t n, size_t unit) { return (n + unit - 1) / unit * unit; }

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

uint32_t FreeMask(const ParameterBlock& block) {
  if (block.constant) return 0;
  return ~block.held & ((uint32_t{1} << block.manifold->tangent) - 1);
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
    if (block.role == BlockRole::kKept) kinds[k].free |= FreeMask(block);
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
                       std::popcount(kind.free) + 6 <= kMaxNodeWidth;
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

void Structure::OrderFeatures(const Problem& problem) {
  const size_t num_blocks = problem.num_blocks();
  scratch_.feature_of_block.assign(num_blocks, kNone);
  features.clear();
  std::vector<uint8_t>& tangent_of =
      scratch_.kind_of_block;  // of features; no longer needed as kinds
  // Upper bounds of the lists' lengths.
  scratch_.list_size.clear();
  for (const Part& part : parts) {
    if (part.feature_slot < 0) continue;
    for (uint32_t i : part.residuals) {
      const BlockId id = part.batch->block(i, part.feature_slot);
      if (scratch_.feature_of_block[id] == kNone) {
        scratch_.feature_of_block[id] = static_cast<uint32_t>(features.size());
        features.push_back(id);
        scratch_.list_size.push_back(0);
        tangent_of[id] = static_cast<uint8_t>(part.feature_tangent);
      }
      scratch_.list_size[scratch_.feature_of_block[id]] += part.num_segments;
    }
  }
  const size_t n = features.size();
  scratch_.list_begin.resize(n + 1);
  scratch_.list_begin[0] = 0;
  for (size_t f = 0; f < n; ++f) {
    scratch_.list_begin[f + 1] = scratch_.list_begin[f] + scratch_.list_size[f];
    scratch_.list_size[f] = 0;
  }
  scratch_.lists.resize(scratch_.list_begin[n]);
  for (const Part& part : parts) {
    if (part.feature_slot < 0) continue;
    for (uint32_t i : part.residuals) {
      const uint32_t f = scratch_.feature_of_block[part.batch->block(i, part.feature_slot)];
      for (int s = 0; s < part.num_segments; ++s) {
        const uint32_t node = NodeOf(part, part.segments[s], i);
        if (node == kNone) continue;
        // Most residuals of a feature come in the order of their nodes.
        uint32_t* list = &scratch_.lists[scratch_.list_begin[f]];
        if (scratch_.list_size[f] > 0 && list[scratch_.list_size[f] - 1] == node) continue;
        list[scratch_.list_size[f]++] = node;
      }
    }
  }
  scratch_.keys.resize(n);
  // Keys: tangent, then as many of the first nodes as fit: features with the same cameras come
  // together.
  const int bits = std::max(1, static_cast<int>(std::bit_width(num_nodes() + 1)));
  const int places = std::max(1, kNodeBits / bits);
  for (size_t f = 0; f < n; ++f) {
    uint32_t* list = &scratch_.lists[scratch_.list_begin[f]];
    uint32_t* end = list + scratch_.list_size[f];
    if (std::adjacent_find(list, end, std::greater_equal<uint32_t>()) != end) {
      std::sort(list, end);
      end = std::unique(list, end);
      scratch_.list_size[f] = static_cast<uint32_t>(end - list);
    }
    uint64_t key = tangent_of[features[f]];
    for (int i = 0; i < places; ++i) key = key << bits | (list + i < end ? list[i] + 1 : 0);
    scratch_.keys[f] = {key, static_cast<uint32_t>(f)};
  }
  SortKeys(bits * places + kTangentBits);
  scratch_.rank.resize(n);
  std::vector<BlockId> ordered(n);
  feature_clique.resize(n);
  cliques.begin.assign(1, 0);
  cliques.nodes.clear();
  num_pairs = 0.0;
  uint32_t last = kNone;
  for (size_t r = 0; r < n; ++r) {
    const uint32_t f = scratch_.keys[r].second;
    scratch_.rank[f] = static_cast<uint32_t>(r);
    ordered[r] = features[f];
    const uint32_t* list = &scratch_.lists[scratch_.list_begin[f]];
    const bool same =
        last != kNone && scratch_.list_size[f] == scratch_.list_size[last] &&
        std::equal(list, list + scratch_.list_size[f], &scratch_.lists[scratch_.list_begin[last]]);
    if (!same) {
      cliques.nodes.insert(cliques.nodes.end(), list, list + scratch_.list_size[f]);
      cliques.begin.push_back(static_cast<uint32_t>(cliques.nodes.size()));
    }
    last = f;
    feature_clique[r] = static_cast<uint32_t>(cliques.size() - 1);
    num_pairs += 0.5 * scratch_.list_size[f] * (scratch_.list_size[f] + 1.0);
  }
  HOLBA_CHECK_MSG(n == 0 || cliques.size() > 0, "features without cliques");
  features.swap(ordered);

  feature_at.resize(n);
  feature_manifold.resize(n);
  manifolds.clear();
  for (size_t f = 0; f < n; ++f) {
    feature_at[f] = problem.values(features[f]) - problem.state().data();
    const ManifoldOps* const manifold = problem.block(features[f]).manifold;
    size_t m = 0;
    while (m < manifolds.size() && manifolds[m] != manifold) ++m;
    if (m == manifolds.size()) {
      HOLBA_CHECK_MSG(m < 255, "too many kinds of features");
      manifolds.push_back(manifold);
    }
    feature_manifold[f] = static_cast<uint8_t>(m);
  }
}

// scratch_.keys by key, equal ones in the order in which they stand: digit by digit from the last
// one.
void Structure::SortKeys(int key_bits) {
  if (std::is_sorted(scratch_.keys.begin(), scratch_.keys.end())) return;
  constexpr int kDigitBits = 11;
  constexpr uint64_t kDigits = uint64_t{1} << kDigitBits;
  if (scratch_.keys.size() < kDigits / 4) {
    std::sort(scratch_.keys.begin(), scratch_.keys.end());
    return;
  }
  scratch_.other_keys.resize(scratch_.keys.size());
  for (int shift = 0; shift < key_bits; shift += kDigitBits) {
    std::array<uint32_t, kDigits> place{};
    for (const auto& [key, f] : scratch_.keys) ++place[key >> shift & (kDigits - 1)];
    uint32_t before = 0;
    for (uint32_t& p : place) before += std::exchange(p, before);
    for (const auto& entry : scratch_.keys)
      scratch_.other_keys[place[entry.first >> shift & (kDigits - 1)]++] = entry;
    scratch_.keys.swap(scratch_.other_keys);
  }
}

// The residuals of each feature in the order of their nodes.
void Structure::SortByNode(Part* part, const uint32_t* start, size_t num_features) const {
  const auto node_of = [&](uint32_t residual) {
    return NodeOf(*part, part->segments[0], residual);
  };
  const auto before = [&](uint32_t a, uint32_t b) {
    const uint32_t node_a = node_of(a), node_b = node_of(b);
    return node_a != node_b ? node_a < node_b : a < b;
  };
  for (size_t f = 0; f < num_features; ++f) {
    uint32_t* const first = part->residuals.data() + start[f];
    uint32_t* const last = part->residuals.data() + start[f + 1];
    if (!std::is_sorted(first, last, before)) std::sort(first, last, before);
  }
}

void Structure::MakeChunks(const Problem& problem) {
  const size_t n = features.size();
  chunks.clear();
  chunk_parts.clear();
  factors_size = max_panel = max_rows = max_w = max_features = max_residuals = max_positions = 0;

  // Residuals of every part in the order of their features.
  size_t num_feature_parts = 0;
  for (const Part& part : parts) num_feature_parts += part.feature_slot >= 0;
  scratch_.part_start.resize(num_feature_parts * (n + 1));
  std::vector<uint32_t> sorted;
  size_t p = 0;
  for (Part& part : parts) {
    if (part.feature_slot < 0) continue;
    uint32_t* start = &scratch_.part_start[p++ * (n + 1)];
    std::fill_n(start, n + 1, 0);
    bool in_order = true;
    uint32_t before = 0;
    for (uint32_t i : part.residuals) {
      const uint32_t r =
          scratch_.rank[scratch_.feature_of_block[part.batch->block(i, part.feature_slot)]];
      ++start[r + 1];
      in_order &= r >= before;
      before = r;
    }
    for (size_t r = 0; r < n; ++r) start[r + 1] += start[r];
    if (!in_order) {
      sorted.resize(part.residuals.size());
      for (uint32_t i : part.residuals) {
        const uint32_t r =
            scratch_.rank[scratch_.feature_of_block[part.batch->block(i, part.feature_slot)]];
        sorted[start[r]++] = i;
      }
      for (size_t r = n; r > 0; --r) start[r] = start[r - 1];
      start[0] = 0;
      part.residuals.assign(sorted.begin(), sorted.end());
    }
    if (part.num_segments == 1) SortByNode(&part, start, n);
    part.local_feature.resize(part.residuals.size());
    part.positions.resize(part.residuals.size() * part.num_segments);
  }

  const auto finish = [&](Chunk* chunk) {
    size_t panel = 0, rows = 0, residuals = 0;
    for (uint32_t c = chunk->parts_begin; c < chunk->parts_end; ++c) {
      const ChunkPart& cp = chunk_parts[c];
      const Part& part = parts[cp.part];
      const size_t count = cp.end - cp.begin, stride = PanelStride(count);
      size_t entries = part.batch->dim();
      for (int s = 0; s < part.batch->num_slots(); ++s) {
        if (part.wanted[s])
          entries += static_cast<size_t>(part.batch->dim()) * part.batch->tangent(s);
      }
      panel += entries * stride;
      rows = std::max(rows, static_cast<size_t>(part.batch->dim()) * part.row_stride * stride);
      residuals = std::max(residuals, stride);
    }
    const size_t num = RoundUp(chunk->feature_end - chunk->feature_begin, kPanelLanes);
    const int F = chunk->feature_tangent;
    chunk->factor_begin = factors_size;
    factors_size += num * (F * (F + 1) / 2 + F);
    max_panel = std::max(max_panel, panel);
    max_rows = std::max(max_rows, rows);
    max_w = std::max(max_w, chunk->w_size);
    max_features = std::max(max_features, num);
    max_residuals = std::max(max_residuals, residuals);
    max_positions = std::max<size_t>(max_positions, chunk->num_positions);
    chunks.push_back(*chunk);
  };

  for (uint32_t begin = 0; begin < n;) {
    Chunk chunk;
    chunk.feature_begin = begin;
    chunk.feature_tangent = problem.block(features[begin]).manifold->tangent;
    size_t residuals = 0;
    uint32_t end = begin;
    while (end < n && end - begin < kMaxChunkFeatures && residuals < kChunkResiduals &&
           problem.block(features[end]).manifold->tangent == chunk.feature_tangent) {
      for (size_t k = 0; k < num_feature_parts; ++k) {
        const uint32_t* start = &scratch_.part_start[k * (n + 1)];
        residuals += start[end + 1] - start[end];
      }
      const auto nodes = cliques.Nodes(feature_clique[end]);
      HOLBA_CHECK_MSG(nodes.size() <= kMaxPositions, "a feature sees more than 32767 kept blocks");
      chunk.num_positions += static_cast<uint32_t>(nodes.size());
      for (uint32_t node : nodes) {
        chunk.w_size += static_cast<size_t>(chunk.feature_tangent) * PaddedWidth(node_width[node]);
      }
      ++end;
    }
    chunk.feature_end = end;
    chunk.parts_begin = static_cast<uint32_t>(chunk_parts.size());
    scratch_.touched.assign(chunk.num_positions, 0);
    size_t k = 0;
    for (uint32_t part_idx = 0; part_idx < parts.size(); ++part_idx) {
      Part& part = parts[part_idx];
      if (part.feature_slot < 0) continue;
      const uint32_t* start = &scratch_.part_start[k++ * (n + 1)];
      if (start[begin] == start[end]) continue;
      chunk_parts.push_back({part_idx, start[begin], start[end]});
      uint8_t* touched = scratch_.touched.data();
      for (uint32_t f = begin; f < end; ++f) {
        const auto nodes = cliques.Nodes(feature_clique[f]);
        for (uint32_t j = start[f]; j < start[f + 1]; ++j) {
          part.local_feature[j] = static_cast<uint16_t>(f - begin);
          for (int s = 0; s < part.num_segments; ++s) {
            const uint32_t node = NodeOf(part, part.segments[s], part.residuals[j]);
            uint16_t& position = part.positions[j * part.num_segments + s];
            if (node == kNone) {
              position = kNoPosition;
              continue;
            }
            position = static_cast<uint16_t>(std::lower_bound(nodes.begin(), nodes.end(), node) -
                                             nodes.begin());
            if (!std::exchange(touched[position], uint8_t{1})) position |= kFirstTouch;
          }
        }
        touched += nodes.size();
      }
    }
    chunk.parts_end = static_cast<uint32_t>(chunk_parts.size());
    chunk.plain = IsPlain(chunk);
    finish(&chunk);
    begin = end;
  }
  for (uint32_t part_idx = 0; part_idx < parts.size(); ++part_idx) {
    Part& part = parts[part_idx];
    if (part.feature_slot >= 0 || part.num_segments == 0) continue;
    part.nodes.resize(part.residuals.size() * part.num_segments);
    for (size_t j = 0; j < part.residuals.size(); ++j) {
      for (int s = 0; s < part.num_segments; ++s)
        part.nodes[j * part.num_segments + s] = NodeOf(part, part.segments[s], part.residuals[j]);
    }
    for (size_t begin = 0; begin < part.residuals.size(); begin += kChunkResiduals) {
      Chunk chunk;
      chunk.parts_begin = static_cast<uint32_t>(chunk_parts.size());
      chunk_parts.push_back(
          {part_idx, static_cast<uint32_t>(begin),
           static_cast<uint32_t>(std::min(begin + kChunkResiduals, part.residuals.size()))});
      chunk.parts_end = static_cast<uint32_t>(chunk_parts.size());
      finish(&chunk);
    }
  }
}

// Whether the residuals are those of one part, one for each place of the features' cliques, in
// order.
bool Structure::IsPlain(const Chunk& chunk) const {
  if (chunk.parts_end - chunk.parts_begin != 1) return false;
  const ChunkPart& cp = chunk_parts[chunk.parts_begin];
  const Part& part = parts[cp.part];
  if (part.num_segments != 1 || cp.end - cp.begin != chunk.num_positions) return false;
  const int width = part.segments[0].width;
  if (std::none_of(std::begin(kConstantShapes), std::end(kConstantShapes),
                   [&](const ResidualShape& shape) {
                     return IsShape(shape, chunk.feature_tangent, part.batch->dim(), width);
                   }))
    return false;
  uint32_t j = cp.begin;
  for (uint32_t f = chunk.feature_begin; f < chunk.feature_end; ++f) {
    const auto nodes = cliques.Nodes(feature_clique[f]);
    for (size_t p = 0; p < nodes.size(); ++p, ++j) {
      if (part.local_feature[j] != f - chunk.feature_begin || node_width[nodes[p]] != width ||
          part.positions[j] != (p | kFirstTouch))
        return false;
    }
  }
  return true;
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
      scratch_.still[id] &= ~FreeMask(block);
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

double Structure::Work(const Chunk& chunk) const {
  double work = 0.0;
  for (uint32_t c = chunk.parts_begin; c < chunk.parts_end; ++c) {
    const ChunkPart& cp = chunk_parts[c];
    work += static_cast<double>(cp.end - cp.begin) * parts[cp.part].batch->dim() *
            parts[cp.part].row_stride * 3.0;
  }
  for (uint32_t f = chunk.feature_begin; f < chunk.feature_end; ++f) {
    const double size = static_cast<double>(cliques.Nodes(feature_clique[f]).size());
    work += 40.0 + 10.0 * size * (size + 1.0);
  }
  return work;
}

}  // namespace holba::native
