// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/groups/plane_detection.h"

#include <Eigen/Core>
#include <algorithm>
#include <utility>
#include <vector>

#include "holba/estimation/groups/plane_merge.h"
#include "holba/estimation/groups/plane_points.h"
#include "holba/estimation/groups/plane_search.h"
#include "holba/estimation/groups/plane_split.h"
#include "holba/estimation/points/point_uncertainty.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

std::vector<FoundPlane> FindPlanes(const PlaneOptions& options, const PlanePoints& points,
                                   const std::vector<Eigen::Vector3d>& vp_normals,
                                   PlaneReport* report) {
  std::vector<FoundPlane> planes;
  // The second search is among the remaining points, which had few samples in the first one.
  for (const bool is_last : {false, true}) {
    std::vector<bool> is_free(points.size(), true);
    for (const FoundPlane& plane : planes) {
      for (uint32_t i : plane.members) is_free[i] = false;
    }
    const std::vector<FoundPlane> found =
        SearchPlanes(options, points, vp_normals, std::move(is_free));
    report->planes_found += found.size();
    planes.insert(planes.end(), found.begin(), found.end());
    // A plane that the first search loses may be found by the second: it is not counted.
    std::map<std::string, size_t>* const dropped = is_last ? &report->dropped : nullptr;
    report->planes_merged += MergePlanes(options, points, &planes);
    RemoveWeakPlanes(options, points, dropped, &planes);
    // The search is greedy, so that a plane may have taken points of one beside it.
    for (int pass = 0; pass < 2; ++pass) ReassignPoints(options, points, &planes);
    report->planes_merged += MergePlanes(options, points, &planes);
    RemoveWeakPlanes(options, points, dropped, &planes);
  }
  std::stable_sort(planes.begin(), planes.end(), [](const FoundPlane& a, const FoundPlane& b) {
    return a.members.size() > b.members.size();
  });
  return planes;
}

// Likely normals of planes: directions of vanishing points, and normals of each two of them.
std::vector<Eigen::Vector3d> NormalsOfVanishingPoints(const Reconstruction& model) {
  std::vector<Eigen::Vector3d> directions;
  for (const auto& [id, group] : model.groups3D) {
    double g[kMaxGroupParams];
    if (!group.type->IsParallelism() || !group.type->from_file(group.params.data(), g)) continue;
    Eigen::Vector3d direction;
    group.type->direction(g, &direction, nullptr);
    directions.push_back(direction);
  }
  std::vector<Eigen::Vector3d> normals;
  const auto add = [&normals](const Eigen::Vector3d& n) {
    for (const Eigen::Vector3d& other : normals) {
      if (AngleRad(n, other) < DegToRad(1.0)) return;
    }
    normals.push_back(n);
  };
  for (const Eigen::Vector3d& v : directions) add(v);
  for (size_t i = 0; i < directions.size(); ++i) {
    for (size_t j = i + 1; j < directions.size(); ++j) {
      const Eigen::Vector3d n = directions[i].cross(directions[j]);
      if (n.norm() > 0.5) add(n.normalized());
    }
  }
  return normals;
}

// Adds the planes among points that are on none yet.
PlaneReport AddPlanes(const PlaneOptions& options, Reconstruction* model) {
  PlaneReport report;
  const ViewMap views(*model);
  report.sigma_px = MeasurePointSigmaPx(*model, views).value_or(1.0);
  std::vector<PlanePoint> eligible = EligiblePoints(options, *model, views, WhichPoints::kOnNoPlane,
                                                    report.sigma_px, &report.dropped);
  report.points_eligible = eligible.size();
  if (eligible.empty()) return report;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const PlanePoint& p : eligible) centre += p.X;
  centre /= static_cast<double>(eligible.size());
  for (PlanePoint& p : eligible) p.X -= centre;
  const PlanePoints points(options, std::move(eligible));

  const std::vector<Eigen::Vector3d> vp_normals = NormalsOfVanishingPoints(*model);
  const std::vector<FoundPlane> planes = FindPlanes(options, points, vp_normals, &report);
  std::vector<double> residuals;
  for (const FoundPlane& plane : planes) {
    const Eigen::Vector3d& n = plane.params.n;
    std::vector<point3D_t> members;
    for (uint32_t i : plane.members) {
      members.push_back(points[i].id);
      residuals.push_back(points.Distance(plane.params, i) / points[i].gsd);
    }
    report.points_on_planes += plane.members.size();
    report.planes_along_vps +=
        std::any_of(vp_normals.begin(), vp_normals.end(),
                    [&n](const Eigen::Vector3d& v) { return AngleRad(n, v) < DegToRad(3.0); });
    model->AddGroup3D(PlaneType(), {n.x(), n.y(), n.z(), plane.params.w - n.dot(centre)},
                      std::move(members));
  }
  report.planes = planes.size();
  report.median_residual_px = Median(std::move(residuals));
  return report;
}

}  // namespace

PlaneReport DetectPlanes(const PlaneOptions& options, Reconstruction* model) {
  PlaneReport report = AddPlanes(options, model);
  report.planes_split = SplitPlanes(options, report.sigma_px, model);
  report.planes += report.planes_split;
  return report;
}

void PlaneOptions::Describe(OptionTable* table) const {
  table->Section("Planes");
  table->Field("seed", &seed, AnyValue(), "Seed of the random samples.");
  table->Field("min_images", &min_images, AtLeast(2), "Fewest images of a point.");
  table->Field("min_angle_deg", &min_angle_deg, Between(0, 90),
               "Least triangulation angle of a point.");
  table->Field("max_distance_px", &max_distance_px, GreaterThan(0),
               "Farthest from its plane that a point may be, in pixels at its depth.");
  table->Field("max_neighbour_px", &max_neighbour_px, GreaterThan(0),
               "Farthest apart that two neighbours on a plane may be, in pixels at their depth.");
  table->Field("min_component", &min_component, AtLeast(4),
               "Fewest connected points that found a plane.");
  table->Field("min_points", &min_points, AtLeast(4), "Fewest points of a plane.");
  table->Field("min_share", &min_share, Between(0, 1),
               "Least mean share of a member's 12 nearest points that are members too.");
  table->Field("samples_per_point", &samples_per_point, AtLeast(1),
               "Samples of three neighbours that each point starts.");
  table->Field("max_planes", &max_planes, AtLeast(0), "Most planes.");
  table->Field("merge_angle_deg", &merge_angle_deg, Between(0, 90),
               "Widest angle of two planes that may be one.");
}

}  // namespace holba
