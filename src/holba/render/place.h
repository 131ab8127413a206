// SPDX-License-Identifier: BSD-3-Clause
// A place to be photographed: surfaces with materials, lights, true edges, what labels name, and
// the walk of the person with the camera. World frame: metres, z up.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/random.h"
#include "holba/group/group_type.h"
#include "holba/render/surface.h"
#include "holba/render/texture.h"

namespace holba {

struct Material {
  int texture = 0;
  Colour tint = Colour::Ones();      // times the texture: the share of light that comes back
  Colour emission = Colour::Zero();  // radiance of a light
  float gloss = 0.0f;                // reflectance of the polish at right angles; 0: matt
  float roughness = 0.05f;           // of the polish: spread of what it mirrors, radians
};

// What a label names: one surface, or the faces of one cuboid.
struct Entity {
  const GroupType* type = nullptr;  // null: nothing with a type; it has no label
  std::vector<double> params;       // plain values of the file
};

// A true edge: a crease, or a rim, of flat surfaces.
struct Edge {
  Eigen::Vector3d start, end;
};

struct Sun {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  // to the sun, unit
  Colour irradiance = Colour::Zero();                    // at right angles, over pi; zero: no sun
  double radius_rad = 0.008;                             // haze included
};

// Light from where no surface is.
struct Sky {
  Colour zenith = Colour::Zero(), horizon = Colour::Zero();
  Colour At(const Eigen::Vector3d& ray) const;
};

// A curve through knots and where the person looks at each, in order of time.
struct Walk {
  std::vector<Eigen::Vector3d> places, targets;
  bool closed = false;
};

struct Place {
  std::vector<Surface> surfaces;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<Entity> entities;
  std::vector<Edge> edges;
  Sun sun;
  Sky sky;
  Walk walk;
  int num_images = 30;            // on the walk, unless the user says otherwise
  double field_of_view_deg = 65;  // likewise
  double texel_m = 0.08;          // of the baked light
};

using Pose = Eigen::Isometry3d;  // of a piece of furniture in the world: its z is up

Pose Standing(double x, double y, double z = 0.0, double turn_rad = 0.0);

// Adds to a place. Boxes and walls come with their edges; whether an edge is seen as one is found
// out when photographs are taken.
class PlaceBuilder {
 public:
  explicit PlaceBuilder(uint64_t seed) : random_(seed) { place_.textures.push_back(Plain()); }

  Random* random() { return &random_; }
  Place* place() { return &place_; }
  Place Take() { return std::move(place_); }

  int AddTexture(Texture texture);
  int AddMaterial(int texture, const Colour& tint = Colour::Ones(), float gloss = 0.0f,
                  float roughness = 0.05f);
  int AddPaint(const Colour& colour, float gloss = 0.0f);  // no texture
  int AddLight(const Colour& emission);

  // From the corner along u and v, whose lengths are its own; u x v is its outside. `entity`: -2: a
  // plane of its own if it is larger than kMinPlane.
  int AddRectangle(const Eigen::Vector3d& origin, const Eigen::Vector3d& u,
                   const Eigen::Vector3d& v, int material, int entity = kOwnPlane);
  // A rectangle without some parts, [u0, v0, u1, v1] metres along u and v: one plane.
  struct Hole {
    double u0, v0, u1, v1;
  };
  int AddWall(const Eigen::Vector3d& origin, const Eigen::Vector3d& u, const Eigen::Vector3d& v,
              int material, const std::vector<Hole>& holes);
  // Between two corners in the frame of `pose`. Without a bottom that stands on something.
  struct BoxStyle {
    int top = -1, front = -1;  // materials of the faces to +z and to -y; -1: as the others
    bool is_cuboid = false;    // one entity instead of six planes
    bool fit_front = false;    // the texture of the front covers it once
    bool turn_texture = false;
  };
  void AddBox(const Pose& pose, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
              int material, const BoxStyle& style);
  void AddBox(const Pose& pose, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
              int material) {
    AddBox(pose, low, high, material, BoxStyle());
  }
  // Primitives, with flat ends. `axis` is the pose's z. As a labelled group if `labelled`.
  void AddCylinder(const Pose& pose, double radius, double height, int material, bool labelled,
                   int cap = -1);
  void AddCone(const Pose& pose, double base_radius, double top_radius, double height, int material,
               bool labelled, bool capped = true);
  void AddSphere(const Eigen::Vector3d& centre, double radius, int material, bool labelled);
  void AddEllipsoid(const Pose& pose, const Eigen::Vector3d& semi_axes, int material,
                    bool labelled);
  void AddEdge(const Eigen::Vector3d& start, const Eigen::Vector3d& end);

  static constexpr int kNoEntity = -1, kOwnPlane = -2;
  static constexpr double kMinPlane = 0.06;  // square metres

 private:
  static Texture Plain();
  int AddEntity(std::string_view type, std::vector<double> params);
  int PlaneEntity(const Eigen::Vector3d& point, const Eigen::Vector3d& normal);
  int Add(Surface surface);

  Place place_;
  Random random_;
};

}  // namespace holba
