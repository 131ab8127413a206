// SPDX-License-Identifier: BSD-3-Clause
// What a rendering says is true is true: checked by other means than it was made with.
#include "holba/render/rendering.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "holba/base/random.h"
#include "holba/group/known_types.h"
#include "holba/render/place_files.h"
#include "holba/render/presets.h"
#include "holba/render/ray_triangle_testing.h"

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

RenderOptions SmallOptions() {
  RenderOptions options;
  options.camera.width = 200;
  options.camera.height = 150;
  options.walk.num_images = 6;
  options.photo.samples = 1;
  options.photo.light_samples = 1;
  return options;
}

// Light is of no interest to these tests: coarse.
Place Small(std::string_view preset) {
  Place place = BuildPreset(preset, 1);
  place.texel_m = 0.6;
  return place;
}

Rendering Render(std::string_view preset, const RenderOptions& options, int num_threads = 2) {
  return Rendering(Small(preset), "image", "jpg", options, num_threads, [](size_t, size_t) {});
}

// The table, with all that is true of it.
const Rendering& TableRendering() {
  static const Rendering* rendering = [] {
    auto* made =
        new Rendering(Small("table"), "table", "jpg", SmallOptions(), 2, [](size_t, size_t) {});
    TruthOptions options;
    options.num_points_per_image = 300;
    made->AddTruthToModel(options);
    return made;
  }();
  return *rendering;
}

TEST(Rendering, IsTheSameForAnyNumberOfThreads) {
  RenderOptions options = SmallOptions();
  options.walk.num_images = 2;
  Rendering one = Render("room_2", options, 1), two = Render("room_2", options, 2);
  EXPECT_EQ(one.TakePhoto(2).rgb, two.TakePhoto(2).rgb);
  EXPECT_EQ(one.MakeMaps(1).depth_m, two.MakeMaps(1).depth_m);
  one.AddTruthToModel();
  two.AddTruthToModel();
  ASSERT_EQ(one.model().points3D.size(), two.model().points3D.size());
  for (const auto& [id, point] : one.model().points3D)
    EXPECT_EQ(point.xyz, two.model().points3D.at(id).xyz);
}

TEST(Rendering, AnotherSeedIsAnotherPlace) {
  const Place first = BuildPreset("room_1", 1), again = BuildPreset("room_1", 1),
              other = BuildPreset("room_1", 2);
  ASSERT_EQ(first.surfaces.size(), again.surfaces.size());
  for (size_t i = 0; i < first.surfaces.size(); ++i)
    EXPECT_EQ(first.surfaces[i].origin, again.surfaces[i].origin);
  EXPECT_NE(first.surfaces[0].size, other.surfaces[0].size);
}

TEST(Rendering, DepthIsThatOfTheTriangles) {
  const Rendering& rendering = TableRendering();
  SurfaceMesh mesh;
  constexpr double kDeviation = 1e-4;
  for (const Surface& surface : rendering.place().surfaces) {
    const SurfaceMesh part = Tessellate(surface, kDeviation);
    const auto first = static_cast<uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
    for (const auto& [a, b, c] : part.triangles)
      mesh.triangles.push_back({first + a, first + b, first + c});
  }
  const image_t image_id = 2;
  const Image& image = rendering.model().images.at(image_id);
  const Camera& camera = rendering.model().cameras.at(image.camera_id);
  const TruthMaps maps = rendering.MakeMaps(image_id);
  const Rigid3d world_from_cam = image.cam_from_world.Inverse();
  Random random(5);
  int num_flat = 0, num_curved = 0, num_off = 0;
  for (int i = 0; i < 300; ++i) {
    const auto x = static_cast<int>(random.Index(200)), y = static_cast<int>(random.Index(150));
    const auto ray = camera.model->unproject(camera.params.data(), Vector2d(x + 0.5, y + 0.5));
    ASSERT_TRUE(ray.has_value());
    const auto distance =
        FirstTriangle(mesh, world_from_cam.translation, world_from_cam.rotation * *ray);
    ASSERT_TRUE(distance.has_value());
    const size_t at = static_cast<size_t>(y) * 200 + static_cast<size_t>(x);
    const double depth = *distance * ray->z();
    const double slant = std::abs(maps.normals[at].dot(*ray));
    if (std::abs(depth - maps.depth_m[at]) < 1e-9) {
      ++num_flat;
    } else if (std::abs(depth - maps.depth_m[at]) < 2 * kDeviation / slant) {
      ++num_curved;
    } else {
      ++num_off;
    }
  }
  EXPECT_GT(num_flat, 200);
  EXPECT_GT(num_curved, 5);
  EXPECT_LE(num_off, 1);  // at the very rim of a curved thing
}

// What the equation of a group says of a point: the distance of its projection.
double DistanceTo(const GroupType& type, const std::vector<double>& params, const Vector3d& point) {
  double g[kMaxGroupParams];
  EXPECT_TRUE(type.from_file(params.data(), g));
  Vector3d projected;
  EXPECT_TRUE(type.project_point(g, point, &projected));
  return (projected - point).norm();
}

TEST(Rendering, LabelledPixelsWithTheirDepthLieOnTheirPrimitives) {
  const Rendering& rendering = TableRendering();
  std::map<std::string_view, int> num_of_type;
  for (const auto& [image_id, image] : rendering.model().images) {
    const Camera& camera = rendering.model().cameras.at(image.camera_id);
    const TruthMaps maps = rendering.MakeMaps(image_id);
    const std::vector<uint16_t> labels = LabelsOf(maps);
    const Rigid3d world_from_cam = image.cam_from_world.Inverse();
    for (size_t at = 0; at < labels.size(); at += 7) {
      if (labels[at] == 0) continue;
      const Vector2d pixel(static_cast<double>(at % 200) + 0.5,
                           static_cast<double>(at / 200) + 0.5);
      const auto ray = camera.model->unproject(camera.params.data(), pixel);
      const Vector3d point = world_from_cam * Vector3d(*ray * (maps.depth_m[at] / ray->z()));
      const Entity& entity = rendering.place().entities[labels[at] - 1u];
      EXPECT_LT(DistanceTo(*entity.type, entity.params, point), 1e-9);
      ++num_of_type[entity.type->name];
      // Towards the camera, and across the surface.
      EXPECT_LT(maps.normals[at].dot(*ray), 0.0);
    }
  }
  for (const std::string_view type :
       {"PLANE", "SPHERE", "CYLINDER", "CONE", "ELLIPSOID", "CUBOID"}) {
    EXPECT_GT(num_of_type[type], 50) << type;
  }
}

TEST(Rendering, TheTruthIsConsistentAndItsResidualsAreZero) {
  const Reconstruction& model = TableRendering().model();
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_GT(model.points3D.size(), 200u);
  EXPECT_GT(model.lines3D.size(), 40u);
  EXPECT_GT(model.wireframe.size(), 20u);
  EXPECT_GT(model.relations.size(), 5u);
  std::map<std::string_view, int> num_groups;
  for (const auto& [id, point] : model.points3D) {
    for (const PointObservation& observation : point.track) {
      const Image& image = model.images.at(observation.image_id);
      const Camera& camera = model.cameras.at(image.camera_id);
      Vector2d pixel;
      ASSERT_TRUE(
          camera.model->project(camera.params.data(), image.cam_from_world * point.xyz, &pixel));
      EXPECT_LT((pixel - image.points2D[observation.point2D_idx].xy).norm(), 1e-9);
    }
  }
  for (const auto& [id, line] : model.lines3D) {
    for (const LineObservation& observation : line.track) {
      const Image& image = model.images.at(observation.image_id);
      const Camera& camera = model.cameras.at(image.camera_id);
      const LineSegment2d& segment = image.lines2D[observation.line2D_idx].segment;
      EXPECT_GE(segment.Length(), 10.0);
      // The rays of both ends meet the line: they are in the plane of line and camera.
      const Rigid3d world_from_cam = image.cam_from_world.Inverse();
      const Vector3d normal =
          (line.line.ClosestPoint(world_from_cam.translation) - world_from_cam.translation)
              .cross(line.line.direction)
              .normalized();
      for (const Vector2d& end : {segment.start, segment.end}) {
        const auto ray = camera.model->unproject(camera.params.data(), end);
        EXPECT_LT(std::abs(normal.dot(world_from_cam.rotation * *ray)), 1e-9);
      }
    }
  }
  for (const auto& [id, group] : model.groups3D) {
    ++num_groups[group.type->name];
    for (const point3D_t point : group.point3D_ids) {
      EXPECT_LT(DistanceTo(*group.type, group.params, model.points3D.at(point).xyz), 1e-7);
    }
    for (const line3D_t line : group.line3D_ids) {
      if (group.type->IsParallelism()) {
        const Vector3d v(group.params[0], group.params[1], group.params[2]);
        EXPECT_LT(model.lines3D.at(line).line.direction.cross(v).norm(), 1e-9);
      } else {
        EXPECT_LT(DistanceTo(*group.type, group.params, model.lines3D.at(line).start), 1e-7);
        EXPECT_LT(DistanceTo(*group.type, group.params, model.lines3D.at(line).end), 1e-7);
      }
    }
  }
  for (const WireframeEdge& edge : model.wireframe) {
    EXPECT_LT(
        model.lines3D.at(edge.line3D_id).line.Distance(model.points3D.at(edge.point3D_id).xyz),
        1e-7);
  }
  for (const Relation& relation : model.relations) {
    const auto direction = [&](group3D_t id) {
      const std::vector<double>& params = model.groups3D.at(id).params;
      return Vector3d(params[0], params[1], params[2]);
    };
    const Vector3d a = direction(relation.group3D_id1), b = direction(relation.group3D_id2);
    EXPECT_LT(relation.type == RelationType::kOrthogonal ? std::abs(a.dot(b)) : a.cross(b).norm(),
              1e-8);
  }
  for (const std::string_view type :
       {"VP", "PLANE", "SPHERE", "CYLINDER", "CONE", "ELLIPSOID", "CUBOID"}) {
    EXPECT_GE(num_groups[type], 2) << type;
  }
}

// Whether the surfaces at two pixels are one plane: by depth and normals alone.
bool IsOnePlane(const TruthMaps& maps, const Camera& camera, const Vector2d& a, const Vector2d& b) {
  const auto index = [&](const Vector2d& pixel) {
    return static_cast<size_t>(pixel.y()) * static_cast<size_t>(maps.width) +
           static_cast<size_t>(pixel.x());
  };
  const auto point = [&](const Vector2d& pixel) {
    const Vector2d centre(std::floor(pixel.x()) + 0.5, std::floor(pixel.y()) + 0.5);
    const auto ray = camera.model->unproject(camera.params.data(), centre);
    return Vector3d(*ray * (maps.depth_m[index(pixel)] / ray->z()));
  };
  const Vector3d &n = maps.normals[index(a)], &m = maps.normals[index(b)];
  return n.dot(m) > 1.0 - 1e-6 && std::abs(n.dot(point(a) - point(b))) < 1e-6;
}

TEST(Rendering, TrueEdgesAreWhereDepthOrNormalsBreak) {
  const Rendering& rendering = TableRendering();
  int num_edges = 0, num_breaks = 0, num_beside = 0, num_breaks_beside = 0;
  for (const auto& [image_id, image] : rendering.model().images) {
    const Camera& camera = rendering.model().cameras.at(image.camera_id);
    const TruthMaps maps = rendering.MakeMaps(image_id);
    const auto is_inside = [&](const Vector2d& p) {
      return p.x() >= 1 && p.y() >= 1 && p.x() < maps.width - 1 && p.y() < maps.height - 1;
    };
    for (const Line2D& line : image.lines2D) {
      const LineSegment2d& segment = line.segment;
      if (segment.Length() < 20.0) continue;
      const Vector2d way = (segment.end - segment.start).normalized(), across(-way.y(), way.x());
      for (const double part : {0.3, 0.5, 0.7}) {
        const Vector2d at = segment.start + part * (segment.end - segment.start);
        const Vector2d a = at + 1.2 * across, b = at - 1.2 * across;
        if (!is_inside(a) || !is_inside(b)) continue;
        ++num_edges;
        num_breaks += IsOnePlane(maps, camera, a, b) ? 0 : 1;
        const Vector2d c = a + 4.0 * across, d = c + 2.4 * across;
        if (!is_inside(c) || !is_inside(d)) continue;
        ++num_beside;
        num_breaks_beside += IsOnePlane(maps, camera, c, d) ? 0 : 1;
      }
    }
  }
  EXPECT_GT(num_edges, 200);
  EXPECT_GE(num_breaks, 0.97 * num_edges)
      << num_edges;  // bars of the window are thinner than three pixels
  EXPECT_LT(num_breaks_beside, 0.5 * num_beside);
}

TEST(Rendering, NoOneWalksThroughThingsOrSeesTheirInside) {
  for (const std::string_view preset :
       {"room_1", "room_5", "facade_2", "hall", "corridor", "table"}) {
    const Place place = BuildPreset(preset, 1);
    const RayCaster caster(place.surfaces);
    const WalkPath path(place.walk, 1.0, 78);
    double nearest = 1e9;
    int num_inside = 0;
    Random random(9);
    for (const double part : Instants(place.walk, place.num_images)) {
      const Rigid3d world_from_cam = path.CamFromWorld(part).Inverse();
      for (int i = 0; i < 200; ++i) {
        const Vector3d anywhere(random.Normal(), random.Normal(), random.Normal());
        const auto around = caster.Cast(world_from_cam.translation, anywhere.normalized());
        if (around) nearest = std::min(nearest, around->distance);
        const Vector3d in_image(random.Uniform(-0.65, 0.65), random.Uniform(-0.5, 0.5), 1.0);
        const auto seen = caster.Cast(world_from_cam.translation,
                                      world_from_cam.rotation * in_image.normalized());
        if (seen && !seen->from_outside) ++num_inside;
      }
    }
    // Of 6000 rays or more; one may slip through the seam of two surfaces.
    EXPECT_LE(num_inside, 2) << preset;
    EXPECT_GT(nearest, 0.15) << preset;
  }
}

TEST(Rendering, RigsKeepTheirSensorsApart) {
  RenderOptions options = SmallOptions();
  options.walk.num_images = 2;
  options.walk.rig = RigKind::kRing;
  Rendering rendering = Render("corridor", options);
  rendering.AddTruthToModel();
  const Reconstruction& model = rendering.model();
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  EXPECT_EQ(model.images.size(), 8u);
  EXPECT_EQ(model.frames.size(), 2u);
  ASSERT_EQ(model.rigs.size(), 1u);
  EXPECT_EQ(model.rigs.at(1).sensors.size(), 3u);
}

TEST(Rendering, RollingExposureMovesRowsButNotTheTruth) {
  RenderOptions options = SmallOptions();
  options.walk.num_images = 2;
  const Rendering still = Render("table", options);
  options.walk.readout_ms = 60.0;
  const Rendering rolling = Render("table", options);
  EXPECT_EQ(still.model().images.at(1).cam_from_world.translation,
            rolling.model().images.at(1).cam_from_world.translation);
  EXPECT_NE(still.TakePhoto(1).rgb, rolling.TakePhoto(1).rgb);
}

TEST(MakeCamera, EveryModelSeesTheWantedField) {
  for (const CameraModel* model : AllCameraModels()) {
    RenderCameraOptions options;
    options.model = std::string(model->name);
    options.field_of_view_deg = 64.0;
    const Camera camera = MakeCamera(options, 60.0);
    ASSERT_EQ(camera.params.size(), static_cast<size_t>(model->num_params));
    if (model->focal_idxs.empty()) continue;
    const auto left = model->unproject(camera.params.data(), {0.0, 240.0});
    const auto right = model->unproject(camera.params.data(), {640.0, 240.0});
    ASSERT_TRUE(left && right) << model->name;
    EXPECT_NEAR(std::acos(left->dot(*right)) * 180.0 / 3.14159265358979, 64.0, 0.1) << model->name;
  }
}

}  // namespace
}  // namespace holba
