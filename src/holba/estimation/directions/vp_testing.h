// SPDX-License-Identifier: BSD-3-Clause
// A scene of parallel lines in posed images, for tests of vanishing points.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <string>

#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/scene/ideal_view.h"
#include "holba/scene/image_features.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Degrees between two axes.
inline double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return RadToDeg(std::atan2(a.cross(b).norm(), std::abs(a.dot(b))));
}

inline Eigen::Vector3d DirectionOf(const Group3D& vp) {
  return {vp.params[0], vp.params[1], vp.params[2]};
}

// Cameras on an arc around the origin, looking there, and lines near the origin along given
// directions, each seen in all images. Vanishing points of images are the true ones turned by a
// random angle, of either sign; segments know theirs.
class ParallelLines {
 public:
  explicit ParallelLines(int num_images) : random_(num_images) {
    Camera camera;
    camera.model = FindCameraModel("PINHOLE");
    camera.width = 800;
    camera.height = 600;
    camera.params = {700, 690, 400, 300};
    model.cameras.Add(1, camera);
    for (int i = 0; i < num_images; ++i) {
      const double angle = 0.15 * i;
      const Eigen::Vector3d centre(8.0 * std::sin(angle), 0.4 * i - 1.0, -8.0 * std::cos(angle));
      const Eigen::Vector3d z = -centre.normalized();
      const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
      Eigen::Matrix3d R;
      R << x.transpose(), z.cross(x).transpose(), z.transpose();
      Image image;
      image.name = std::to_string(i + 1);
      image.camera_id = 1;
      image.cam_from_world.rotation = Eigen::Quaterniond(R);
      image.cam_from_world.translation = -R * centre;
      model.images.Add(i + 1, image);
      features[i + 1];
    }
    model.AddTrivialRigsAndFrames();
  }

  // Vanishing points in images [first, last] (0: no lines of it).
  void AddDirection(const Eigen::Vector3d& d, int num_lines, double noise_px, double vp_noise_deg,
                    image_t first, image_t last, bool in_space) {
    for (image_t id = first; id <= last; ++id) {
      const Eigen::Vector3d axis(random_.Normal(), random_.Normal(), random_.Normal());
      const Eigen::AngleAxisd turn(DegToRad(random_.Normal(vp_noise_deg)), axis.normalized());
      const Eigen::Vector3d turned = turn * d;
      features[id].vanishing_points.push_back(
          {(random_.Uniform() < 0.5 ? -1.0 : 1.0) * (IdealView(model, id).R() * turned),
           static_cast<uint32_t>(num_lines)});
    }
    for (int i = 0; i < num_lines; ++i) {
      const Eigen::Vector3d middle(random_.Uniform(-1.5, 1.5), random_.Uniform(-1.2, 1.2),
                                   random_.Uniform(-1.5, 1.5));
      Line3D line;
      line.start = middle - random_.Uniform(0.3, 0.6) * d;
      line.end = middle + random_.Uniform(0.3, 0.6) * d;
      line.line = PlueckerLine::FromPoints(line.start, line.end);
      const line3D_t line_id = model.lines3D.size() + 1;
      for (image_t id = first; id <= last; ++id) {
        const IdealView view(model, id);
        LineSegment2d segment = {*view.Project(line.start), *view.Project(line.end)};
        for (Eigen::Vector2d* x : {&segment.start, &segment.end}) {
          *x += Eigen::Vector2d(random_.Normal(noise_px), random_.Normal(noise_px));
        }
        ImageFeatures& of_image = features[id];
        of_image.segments.push_back(segment);
        of_image.vp_of_segment.push_back(static_cast<int32_t>(of_image.vanishing_points.size()) -
                                         1);
        Image& image = model.images.at(id);
        if (in_space) {
          line.track.push_back({id, static_cast<line2D_t>(image.lines2D.size())});
        }
        image.lines2D.push_back({segment, in_space ? line_id : kNoId});
      }
      if (in_space) model.lines3D.Add(line_id, line);
    }
  }

  Reconstruction model;
  ImageFeatureMap features;

 private:
  Random random_;
};

}  // namespace holba
