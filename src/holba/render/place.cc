// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/place.h"

#include <algorithm>
#include <cmath>

#include "holba/base/check.h"
#include "holba/group/known_types.h"
#include "holba/render/texture_recipes.h"

namespace holba {

using Eigen::Vector3d;

Colour Sky::At(const Vector3d& ray) const {
  const auto up = static_cast<float>(std::clamp(ray.z(), 0.0, 1.0));
  const float share = std::sqrt(up);
  return (1 - share) * horizon + share * zenith;
}

Pose Standing(double x, double y, double z, double turn_rad) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::AngleAxisd(turn_rad, Vector3d::UnitZ()).toRotationMatrix();
  pose.translation() = Vector3d(x, y, z);
  return pose;
}

Texture PlaceBuilder::Plain() { return PlainTexture(Colour::Constant(0.9f)); }

int PlaceBuilder::AddTexture(Texture texture) {
  place_.textures.push_back(std::move(texture));
  return static_cast<int>(place_.textures.size()) - 1;
}

int PlaceBuilder::AddMaterial(int texture, const Colour& tint, float gloss, float roughness) {
  place_.materials.push_back(
      {.texture = texture, .tint = tint, .gloss = gloss, .roughness = roughness});
  return static_cast<int>(place_.materials.size()) - 1;
}

int PlaceBuilder::AddPaint(const Colour& colour, float gloss) {
  return AddMaterial(0, colour, gloss, 0.12f);
}

int PlaceBuilder::AddLight(const Colour& emission) {
  place_.materials.push_back({.tint = Colour::Constant(0.5f), .emission = emission});
  return static_cast<int>(place_.materials.size()) - 1;
}

int PlaceBuilder::AddEntity(std::string_view type, std::vector<double> params) {
  const GroupType* found = FindGroupType(type);
  HOLBA_CHECK(found != nullptr);
  place_.entities.push_back({found, std::move(params)});
  return static_cast<int>(place_.entities.size()) - 1;
}

int PlaceBuilder::PlaneEntity(const Vector3d& point, const Vector3d& normal) {
  return AddEntity("PLANE", {normal.x(), normal.y(), normal.z(), -normal.dot(point)});
}

int PlaceBuilder::Add(Surface surface) {
  place_.surfaces.push_back(std::move(surface));
  return static_cast<int>(place_.surfaces.size()) - 1;
}

int PlaceBuilder::AddRectangle(const Vector3d& origin, const Vector3d& u, const Vector3d& v,
                               int material, int entity) {
  Surface surface;
  surface.shape = Shape::kRectangle;
  surface.origin = origin;
  surface.axes.col(0) = u.normalized();
  surface.axes.col(2) = u.cross(v).normalized();
  surface.axes.col(1) = surface.axes.col(2).cross(surface.axes.col(0));
  surface.size = Vector3d(u.norm(), v.norm(), 0.0);
  surface.material = material;
  if (entity == kOwnPlane) {
    entity = u.norm() * v.norm() > kMinPlane ? PlaneEntity(origin, surface.axes.col(2)) : kNoEntity;
  }
  surface.entity = entity;
  // Its texture begins anywhere, so that two walls of one paper are not the same picture.
  surface.texture_origin = Eigen::Vector2d(random_.Uniform(0, 4), random_.Uniform(0, 4));
  return Add(std::move(surface));
}

int PlaceBuilder::AddWall(const Vector3d& origin, const Vector3d& u, const Vector3d& v,
                          int material, const std::vector<Hole>& holes) {
  const double width = u.norm(), height = v.norm();
  const Vector3d along = u / width, up = v / height;
  const int entity = PlaneEntity(origin, along.cross(up));
  const Eigen::Vector2d texture_origin(random_.Uniform(0, 4), random_.Uniform(0, 4));
  std::vector<double> columns = {0.0, width};
  for (const Hole& hole : holes) {
    columns.push_back(hole.u0);
    columns.push_back(hole.u1);
    const Vector3d a = origin + hole.u0 * along + hole.v0 * up,
                   b = origin + hole.u1 * along + hole.v0 * up,
                   c = origin + hole.u1 * along + hole.v1 * up,
                   d = origin + hole.u0 * along + hole.v1 * up;
    AddEdge(a, b);
    AddEdge(b, c);
    AddEdge(c, d);
    AddEdge(d, a);
  }
  std::sort(columns.begin(), columns.end());
  for (size_t i = 0; i + 1 < columns.size(); ++i) {
    const double left = columns[i], right = columns[i + 1];
    if (!(right - left > 1e-9)) continue;
    std::vector<std::pair<double, double>> open;  // what holes take of this column
    for (const Hole& hole : holes) {
      if (hole.u0 < right - 1e-9 && hole.u1 > left + 1e-9) open.push_back({hole.v0, hole.v1});
    }
    std::sort(open.begin(), open.end());
    open.push_back({height, height});
    double bottom = 0.0;
    for (const auto& [from, to] : open) {
      if (from - bottom > 1e-9) {
        const int piece = AddRectangle(origin + left * along + bottom * up, (right - left) * along,
                                       (from - bottom) * up, material, entity);
        place_.surfaces[static_cast<size_t>(piece)].texture_origin =
            texture_origin + Eigen::Vector2d(left, -from);
      }
      bottom = std::max(bottom, to);
    }
  }
  return entity;
}

void PlaceBuilder::AddEdge(const Vector3d& start, const Vector3d& end) {
  place_.edges.push_back({start, end});
}

void PlaceBuilder::AddBox(const Pose& pose, const Vector3d& low, const Vector3d& high, int material,
                          const BoxStyle& style) {
  int entity = kOwnPlane;
  const Eigen::Matrix3d R = pose.linear();
  if (style.is_cuboid) {
    const Eigen::Quaterniond q(R);
    std::vector<double> params = {q.w(), q.x(), q.y(), q.z()};
    for (int i = 0; i < 3; ++i) {
      const Vector3d n = R.col(i);
      params.push_back(-n.dot(pose * high));
      params.push_back(n.dot(pose * low));
    }
    entity = AddEntity("CUBOID", std::move(params));
  }
  const auto corner = [&](int i) {
    return Vector3d(pose * Vector3d((i & 1) != 0 ? high.x() : low.x(),
                                    (i & 2) != 0 ? high.y() : low.y(),
                                    (i & 4) != 0 ? high.z() : low.z()));
  };
  const auto face = [&](int a, int b, int c, int of) {
    const int surface =
        AddRectangle(corner(a), corner(b) - corner(a), corner(c) - corner(a), of, entity);
    place_.surfaces[static_cast<size_t>(surface)].turn_texture = style.turn_texture;
    return surface;
  };
  const int front = face(0, 1, 4, style.front >= 0 ? style.front : material);  // -y
  if (style.fit_front) {
    Surface& surface = place_.surfaces[static_cast<size_t>(front)];
    surface.texture_origin.setZero();
    surface.turn_texture = false;
  }
  face(3, 2, 7, material);                               // +y
  face(2, 0, 6, material);                               // -x
  face(1, 3, 5, material);                               // +x
  face(4, 5, 6, style.top >= 0 ? style.top : material);  // +z
  face(2, 3, 0, material);                               // -z
  for (int i = 0; i < 8; ++i) {
    for (const int bit : {1, 2, 4}) {
      if ((i & bit) == 0) AddEdge(corner(i), corner(i | bit));
    }
  }
}

void PlaceBuilder::AddCylinder(const Pose& pose, double radius, double height, int material,
                               bool labelled, int cap) {
  const Vector3d d = pose.linear().col(2), base = pose.translation();
  Surface side{.shape = Shape::kFrustum,
               .origin = base,
               .axes = pose.linear(),
               .size = Vector3d(radius, radius, height),
               .material = material,
               .entity = kNoEntity};
  if (labelled) {
    const Vector3d m = base.cross(d);
    side.entity = AddEntity("CYLINDER", {d.x(), d.y(), d.z(), m.x(), m.y(), m.z(), radius});
  }
  Add(side);
  Surface end{.shape = Shape::kDisc,
              .origin = base + height * d,
              .axes = pose.linear(),
              .size = Vector3d(radius, 0.0, 0.0),
              .material = cap >= 0 ? cap : material,
              .entity = kNoEntity};
  Add(end);
  end.origin = base;
  end.axes.col(1) *= -1.0;
  end.axes.col(2) *= -1.0;
  Add(end);
}

void PlaceBuilder::AddCone(const Pose& pose, double base_radius, double top_radius, double height,
                           int material, bool labelled, bool capped) {
  const Vector3d d = pose.linear().col(2), base = pose.translation();
  Surface side{.shape = Shape::kFrustum,
               .origin = base,
               .axes = pose.linear(),
               .size = Vector3d(base_radius, top_radius, height),
               .material = material,
               .entity = kNoEntity};
  if (labelled) {
    // The apex where the radius is 0; the axis runs from it into the cone.
    const double at = height * base_radius / (base_radius - top_radius);
    const Vector3d apex = base + at * d, axis = base_radius > top_radius ? Vector3d(-d) : d;
    side.entity = AddEntity("CONE", {apex.x(), apex.y(), apex.z(), axis.x(), axis.y(), axis.z(),
                                     std::atan(std::abs(base_radius - top_radius) / height)});
  }
  Add(side);
  if (!capped) return;
  Surface end{.shape = Shape::kDisc,
              .origin = base + height * d,
              .axes = pose.linear(),
              .size = Vector3d(top_radius, 0.0, 0.0),
              .material = material,
              .entity = kNoEntity};
  if (top_radius > 0.0) Add(end);
  end.origin = base;
  end.size = Vector3d(base_radius, 0.0, 0.0);
  end.axes.col(1) *= -1.0;
  end.axes.col(2) *= -1.0;
  if (base_radius > 0.0) Add(end);
}

void PlaceBuilder::AddSphere(const Vector3d& centre, double radius, int material, bool labelled) {
  Surface surface{.shape = Shape::kEllipsoid,
                  .origin = centre,
                  .size = Vector3d::Constant(radius),
                  .material = material,
                  .entity = kNoEntity};
  if (labelled) surface.entity = AddEntity("SPHERE", {centre.x(), centre.y(), centre.z(), radius});
  Add(surface);
}

void PlaceBuilder::AddEllipsoid(const Pose& pose, const Vector3d& semi_axes, int material,
                                bool labelled) {
  Surface surface{.shape = Shape::kEllipsoid,
                  .origin = pose.translation(),
                  .axes = pose.linear(),
                  .size = semi_axes,
                  .material = material,
                  .entity = kNoEntity};
  if (labelled) {
    const Eigen::Quaterniond q(pose.linear());
    const Vector3d c = pose.translation();
    surface.entity = AddEntity("ELLIPSOID", {q.w(), q.x(), q.y(), q.z(), c.x(), c.y(), c.z(),
                                             semi_axes.x(), semi_axes.y(), semi_axes.z()});
  }
  Add(surface);
}

}  // namespace holba
