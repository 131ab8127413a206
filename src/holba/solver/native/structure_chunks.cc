// SPDX-License-Identifier: BSD-3-Clause
// Structure: the order of the features, their cliques, and the chunks.
#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <iterator>
#include <utility>

#include "holba/base/check.h"
#include "holba/linear/padding.h"
#include "holba/solver/native/structure.h"

namespace holba::native {
namespace {

// Residuals of a chunk: enough to fill vectors and to hide a virtual call, few enough for their
// panels, rows and W to stay in the second level of cache.
constexpr size_t kChunkResiduals = 128;
constexpr size_t kMaxChunkFeatures = 1024;  // features with few residuals each
// Bits of the keys that features are sorted by.
constexpr int kTangentBits = 3, kNodeBits = 64 - kTangentBits;

}  // namespace

void Structure::OrderFeatures(const Problem& problem) {
  FindFeatures(problem);
  ListNodes();
  SortFeatures();
  MakeCliques();
  FindPlacesOfFeatures(problem);
}

// The variable features in the order in which the residuals mention them, and upper bounds of the
// lengths of their lists of nodes.
void Structure::FindFeatures(const Problem& problem) {
  scratch_.feature_of_block.assign(problem.num_blocks(), kNoFeature);
  features.clear();
  std::vector<uint8_t>& tangent_of = scratch_.kind_of_block;  // the kinds are no longer needed
  scratch_.list_size.clear();
  for (const Part& part : parts) {
    if (part.feature_slot < 0) continue;
    for (uint32_t i : part.residuals) {
      const BlockId id = part.batch->block(i, part.feature_slot);
      if (scratch_.feature_of_block[id] == kNoFeature) {
        scratch_.feature_of_block[id] = static_cast<uint32_t>(features.size());
        features.push_back(id);
        scratch_.list_size.push_back(0);
        tangent_of[id] = static_cast<uint8_t>(part.feature_tangent);
      }
      scratch_.list_size[scratch_.feature_of_block[id]] += part.num_segments;
    }
  }
}

// The nodes that the residuals of each feature touch, ascending.
void Structure::ListNodes() {
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
        if (node == kNoNode) continue;
        // Most residuals of a feature come in the order of their nodes.
        uint32_t* list = &scratch_.lists[scratch_.list_begin[f]];
        if (scratch_.list_size[f] > 0 && list[scratch_.list_size[f] - 1] == node) continue;
        list[scratch_.list_size[f]++] = node;
      }
    }
  }
  for (size_t f = 0; f < n; ++f) {
    uint32_t* list = &scratch_.lists[scratch_.list_begin[f]];
    uint32_t* end = list + scratch_.list_size[f];
    if (std::adjacent_find(list, end, std::greater_equal<uint32_t>()) == end) continue;
    std::sort(list, end);
    scratch_.list_size[f] = static_cast<uint32_t>(std::unique(list, end) - list);
  }
}

// scratch_.keys: the features by their tangent size and then by as many of their first nodes as fit
// into a key, so that features with the same cameras stand side by side.
void Structure::SortFeatures() {
  const size_t n = features.size();
  const std::vector<uint8_t>& tangent_of = scratch_.kind_of_block;
  scratch_.keys.resize(n);
  const int bits = std::max(1, static_cast<int>(std::bit_width(num_nodes() + 1)));
  const int places = std::max(1, kNodeBits / bits);
  for (size_t f = 0; f < n; ++f) {
    const uint32_t* list = &scratch_.lists[scratch_.list_begin[f]];
    const uint32_t* end = list + scratch_.list_size[f];
    uint64_t key = tangent_of[features[f]];
    for (int i = 0; i < places; ++i) key = key << bits | (list + i < end ? list[i] + 1 : 0);
    scratch_.keys[f] = {key, static_cast<uint32_t>(f)};
  }
  SortKeys(bits * places + kTangentBits);
}

// The features in the order of their keys, and a clique for each run of features with the same
// nodes.
void Structure::MakeCliques() {
  const size_t n = features.size();
  scratch_.rank.resize(n);
  std::vector<BlockId> ordered(n);
  feature_clique.resize(n);
  cliques.begin.assign(1, 0);
  cliques.nodes.clear();
  num_pairs = 0.0;
  for (size_t r = 0; r < n; ++r) {
    const uint32_t f = scratch_.keys[r].second;
    scratch_.rank[f] = static_cast<uint32_t>(r);
    ordered[r] = features[f];
    const uint32_t* list = &scratch_.lists[scratch_.list_begin[f]];
    const uint32_t size = scratch_.list_size[f];
    const uint32_t last = r > 0 ? scratch_.keys[r - 1].second : f;
    const bool same = r > 0 && size == scratch_.list_size[last] &&
                      std::equal(list, list + size, &scratch_.lists[scratch_.list_begin[last]]);
    if (!same) {
      cliques.nodes.insert(cliques.nodes.end(), list, list + size);
      cliques.begin.push_back(static_cast<uint32_t>(cliques.nodes.size()));
    }
    feature_clique[r] = static_cast<uint32_t>(cliques.size() - 1);
    num_pairs += 0.5 * size * (size + 1.0);
  }
  HOLBA_CHECK_MSG(n == 0 || cliques.size() > 0, "features without cliques");
  features.swap(ordered);
}

// Where the values of each feature stand in the state, and its manifold.
void Structure::FindPlacesOfFeatures(const Problem& problem) {
  const size_t n = features.size();
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

// Sorts scratch_.keys by key with a stable radix sort.
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

// Puts the residuals of each feature in the order of their nodes. `start`: the first residual of
// each feature.
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
  chunks.clear();
  chunk_parts.clear();
  factors_size = max_panel = max_rows = max_w = max_features = max_residuals = max_positions = 0;
  SortResiduals();
  for (uint32_t begin = 0; begin < features.size();) begin = MakeFeatureChunk(problem, begin);
  for (uint32_t part_idx = 0; part_idx < parts.size(); ++part_idx) MakeLooseChunks(part_idx);
}

// Puts the residuals of every part in the order of their features; scratch_.part_start has, for
// each part with features, the first residual of each feature.
void Structure::SortResiduals() {
  const size_t n = features.size();
  size_t num_feature_parts = 0;
  for (const Part& part : parts) num_feature_parts += part.feature_slot >= 0;
  scratch_.part_start.resize(num_feature_parts * (n + 1));
  std::vector<uint32_t> sorted;
  size_t p = 0;
  for (Part& part : parts) {
    if (part.feature_slot < 0) continue;
    const auto rank_of = [&](uint32_t i) {
      return scratch_.rank[scratch_.feature_of_block[part.batch->block(i, part.feature_slot)]];
    };
    uint32_t* start = &scratch_.part_start[p++ * (n + 1)];
    std::fill_n(start, n + 1, 0);
    bool in_order = true;
    uint32_t before = 0;
    for (uint32_t i : part.residuals) {
      const uint32_t r = rank_of(i);
      ++start[r + 1];
      in_order &= r >= before;
      before = r;
    }
    for (size_t r = 0; r < n; ++r) start[r + 1] += start[r];
    if (!in_order) {
      sorted.resize(part.residuals.size());
      for (uint32_t i : part.residuals) sorted[start[rank_of(i)]++] = i;
      for (size_t r = n; r > 0; --r) start[r] = start[r - 1];
      start[0] = 0;
      part.residuals.assign(sorted.begin(), sorted.end());
    }
    if (part.num_segments == 1) SortByNode(&part, start, n);
    part.local_feature.resize(part.residuals.size());
    part.positions.resize(part.residuals.size() * part.num_segments);
  }
}

// One chunk of features from `begin` on; returns where the next one begins.
uint32_t Structure::MakeFeatureChunk(const Problem& problem, uint32_t begin) {
  const size_t n = features.size();
  const size_t num_feature_parts = scratch_.part_start.size() / (n + 1);
  const auto tangent_of = [&](uint32_t f) {
    return problem.block(features[f]).manifold->tangent;
  };
  Chunk chunk;
  chunk.feature_begin = begin;
  chunk.feature_tangent = tangent_of(begin);
  size_t residuals = 0;
  uint32_t end = begin;
  while (end < n && end - begin < kMaxChunkFeatures && residuals < kChunkResiduals &&
         tangent_of(end) == chunk.feature_tangent) {
    for (size_t k = 0; k < num_feature_parts; ++k) {
      const uint32_t* start = &scratch_.part_start[k * (n + 1)];
      residuals += start[end + 1] - start[end];
    }
    const auto nodes = cliques.Nodes(feature_clique[end]);
    HOLBA_CHECK_MSG(nodes.size() <= kMaxPositions, "a feature sees more than 32767 kept blocks");
    chunk.num_positions += static_cast<uint32_t>(nodes.size());
    for (uint32_t node : nodes)
      chunk.w_size += static_cast<size_t>(chunk.feature_tangent) * PaddedWidth(node_width[node]);
    ++end;
  }
  chunk.feature_end = end;
  chunk.parts_begin = static_cast<uint32_t>(chunk_parts.size());
  scratch_.touched.assign(chunk.num_positions, 0);
  size_t k = 0;
  for (uint32_t part_idx = 0; part_idx < parts.size(); ++part_idx) {
    if (parts[part_idx].feature_slot < 0) continue;
    const uint32_t* start = &scratch_.part_start[k++ * (n + 1)];
    if (start[begin] == start[end]) continue;
    chunk_parts.push_back({part_idx, start[begin], start[end]});
    PlaceResiduals(chunk, start, &parts[part_idx]);
  }
  chunk.parts_end = static_cast<uint32_t>(chunk_parts.size());
  chunk.plain = IsPlain(chunk);
  FinishChunk(&chunk);
  return end;
}

// Places of a part's residuals in the cliques of a chunk's features; who touches a W first.
void Structure::PlaceResiduals(const Chunk& chunk, const uint32_t* start, Part* part) {
  uint8_t* touched = scratch_.touched.data();
  for (uint32_t f = chunk.feature_begin; f < chunk.feature_end; ++f) {
    const auto nodes = cliques.Nodes(feature_clique[f]);
    for (uint32_t j = start[f]; j < start[f + 1]; ++j) {
      part->local_feature[j] = static_cast<uint16_t>(f - chunk.feature_begin);
      for (int s = 0; s < part->num_segments; ++s) {
        const uint32_t node = NodeOf(*part, part->segments[s], part->residuals[j]);
        uint16_t& position = part->positions[j * part->num_segments + s];
        if (node == kNoNode) {
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

// Chunks of the residuals of a part without features.
void Structure::MakeLooseChunks(uint32_t part_idx) {
  Part& part = parts[part_idx];
  if (part.feature_slot >= 0 || part.num_segments == 0) return;
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
    FinishChunk(&chunk);
  }
}

// Gives a chunk the place of its factors, counts what its buffers need, and appends it.
void Structure::FinishChunk(Chunk* chunk) {
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
  const size_t num = FeatureStride(chunk->feature_end - chunk->feature_begin);
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
}

// Whether the residuals of a chunk are those of one part, one for each place in the cliques of the
// features, in order, and of a shape that elimination has constants for.
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
