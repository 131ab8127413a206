// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/truth_model.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "holba/base/random.h"
#include "holba/base/threads.h"
#include "holba/group/known_types.h"
#include "holba/render/true_edges.h"

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;


struct TruePoint {
  Vector3d xyz;
  int surface;
  std::array<uint8_t, 3> rgb;
};

// A point on the rim or the face of a flat surface.
bool IsOnFlat(const Surface& surface, const Vector3d& point) {
  const Vector3d local = surface.axes.transpose() * (point - surface.origin);
  return std::abs(local.z()) < kSamePlace && local.x() > -kSamePlace && local.y() > -kSamePlace &&
         local.x() < surface.size[0] + kSamePlace && local.y() < surface.size[1] + kSamePlace;
}

class TruthBuilder {
 public:
  TruthBuilder(const Place& place, const RayCaster& caster, const TruthOptions& options,
               int num_threads, Reconstruction* model)
      : place_(place),
        caster_(caster),
        options_(options),
        num_threads_(num_threads),
        model_(*model) {
    for (const auto& [id, image] : model_.images) image_ids_.push_back(id);
  }

  void Build(uint64_t seed) {
    AddSurfacePoints(seed);
    AddLines();
    AddCorners();
    AddGroups();
    AddVanishingPoints();
    AddObservationsOfGroups();
  }

 private:
  // --- Points on surfaces: pixels of each image, spread evenly, and wherever else these places are
  // seen.
  void AddSurfacePoints(uint64_t seed) {
    std::vector<std::vector<TruePoint>> of_image(image_ids_.size());
    ParallelTasks(num_threads_, image_ids_.size(), [&](size_t i) {
      const Image& image = model_.images.at(image_ids_[i]);
      const Camera& camera = model_.cameras.at(image.camera_id);
      const Rigid3d world_from_cam = image.cam_from_world.Inverse();
      Random random(seed * 131 + i);
      const double aspect = static_cast<double>(camera.width) / static_cast<double>(camera.height);
      const int columns = std::max(
          1, static_cast<int>(std::lround(std::sqrt(options_.num_points_per_image * aspect))));
      const int rows = std::max(1, options_.num_points_per_image / columns);
      for (int cell = 0; cell < columns * rows; ++cell) {
        const Vector2d pixel(
            (cell % columns + random.Uniform()) * static_cast<double>(camera.width) / columns,
            (cell / columns + random.Uniform()) * static_cast<double>(camera.height) / rows);
        const auto ray = camera.model->unproject(camera.params.data(), pixel);
        if (!ray) continue;
        const auto hit = caster_.Cast(world_from_cam.translation, world_from_cam.rotation * *ray);
        if (!hit || !hit->from_outside) continue;
        of_image[i].push_back({hit->point, hit->surface, ColourAt(*hit)});
      }
    });
    std::vector<TruePoint> points;
    for (const auto& found : of_image) points.insert(points.end(), found.begin(), found.end());
    // Where each is seen, image by image.
    std::vector<std::vector<std::optional<Vector2d>>> pixels(image_ids_.size());
    ParallelTasks(num_threads_, image_ids_.size(), [&](size_t i) {
      const Image& image = model_.images.at(image_ids_[i]);
      for (const TruePoint& point : points) pixels[i].push_back(PixelOf(image, point));
    });
    for (size_t k = 0; k < points.size(); ++k) {
      std::vector<PointObservation> track;
      for (size_t i = 0; i < image_ids_.size(); ++i) {
        if (pixels[i][k]) track.push_back({image_ids_[i], 0});
      }
      if (track.size() < 2) continue;
      for (size_t i = 0, at = 0; i < image_ids_.size(); ++i) {
        if (pixels[i][k]) track[at++].point2D_idx = model_.AddPoint2D(image_ids_[i], *pixels[i][k]);
      }
      const point3D_t id =
          model_.AddPoint3D(points[k].xyz, track, PointOrigin::kDetected, points[k].rgb);
      model_.points3D.at(id).error = 0.0;
      const int entity = place_.surfaces[static_cast<size_t>(points[k].surface)].entity;
      if (entity >= 0) points_of_entity_[entity].push_back(id);
    }
  }

  std::optional<Vector2d> PixelOf(const Image& image, const TruePoint& point) const {
    const Camera& camera = model_.cameras.at(image.camera_id);
    const auto pixel = PixelInImage(camera, image.cam_from_world * point.xyz);
    if (!pixel) return std::nullopt;
    const Vector3d centre = image.cam_from_world.OriginInA();
    const double distance = (point.xyz - centre).norm();
    const auto hit = caster_.Cast(centre, (point.xyz - centre) / distance);
    if (!hit || hit->surface != point.surface || !hit->from_outside ||
        std::abs(hit->distance - distance) > 1e-6) {
      return std::nullopt;
    }
    return pixel;
  }

  std::array<uint8_t, 3> ColourAt(const RayCaster::Hit& hit) const {
    const Surface& surface = place_.surfaces[static_cast<size_t>(hit.surface)];
    const Material& material = place_.materials[static_cast<size_t>(surface.material)];
    std::array<uint8_t, 3> rgb;
    const Colour mean = material.tint.cwiseProduct(
        place_.textures[static_cast<size_t>(material.texture)].At(0, 0, 1e6));
    for (int i = 0; i < 3; ++i) {
      rgb[static_cast<size_t>(i)] = static_cast<uint8_t>(
          std::lround(255.0f * SrgbFromLinear(std::clamp(mean[i], 0.0f, 1.0f))));
    }
    return rgb;
  }

  // --- Edges that two images see at least.
  void AddLines() {
    const std::vector<Edge> edges = MergeEdges(place_.edges);
    std::vector<std::vector<std::vector<VisiblePart>>> parts(image_ids_.size());
    ParallelTasks(num_threads_, image_ids_.size(), [&](size_t i) {
      const Image& image = model_.images.at(image_ids_[i]);
      const Camera& camera = model_.cameras.at(image.camera_id);
      for (const Edge& edge : edges) {
        parts[i].push_back(VisibleParts(place_, caster_, camera, image.cam_from_world, edge,
                                        options_.min_segment_px));
      }
    });
    for (size_t k = 0; k < edges.size(); ++k) {
      double from = 1.0, to = 0.0;
      size_t num_images = 0;
      for (size_t i = 0; i < image_ids_.size(); ++i) {
        if (!parts[i][k].empty()) ++num_images;
        for (const VisiblePart& part : parts[i][k]) {
          from = std::min(from, part.from);
          to = std::max(to, part.to);
        }
      }
      if (num_images < 2) continue;
      TrueLine line;
      const Edge& edge = edges[k];
      const Vector3d way = edge.end - edge.start;
      line.extent = {from == 0.0 ? edge.start : Vector3d(edge.start + from * way),
                     to == 1.0 ? edge.end : Vector3d(edge.start + to * way)};
      std::vector<LineObservation> track;
      for (size_t i = 0; i < image_ids_.size(); ++i) {
        for (const VisiblePart& part : parts[i][k]) {
          track.push_back({image_ids_[i], model_.AddLine2D(image_ids_[i], part.segment)});
          if (part.from == 0.0) line.images_of_start.push_back(image_ids_[i]);
          if (part.to == 1.0) line.images_of_end.push_back(image_ids_[i]);
          line.parts[image_ids_[i]].push_back(
              {edge.start + part.from * way, edge.start + part.to * way});
        }
      }
      line.whole = edge;
      line.id = model_.AddLine3D(PlueckerLine::FromPoints(edge.start, edge.end), line.extent.start,
                                 line.extent.end, track);
      model_.lines3D.at(line.id).error = 0.0;
      lines_.push_back(std::move(line));
    }
  }

  // --- Ends of edges at which another edge ends or passes, where two of them are seen up to there.
  void AddCorners() {
    std::vector<Vector3d> ends;
    std::map<std::array<int64_t, 3>, std::vector<size_t>>
        near;  // by cells of a tenth of a millimetre
    const auto cell_of = [](const Vector3d& point, int dx, int dy, int dz) {
      return std::array<int64_t, 3>{std::llround(point.x() * 1e4) + dx,
                                    std::llround(point.y() * 1e4) + dy,
                                    std::llround(point.z() * 1e4) + dz};
    };
    for (const TrueLine& line : lines_) {
      for (const auto& [end, images] : {std::pair{line.whole.start, &line.images_of_start},
                                        std::pair{line.whole.end, &line.images_of_end}}) {
        if (images->empty()) continue;
        bool is_known = false;
        for (int i = 0; i < 27 && !is_known; ++i) {
          const auto found = near.find(cell_of(end, i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1));
          if (found == near.end()) continue;
          for (const size_t known : found->second)
            is_known |= (ends[known] - end).norm() < kSamePlace;
        }
        if (is_known) continue;
        near[cell_of(end, 0, 0, 0)].push_back(ends.size());
        ends.push_back(end);
      }
    }
    for (const Vector3d& corner : ends) {
      // In which images each line through it is seen up to it.
      std::vector<std::pair<const TrueLine*, std::set<image_t>>> through;
      for (const TrueLine& line : lines_) {
        if (DistanceToEdge(line.extent, corner) > kSamePlace) continue;
        std::set<image_t> images;
        for (const auto& [image_id, parts] : line.parts) {
          for (const Edge& part : parts) {
            if (DistanceToEdge(part, corner) < kSamePlace) images.insert(image_id);
          }
        }
        if (!images.empty()) through.push_back({&line, std::move(images)});
      }
      std::vector<PointObservation> track;
      std::vector<Vector2d> pixels;
      for (const image_t image_id : image_ids_) {
        const TrueLine* first = nullptr;
        bool is_corner = false;
        for (const auto& [line, images] : through) {
          if (!images.contains(image_id)) continue;
          if (first == nullptr) {
            first = line;
          } else {
            is_corner |= DirectionOf(*first).cross(DirectionOf(*line)).norm() > 1e-3;
          }
        }
        if (!is_corner) continue;
        const Image& image = model_.images.at(image_id);
        const Camera& camera = model_.cameras.at(image.camera_id);
        const auto pixel = PixelInImage(camera, image.cam_from_world * corner);
        if (!pixel) continue;
        track.push_back({image_id, 0});
        pixels.push_back(*pixel);
      }
      if (track.size() < 2) continue;
      for (size_t i = 0; i < track.size(); ++i) {
        track[i].point2D_idx = model_.AddPoint2D(track[i].image_id, pixels[i]);
      }
      const point3D_t id = model_.AddPoint3D(corner, track, PointOrigin::kCorner, {255, 255, 255});
      model_.points3D.at(id).error = 0.0;
      corners_.push_back(id);
      for (const auto& [line, images] : through) {
        uint64_t num_images = 0;
        for (const PointObservation& observation : track)
          num_images += images.contains(observation.image_id) ? 1 : 0;
        if (num_images > 0) model_.wireframe.push_back({id, line->id, num_images});
      }
    }
  }

  // --- Planes and primitives, under the numbers that label maps have.
  void AddGroups() {
    std::map<int, std::vector<line3D_t>> lines_of_entity;
    for (const Surface& surface : place_.surfaces) {
      if (surface.shape != Shape::kRectangle || surface.entity < 0) continue;
      for (const point3D_t id : corners_) {
        if (IsOnFlat(surface, model_.points3D.at(id).xyz))
          points_of_entity_[surface.entity].push_back(id);
      }
      for (const TrueLine& line : lines_) {
        if (IsOnSurface(surface, line.extent)) lines_of_entity[surface.entity].push_back(line.id);
      }
    }
    for (size_t i = 0; i < place_.entities.size(); ++i) {
      const Entity& entity = place_.entities[i];
      Group3D group{.type = entity.type, .params = entity.params};
      const auto members = [](auto found, auto end) {
        auto ids = found == end ? std::vector<uint64_t>() : found->second;
        std::sort(ids.begin(), ids.end());
        ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
        return ids;
      };
      const int key = static_cast<int>(i);
      group.point3D_ids = members(points_of_entity_.find(key), points_of_entity_.end());
      if (entity.type->TakesLines())
        group.line3D_ids = members(lines_of_entity.find(key), lines_of_entity.end());
      if (group.point3D_ids.size() + 2 * group.line3D_ids.size() < 3) continue;  // not seen
      model_.groups3D.Add(GroupOfEntity(key), std::move(group));
    }
  }

  // --- Directions that at least two lines share; right angles between them; planes across them.
  void AddVanishingPoints() {
    std::vector<Vector3d> directions;
    std::vector<std::vector<line3D_t>> members;
    for (const TrueLine& line : lines_) {
      const Vector3d direction = model_.lines3D.at(line.id).line.direction;
      size_t found = 0;
      while (found < directions.size() && directions[found].cross(direction).norm() > 1e-9) ++found;
      if (found == directions.size()) {
        directions.push_back(direction);
        members.emplace_back();
      }
      members[found].push_back(line.id);
    }
    std::vector<group3D_t> ids;
    std::vector<Vector3d> of_ids;
    group3D_t next = GroupOfEntity(static_cast<int>(place_.entities.size()));
    for (size_t i = 0; i < directions.size(); ++i) {
      if (members[i].size() < 2) continue;
      model_.groups3D.Add(next,
                          {.type = &VanishingPointType(),
                           .params = {directions[i].x(), directions[i].y(), directions[i].z()},
                           .line3D_ids = members[i]});
      ids.push_back(next++);
      of_ids.push_back(directions[i]);
    }
    for (size_t i = 0; i < ids.size(); ++i) {
      for (size_t j = i + 1; j < ids.size(); ++j) {
        if (std::abs(of_ids[i].dot(of_ids[j])) < 1e-9)
          model_.relations.push_back({ids[i], ids[j], RelationType::kOrthogonal});
      }
    }
    for (const auto& [id, group] : model_.groups3D) {
      if (!IsPlane(*group.type)) continue;
      const Vector3d normal(group.params[0], group.params[1], group.params[2]);
      for (size_t i = 0; i < ids.size(); ++i) {
        if (normal.cross(of_ids[i]).norm() < 1e-9)
          model_.relations.push_back({id, ids[i], RelationType::kParallel});
      }
    }
  }

  // --- In each image the members that it sees.
  void AddObservationsOfGroups() {
    std::vector<group3D_t> ids;
    for (const auto& [id, group] : model_.groups3D) ids.push_back(id);
    for (const group3D_t id : ids) {
      const Group3D& group = model_.groups3D.at(id);
      std::map<image_t, Group2D> seen;
      for (const point3D_t point : group.point3D_ids) {
        for (const PointObservation& observation : model_.points3D.at(point).track) {
          seen[observation.image_id].point2D_idxs.push_back(observation.point2D_idx);
        }
      }
      for (const line3D_t line : group.line3D_ids) {
        for (const LineObservation& observation : model_.lines3D.at(line).track) {
          seen[observation.image_id].line2D_idxs.push_back(observation.line2D_idx);
        }
      }
      for (auto& [image_id, in_image] : seen) {
        in_image.type = group.type;
        const group2D_t idx = model_.AddGroup2D(image_id, std::move(in_image));
        model_.AddObservation(id, GroupObservation{image_id, idx});
      }
    }
  }

  struct TrueLine {
    line3D_t id = kNoId;
    Edge whole, extent;
    std::vector<image_t> images_of_start, images_of_end;  // that see it up to there
    std::map<image_t, std::vector<Edge>> parts;           // that are seen
  };

  static Vector3d DirectionOf(const TrueLine& line) {
    return (line.whole.end - line.whole.start).normalized();
  }

  static double DistanceToEdge(const Edge& edge, const Vector3d& point) {
    const Vector3d way = edge.end - edge.start;
    const double part = std::clamp(way.dot(point - edge.start) / way.squaredNorm(), 0.0, 1.0);
    return (edge.start + part * way - point).norm();
  }

  // In its plane, and somewhere on it.
  static bool IsOnSurface(const Surface& surface, const Edge& edge) {
    const Vector3d normal = surface.axes.col(2);
    if (std::abs(normal.dot(edge.start - surface.origin)) > kSamePlace ||
        std::abs(normal.dot(edge.end - surface.origin)) > kSamePlace) {
      return false;
    }
    constexpr int kNum = 16;
    for (int i = 0; i <= kNum; ++i) {
      if (IsOnFlat(surface, edge.start + static_cast<double>(i) / kNum * (edge.end - edge.start)))
        return true;
    }
    return false;
  }

  const Place& place_;
  const RayCaster& caster_;
  const TruthOptions& options_;
  int num_threads_;
  Reconstruction& model_;
  std::vector<image_t> image_ids_;
  std::vector<TrueLine> lines_;
  std::vector<point3D_t> corners_;
  std::map<int, std::vector<point3D_t>> points_of_entity_;
};

}  // namespace

void AddTruth(const Place& place, const RayCaster& caster, const TruthOptions& options,
              uint64_t seed, int num_threads, Reconstruction* model) {
  TruthBuilder(place, caster, options, num_threads, model).Build(seed);
}

}  // namespace holba
