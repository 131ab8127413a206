// SPDX-License-Identifier: BSD-3-Clause
#include "holba/bundle/plausibility.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "holba/base/words.h"
#include "holba/geometry/angle.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

constexpr double kMaxAbsentShare = 0.05;
constexpr double kMaxMedianPx = 100.0;
// Rays that meet at less say nothing about depth.
constexpr double kMinMedianAngleDeg = 0.1;
constexpr size_t kAngleSample = 10000;
// The widest lenses see to 120 degrees or so from their axis.
constexpr double kMaxLensAngleDeg = 120.0;

using PoseMap = std::function<Rigid3d(const Rigid3d&)>;

ReprojectionCheck CheckWith(const Reconstruction& model, const PoseMap& pose_of) {
  struct View {
    Eigen::Matrix3d rotation;
    Eigen::Vector3d translation, centre;
    const Camera* camera;
    const Image* image;
    bool is_wide;  // of a model that sees beyond 90 degrees from its axis
  };
  std::vector<View> views;
  IdMap<image_t, uint32_t> view_idx;
  for (const auto& [id, image] : model.images) {
    const Rigid3d pose = pose_of ? pose_of(image.cam_from_world) : image.cam_from_world;
    const Camera& camera = model.cameras.at(image.camera_id);
    view_idx.Add(id, static_cast<uint32_t>(views.size()));
    views.push_back({pose.RotationMatrix(), pose.translation, pose.OriginInA(), &camera, &image,
                     camera.model->max_angle != nullptr});
  }
  const double min_lens_cosine = std::cos(DegToRad(kMaxLensAngleDeg));
  const size_t stride = 1 + model.points3D.size() / kAngleSample;
  ReprojectionCheck check;
  check.num_points = model.points3D.size();
  std::vector<double> residuals_px, angles_deg;
  for (size_t i = 0; i < model.points3D.size(); ++i) {
    const Point3D& point = (model.points3D.begin() + i)->second;
    const bool measures_angle = i % stride == 0;
    Eigen::Vector3d first_ray = Eigen::Vector3d::Zero();
    double angle = 0.0;
    for (const PointObservation& observation : point.track) {
      const View& view = views[view_idx.at(observation.image_id)];
      ++check.num_observations;
      const Eigen::Vector3d in_cam = view.rotation * point.xyz + view.translation;
      Eigen::Vector2d pixel;
      if (!view.camera->model->project(view.camera->params.data(), in_cam, &pixel)) {
        ++check.num_absent;
        check.num_beyond_lens +=
            view.is_wide && in_cam.z() < 0.0 && in_cam.z() > min_lens_cosine * in_cam.norm();
        continue;
      }
      residuals_px.push_back((pixel - view.image->points2D[observation.point2D_idx].xy).norm());
      if (!measures_angle) continue;
      const Eigen::Vector3d ray = (point.xyz - view.centre).normalized();
      if (first_ray.isZero(0.0)) first_ray = ray;
      angle = std::max(angle, std::atan2(first_ray.cross(ray).norm(), first_ray.dot(ray)));
    }
    if (measures_angle && point.track.size() > 1) angles_deg.push_back(RadToDeg(angle));
  }
  check.median_px = Median(std::move(residuals_px));
  check.median_angle_deg = Median(std::move(angles_deg));
  return check;
}

double PresentShare(const ReprojectionCheck& check) {
  return static_cast<double>(check.num_observations - check.num_absent) /
         static_cast<double>(std::max<size_t>(check.num_observations, 1));
}

// What the poses would be under another convention, and what they are called then.
struct Convention {
  const char* name;
  PoseMap pose_of;
};

std::vector<Convention> OtherConventions() {
  const auto turned = [](const Rigid3d& pose) {  // y and z of the camera the other way
    return Rigid3d(Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0), Eigen::Vector3d::Zero()) * pose;
  };
  const auto scalar_last = [](const Rigid3d& pose) {
    const Eigen::Quaterniond& q = pose.rotation;  // w, x, y, z were read where x, y, z, w stood
    return Rigid3d(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), pose.translation);
  };
  const auto from_centre = [](const Rigid3d& pose) {
    return Rigid3d(pose.rotation, -(pose.rotation.normalized() * pose.translation));
  };
  return {
      {"camera-to-world poses", [](const Rigid3d& p) { return p.Inverse(); }},
      {"poses of cameras that look along -z with y up (OpenGL, Blender)", turned},
      {"camera-to-world poses of cameras that look along -z with y up (OpenGL, Blender)",
       [=](const Rigid3d& p) { return turned(p.Inverse()); }},
      {"quaternions whose real part stands last", scalar_last},
      {"rotations with camera centres in place of translations", from_centre},
      {"camera-to-world quaternions whose real part stands last",
       [=](const Rigid3d& p) { return scalar_last(p).Inverse(); }},
  };
}

// The likely cause: the convention under which the model fits its observations, if there is one.
std::string CauseOf(const ReprojectionCheck& check, const Reconstruction& model) {
  constexpr const char* kExpected =
      "COLMAP's are world-to-camera, with x right, y down, z forward and quaternions QW QX QY QZ";
  for (const Convention& other : OtherConventions()) {
    const ReprojectionCheck trial = CheckWith(model, other.pose_of);
    if (PresentShare(trial) < 0.9 || trial.median_px > 0.5 * kMaxMedianPx) continue;
    if (PresentShare(check) > 0.5 && trial.median_px > 0.1 * check.median_px) continue;
    return fmt::format(
        "read as {} they would be {:.3g} px off in the median, which is what they seem to be, so "
        "write them anew: {}",
        other.name, trial.median_px, kExpected);
  }
  if (PresentShare(check) > 0.5 && check.median_px < kMaxMedianPx)
    return "check the poses of single images, and the matches that points were triangulated from";
  return fmt::format(
      "check whether the poses are camera-to-world or of another axis convention ({}), or the "
      "cameras those of other images",
      kExpected);
}

std::string AbsentText(const ReprojectionCheck& check) {
  return fmt::format("{} of {} observations are of points behind their camera", check.num_absent,
                     check.num_observations);
}

bool IsOfWideLens(const ReprojectionCheck& check) {
  return 2 * check.num_beyond_lens > check.num_absent;
}

}  // namespace

ReprojectionCheck CheckReprojections(const Reconstruction& model) { return CheckWith(model, {}); }

std::vector<std::string> DoubtsOf(const ReprojectionCheck& check, const Reconstruction& model) {
  std::vector<std::string> doubts;
  if (check.num_points == 0)
    doubts.push_back("the model has no points, so that only its lines count");
  if (check.num_observations == 0) return doubts;
  const bool many_absent = PresentShare(check) < 1.0 - kMaxAbsentShare;
  const bool is_far_off = check.median_px > kMaxMedianPx;
  if (many_absent && IsOfWideLens(check) && !is_far_off) {
    doubts.push_back(
        fmt::format("{} of {} observations count nothing: they lie at 90 deg or more from the axis "
                    "of a fisheye camera whose parameters end before; calibrate it with points as "
                    "far out as that, or mask the rim of the photographs",
                    check.num_absent, check.num_observations));
  } else if (many_absent) {
    doubts.push_back(
        fmt::format("{} and count nothing; {}", AbsentText(check), CauseOf(check, model)));
  } else if (is_far_off) {
    doubts.push_back(
        fmt::format("half of the observations are {:.0f} px or more from where the model has them, "
                    "so that poses, points and cameras do not belong together; {}",
                    check.median_px, CauseOf(check, model)));
  }
  if (!many_absent && check.median_angle_deg < kMinMedianAngleDeg) {
    doubts.push_back(
        fmt::format("the rays of most points meet at {:.2g} deg or less (the cameras turn in one "
                    "place, or all points are very far), so that depths and camera positions are "
                    "not determined; use images from more places",
                    check.median_angle_deg));
  }
  return doubts;
}

std::string WhyNothingIsLeft(const Reconstruction& model) {
  if (model.points3D.empty() && model.lines3D.empty()) {
    return fmt::format("this model has no points and no lines to adjust; {}", kTriangulateFirst);
  }
  const ReprojectionCheck check = CheckReprojections(model);
  if (check.num_observations > 0 && check.num_absent == check.num_observations) {
    return fmt::format("{}, so that nothing can be adjusted; {}", AbsentText(check),
                       CauseOf(check, model));
  }
  return fmt::format(
      "nothing is left to adjust, as of {} and {} none takes part that two images see in front of "
      "them; --Bundle.config, --Bundle.fix_points and --Bundle.fix_lines say what takes part",
      Counted(model.points3D.size(), "point"), Counted(model.lines3D.size(), "line"));
}

}  // namespace holba
