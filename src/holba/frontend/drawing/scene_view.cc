// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/drawing/scene_view.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "holba/geometry/angle.h"
#include "holba/scene/main_directions.h"

namespace holba {
namespace {

// Shares of points and line ends between which the scene lies; those farther out are often wrong.
constexpr double kLowShareOfScene = 0.02, kHighShareOfScene = 0.98;
// By how much of its extent on each side the box of what is drawn is wider.
constexpr double kBoxMargin = 0.25;
// Of the pictures.
constexpr double kMaxAspect = 2.2, kMarginShare = 0.04;
constexpr double kOverviewAspect = 4.0 / 3.0;
// Half the angle across the longer side of the overview: that of a lens of about 50 mm, in which
// nothing looks distorted.
constexpr double kHalfAngleDeg = 19.0;
constexpr double kAsideDeg = 26.0, kAboveDeg = 23.0;
// More directions to look along: at least this share of the lines of all, at most this many.
constexpr double kMinShareOfLines = 0.05;
constexpr size_t kMaxNumMoreDirections = 3;
// Nearer to an axis of the plan than this it is seen well enough along it.
constexpr double kSameDirectionDeg = 10.0;

double QuantileOf(std::vector<double> values, double share) {
  const auto nth = values.begin() + std::lround(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

class ViewMaker {
 public:
  ViewMaker(const Reconstruction& model, int longer_side_px)
      : model_(model), side_(longer_side_px), down_(EstimateDown(model)) {
    std::vector<Eigen::Vector3d> all;
    for (const auto& [id, point] : model.points3D) all.push_back(point.xyz);
    for (const auto& [id, line] : model.lines3D) {
      all.push_back(line.start);
      all.push_back(line.end);
    }
    std::vector<Eigen::Vector3d> centres;
    for (const auto& [id, image] : model.images) {
      centres.push_back(image.cam_from_world.OriginInA());
      ahead_ += image.cam_from_world.rotation.normalized().conjugate() * Eigen::Vector3d::UnitZ();
    }
    if (all.empty()) all = centres;
    std::erase_if(all, [](const Eigen::Vector3d& X) { return !X.allFinite(); });
    std::erase_if(centres, [](const Eigen::Vector3d& X) { return !X.allFinite(); });
    if (all.empty()) return;
    for (int k = 0; k < 3; ++k) {
      std::vector<double> values;
      for (const Eigen::Vector3d& X : all) values.push_back(X[k]);
      low_[k] = QuantileOf(values, kLowShareOfScene);
      high_[k] = QuantileOf(values, kHighShareOfScene);
    }
    const double extent = std::max((high_ - low_).maxCoeff(), 1e-12);
    // What is flat has a box, too.
    const Eigen::Vector3d margin =
        kBoxMargin * (high_ - low_).cwiseMax(0.1 * Eigen::Vector3d::Constant(extent));
    low_ -= margin;
    high_ += margin;
    for (const Eigen::Vector3d& X : all) {
      if ((X.array() >= low_.array()).all() && (X.array() <= high_.array()).all())
        seen_.push_back(X);
    }
    middle_ = 0.5 * (low_ + high_);
    for (const Eigen::Vector3d& X : centres) {
      low_ = low_.cwiseMin(X - margin);
      high_ = high_.cwiseMax(X + margin);
      centres_.push_back(X);
    }
    extent_ = extent;
  }

  std::vector<SceneView> Make() const {
    std::vector<SceneView> views;
    if (seen_.empty()) return views;
    const PlanAxes plan = EstimatePlanAxes(model_, down_);
    views.push_back(Overview(plan));
    views.push_back(Along("plan", down_, plan.below));
    const auto as_cameras_look = [&](const Eigen::Vector3d& axis) {
      return Eigen::Vector3d(axis.dot(ahead_) >= 0.0 ? axis : Eigen::Vector3d(-axis));
    };
    views.push_back(Along("front", as_cameras_look(plan.below), down_));
    views.push_back(Along("side", as_cameras_look(plan.right), down_));
    for (const auto& [id, direction] : MoreDirections(plan)) {
      const Eigen::Vector3d ahead = as_cameras_look(direction);
      views.push_back(Along("along_" + std::to_string(id), ahead, down_));
    }
    return views;
  }

 private:
  // Of one who looks along `ahead`, with `below` down on the picture as far as it is across.
  static Eigen::Quaterniond Rotation(const Eigen::Vector3d& ahead, const Eigen::Vector3d& below) {
    Eigen::Vector3d y = below - ahead * ahead.dot(below);
    y = y.norm() > 1e-6 ? y.normalized() : ahead.unitOrthogonal();
    Eigen::Matrix3d axes;
    axes << y.cross(ahead).transpose(), y.transpose(), ahead.transpose();
    return Eigen::Quaterniond(axes).normalized();
  }

  SceneView New(std::string name, const Eigen::Vector3d& ahead,
                const Eigen::Vector3d& below) const {
    SceneView view;
    view.name = std::move(name);
    view.view_from_world.rotation = Rotation(ahead, below);
    view.view_from_world.translation = -(view.view_from_world.rotation * middle_);
    view.low = low_;
    view.high = high_;
    return view;
  }

  SceneView Along(std::string name, const Eigen::Vector3d& ahead,
                  const Eigen::Vector3d& below) const {
    SceneView view = New(std::move(name), ahead, below);
    view.is_orthographic = true;
    Eigen::Array2d low = Eigen::Array2d::Constant(INFINITY), high = -low;
    for (const auto* places : {&seen_, &centres_}) {
      for (const Eigen::Vector3d& X : *places) {
        const Eigen::Array2d xy = (view.view_from_world * X).head<2>().array();
        low = low.min(xy);
        high = high.max(xy);
      }
    }
    Eigen::Array2d size = (high - low).max(1e-9 * extent_);
    const double aspect = std::clamp(size.x() / size.y(), 1.0 / kMaxAspect, kMaxAspect);
    view.width = aspect >= 1.0 ? side_ : static_cast<int>(std::lround(side_ * aspect));
    view.height = aspect >= 1.0 ? static_cast<int>(std::lround(side_ / aspect)) : side_;
    view.scale =
        (1.0 - 2.0 * kMarginShare) * std::min(view.width / size.x(), view.height / size.y());
    const Eigen::Array2d centre = 0.5 * (low + high);
    view.view_from_world.translation -= Eigen::Vector3d(centre.x(), centre.y(), 0.0);
    return view;
  }

  SceneView Overview(const PlanAxes& plan) const {
    // From behind those who took the photographs; where they look all around, from their side.
    Eigen::Vector3d level = ahead_ - down_ * down_.dot(ahead_);
    if (level.norm() < 0.2 * static_cast<double>(centres_.size())) {
      level.setZero();
      for (const Eigen::Vector3d& X : centres_) level -= (X - middle_) / extent_;
      level -= down_ * down_.dot(level);
    }
    if (level.norm() < 1e-3 * std::max<double>(static_cast<double>(centres_.size()), 1.0))
      level = -plan.below;
    level.normalize();
    level = Eigen::AngleAxisd(DegToRad(kAsideDeg), down_) * level;
    const double above = DegToRad(kAboveDeg);
    const Eigen::Vector3d ahead = (std::cos(above) * level + std::sin(above) * down_).normalized();
    SceneView view = New("overview", ahead, down_);
    view.width = side_;
    view.height = static_cast<int>(std::lround(side_ / kOverviewAspect));
    const double slope = std::tan(DegToRad(kHalfAngleDeg));
    view.scale = 0.5 * side_ / slope;
    const double room = (1.0 - 2.0 * kMarginShare) * slope;
    // As near as all of it is in the picture, and amid it.
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    for (int round = 0; round < 8; ++round) {
      double distance = 0.0;
      for (const auto* places : {&seen_, &centres_}) {
        for (const Eigen::Vector3d& X : *places) {
          const Eigen::Vector3d in_view = view.view_from_world * X;
          distance =
              std::max({distance, std::abs(in_view.x() + shift.x()) / room - in_view.z(),
                        std::abs(in_view.y() + shift.y()) * kOverviewAspect / room - in_view.z()});
        }
      }
      shift.z() = std::max(distance, 1e-9 * extent_);
      Eigen::Array2d low = Eigen::Array2d::Constant(INFINITY), high = -low;
      for (const auto* places : {&seen_, &centres_}) {
        for (const Eigen::Vector3d& X : *places) {
          const Eigen::Vector3d in_view = view.view_from_world * X + shift;
          const Eigen::Array2d xy = in_view.head<2>().array() / in_view.z();
          low = low.min(xy);
          high = high.max(xy);
        }
      }
      shift.head<2>() -= (0.5 * (low + high) * shift.z()).matrix();
    }
    view.view_from_world.translation += shift;
    view.near = 0.02 * shift.z();
    // Not higher than what it shows, which lies amid it.
    double half = 0.0;
    for (const auto* places : {&seen_, &centres_}) {
      for (const Eigen::Vector3d& X : *places) {
        const Eigen::Vector3d in_view = view.view_from_world * X;
        half = std::max(half, std::abs(in_view.y()) / in_view.z());
      }
    }
    const double height = 2.0 * (half * view.scale + kMarginShare * side_);
    view.height = static_cast<int>(
        std::lround(std::clamp<double>(height, side_ / kMaxAspect, side_ / kOverviewAspect)));
    return view;
  }

  std::vector<std::pair<group3D_t, Eigen::Vector3d>> MoreDirections(const PlanAxes& plan) const {
    struct Candidate {
      size_t num_lines;
      group3D_t id;
      Eigen::Vector3d direction;
    };
    std::vector<Candidate> candidates;
    for (const auto& [id, group] : model_.groups3D) {
      double g[kMaxGroupParams];
      const auto num_lines = static_cast<double>(group.line3D_ids.size());
      if (!group.type->IsParallelism() || !group.type->from_file(group.params.data(), g) ||
          num_lines < kMinShareOfLines * static_cast<double>(model_.lines3D.size()))
        continue;
      Eigen::Vector3d direction;
      group.type->direction(g, &direction, nullptr);
      candidates.push_back({group.line3D_ids.size(), id, direction.normalized()});
    }
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [](const Candidate& a, const Candidate& b) { return a.num_lines > b.num_lines; });
    std::vector<Eigen::Vector3d> taken = {down_, plan.right, plan.below};
    std::vector<std::pair<group3D_t, Eigen::Vector3d>> more;
    for (const Candidate& candidate : candidates) {
      const bool is_new = std::all_of(taken.begin(), taken.end(), [&](const Eigen::Vector3d& d) {
        return std::abs(d.dot(candidate.direction)) < std::cos(DegToRad(kSameDirectionDeg));
      });
      if (!is_new || more.size() == kMaxNumMoreDirections) continue;
      taken.push_back(candidate.direction);
      more.emplace_back(candidate.id, candidate.direction);
    }
    return more;
  }

  const Reconstruction& model_;
  int side_;
  Eigen::Vector3d down_;
  Eigen::Vector3d ahead_ = Eigen::Vector3d::Zero();  // sum of the cameras' axes
  std::vector<Eigen::Vector3d> seen_, centres_;
  Eigen::Vector3d low_ = Eigen::Vector3d::Zero(), high_ = low_, middle_ = low_;
  double extent_ = 0.0;  // of most of the scene
};

}  // namespace

std::vector<SceneView> MakeSceneViews(const Reconstruction& model, int longer_side_px) {
  return ViewMaker(model, longer_side_px).Make();
}

}  // namespace holba
