// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/group_estimation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "holba/base/random.h"

namespace holba {
namespace {

// Features of a sample or of a refit, as FitMinimal takes them.
struct FitInput {
  std::vector<Eigen::Vector3d> points;
  std::vector<PlueckerLine> lines;
  void Clear() {
    points.clear();
    lines.clear();
  }
  bool Fit(const GroupType& type, double* g) const {
    if (points.size() + lines.size() == 0) return false;
    if (!type.fit_minimal(points, lines, g)) return false;
    return std::all_of(g, g + type.manifold->ambient, [](double x) { return std::isfinite(x); });
  }
};

// Size of a random sample of points (or of lines); 0: the type is not sampled from them. A surface
// through as few points as it has unknowns follows their noise, so that types with more than four
// get some extra points. Types with several faces (those that take lines) get more, so that enough
// faces have points.
size_t SampleSize(const GroupType& type, bool of_points) {
  if (!of_points) return static_cast<size_t>(type.min_lines);
  const auto least = static_cast<size_t>(type.min_points);
  if (least <= 4) return least;
  return least + (type.TakesLines() ? 5 : 2);
}

// Points to draw samples from. A labelled surface is one object: points farther from its middle
// than three times the median distance carry a wrong label.
std::vector<uint32_t> Core(std::span<const FitPoint> points) {
  std::vector<uint32_t> core;
  if (points.empty()) return core;
  Eigen::Vector3d middle;
  std::vector<double> values(points.size());
  const auto median = [&values] {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), at, values.end());
    return *at;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < points.size(); ++i) values[i] = points[i].X[axis];
    middle[axis] = median();
  }
  for (size_t i = 0; i < points.size(); ++i) values[i] = (points[i].X - middle).norm();
  const double reach = 3.0 * median();
  for (uint32_t i = 0; i < points.size(); ++i) {
    if ((points[i].X - middle).norm() <= reach) core.push_back(i);
  }
  return core;
}

}  // namespace

const FitPoint* FeatureLookup::Point(point3D_t id) {
  auto [it, is_new] = points_.try_emplace(id);
  if (is_new) {
    const Point3D* point = model_.points3D.Find(id);
    const auto geometry = point ? GeometryOf(views_, *point) : std::nullopt;
    if (geometry) it->second = FitPoint{point->xyz, geometry->LengthPerPx()};
  }
  return it->second ? &*it->second : nullptr;
}

const FitLine* FeatureLookup::Line(line3D_t id) {
  auto [it, is_new] = lines_.try_emplace(id);
  if (is_new) {
    const Line3D* line = model_.lines3D.Find(id);
    if (line) {
      std::vector<image_t> images;
      for (const LineObservation& o : line->track) images.push_back(o.image_id);
      const auto gsd = GroundSamplingDistance(views_, 0.5 * (line->start + line->end), images);
      if (gsd) it->second = FitLine{line->line, line->start, line->end, *gsd};
    }
  }
  return it->second ? &*it->second : nullptr;
}

GroupFeatures FeatureLookup::Find(const GroupType& type, std::span<const point3D_t> point_ids,
                                  std::span<const line3D_t> line_ids) {
  GroupFeatures features;
  for (const point3D_t id : point_ids) {
    const FitPoint* point = type.TakesPoints() ? Point(id) : nullptr;
    if (!point) continue;
    features.point_ids.push_back(id);
    features.points.push_back(*point);
  }
  for (const line3D_t id : line_ids) {
    const FitLine* line = type.TakesLines() ? Line(id) : nullptr;
    if (!line) continue;
    features.line_ids.push_back(id);
    features.lines.push_back(*line);
  }
  return features;
}

double GroupResidual(const GroupType& type, const double* g, const FitPoint& point) {
  Eigen::Vector3d projected;
  if (!type.project_point(g, point.X, &projected)) return HUGE_VAL;
  return (point.X - projected).norm() / point.length_per_px;
}

double GroupResidual(const GroupType& type, const double* g, const FitLine& line) {
  if (type.IsParallelism()) {
    Eigen::Vector3d v;
    type.direction(g, &v, nullptr);
    const Eigen::Vector3d& d = line.line.direction;
    return std::atan2(v.cross(d).norm(), std::abs(v.dot(d))) * 180.0 / std::numbers::pi;
  }
  return std::max(GroupResidual(type, g, FitPoint{line.start, line.length_per_px}),
                  GroupResidual(type, g, FitPoint{line.end, line.length_per_px}));
}

std::vector<double> GroupFit::FileParams(const GroupType& type) const {
  std::vector<double> plain(static_cast<size_t>(type.num_file_params));
  type.to_file(g.data(), plain.data());
  return plain;
}

GroupFit EvaluateGroup(const GroupType& type, const double* g, const GroupFeatures& features,
                       double limit) {
  GroupFit fit;
  std::copy_n(g, type.manifold->ambient, fit.g.begin());
  fit.residuals.reserve(features.size());
  for (const FitPoint& point : features.points) {
    fit.residuals.push_back(GroupResidual(type, g, point));
  }
  for (const FitLine& line : features.lines) {
    fit.residuals.push_back(GroupResidual(type, g, line));
  }
  for (const double residual : fit.residuals) {
    if (!(residual < limit)) continue;
    ++fit.num_inliers;
    fit.gain += 1.0 - (residual / limit) * (residual / limit);
  }
  return fit;
}

std::optional<std::array<double, kMaxGroupParams>> FitAll(const GroupType& type,
                                                          const GroupFeatures& features) {
  FitInput input;
  for (const FitPoint& point : features.points) input.points.push_back(point.X);
  for (const FitLine& line : features.lines) input.lines.push_back(line.line);
  std::array<double, kMaxGroupParams> g{};
  if (!input.Fit(type, g.data())) return std::nullopt;
  return g;
}

std::optional<GroupFit> FitGroup(const GroupType& type, const GroupFeatures& features,
                                 const GroupFitOptions& options, const double* start) {
  const double limit = options.Limit(type);
  GroupFit best;
  const auto consider = [&](const double* g) {
    GroupFit fit = EvaluateGroup(type, g, features, limit);
    if (fit.gain <= best.gain) return false;
    best = std::move(fit);
    return true;
  };
  FitInput input;
  const auto refit = [&](const GroupFit& from, double reach, double* g) {
    input.Clear();
    for (size_t i = 0; i < features.points.size(); ++i) {
      if (from.residuals[i] < reach) input.points.push_back(features.points[i].X);
    }
    for (size_t i = 0; i < features.lines.size(); ++i) {
      if (from.residuals[features.points.size() + i] < reach) {
        input.lines.push_back(features.lines[i].line);
      }
    }
    return input.Fit(type, g);
  };
  // The first refits take members from beyond the limit: a sample's parameters are too inaccurate
  // to separate members at the limit itself.
  const auto optimise = [&](GroupFit fit) {
    for (const double factor : {3.0, 1.5, 1.0, 1.0}) {
      double g[kMaxGroupParams];
      if (!refit(fit, factor * limit, g)) return;
      fit = EvaluateGroup(type, g, features, limit);
      consider(g);
    }
  };
  if (start && consider(start)) optimise(best);

  std::vector<uint32_t> points = Core(features.points), lines(features.lines.size());
  std::iota(lines.begin(), lines.end(), 0);
  const auto can_sample = [&type](const std::vector<uint32_t>& pool, bool of_points) {
    const size_t size = SampleSize(type, of_points);
    return size > 0 && pool.size() >= size;
  };
  const bool by_points = can_sample(points, true), by_lines = can_sample(lines, false);
  if (by_points || by_lines) {
    Random random(options.seed);
    int needed = options.max_samples;
    for (int sample = 0; sample < needed; ++sample) {
      // Points or lines, in proportion to their numbers.
      const bool take_points =
          by_points && (!by_lines || random.Index(features.size()) < features.points.size());
      std::vector<uint32_t>& order = take_points ? points : lines;
      const size_t sample_size = SampleSize(type, take_points);
      input.Clear();
      for (size_t k = 0; k < sample_size; ++k) {
        std::swap(order[k], order[k + random.Index(order.size() - k)]);
        if (take_points) {
          input.points.push_back(features.points[order[k]].X);
        } else {
          input.lines.push_back(features.lines[order[k]].line);
        }
      }
      double g[kMaxGroupParams];
      if (!input.Fit(type, g)) continue;
      GroupFit fit = EvaluateGroup(type, g, features, limit);
      // A rough start may still lead to the best end.
      if (fit.gain > 0.75 * best.gain) optimise(std::move(fit));
      size_t inliers = 0;
      for (const uint32_t i : order) {
        inliers += best.num_inliers > 0 &&
                   best.residuals[take_points ? i : features.points.size() + i] < limit;
      }
      const double share = static_cast<double>(inliers) / static_cast<double>(order.size());
      const double miss =
          1.0 - std::pow(std::clamp(share, 1e-3, 1.0 - 1e-9), static_cast<double>(sample_size));
      const double wanted = std::log(1.0 - options.confidence) / std::log(miss);
      needed = static_cast<int>(
          std::clamp(std::ceil(wanted), 1.0, static_cast<double>(options.max_samples)));
    }
  }
  if (best.num_inliers == 0) return std::nullopt;
  return best;
}

}  // namespace holba
