// SPDX-License-Identifier: BSD-3-Clause
// Which proposal of a segment other images agree on most. A proposal is scored against those near
// it that other images support, in 3D and by its distance from their segments; of each image the
// best score counts.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "holba/estimation/lines/line_nodes.h"
#include "holba/estimation/lines/line_options.h"
#include "holba/estimation/lines/line_scene.h"

namespace holba {

// A place of a segment in 3D.
struct Proposal {
  uint32_t view, segment;  // that supports it
  ProposalKind kind;
  int32_t plane;
  double length_start, length_end;  // along the rays
  Eigen::Vector3d start, end, along;
};

// 1 at 0, 0.5 at the threshold, and 0 beyond it.
double ScoreOf(double value, double threshold);

// Has work space: one for each thread.
class ProposalScorer {
 public:
  ProposalScorer(const LineOptions& options, const LineScene& scene)
      : options_(options), scene_(scene) {}

  // Places the node by the proposal of the highest score, and lists the segments that support one
  // of enough score. Sorts the proposals by the length along the first ray.
  void Score(std::vector<Proposal>* proposals, SegmentNode* node);

 private:
  const LineOptions& options_;
  const LineScene& scene_;
  std::vector<double> best_of_view_;
  std::vector<uint32_t> touched_;
};

}  // namespace holba
