// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/guided_matching.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "holba/base/check.h"

namespace holba {
namespace {

// What a point's position gives once for all its pairs: the line or the point that it is mapped to
// in the other image. Structure of arrays, so that the loop over pairs is vectorised.
struct MappedPoints {
  std::vector<double> x, y;     // of the points; NaN: none
  std::vector<double> a, b, c;  // line a x + b y + c = 0, or point (a, b)

  MappedPoints(const std::vector<std::optional<Eigen::Vector2d>>& positions,
               const Eigen::Matrix3d& M, bool to_point) {
    const size_t n = positions.size();
    for (auto* v : {&x, &y, &a, &b, &c}) v->resize(n, NAN);
    for (size_t i = 0; i < n; ++i) {
      if (!positions[i]) continue;
      Eigen::Vector3d mapped = M * positions[i]->homogeneous();
      if (to_point) mapped /= mapped.z();
      x[i] = positions[i]->x();
      y[i] = positions[i]->y();
      a[i] = mapped.x();
      b[i] = mapped.y();
      c[i] = mapped.z();
    }
  }
};

// Indices of the points of the second image that may belong to the point i of the first.
void FindAllowed(const GuidingGeometry& geometry, const MappedPoints& p1, const MappedPoints& p2,
                 size_t i, std::vector<uint8_t>* allowed) {
  const double limit = geometry.max_error_px * geometry.max_error_px;
  const double a = p1.a[i], b = p1.b[i], c = p1.c[i], x = p1.x[i], y = p1.y[i];
  const size_t n = p2.x.size();
  if (geometry.H) {
    for (size_t j = 0; j < n; ++j) {
      const double dx2 = p2.x[j] - a, dy2 = p2.y[j] - b, dx1 = x - p2.a[j], dy1 = y - p2.b[j];
      (*allowed)[j] = dx1 * dx1 + dy1 * dy1 + dx2 * dx2 + dy2 * dy2 <= 2.0 * limit;
    }
    return;
  }
  const double slope1 = a * a + b * b;
  for (size_t j = 0; j < n; ++j) {
    const double e = a * p2.x[j] + b * p2.y[j] + c;
    (*allowed)[j] = e * e <= limit * (slope1 + p2.a[j] * p2.a[j] + p2.b[j] * p2.b[j]);
  }
}

struct NearestOfGuided {
  double best = 0.0, second = 0.0;  // cosines
  int32_t idx = -1;

  void Enter(double cosine, size_t i) {
    if (cosine > best) {
      second = best;
      best = cosine;
      idx = static_cast<int32_t>(i);
    } else if (cosine > second) {
      second = cosine;
    }
  }
};

}  // namespace

DescriptorMatches MatchGuided(const DescriptorMatchOptions& options,
                              const GuidingGeometry& geometry,
                              const PackedDescriptors& descriptors1,
                              const std::vector<std::optional<Eigen::Vector2d>>& positions1,
                              const PackedDescriptors& descriptors2,
                              const std::vector<std::optional<Eigen::Vector2d>>& positions2) {
  HOLBA_CHECK(geometry.F.has_value() != geometry.H.has_value());
  HOLBA_CHECK(positions1.size() == descriptors1.size() && positions2.size() == descriptors2.size());
  DescriptorMatches result;
  if (descriptors1.are_floats() != descriptors2.are_floats() ||
      descriptors1.length() != descriptors2.length()) {
    return result;
  }
  const bool to_point = geometry.H.has_value();
  const Eigen::Matrix3d forward = to_point ? *geometry.H : *geometry.F;
  const Eigen::Matrix3d backward =
      to_point ? Eigen::Matrix3d(geometry.H->inverse()) : Eigen::Matrix3d(geometry.F->transpose());
  const MappedPoints p1(positions1, forward, to_point), p2(positions2, backward, to_point);

  std::vector<NearestOfGuided> of_first(descriptors1.size()), of_second(descriptors2.size());
  std::vector<uint8_t> allowed(descriptors2.size());
  for (size_t i = 0; i < descriptors1.size(); ++i) {
    if (!positions1[i]) continue;
    FindAllowed(geometry, p1, p2, i, &allowed);
    for (size_t j = 0; j < descriptors2.size(); ++j) {
      if (!allowed[j]) continue;
      const double cosine = descriptors1.Cosine(i, descriptors2, j);
      of_first[i].Enter(cosine, j);
      of_second[j].Enter(cosine, i);
    }
  }
  std::vector<FoundNeighbour> first, second;
  for (const NearestOfGuided& n : of_first) first.push_back({n.best, n.second, n.idx});
  for (const NearestOfGuided& n : of_second) second.push_back({n.best, n.second, n.idx});
  return SelectMatches(options, descriptors1.are_floats(), first, second);
}

}  // namespace holba
