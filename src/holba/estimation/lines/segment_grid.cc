// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/segment_grid.h"

namespace holba {

SegmentGrid::SegmentGrid(std::span<const LineSegment2d> segments, double cell_px, double reach_px)
    : cell_(cell_px) {
  if (segments.empty()) return;
  Eigen::Vector2d low = segments[0].start, high = segments[0].start;
  for (const LineSegment2d& s : segments) {
    low = low.cwiseMin(s.start).cwiseMin(s.end);
    high = high.cwiseMax(s.start).cwiseMax(s.end);
  }
  origin_ = low.array() - reach_px;
  const Eigen::Vector2d size = (high - low).array() + 2.0 * reach_px;
  // Segments far outside of a picture (ideal pixels of a strong distortion) make cells larger, not
  // more.
  constexpr double kMaxCellsPerAxis = 512.0;
  cell_ = std::max(cell_, size.maxCoeff() / kMaxCellsPerAxis);
  columns_ = static_cast<int>(size.x() / cell_) + 1;
  rows_ = static_cast<int>(size.y() / cell_) + 1;
  begin_.assign(static_cast<size_t>(columns_) * rows_ + 1, 0);
  for (const LineSegment2d& s : segments) {
    ForEachCell(s, reach_px, [&](size_t cell) { ++begin_[cell + 1]; });
  }
  for (size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
  items_.resize(begin_.back());
  std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (uint32_t i = 0; i < segments.size(); ++i) {
    ForEachCell(segments[i], reach_px, [&](size_t cell) { items_[next[cell]++] = i; });
  }
}

}  // namespace holba
