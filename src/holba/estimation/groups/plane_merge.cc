// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_merge.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "holba/base/threads.h"
#include "holba/geometry/angle.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

// Of the points beside it, so many are on a plane that a point may join.
constexpr size_t kMinBeside = 2;
constexpr uint32_t kNoPlane = 0xffffffff;

double MedianRatio(const PlanePoints& points, const PlaneParams& plane,
                   std::span<const uint32_t> members) {
  std::vector<double> ratios;
  for (uint32_t i : members) {
    ratios.push_back(points.Distance(plane, i) / points[i].limit);
  }
  return Median(std::move(ratios));
}

// In standard deviations of the points along the normal.
double WhitenedDistance(const PlanePoints& points, const PlaneParams& plane, uint32_t i) {
  const double variance = plane.n.dot(points[i].covariance * plane.n);
  return points.Distance(plane, i) / std::sqrt(std::max(variance, 1e-300));
}

// Whether one plane fits both sets about as well as their own planes: within the limits or within
// the uncertainty of the depths (distant facades are often found as several oblique pieces).
bool IsOnePlane(const PlaneOptions& options, const PlanePoints& points, const FoundPlane& a,
                const FoundPlane& b, FoundPlane* both) {
  if (AngleRad(a.params.n, b.params.n) > DegToRad(options.merge_angle_deg)) {
    return false;
  }
  both->members = a.members;
  both->members.insert(both->members.end(), b.members.begin(), b.members.end());
  both->params = points.Fit(both->members);
  both->gain = 0.0;
  for (uint32_t i : both->members) both->gain += points.Gain(both->params, i);
  for (const FoundPlane* part : {&a, &b}) {
    size_t inside = 0;
    std::vector<double> whitened;
    for (uint32_t i : part->members) {
      whitened.push_back(WhitenedDistance(points, both->params, i));
      inside += points.IsWithinLimit(both->params, i) || whitened.back() < 2.5;
    }
    if (static_cast<double>(inside) < 0.85 * static_cast<double>(part->members.size())) {
      return false;
    }
    const bool is_as_near = MedianRatio(points, both->params, part->members) <
                            1.3 * MedianRatio(points, part->params, part->members) + 0.05;
    // The expected median is 0.67.
    if (!is_as_near && Median(std::move(whitened)) > 1.0) return false;
  }
  return true;
}

}  // namespace

size_t MergePlanes(const PlaneOptions& options, const PlanePoints& points,
                   std::vector<FoundPlane>* planes) {
  size_t num_merged = 0;
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t a = 0; a < planes->size() && !changed; ++a) {
      for (size_t b = a + 1; b < planes->size() && !changed; ++b) {
        FoundPlane both;
        if (!IsOnePlane(options, points, (*planes)[a], (*planes)[b], &both)) continue;
        std::sort(both.members.begin(), both.members.end());
        (*planes)[a] = std::move(both);
        planes->erase(planes->begin() + static_cast<std::ptrdiff_t>(b));
        ++num_merged;
        changed = true;
      }
    }
  }
  return num_merged;
}

void ReassignPoints(const PlaneOptions& options, const PlanePoints& points,
                    std::vector<FoundPlane>* planes) {
  std::vector<uint32_t> plane_of(points.size(), kNoPlane), fresh(points.size(), kNoPlane);
  for (uint32_t p = 0; p < planes->size(); ++p) {
    for (uint32_t i : (*planes)[p].members) plane_of[i] = p;
  }
  ParallelFor(options.num_threads, points.size(), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      size_t num = 0;
      uint32_t beside[PlanePoints::kNumBeside];
      for (uint32_t j : points.Beside(i)) {
        if (points.AreNeighbours(i, j)) beside[num++] = plane_of[j];
      }
      double least = points[i].limit;
      for (size_t k = 0; k < num; ++k) {
        if (beside[k] == kNoPlane || beside[k] == fresh[i]) continue;
        const auto same = static_cast<size_t>(std::count(beside, beside + num, beside[k]));
        if (same < kMinBeside) continue;
        const double distance = points.Distance((*planes)[beside[k]].params, i);
        if (distance >= least) continue;
        least = distance;
        fresh[i] = beside[k];
      }
    }
  });
  for (FoundPlane& plane : *planes) plane.members.clear();
  for (uint32_t i = 0; i < points.size(); ++i) {
    if (fresh[i] != kNoPlane) (*planes)[fresh[i]].members.push_back(i);
  }
  for (FoundPlane& plane : *planes) {
    if (plane.members.size() < 3) continue;
    const PlaneParams before = plane.params;
    plane.params = points.Fit(plane.members, &before);
  }
}

void RemoveWeakPlanes(const PlaneOptions& options, const PlanePoints& points,
                      std::map<std::string, size_t>* dropped, std::vector<FoundPlane>* planes) {
  std::erase_if(*planes, [&](const FoundPlane& plane) {
    const char* reason = nullptr;
    if (plane.members.size() < static_cast<size_t>(options.min_points)) {
      reason = "plane: few points";
    } else if (points.ShareOf(plane.members) < options.min_share) {
      reason = "plane: points of others among its own";
    }
    if (reason && dropped) ++(*dropped)[reason];
    return reason != nullptr;
  });
}

}  // namespace holba
