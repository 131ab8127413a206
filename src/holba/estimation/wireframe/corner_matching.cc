// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/corner_matching.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace holba {
namespace {

constexpr double kCellPx = 16.0;
// Cells in a row of a field: ideal pixels of a wide lens reach far beyond the photograph.
constexpr double kMaxCells = 1024.0;

int CellOf(double x, int count) {
  return static_cast<int>(std::clamp(std::floor(x / kCellPx), 0.0, count - 1.0));
}

int32_t DotProduct(const uint8_t* a, const uint8_t* b) {
  int32_t sum = 0;
  for (int k = 0; k < kCornerDescriptorSize; ++k) sum += static_cast<int32_t>(a[k]) * b[k];
  return sum;
}

// Best and second best of one corner so far; similarity is the cosine of the descriptors.
struct Nearest {
  double best = -1.0, second = -1.0;
  uint32_t corner = 0;

  void Add(double cosine, uint32_t other) {
    if (cosine > best) {
      second = best;
      best = cosine;
      corner = other;
    } else {
      second = std::max(second, cosine);
    }
  }
};

// Distance of unit vectors.
double Distance(double cosine) { return std::sqrt(std::max(0.0, 2.0 - 2.0 * cosine)); }

}  // namespace

CornerField::CornerField(const IdealView& view, const ImageFeatures& features) : view_(&view) {
  if (features.corner_descriptors.size() != features.corners.size() * kCornerDescriptorSize) return;
  std::vector<Eigen::Vector2d> ideal;
  std::vector<uint32_t> idxs;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (size_t i = 0; i < features.corners.size(); ++i) {
    const auto x = view.ToIdeal(features.corners[i]);
    if (!x) continue;
    ideal.push_back(*x);
    idxs.push_back(static_cast<uint32_t>(i));
    low = low.cwiseMin(*x);
    high = high.cwiseMax(*x);
  }
  if (ideal.empty()) return;
  origin_ = low;
  const auto cells = [](double extent) {
    return static_cast<int>(std::min(std::floor(extent / kCellPx) + 1.0, kMaxCells));
  };
  columns_ = cells(high.x() - low.x());
  rows_ = cells(high.y() - low.y());

  std::vector<uint32_t> cell(ideal.size()), order(ideal.size());
  begin_.assign(static_cast<size_t>(columns_) * rows_ + 1, 0);
  for (size_t i = 0; i < ideal.size(); ++i) {
    cell[i] = static_cast<uint32_t>(CellOf(ideal[i].y() - origin_.y(), rows_) * columns_ +
                                    CellOf(ideal[i].x() - origin_.x(), columns_));
    ++begin_[cell[i] + 1];
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t i, uint32_t j) { return cell[i] < cell[j]; });
  for (uint32_t i : order) {
    const uint8_t* descriptor =
        features.corner_descriptors.data() + size_t{idxs[i]} * kCornerDescriptorSize;
    corners_.push_back(ideal[i]);
    feature_idxs_.push_back(idxs[i]);
    descriptors_.insert(descriptors_.end(), descriptor, descriptor + kCornerDescriptorSize);
    norms_.push_back(std::sqrt(static_cast<double>(DotProduct(descriptor, descriptor))));
  }
}

template <typename Visit>
void CornerField::ForEachNear(const LineSegment2d& segment, double reach_px, Visit visit) const {
  if (corners_.empty()) return;
  const Eigen::Vector2d a = segment.start - origin_, b = segment.end - origin_;
  // The corners of the rectangle about the segment are sqrt(2) of the reach from its ends.
  const double around = 1.4143 * reach_px;
  const double low_x = std::min(a.x(), b.x()) - around, high_x = std::max(a.x(), b.x()) + around;
  const double low_y = std::min(a.y(), b.y()) - around, high_y = std::max(a.y(), b.y()) + around;
  // The last row and column hold all that lies beyond them.
  if (!(high_x >= 0.0 && high_y >= 0.0)) return;
  const Eigen::Vector2d along = b - a;
  const bool is_steep = std::abs(along.y()) > std::abs(along.x());
  // Walk along the longer axis, one row or column at a time.
  const int axis = is_steep ? 1 : 0, other = 1 - axis;
  const int count = is_steep ? rows_ : columns_, other_count = is_steep ? columns_ : rows_;
  const double slope = along[axis] != 0.0 ? along[other] / along[axis] : 0.0;
  const double low = is_steep ? low_y : low_x, high = is_steep ? high_y : high_x;
  const double other_low = is_steep ? low_x : low_y, other_high = is_steep ? high_x : high_y;
  // Across the line the reach is longer along the other axis, by at most sqrt(2).
  const double margin = reach_px * std::sqrt(1.0 + slope * slope);
  for (int i = CellOf(low, count); i <= CellOf(high, count); ++i) {
    const bool is_last = i == count - 1;
    const double from = std::max(low, i * kCellPx);
    const double to = is_last ? high : std::min(high, (i + 1) * kCellPx);
    const double at_from = a[other] + slope * (from - a[axis]);
    const double at_to = a[other] + slope * (to - a[axis]);
    const double from_other = std::max(std::min(at_from, at_to) - margin, other_low);
    const double to_other = std::min(std::max(at_from, at_to) + margin, other_high);
    if (!(to_other >= 0.0) || from_other > to_other) continue;
    for (int j = CellOf(from_other, other_count); j <= CellOf(to_other, other_count); ++j) {
      const size_t cell = static_cast<size_t>(is_steep ? i : j) * columns_ + (is_steep ? j : i);
      for (uint32_t corner = begin_[cell]; corner < begin_[cell + 1]; ++corner) visit(corner);
    }
  }
}

std::optional<LineSegment2d> EpipolarSegment(const IdealView& view1, const DepthRange& depths1,
                                             const Eigen::Vector2d& ideal1, const IdealView& view2,
                                             const DepthRange& depths2) {
  // In view2 the point at depth z of view1 is at z * towards + from.
  const Eigen::Matrix3d R = view2.R() * view1.R().transpose();
  const Eigen::Vector3d towards = R * (view1.InverseK() * ideal1.homogeneous());
  const Eigen::Vector3d from = view2.t() - R * view1.t();
  double low = depths1.nearest, high = depths1.farthest;
  if (towards.z() != 0.0) {
    double z1 = (depths2.nearest - from.z()) / towards.z();
    double z2 = (depths2.farthest - from.z()) / towards.z();
    if (z1 > z2) std::swap(z1, z2);
    low = std::max(low, z1);
    high = std::min(high, z2);
  } else if (from.z() < depths2.nearest || from.z() > depths2.farthest) {
    return std::nullopt;
  }
  if (!(low <= high)) return std::nullopt;
  const Eigen::Vector3d start = view2.K() * (low * towards + from);
  const Eigen::Vector3d end = view2.K() * (high * towards + from);
  if (!(start.z() > 0.0 && end.z() > 0.0)) return std::nullopt;
  return LineSegment2d{start.hnormalized(), end.hnormalized()};
}

std::vector<CornerMatch> MatchCorners(const CornerField& field1, const DepthRange& depths1,
                                      const CornerField& field2, const DepthRange& depths2,
                                      const CornerTrackOptions& options) {
  const double reach = options.max_epipolar_error_px;
  const Eigen::Matrix3d F = FundamentalMatrix(field1.view(), field2.view());
  std::vector<Nearest> nearest1(field1.size()), nearest2(field2.size());
  for (uint32_t i = 0; i < field1.size(); ++i) {
    const auto segment =
        EpipolarSegment(field1.view(), depths1, field1.ideal(i), field2.view(), depths2);
    if (!segment) continue;
    const Eigen::Vector2d between = segment->end - segment->start;
    const double length = between.norm();
    const Eigen::Vector2d along =
        length > 0.0 ? Eigen::Vector2d(between / length) : Eigen::Vector2d::UnitX();
    field2.ForEachNear(*segment, reach, [&](uint32_t j) {
      const Eigen::Vector2d offset = field2.ideal(j) - segment->start;
      const double u = along.dot(offset);
      if (u < -reach || u > length + reach) return;
      if (std::abs(along.x() * offset.y() - along.y() * offset.x()) > reach) return;
      const Eigen::Vector3d l1 = F.transpose() * field2.ideal(j).homogeneous();
      if (std::abs(l1.dot(field1.ideal(i).homogeneous())) > reach * l1.head<2>().norm()) return;
      const double norms = field1.descriptor_norm(i) * field2.descriptor_norm(j);
      if (!(norms > 0.0)) return;
      const double cosine = DotProduct(field1.descriptor(i), field2.descriptor(j)) / norms;
      nearest1[i].Add(cosine, j);
      nearest2[j].Add(cosine, i);
    });
  }
  std::vector<CornerMatch> matches;
  for (uint32_t i = 0; i < field1.size(); ++i) {
    const Nearest& n1 = nearest1[i];
    if (n1.best < 0.0) continue;
    const Nearest& n2 = nearest2[n1.corner];
    if (n2.corner != i) continue;
    const double distance = Distance(n1.best);
    if (distance > options.max_descriptor_distance) continue;
    const double second = std::max(n1.second, n2.second);
    if (second >= 0.0 && !(distance < options.max_ratio * Distance(second))) continue;
    matches.push_back({i, n1.corner, static_cast<float>(distance)});
  }
  return matches;
}

}  // namespace holba
