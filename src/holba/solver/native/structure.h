// SPDX-License-Identifier: BSD-3-Clause
// What the native solver knows of a problem before it sees a number: the unknowns and their places,
// which residuals belong to which feature, and which kept unknowns a feature couples.
//
//   node      kept parameter blocks side by side in one block of the reduced system: a pose, an
//             intrinsics block or group, or a pose with the intrinsics that only it has
//   part      the residuals of one batch that have their feature in the same slot, or none
//   segment   consecutive columns of a part's Jacobian that belong to one node
//   clique    the nodes that a feature's residuals touch, ascending: what its elimination couples
//   chunk     consecutive features (or residuals without one) that are worked on in one go; their
//             panels fit the first two levels of cache
//   slice     consecutive chunks that one thread works on, with sums of their own. Slices depend on
//             the problem only, never on the number of threads, and so do all sums.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "holba/problem/problem.h"
#include "holba/solver/native/elimination.h"

namespace holba::native {

inline constexpr uint32_t kNone = ~uint32_t{0};
inline constexpr int kMaxFeatureTangent = 6;
inline constexpr int kMaxSegments = kMaxSlots;

// Columns of a block's Jacobian, as they stand in its node. Coordinates that every block of its
// kind holds have no column; one that only this block holds keeps its column, filled with zeros.
struct Columns {
  int count = 0;
  std::array<uint8_t, kMaxTangent> tangent{};  // which tangent coordinate
};

// Place of a variable kept block.
struct KeptBlock {
  uint32_t node = kNone;
  int first = 0;  // column in the node
};

struct SegmentPart {
  int slot = 0;
  int tangent = 0;
  int first = 0;  // column in the segment
  Columns columns;
};
struct Segment {
  int width = 0;
  int padded = 0;
  int num_parts = 0;
  std::array<SegmentPart, 2> parts{};
};

struct Part {
  const ResidualBatch* batch = nullptr;
  int batch_idx = 0;
  int feature_slot = -1;
  int feature_tangent = 0;               // 0: no feature
  std::array<bool, kMaxSlots> wanted{};  // Jacobians
  int num_segments = 0;
  std::array<Segment, kMaxSegments> segments{};
  int row_stride = 0;  // doubles of one row: 8 of the feature, then the padded segments

  // In the order in which they are worked on.
  std::vector<uint32_t> residuals;
  std::vector<uint16_t> local_feature;  // within its chunk
  // Of segment s of residual j, at [j * num_segments + s]: kNoPosition, or its node's place in the
  // feature's clique and kFirstTouch (elimination.h).
  std::vector<uint16_t> positions;
  // Without a feature: the node instead, or kNone.
  std::vector<uint32_t> nodes;
  // Columns of zeros, by residual: coordinates of single blocks that do not move.
  struct Held {
    uint32_t residual;  // place in `residuals`
    int slot;
    uint32_t coordinates;
  };
  std::vector<Held> held;
};

struct Cliques {
  std::vector<uint32_t> begin;  // of nodes, one more than cliques
  std::vector<uint32_t> nodes;

  std::span<const uint32_t> Nodes(uint32_t clique) const {
    return {nodes.data() + begin[clique], nodes.data() + begin[clique + 1]};
  }
  size_t size() const { return begin.empty() ? 0 : begin.size() - 1; }
};

struct ChunkPart {
  uint32_t part = 0;
  uint32_t begin = 0, end = 0;  // in Part::residuals
};
struct Chunk {
  int feature_tangent = 0;  // 0: residuals without a feature
  uint32_t feature_begin = 0, feature_end = 0;
  uint32_t parts_begin = 0, parts_end = 0;
  uint32_t num_positions = 0;  // sum of the sizes of the features' cliques
  bool plain = false;          // EliminatePlain (elimination.h) applies
  size_t w_size = 0;           // doubles of W of all its features
  size_t factor_begin = 0;     // of its features' factors, doubles
};
// Of a panel of so many residuals: an odd multiple of kPanelLanes, so that its rows do not all fall
// into the same sets of the cache.
constexpr size_t PanelStride(size_t count) {
  return (count + kPanelLanes - 1) / kPanelLanes / 2 * 2 * kPanelLanes + kPanelLanes;
}

// Of the factors of so many features.
constexpr size_t FeatureStride(size_t count) {
  return (count + kPanelLanes - 1) / kPanelLanes * kPanelLanes;
}

struct Structure {
  // Nodes: poses (and what merged with them) first, then the border: nodes that several poses see.
  std::vector<KeptBlock> kept;  // by block id; node == kNone: constant or a feature
  std::vector<uint32_t> node_begin, node_blocks;  // blocks of each node
  std::vector<int> node_width;
  std::vector<uint32_t> node_padded_offset;  // in padded vectors, one more than nodes
  std::vector<Columns> block_columns;        // by block id, of variable kept blocks
  uint32_t num_pose_nodes = 0;               // the first ones
  std::vector<uint8_t> held_column;          // of padded vectors: nothing moves it

  std::vector<BlockId> features;  // in working order
  std::vector<uint32_t> feature_clique;
  std::vector<size_t> feature_at;             // where its values stand in the state
  std::vector<uint8_t> feature_manifold;      // in manifolds
  std::vector<const ManifoldOps*> manifolds;  // of features
  Cliques cliques;
  std::vector<Part> parts;
  std::vector<Chunk> chunks;
  std::vector<ChunkPart> chunk_parts;
  size_t factors_size = 0;  // doubles of all features' factors

  // Sizes of the largest chunk.
  size_t max_panel = 0, max_rows = 0, max_w = 0, max_features = 0, max_residuals = 0,
         max_positions = 0;
  double num_pairs = 0.0;  // of nodes, over all features, diagonal included

  size_t num_nodes() const { return node_width.size(); }
  size_t padded_size() const { return node_padded_offset.empty() ? 0 : node_padded_offset.back(); }

  // From scratch; buffers of small problems keep their capacity, so that a second one of the same
  // size allocates next to nothing.
  void Build(const Problem& problem);
  // Work of a chunk in some unit, for balance.
  double Work(const Chunk& chunk) const;

 private:
  void FindNodes(const Problem& problem);
  void FindParts(const Problem& problem);
  void OrderFeatures(const Problem& problem);
  void SortKeys(int key_bits);
  void SortByNode(Part* part, const uint32_t* start, size_t num_features) const;
  bool IsPlain(const Chunk& chunk) const;
  void MakeChunks(const Problem& problem);
  void FindHeld(const Problem& problem);
  // Node of a segment of a residual; kNone: nothing of it moves.
  uint32_t NodeOf(const Part& part, const Segment& segment, size_t residual) const {
    for (int i = 0; i < segment.num_parts; ++i) {
      const uint32_t node = kept[part.batch->block(residual, segment.parts[i].slot)].node;
      if (node != kNone) return node;
    }
    return kNone;
  }

  bool merged_ = false;
  struct Scratch {  // of Build
    std::vector<uint8_t> kind_of_block, touched;
    std::vector<uint32_t> feature_of_block, list_begin, list_size, lists, rank, part_start, still;
    std::vector<std::pair<uint64_t, uint32_t>> keys, other_keys;

    size_t Bytes() const;
  };
  Scratch scratch_;
};
}  // namespace holba::native
