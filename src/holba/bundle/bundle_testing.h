// SPDX-License-Identifier: BSD-3-Clause
// For the tests of this room: a small model by hand with exact observations, and what costs it has.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/check.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/scene/reconstruction.h"

namespace holba {

// Builds a model whose observations are exact projections. Cameras have ids from 1, an image each
// with the same id.
class ModelMaker {
 public:
  explicit ModelMaker(std::string_view camera_model = "PINHOLE",
                      std::vector<double> params = {700, 720, 500, 480}) {
    camera_ = {FindCameraModel(camera_model), 1000, 960, std::move(params)};
  }

  // A camera at `centre` looking at `target`, y down (world z up); with a camera of its own or that
  // of image 1.
  image_t AddImage(const Eigen::Vector3d& centre, const Eigen::Vector3d& target,
                   bool own_camera = false) {
    const image_t id = static_cast<image_t>(model.images.size() + 1);
    const camera_t camera_id = own_camera || id == 1 ? id : 1;
    if (camera_id == id) model.cameras.Add(id, camera_);
    const Eigen::Vector3d z = (target - centre).normalized();
    const Eigen::Vector3d up =
        std::abs(z.z()) > 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d x = z.cross(up).normalized();
    Eigen::Matrix3d R;
    R << x.transpose(), z.cross(x).transpose(), z.transpose();
    Image image;
    image.name = "image" + std::to_string(id) + ".png";
    image.camera_id = camera_id;
    image.cam_from_world = {Eigen::Quaterniond(R), -(R * centre)};
    model.images.Add(id, std::move(image));
    return id;
  }
  // Once all images are there.
  void Finish() { model.AddTrivialRigsAndFrames(); }

  Eigen::Vector2d Project(image_t image_id, const Eigen::Vector3d& X) const {
    const Image& image = model.images.at(image_id);
    const Camera& camera = model.cameras.at(image.camera_id);
    Eigen::Vector2d pixel;
    HOLBA_CHECK(camera.model->project(camera.params.data(), image.cam_from_world * X, &pixel));
    return pixel;
  }

  point3D_t AddPoint(const Eigen::Vector3d& X, const std::vector<image_t>& images) {
    const point3D_t id = 100 + model.points3D.size();
    Point3D point;
    point.xyz = X;
    for (image_t image_id : images) {
      auto& points2D = model.images.at(image_id).points2D;
      point.track.push_back({image_id, static_cast<point2D_t>(points2D.size())});
      points2D.push_back({Project(image_id, X), id});
    }
    model.points3D.Add(id, std::move(point));
    return id;
  }

  // Every entry of `images` is one segment; a second one of the same image is another part of the
  // line.
  line3D_t AddLine(const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                   const std::vector<image_t>& images) {
    const line3D_t id = 500 + model.lines3D.size();
    Line3D line;
    line.line = PlueckerLine::FromPoints(start, end);
    line.start = start;
    line.end = end;
    std::map<image_t, int> seen;
    for (image_t image_id : images) {
      auto& lines2D = model.images.at(image_id).lines2D;
      line.track.push_back({image_id, static_cast<line2D_t>(lines2D.size())});
      const double from = 0.3 * seen[image_id]++;
      lines2D.push_back(
          {{Project(image_id, start + from * (end - start)), Project(image_id, end)}, id});
    }
    model.lines3D.Add(id, std::move(line));
    return id;
  }

  group3D_t AddGroup(std::string_view type, std::vector<double> params,
                     std::vector<point3D_t> points, std::vector<line3D_t> lines) {
    const group3D_t id = 900 + model.groups3D.size();
    Group3D group;
    group.type = FindGroupType(type);
    HOLBA_CHECK(group.type != nullptr);
    group.params = std::move(params);
    group.point3D_ids = std::move(points);
    group.line3D_ids = std::move(lines);
    model.groups3D.Add(id, std::move(group));
    return id;
  }

  Reconstruction model;

 private:
  Camera camera_;
};

inline std::map<std::string, TermCost> TermsByName(const std::vector<TermCost>& terms) {
  std::map<std::string, TermCost> by_name;
  for (const TermCost& term : terms) by_name[term.term] = term;
  return by_name;
}

// Options without the steps around the plain adjustment: the association gate, measured losses,
// refitting.
inline BundleOptions PlainOptions(LossChoice loss = LossChoice::kTrivial) {
  BundleOptions options;
  options.gate = false;
  options.choose_weights = false;
  options.refit_others = false;
  for (TermSettings& settings : options.terms) settings.loss = loss;
  return options;
}

inline SolverOptions TightSolver() {
  SolverOptions options;
  options.num_threads = 1;
  options.max_num_iterations = 300;
  options.function_tolerance = 1e-14;
  options.gradient_tolerance = 0.0;
  options.parameter_tolerance = 1e-12;
  return options;
}

}  // namespace holba
