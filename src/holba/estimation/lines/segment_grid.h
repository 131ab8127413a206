// SPDX-License-Identifier: BSD-3-Clause
// Segments of one image by place: those that may come within a distance of a segment, without a
// look at all others.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "holba/geometry/line.h"

namespace holba {

class SegmentGrid {
 public:
  SegmentGrid() = default;
  // Cells of the given size over the box of the segments; each segment is put into all cells that
  // it comes near to by `reach_px`.
  SegmentGrid(std::span<const LineSegment2d> segments, double cell_px, double reach_px);

  // Calls visit(idx) for every segment that comes within the reach of the query, and for some
  // beyond it; a segment may be visited several times.
  template <typename Visit>
  void ForEachNear(const LineSegment2d& query, Visit visit) const {
    if (columns_ == 0) return;
    ForEachCell(query, 0.0, [&](size_t cell) {
      for (uint32_t i = begin_[cell]; i < begin_[cell + 1]; ++i) visit(items_[i]);
    });
  }

 private:
  // All cells whose circumscribed circle, grown by `reach`, meets the segment.
  template <typename Visit>
  void ForEachCell(const LineSegment2d& segment, double reach, Visit visit) const {
    const Eigen::Vector2d low = segment.start.cwiseMin(segment.end) - origin_;
    const Eigen::Vector2d high = segment.start.cwiseMax(segment.end) - origin_;
    // Negated so that not-a-number visits nothing.
    if (!(high.x() + reach >= 0.0 && high.y() + reach >= 0.0 &&
          low.x() - reach < columns_ * cell_ && low.y() - reach < rows_ * cell_))
      return;
    const auto cell_of = [this](double x, int count) {
      return static_cast<int>(std::clamp(std::floor(x / cell_), 0.0, count - 1.0));
    };
    const int x0 = cell_of(low.x() - reach, columns_), x1 = cell_of(high.x() + reach, columns_);
    const int y0 = cell_of(low.y() - reach, rows_), y1 = cell_of(high.y() + reach, rows_);
    const Eigen::Vector2d along = segment.end - segment.start;
    const double length = along.norm();
    Eigen::Vector2d normal = Eigen::Vector2d::Zero();
    if (length > 0.0) normal = Eigen::Vector2d(-along.y(), along.x()) / length;
    const double offset = normal.dot(segment.start - origin_);
    const double radius = reach + cell_ * 0.7072;
    for (int y = y0; y <= y1; ++y) {
      const double from_row = normal.y() * (y + 0.5) * cell_ - offset;
      for (int x = x0; x <= x1; ++x) {
        if (std::abs(from_row + normal.x() * (x + 0.5) * cell_) <= radius)
          visit(static_cast<size_t>(y) * columns_ + x);
      }
    }
  }

  double cell_ = 1.0;
  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();
  int columns_ = 0, rows_ = 0;
  std::vector<uint32_t> begin_, items_;  // of each cell
};

}  // namespace holba
