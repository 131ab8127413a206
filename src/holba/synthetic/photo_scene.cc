// SPDX-License-Identifier: BSD-3-Clause
#include "holba/synthetic/photo_scene.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/geometry/manifold.h"
#include "holba/group/known_types.h"
#include "holba/synthetic/synthetic_cameras.h"

namespace holba {
namespace {

// Rounding of turns by right angles, so that axes are axes again.
Eigen::Vector3d Snapped(const Eigen::Vector3d& v) {
  constexpr double kRounding = 1e-9;
  return v.unaryExpr([](double x) { return std::abs(x) < kRounding ? 0.0 : x; });
}

int AxisOf(const Segment3d& segment) {
  const Eigen::Vector3d d = Snapped((segment[1] - segment[0]).normalized());
  for (int axis = 0; axis < 3; ++axis) {
    if (d[(axis + 1) % 3] == 0.0 && d[(axis + 2) % 3] == 0.0) return axis;
  }
  return -1;
}

// Uniform in the cone of 70 degrees around the normal; the place in its part is the seed.
Eigen::Vector3d FavouriteOf(const Eigen::Vector3d& X, const Eigen::Vector3d& normal) {
  uint64_t seed = 0;
  for (const double x : X) seed = seed * 0x9e3779b97f4a7c15ULL + std::bit_cast<uint64_t>(x);
  Random random(seed);
  const double cosine = random.Uniform(std::cos(DegToRad(70.0)), 1.0);
  const double sine = std::sqrt(1.0 - cosine * cosine);
  const double turn = random.Uniform(0.0, 2.0 * std::numbers::pi);
  return cosine * normal +
         TangentBasis(normal) * Eigen::Vector2d(sine * std::cos(turn), sine * std::sin(turn));
}

std::vector<double> TransformedParams(const SyntheticGroup& group, const Rigid3d& world_from_part) {
  std::array<double, kMaxGroupParams> g{}, transformed{};
  HOLBA_CHECK(group.type->from_file(group.params.data(), g.data()));
  const Sim3d similarity{1.0, world_from_part.rotation, world_from_part.translation};
  group.type->transform(similarity, g.data(), transformed.data());
  std::vector<double> params(group.params.size());
  group.type->to_file(transformed.data(), params.data());
  if (IsPlane(*group.type)) {
    Eigen::Map<Eigen::Vector3d> normal(params.data());
    normal = Snapped(normal).normalized();
  }
  return params;
}

// Builds a facade, feature by feature.
class FacadeMaker {
 public:
  explicit FacadeMaker(const Facade& facade) : facade_(facade), random_(facade.design + 77) {
    part_.structure.groups.push_back({&PlaneType(), {0.0, -1.0, 0.0, 0.0}, {}, {}});
    part_.panels.push_back(
        {Eigen::Vector3d::Zero(), {facade.width, 0, 0}, {0, 0, facade.height}, 0});
  }

  ScenePart Make(double points_per_m2) {
    AddFrame(0.0, facade_.width, 0.0, facade_.height);
    AddWindows();
    const auto num_points =
        static_cast<size_t>(points_per_m2 * facade_.width * facade_.height + 0.5);
    for (size_t k = 0; k < num_points; ++k) {
      const bool is_off = random_.Uniform() < facade_.share_off_plane;
      const double x = random_.Uniform(0.0, facade_.width);
      const double z = random_.Uniform(0.0, facade_.height);
      const double y = is_off ? -random_.Uniform(0.05, facade_.max_relief) : 0.0;
      // Log-uniform, 2 to 30 cm.
      AddPoint({x, y, z}, 0.02 * std::pow(15.0, random_.Uniform()), !is_off);
    }
    return std::move(part_);
  }

 private:
  uint32_t AddPoint(const Eigen::Vector3d& X, double size, bool on_plane) {
    const auto idx = static_cast<uint32_t>(part_.structure.points.size());
    part_.structure.points.push_back(X);
    part_.point_normals.emplace_back(0.0, -1.0, 0.0);
    part_.point_sizes.push_back(size);
    if (on_plane) part_.structure.groups[0].points.push_back(idx);
    return idx;
  }

  // Four lines clockwise with a junction at each corner.
  void AddFrame(double left, double right, double low, double high) {
    constexpr double kCornerSize = 0.08;
    const std::array<Eigen::Vector3d, 4> corners = {
        Eigen::Vector3d(left, 0, low), Eigen::Vector3d(left, 0, high),
        Eigen::Vector3d(right, 0, high), Eigen::Vector3d(right, 0, low)};
    std::array<uint32_t, 4> points{};
    for (int k = 0; k < 4; ++k) points[k] = AddPoint(corners[k], kCornerSize, true);
    for (int k = 0; k < 4; ++k) {
      const int next = (k + 1) % 4;
      const auto line = static_cast<uint32_t>(part_.structure.segments.size());
      part_.structure.segments.push_back({corners[k], corners[next]});
      part_.structure.plane_of_line.push_back(0);
      part_.structure.axis_of_line.push_back(-1);  // AddPart finds it
      part_.segment_normals.emplace_back(0.0, -1.0, 0.0);
      part_.structure.groups[0].lines.push_back(line);
      part_.structure.edges.push_back({points[k], line});
      part_.structure.edges.push_back({points[next], line});
    }
  }

  void AddWindows() {
    constexpr double kFloor = 3.2, kSill = 1.0, kHeight = 1.5;
    const int columns = std::max(1, static_cast<int>(facade_.width / random_.Uniform(2.3, 3.2)));
    const int floors = std::max(1, static_cast<int>(facade_.height / kFloor));
    const double step = facade_.width / columns, width = step * random_.Uniform(0.35, 0.55);
    for (int floor = 0; floor < floors; ++floor) {
      for (int column = 0; column < columns; ++column) {
        const double left = (column + 0.5) * step - 0.5 * width, low = floor * kFloor + kSill;
        AddFrame(left, left + width, low, low + kHeight);
      }
    }
  }

  const Facade& facade_;
  Random random_;
  ScenePart part_;
};

}  // namespace

ScenePlace AddPart(const ScenePart& part, const Rigid3d& world_from_part, ScenePart* content) {
  SyntheticStructure& to = content->structure;
  const SyntheticStructure& from = part.structure;
  ScenePlace place{world_from_part, static_cast<uint32_t>(to.points.size()),
                   static_cast<uint32_t>(to.segments.size())};
  const auto first_group = static_cast<uint32_t>(to.groups.size());
  const auto turned = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
    return world_from_part.rotation * v;
  };
  for (const Eigen::Vector3d& X : from.points) to.points.push_back(world_from_part * X);
  for (const Segment3d& segment : from.segments) {
    to.segments.push_back({world_from_part * segment[0], world_from_part * segment[1]});
    to.axis_of_line.push_back(AxisOf(to.segments.back()));
  }
  for (const int plane : from.plane_of_line) {
    to.plane_of_line.push_back(plane < 0 ? -1 : plane + static_cast<int>(first_group));
  }
  for (const SyntheticGroup& group : from.groups) {
    SyntheticGroup& added = to.groups.emplace_back(
        group.type, TransformedParams(group, world_from_part), group.points, group.lines);
    for (uint32_t& point : added.points) point += place.first_point;
    for (uint32_t& line : added.lines) line += place.first_line;
  }
  for (const SyntheticEdge& edge : from.edges) {
    to.edges.push_back({edge.point + place.first_point, edge.line + place.first_line});
  }
  for (const SyntheticRelation& relation : from.relations) {
    to.relations.push_back(
        {relation.group1 + first_group, relation.group2 + first_group, relation.type});
  }
  for (size_t p = 0; p < from.points.size(); ++p) {
    const Eigen::Vector3d& normal = part.point_normals[p];
    content->point_favourites.push_back(turned(FavouriteOf(from.points[p], normal)));
  }
  for (size_t l = 0; l < from.segments.size(); ++l) {
    const Segment3d& s = from.segments[l];
    const Eigen::Vector3d middle = 0.5 * (s[0] + s[1]);
    content->segment_favourites.push_back(turned(FavouriteOf(middle, part.segment_normals[l])));
  }
  for (const Eigen::Vector3d& n : part.point_normals) content->point_normals.push_back(turned(n));
  for (const Eigen::Vector3d& n : part.segment_normals)
    content->segment_normals.push_back(turned(n));
  content->point_sizes.insert(content->point_sizes.end(), part.point_sizes.begin(),
                              part.point_sizes.end());
  for (const ScenePanel& panel : part.panels) {
    content->panels.push_back({world_from_part * panel.corner, turned(panel.u), turned(panel.v),
                               panel.group + first_group});
  }
  return place;
}

SceneCopy CopyOf(const ScenePart& part, const ScenePlace& original, const ScenePlace& copy) {
  return {copy.world_from_part * original.world_from_part.Inverse(),
          original.first_point,
          copy.first_point,
          static_cast<uint32_t>(part.structure.points.size()),
          original.first_line,
          copy.first_line,
          static_cast<uint32_t>(part.structure.segments.size())};
}

ScenePart MakeFacade(const Facade& facade, double points_per_m2) {
  return FacadeMaker(facade).Make(points_per_m2);
}

PhotoScene MakePhotoScene(PhotoSceneKind kind, int num_images, double density, uint64_t seed) {
  HOLBA_CHECK(density > 0.0);
  const int fewest = kind == PhotoSceneKind::kStreet ? 50 : 20;
  if (num_images < fewest) {
    throw InputError("--num_images: expected at least " + std::to_string(fewest) +
                     " for this scene, found " + std::to_string(num_images));
  }
  PhotoScene scene;
  switch (kind) {
    case PhotoSceneKind::kSphere:
      scene = MakeSphereScene(num_images, density, seed);
      break;
    case PhotoSceneKind::kStreet:
      scene = MakeStreetScene(num_images, density, seed);
      break;
    case PhotoSceneKind::kCollection:
      scene = MakeCollectionScene(num_images, density, seed);
      break;
  }
  AddVanishingPoints(&scene.content.structure);
  return scene;
}

}  // namespace holba
