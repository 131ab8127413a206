// SPDX-License-Identifier: BSD-3-Clause
// The structure of a problem as the native solver needs it, before any value is known: the places
// of the unknowns, the residuals of each feature, and the kept unknowns that each feature couples.
// README.md in this folder has a worked example and defines node, part, segment, clique, chunk and
// slice.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "holba/problem/problem.h"
#include "holba/solver/native/elimination.h"

namespace holba::native {

inline constexpr uint32_t kNoFeature = ~uint32_t{0}, kNoClique = ~uint32_t{0};
inline constexpr int kMaxFeatureTangent = 6;
inline constexpr int kMaxSegments = kMaxSlots;

// The Jacobian columns of a block within its node. A coordinate that is held in every block of the
// same role and manifold has no column; one that is held in this block only has a column of zeros.
struct Columns {
  int count = 0;
  std::array<uint8_t, kMaxTangent> tangent{};  // tangent coordinate of each column
};

// Place of a variable kept block in the reduced system.
struct KeptBlock {
  uint32_t node = kNoNode;
  int first = 0;  // column in the node
};

// The columns of one slot within a segment.
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
  std::array<bool, kMaxSlots> wanted{};  // slots whose Jacobians are needed
  int num_segments = 0;
  std::array<Segment, kMaxSegments> segments{};
  int row_stride = 0;  // doubles of one row: kFeatureRow, then the padded segments

  // Indices into the batch, in the order in which the solver evaluates them.
  std::vector<uint32_t> residuals;
  // Index of the feature of residual j within its chunk.
  std::vector<uint16_t> local_feature;
  // At [j * num_segments + s], the position of segment s of residual j (elimination.h).
  std::vector<uint16_t> positions;
  // In a part without features instead: the node, or kNoNode.
  std::vector<uint32_t> nodes;
  // Jacobian columns to set to zero, ascending by residual: the held coordinates of single blocks.
  struct Held {
    uint32_t residual;  // index into `residuals`
    int slot;
    uint32_t coordinates;  // bit i: tangent coordinate i
  };
  std::vector<Held> held;
};

struct Cliques {
  std::vector<uint32_t> begin;  // into nodes; one entry more than there are cliques
  std::vector<uint32_t> nodes;

  std::span<const uint32_t> Nodes(uint32_t clique) const {
    return {nodes.data() + begin[clique], nodes.data() + begin[clique + 1]};
  }
  size_t size() const { return begin.empty() ? 0 : begin.size() - 1; }
};

// The residuals of a chunk that belong to one part.
struct ChunkPart {
  uint32_t part = 0;
  uint32_t begin = 0, end = 0;  // range of Part::residuals
};
struct Chunk {
  int feature_tangent = 0;  // 0: residuals without a feature
  uint32_t feature_begin = 0, feature_end = 0;
  uint32_t parts_begin = 0, parts_end = 0;
  uint32_t num_positions = 0;  // sum of the sizes of the features' cliques
  bool plain = false;          // EliminatePlain (elimination.h) applies
  size_t w_size = 0;           // doubles of W of all its features
  size_t factor_begin = 0;     // first double of the factors of its features
};

// Stride of a panel of `count` residuals: an odd multiple of kPanelLanes, so that its rows do not
// all fall into the same sets of the cache.
constexpr size_t PanelStride(size_t count) {
  return (count + kPanelLanes - 1) / kPanelLanes / 2 * 2 * kPanelLanes + kPanelLanes;
}
// Stride of the factors of `count` features.
constexpr size_t FeatureStride(size_t count) {
  return (count + kPanelLanes - 1) / kPanelLanes * kPanelLanes;
}

struct Structure {
  // Nodes of poses come first, then those of shared intrinsics and groups (the border).
  std::vector<KeptBlock> kept;  // by block id; kNoNode: the block is constant, unused or a feature
  std::vector<uint32_t> node_begin, node_blocks;  // blocks of each node
  std::vector<int> node_width;                    // unknowns of each node
  std::vector<uint32_t> node_padded_offset;       // into padded vectors; one entry more than nodes
  std::vector<Columns> block_columns;             // by block id, of variable kept blocks
  uint32_t num_pose_nodes = 0;
  std::vector<uint8_t> held_column;  // by entry of a padded vector: whether its coordinate is held

  // Variable features, in elimination order.
  std::vector<BlockId> features;
  std::vector<uint32_t> feature_clique;
  std::vector<size_t> feature_at;         // index of its first value in the state
  std::vector<uint8_t> feature_manifold;  // index into manifolds
  std::vector<const ManifoldOps*> manifolds;
  Cliques cliques;
  std::vector<Part> parts;
  std::vector<Chunk> chunks;
  std::vector<ChunkPart> chunk_parts;
  size_t factors_size = 0;  // doubles of the factors of all features

  // Largest sizes that any chunk needs.
  size_t max_panel = 0, max_rows = 0, max_w = 0, max_features = 0, max_residuals = 0,
         max_positions = 0;
  double num_pairs = 0.0;  // pairs of nodes in the cliques, summed over all features

  size_t num_nodes() const { return node_width.size(); }
  size_t padded_size() const { return node_padded_offset.empty() ? 0 : node_padded_offset.back(); }

  // Analyses a problem. Buffers keep their capacity where it is small, so that a second small
  // problem allocates next to nothing.
  void Build(const Problem& problem);
  // Estimated work of a chunk, in roughly CPU cycles.
  double Work(const Chunk& chunk) const;

 private:
  void FindNodes(const Problem& problem);

  void FindParts(const Problem& problem);
  void MakeSegments(Part* part) const;
  bool ShareNode(const Part& part, int slot, int other) const;

  void OrderFeatures(const Problem& problem);
  void FindFeatures(const Problem& problem);
  void ListNodes();
  void SortFeatures();
  void SortKeys(int key_bits);
  void MakeCliques();
  void FindPlacesOfFeatures(const Problem& problem);

  void MakeChunks(const Problem& problem);
  void SortResiduals();
  void SortByNode(Part* part, const uint32_t* start, size_t num_features) const;
  uint32_t MakeFeatureChunk(const Problem& problem, uint32_t begin);
  void PlaceResiduals(const Chunk& chunk, const uint32_t* start, Part* part);
  void MakeLooseChunks(uint32_t part_idx);
  void FinishChunk(Chunk* chunk);
  bool IsPlain(const Chunk& chunk) const;

  void FindHeld(const Problem& problem);

  // Node of a segment of a residual; kNoNode: all its blocks are constant.
  uint32_t NodeOf(const Part& part, const Segment& segment, size_t residual) const {
    for (int i = 0; i < segment.num_parts; ++i) {
      const uint32_t node = kept[part.batch->block(residual, segment.parts[i].slot)].node;
      if (node != kNoNode) return node;
    }
    return kNoNode;
  }

  bool merged_ = false;  // nodes of poses contain their intrinsics
  struct Scratch {       // memory of Build
    std::vector<uint8_t> kind_of_block, touched;
    std::vector<uint32_t> feature_of_block, list_begin, list_size, lists, rank, part_start, still;
    std::vector<std::pair<uint64_t, uint32_t>> keys, other_keys;

    size_t Bytes() const;
  };
  Scratch scratch_;
};

}  // namespace holba::native
