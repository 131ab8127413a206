// SPDX-License-Identifier: BSD-3-Clause
#include "holba/solver/distributed/partition.h"

#include <metis.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <unordered_map>
#include <utility>

#include "holba/base/check.h"

namespace holba::distributed {
namespace {

// Predicted work of a feature, roughly CPU cycles: its residuals are evaluated twice in an
// iteration, and each pair of its poses takes a product of two blocks.
constexpr double kResidualCycles = 250.0, kPairCycles = 20.0;
// A pose is tied to the next so many poses of a feature's list: a chain of that width keeps long
// tracks together, while all pairs of a plane's or a long track's poses would fill the graph.
constexpr size_t kTiesAhead = 3;
// Edges are sorted and added up in portions, so that their list stays below 256 MB.
constexpr size_t kMaxLooseEdges = size_t{1} << 24;
// METIS: recursive bisection balances better for few parts, and takes longer for many.
constexpr int kMaxPartsByBisection = 8;
constexpr idx_t kWeightScale = 1 << 28;  // sum of all weights of the graph: an idx_t has 31 bits

bool IsVariableFeature(const ParameterBlock& block) {
  return !IsKept(block.role) && block.IsVariable();
}

// The poses of each variable feature, ascending, and how many residuals hold each.
struct FeaturePoses {
  std::vector<BlockId> features;
  std::vector<uint32_t> begin;  // into poses; one entry more than there are features
  std::vector<BlockId> poses;
  std::vector<uint32_t> num_residuals;  // beside poses
  std::vector<uint32_t> feature_residuals;

  std::span<const BlockId> Poses(size_t f) const {
    return {poses.data() + begin[f], poses.data() + begin[f + 1]};
  }
  double Work(size_t f) const {
    const double k = begin[f + 1] - begin[f];
    return kResidualCycles * feature_residuals[f] + 0.5 * kPairCycles * k * (k + 1.0);
  }
};

FeaturePoses FindFeaturePoses(const Problem& problem) {
  FeaturePoses out;
  std::vector<uint32_t> index(problem.num_blocks(), ~uint32_t{0});
  for (BlockId id = 0; id < problem.num_blocks(); ++id) {
    if (!IsVariableFeature(problem.block(id))) continue;
    index[id] = static_cast<uint32_t>(out.features.size());
    out.features.push_back(id);
  }
  const size_t n = out.features.size();
  out.feature_residuals.assign(n, 0);
  std::vector<uint32_t> begin(n + 1, 0);
  // Calls visit(feature, pose) for each pose of each residual of a feature.
  const auto for_each = [&](bool count_residuals, const auto& visit) {
    for (const auto& batch : problem.batches()) {
      const int slots = batch->num_slots();
      for (size_t i = 0; i < batch->size(); ++i) {
        const BlockId* ids = batch->blocks().data() + i * slots;
        uint32_t f = ~uint32_t{0};
        for (int s = 0; s < slots && f == ~uint32_t{0}; ++s) f = index[ids[s]];
        if (f == ~uint32_t{0}) continue;
        if (count_residuals) ++out.feature_residuals[f];
        for (int s = 0; s < slots; ++s) {
          if (problem.block(ids[s]).role == BlockRole::kPose) visit(f, ids[s]);
        }
      }
    }
  };
  for_each(true, [&](uint32_t f, BlockId) { ++begin[f + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<BlockId> listed(begin.back());
  std::vector<uint32_t> next(begin.begin(), begin.end() - 1);
  for_each(false, [&](uint32_t f, BlockId pose) { listed[next[f]++] = pose; });
  out.begin.assign(1, 0);
  for (size_t f = 0; f < n; ++f) {
    std::sort(listed.begin() + begin[f], listed.begin() + begin[f + 1]);
    for (uint32_t i = begin[f]; i < begin[f + 1]; ++i) {
      if (i > begin[f] && listed[i] == listed[i - 1]) {
        ++out.num_residuals.back();
      } else {
        out.poses.push_back(listed[i]);
        out.num_residuals.push_back(1);
      }
    }
    out.begin.push_back(static_cast<uint32_t>(out.poses.size()));
  }
  return out;
}

// Edges between vertices with their weights, each once, sorted.
class EdgeSums {
 public:
  void Add(uint32_t a, uint32_t b) {
    loose_.push_back(uint64_t{std::min(a, b)} << 32 | std::max(a, b));
    if (loose_.size() >= kMaxLooseEdges) Merge();
  }
  const std::vector<std::pair<uint64_t, uint32_t>>& Get() {
    Merge();
    return sums_;
  }

 private:
  void Merge() {
    std::sort(loose_.begin(), loose_.end());
    std::vector<std::pair<uint64_t, uint32_t>> merged;
    merged.reserve(sums_.size() + loose_.size() / 4);
    const auto add = [&](uint64_t edge, uint32_t weight) {
      if (!merged.empty() && merged.back().first == edge) {
        merged.back().second += weight;
      } else {
        merged.emplace_back(edge, weight);
      }
    };
    size_t s = 0;
    for (uint64_t edge : loose_) {
      while (s < sums_.size() && sums_[s].first <= edge) add(sums_[s].first, sums_[s].second), ++s;
      add(edge, 1);
    }
    for (; s < sums_.size(); ++s) add(sums_[s].first, sums_[s].second);
    sums_ = std::move(merged);
    loose_.clear();
  }
  std::vector<uint64_t> loose_;
  std::vector<std::pair<uint64_t, uint32_t>> sums_;
};

// Consecutive vertices of about the same total weight.
std::vector<int32_t> InRanges(const std::vector<double>& weights, int num_parts) {
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  std::vector<int32_t> part(weights.size());
  double done = 0.0;
  for (size_t v = 0; v < weights.size(); ++v) {
    const double middle = done + 0.5 * weights[v];
    part[v] = total > 0.0 ? std::min(num_parts - 1, static_cast<int>(num_parts * middle / total))
                          : static_cast<int32_t>(v % num_parts);
    done += weights[v];
  }
  return part;
}

// Parts of the vertices, whose graph has the given edges.
std::vector<int32_t> CutGraph(const std::vector<double>& weights,
                              const std::vector<std::pair<uint64_t, uint32_t>>& edges,
                              int num_parts) {
  const size_t n = weights.size();
  if (n < 2 * static_cast<size_t>(num_parts) || edges.empty()) return InRanges(weights, num_parts);
  std::vector<idx_t> begin(n + 1, 0), neighbour(2 * edges.size()), edge_weight(2 * edges.size());
  for (const auto& [edge, weight] : edges) {
    ++begin[(edge >> 32) + 1];
    ++begin[(edge & 0xFFFFFFFF) + 1];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<idx_t> next(begin.begin(), begin.end() - 1);
  for (const auto& [edge, weight] : edges) {
    const uint32_t a = static_cast<uint32_t>(edge >> 32), b = static_cast<uint32_t>(edge);
    neighbour[next[a]] = static_cast<idx_t>(b);
    edge_weight[next[a]++] = static_cast<idx_t>(std::min<uint32_t>(weight, 1 << 20));
    neighbour[next[b]] = static_cast<idx_t>(a);
    edge_weight[next[b]++] = static_cast<idx_t>(std::min<uint32_t>(weight, 1 << 20));
  }
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  std::vector<idx_t> vertex_weight(n);
  for (size_t v = 0; v < n; ++v)
    vertex_weight[v] = 1 + static_cast<idx_t>(weights[v] / std::max(total, 1.0) * kWeightScale);
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_NUMBERING] = 0;
  options[METIS_OPTION_SEED] = 1;
  idx_t num_vertices = static_cast<idx_t>(n), num_constraints = 1, parts = num_parts, cut = 0;
  std::vector<idx_t> part(n);
  const auto cut_graph =
      num_parts <= kMaxPartsByBisection ? METIS_PartGraphRecursive : METIS_PartGraphKway;
  if (cut_graph(&num_vertices, &num_constraints, begin.data(), neighbour.data(),
                vertex_weight.data(), nullptr, edge_weight.data(), &parts, nullptr, nullptr,
                options, &cut, part.data()) != METIS_OK)
    return InRanges(weights, num_parts);
  return {part.begin(), part.end()};
}

class Partitioner {
 public:
  Partitioner(const Problem& problem, int num_parts)
      : problem_(problem), features_(FindFeaturePoses(problem)) {
    out_.num_parts = num_parts;
    out_.part_of_block.assign(problem.num_blocks(), Partition::kNone);
    out_.is_border.assign(problem.num_blocks(), 0);
    out_.work.assign(num_parts, 0.0);
  }

  Partition Make() {
    CutPoses();
    PlaceFeatures();
    PlaceOtherKept();
    AddLooseWork();
    return std::move(out_);
  }

 private:
  void CutPoses() {
    std::vector<uint32_t> vertex_of(problem_.num_blocks(), 0);
    std::vector<BlockId> poses;
    for (BlockId id = 0; id < problem_.num_blocks(); ++id) {
      if (problem_.block(id).role != BlockRole::kPose) continue;
      vertex_of[id] = static_cast<uint32_t>(poses.size());
      poses.push_back(id);
    }
    std::vector<double> weights(poses.size(), 0.0);
    EdgeSums edges;
    for (size_t f = 0; f < features_.features.size(); ++f) {
      const auto of_feature = features_.Poses(f);
      for (size_t i = 0; i < of_feature.size(); ++i) {
        weights[vertex_of[of_feature[i]]] +=
            features_.Work(f) / static_cast<double>(of_feature.size());
        for (size_t j = i + 1; j < std::min(of_feature.size(), i + 1 + kTiesAhead); ++j)
          edges.Add(vertex_of[of_feature[i]], vertex_of[of_feature[j]]);
      }
    }
    const std::vector<int32_t> part = out_.num_parts == 1
                                          ? std::vector<int32_t>(poses.size(), 0)
                                          : CutGraph(weights, edges.Get(), out_.num_parts);
    for (size_t v = 0; v < poses.size(); ++v) out_.part_of_block[poses[v]] = part[v];
  }

  // Features whose poses lie in one part go there. The others go to the least loaded of the parts
  // that have at least half as many of their residuals as the part with the most.
  void PlaceFeatures() {
    std::vector<size_t> undecided;
    std::vector<std::pair<int32_t, uint32_t>> shares;
    for (size_t f = 0; f < features_.features.size(); ++f) {
      SharesOf(f, &shares);
      if (shares.size() == 1) {
        Place(f, shares[0].first);
      } else {
        undecided.push_back(f);
      }
    }
    for (size_t f : undecided) {
      SharesOf(f, &shares);
      if (shares.empty()) {
        Place(f, static_cast<int>(std::min_element(out_.work.begin(), out_.work.end()) -
                                  out_.work.begin()));
        continue;
      }
      uint32_t most = 0;
      for (const auto& [part, count] : shares) most = std::max(most, count);
      int best = -1;
      for (const auto& [part, count] : shares) {
        if (2 * count >= most && (best < 0 || out_.work[part] < out_.work[best])) best = part;
      }
      Place(f, best);
    }
  }
  // Residuals of a feature by the part of their pose, in ascending order of parts.
  void SharesOf(size_t f, std::vector<std::pair<int32_t, uint32_t>>* shares) const {
    shares->clear();
    for (uint32_t i = features_.begin[f]; i < features_.begin[f + 1]; ++i) {
      const int32_t part = out_.part_of_block[features_.poses[i]];
      const auto it = std::find_if(shares->begin(), shares->end(),
                                   [&](const auto& share) { return share.first == part; });
      if (it == shares->end()) {
        shares->emplace_back(part, features_.num_residuals[i]);
      } else {
        it->second += features_.num_residuals[i];
      }
    }
    std::sort(shares->begin(), shares->end());
  }
  void Place(size_t f, int part) {
    out_.part_of_block[features_.features[f]] = part;
    out_.work[part] += features_.Work(f);
  }

  // Kept blocks other than poses go to the part with the most of their residuals, those of most
  // parts to the last one.
  void PlaceOtherKept() {
    const auto parts = static_cast<uint64_t>(out_.num_parts);
    std::unordered_map<uint64_t, uint32_t> counts;  // by block * parts + part
    for (const auto& batch : problem_.batches()) {
      for (size_t i = 0; i < batch->size(); ++i) {
        int part = -2;
        for (int s = 0; s < batch->num_slots(); ++s) {
          const BlockId id = batch->block(i, s);
          const BlockRole role = problem_.block(id).role;
          if (!IsKept(role) || role == BlockRole::kPose) continue;
          if (part == -2) part = PartOfFirst(*batch, i);
          if (out_.part_of_block[id] == Partition::kNone) out_.part_of_block[id] = 0;
          if (part >= 0) ++counts[id * parts + static_cast<uint64_t>(part)];
        }
      }
    }
    std::vector<std::pair<uint64_t, uint32_t>> sorted(counts.begin(), counts.end());
    std::sort(sorted.begin(), sorted.end());
    for (size_t i = 0; i < sorted.size();) {
      const auto id = static_cast<BlockId>(sorted[i].first / parts);
      size_t num_parts = 0;
      uint32_t most = 0;
      for (; i < sorted.size() && sorted[i].first / parts == id; ++i, ++num_parts) {
        if (sorted[i].second <= most) continue;
        most = sorted[i].second;
        out_.part_of_block[id] = static_cast<int32_t>(sorted[i].first % parts);
      }
      if (parts > 1 && 2 * num_parts > parts) {
        out_.is_border[id] = 1;
        out_.part_of_block[id] = out_.num_parts - 1;
      }
    }
  }
  // The part of a residual's feature or pose; -1: it has neither.
  int PartOfFirst(const ResidualBatch& batch, size_t i) const {
    for (int s = 0; s < batch.num_slots(); ++s) {
      if (IsVariableFeature(problem_.block(batch.block(i, s))))
        return out_.part_of_block[batch.block(i, s)];
    }
    for (int s = 0; s < batch.num_slots(); ++s) {
      if (problem_.block(batch.block(i, s)).role == BlockRole::kPose)
        return out_.part_of_block[batch.block(i, s)];
    }
    return -1;
  }

  void AddLooseWork() {
    for (const auto& batch : problem_.batches()) {
      for (size_t i = 0; i < batch->size(); ++i) {
        bool loose = true;
        for (int s = 0; s < batch->num_slots() && loose; ++s)
          loose = !IsVariableFeature(problem_.block(batch->block(i, s)));
        if (loose) out_.work[out_.PartOfResidual(problem_, *batch, i)] += kResidualCycles;
      }
    }
  }

  const Problem& problem_;
  const FeaturePoses features_;
  Partition out_;
};

}  // namespace

int Partition::PartOfResidual(const Problem& problem, const ResidualBatch& batch, size_t i) const {
  int of_pose = kNone, of_kept = kNone;
  for (int s = 0; s < batch.num_slots(); ++s) {
    const BlockId id = batch.block(i, s);
    const ParameterBlock& block = problem.block(id);
    if (IsVariableFeature(block)) return part_of_block[id];
    if (!IsKept(block.role)) continue;
    int& found = block.role == BlockRole::kPose ? of_pose : of_kept;
    if (found == kNone) found = part_of_block[id];
  }
  return of_pose != kNone ? of_pose : std::max(of_kept, 0);
}

double Partition::Imbalance() const {
  const double total = std::accumulate(work.begin(), work.end(), 0.0);
  if (total == 0.0) return 1.0;
  return *std::max_element(work.begin(), work.end()) * num_parts / total;
}

Partition MakePartition(const Problem& problem, int num_parts) {
  HOLBA_CHECK(num_parts > 0);
  return Partitioner(problem, num_parts).Make();
}

}  // namespace holba::distributed
