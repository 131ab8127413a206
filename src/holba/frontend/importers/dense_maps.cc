// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/importers/dense_maps.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "holba/base/check.h"
#include "holba/frontend/matching/label_maps.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"

namespace holba {
namespace {

// Median of a Rayleigh distribution of scale 1: tilts in two directions of that spread each.
constexpr double kRayleighMedian = 1.1774100225154747;

using NormalsByLabel = std::map<uint16_t, std::vector<Eigen::Vector3d>>;

std::map<uint16_t, float> PlanarLabels(const LabelMap& labels) {
  std::map<uint16_t, float> result;
  for (const auto& [label, type] : labels.types) {
    if (label != 0 && IsPlane(*type)) result[label] = 0.0f;
  }
  return result;
}

// The camera's unit ray through the centre of a pixel of a map that covers the image.
std::optional<Eigen::Vector3d> RayOfMapPixel(const Camera& camera, int width, int height, int x,
                                             int y) {
  const Eigen::Vector2d pixel((x + 0.5) * static_cast<double>(camera.width) / width,
                              (y + 0.5) * static_cast<double>(camera.height) / height);
  return camera.model->unproject(camera.params.data(), pixel);
}

// Labels as seen by the pixels of another map, without a margin at the rim: 0 elsewhere.
class ErodedLabels {
 public:
  ErodedLabels(const LabelMap& map, int width, int height, double margin_px)
      : map_(map),
        wanted_(PlanarLabels(map)),
        distance_(wanted_.empty() ? std::vector<float>() : DistanceToRim(map)),
        margin_(
            static_cast<float>(margin_px * std::max(map.width, map.height) / kReferenceLongSidePx)),
        column_of_(Positions(map.width, width)),
        row_of_(Positions(map.height, height)) {}

  const std::map<uint16_t, float>& wanted() const { return wanted_; }
  uint16_t At(int x, int y) const {
    const size_t at =
        static_cast<size_t>(row_of_[y]) * map_.width + static_cast<size_t>(column_of_[x]);
    const uint16_t label = map_.labels[at];
    return distance_[at] >= margin_ && wanted_.contains(label) ? label : 0;
  }

 private:
  static std::vector<int> Positions(int map_size, int size) {
    std::vector<int> positions(static_cast<size_t>(size));
    for (int i = 0; i < size; ++i) {
      positions[i] = std::min(map_size - 1, static_cast<int>((i + 0.5) * map_size / size));
    }
    return positions;
  }

  const LabelMap& map_;
  std::map<uint16_t, float> wanted_;
  std::vector<float> distance_;
  float margin_;
  std::vector<int> column_of_, row_of_;
};

// Weiszfeld's iteration for the point with the least sum of distances, then of unit length.
Eigen::Vector3d GeometricMedian(const std::vector<Eigen::Vector3d>& normals) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& n : normals) mean += n;
  mean /= static_cast<double>(normals.size());
  constexpr int kMaxIterations = 50;
  constexpr double kSmallest = 1e-6;  // distance that still counts: the iteration's smoothing
  for (int i = 0; i < kMaxIterations; ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 0.0;
    for (const Eigen::Vector3d& n : normals) {
      const double weight = 1.0 / std::max((n - mean).norm(), kSmallest);
      sum += weight * n;
      weights += weight;
    }
    const Eigen::Vector3d next = sum / weights;
    const double step = (next - mean).norm();
    mean = next;
    if (step < kSmallest) break;
  }
  return mean.normalized();
}

std::map<uint16_t, RegionNormal> Summarise(const std::map<uint16_t, float>& wanted,
                                           const NormalsByLabel& by_label,
                                           const RegionNormalOptions& options,
                                           std::map<std::string, size_t>* dropped) {
  std::map<uint16_t, RegionNormal> result;
  for (const auto& [label, ignored] : wanted) {
    const auto it = by_label.find(label);
    if (it == by_label.end() || it->second.size() < static_cast<size_t>(options.min_num_normals)) {
      ++(*dropped)["too few pixels with a normal"];
      continue;
    }
    const std::vector<Eigen::Vector3d>& normals = it->second;
    const Eigen::Vector3d mean = GeometricMedian(normals);
    std::vector<double> angles_deg;
    size_t num_close = 0;
    for (const Eigen::Vector3d& n : normals) {
      angles_deg.push_back(std::atan2(n.cross(mean).norm(), n.dot(mean)) * kDegPerRad);
      if (angles_deg.back() <= options.max_deviation_deg) ++num_close;
    }
    if (!mean.allFinite() ||
        static_cast<double>(num_close) < options.min_share * static_cast<double>(normals.size())) {
      ++(*dropped)["the normals of the region disagree"];
      continue;
    }
    const auto middle = angles_deg.begin() + static_cast<std::ptrdiff_t>(angles_deg.size() / 2);
    std::nth_element(angles_deg.begin(), middle, angles_deg.end());
    result[label] = {mean, std::max(options.min_sigma_deg, *middle / kRayleighMedian)};
  }
  return result;
}

Eigen::Vector3d TowardsCamera(const Eigen::Vector3d& normal, const Eigen::Vector3d& ray) {
  return normal.dot(ray) > 0.0 ? Eigen::Vector3d(-normal) : normal;
}

}  // namespace

void RegionNormalOptions::Describe(OptionTable* table) const {
  table->Section("RegionNormals");
  table->Field("margin_px", &margin_px, AtLeast(0),
               "Pixels this close to the rim of a region are left out of its normal, of an image "
               "whose long side is 800.");
  table->Field("min_share", &min_share, Between(0, 1),
               "Least share of a region's normals that agree with its mean.");
  table->Field("max_deviation_deg", &max_deviation_deg, Between(0, 90),
               "Angle to the mean up to which a normal agrees with it.");
  table->Field("min_num_normals", &min_num_normals, AtLeast(3), "Normals needed in a region.");
  table->Field("min_sigma_deg", &min_sigma_deg, GreaterThan(0),
               "Least standard deviation of a region's normal.");
  table->Field("window_px", &window_px, AtLeast(3),
               "Side of the windows of depths that give one normal each, of an image whose long "
               "side is 800.");
}

std::map<uint16_t, RegionNormal> NormalsOfRegions(const LabelMap& labels, const NormalMap& normals,
                                                  const Camera& camera,
                                                  const RegionNormalOptions& options,
                                                  std::map<std::string, size_t>* dropped) {
  HOLBA_CHECK(normals.normals_in_cam.size() == static_cast<size_t>(normals.width) * normals.height);
  const ErodedLabels eroded(labels, normals.width, normals.height, options.margin_px);
  if (eroded.wanted().empty() || labels.empty()) return {};
  // More than some hundred a side say no more.
  constexpr int kMaxSide = 400;
  const int step = std::max(1, std::max(normals.width, normals.height) / kMaxSide);
  NormalsByLabel by_label;
  for (int y = step / 2; y < normals.height; y += step) {
    for (int x = step / 2; x < normals.width; x += step) {
      const uint16_t label = eroded.At(x, y);
      if (label == 0) continue;
      const Eigen::Vector3d n =
          normals.normals_in_cam[static_cast<size_t>(y) * normals.width + x].cast<double>();
      const double norm = n.norm();
      if (!std::isfinite(norm) || norm < 1e-3) continue;
      const auto ray = RayOfMapPixel(camera, normals.width, normals.height, x, y);
      if (ray) by_label[label].push_back(TowardsCamera(n / norm, *ray));
    }
  }
  return Summarise(eroded.wanted(), by_label, options, dropped);
}

std::map<uint16_t, RegionNormal> NormalsOfRegions(const LabelMap& labels, const DepthMap& depths,
                                                  const Camera& camera,
                                                  const RegionNormalOptions& options,
                                                  std::map<std::string, size_t>* dropped) {
  HOLBA_CHECK(depths.depth.size() == static_cast<size_t>(depths.width) * depths.height);
  const ErodedLabels eroded(labels, depths.width, depths.height, options.margin_px);
  if (eroded.wanted().empty() || labels.empty()) return {};
  const int long_side = std::max(depths.width, depths.height);
  const int window = std::max(
      3, static_cast<int>(std::lround(options.window_px * long_side / kReferenceLongSidePx)));
  // A plane n.X = -w has 1/z = (n / -w).(x/z, y/z, 1): linear in what each pixel knows, and so are
  // the errors of stereo and of networks trained on inverse depth.
  struct Sums {
    Eigen::Matrix3d normal_matrix = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
    int count = 0;
  };
  NormalsByLabel by_label;
  for (int y0 = 0; y0 < depths.height; y0 += window) {
    for (int x0 = 0; x0 < depths.width; x0 += window) {
      std::map<uint16_t, Sums> sums;
      for (int y = y0; y < std::min(y0 + window, depths.height); ++y) {
        for (int x = x0; x < std::min(x0 + window, depths.width); ++x) {
          const uint16_t label = eroded.At(x, y);
          if (label == 0) continue;
          const double depth = depths.depth[static_cast<size_t>(y) * depths.width + x];
          if (!(depth > 0.0) || !std::isfinite(depth)) continue;
          const auto ray = RayOfMapPixel(camera, depths.width, depths.height, x, y);
          constexpr double kMinCos = 0.05;  // rays beyond 87 degrees have no place in a plane z = 1
          if (!ray || ray->z() < kMinCos) continue;
          const double z = depths.along_ray ? depth * ray->z() : depth;
          const Eigen::Vector3d r = *ray / ray->z();
          Sums& s = sums[label];
          s.normal_matrix += r * r.transpose();
          s.right_side += r / z;
          ++s.count;
        }
      }
      for (const auto& [label, s] : sums) {
        // Half a window at least; else its shape may be a strip, which fixes no plane.
        if (s.count * 2 < window * window) continue;
        const Eigen::LDLT<Eigen::Matrix3d> ldlt(s.normal_matrix);
        const Eigen::Vector3d g = ldlt.solve(s.right_side);
        const double norm = g.norm();
        if (!std::isfinite(norm) || norm == 0.0) continue;
        // 1/z > 0 on the plane: its side that faces the camera has normal -g.
        by_label[label].push_back(-g / norm);
      }
    }
  }
  return Summarise(eroded.wanted(), by_label, options, dropped);
}

}  // namespace holba
