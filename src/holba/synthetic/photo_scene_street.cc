// SPDX-License-Identifier: BSD-3-Clause
// A walk around a block of houses as a PhotoScene.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/synthetic/photo_scene.h"
#include "holba/synthetic/random_streams.h"
#include "holba/synthetic/synthetic_cameras.h"

namespace holba {
namespace {

constexpr double kHalfWidth = 6.0;     // of the street, from its middle to the fronts
constexpr double kCornerRadius = 4.0;  // of the way
constexpr double kStep = 1.2;          // from image to image, on the straight
constexpr double kPaceOfCorner = 2.2;  // steps around corners are so many times shorter
// Of the way, corners counted by their pace: a shorter one has no block in its middle.
constexpr double kMinLength = 125.0;
constexpr double kEyeHeight = 1.7;
constexpr double kMaxSetBack = 0.5;  // of a front
// Images that see the start again.
constexpr int kMinLoopImages = 8;
constexpr double kLoopShare = 0.05;

Rigid3d TurnedAboutZ(int quarter_turns, const Eigen::Vector3d& translation) {
  const double half_angle = 0.25 * std::numbers::pi * quarter_turns;
  return {Eigen::Quaterniond(std::cos(half_angle), 0.0, 0.0, std::sin(half_angle)), translation};
}

// A square way with round corners, counter-clockwise around the origin.
class Way {
 public:
  explicit Way(double length)
      : arc_(0.5 * std::numbers::pi * kCornerRadius * kPaceOfCorner),
        straight_(length / 4.0 - arc_),
        half_side_(0.5 * straight_ + kCornerRadius) {}

  double half_side() const { return half_side_; }

  struct Place {
    Eigen::Vector3d position, ahead;
  };
  Place At(double along) const {
    const double quarter = straight_ + arc_;
    const double turns = std::floor(along / quarter);
    const double s = along - turns * quarter;
    Eigen::Vector3d position, ahead;
    if (s < straight_) {
      position << -0.5 * straight_ + s, -half_side_, 0.0;
      ahead << 1.0, 0.0, 0.0;
    } else {
      const double angle = 0.5 * std::numbers::pi * (s - straight_) / arc_;
      position << 0.5 * straight_ + kCornerRadius * std::sin(angle),
          -half_side_ + kCornerRadius * (1.0 - std::cos(angle)), 0.0;
      ahead << std::cos(angle), std::sin(angle), 0.0;
    }
    const Rigid3d turn = TurnedAboutZ(static_cast<int>(turns) % 4, Eigen::Vector3d::Zero());
    return {turn * position, turn * ahead};
  }

 private:
  double arc_, straight_, half_side_;
};

class StreetMaker {
 public:
  StreetMaker(int num_images, double density, uint64_t seed)
      : num_images_(num_images),
        density_(density),
        random_(StreamOf(seed, 301)),
        num_loop_(std::max(kMinLoopImages, static_cast<int>(kLoopShare * num_images))),
        length_(std::max(kMinLength, kStep * (num_images - num_loop_))),
        way_(length_) {}

  PhotoScene Make() {
    AddViews();
    const double inner = way_.half_side() - kHalfWidth, outer = way_.half_side() + kHalfWidth;
    for (int side = 0; side < 4; ++side) {
      // Fronts are seen from -y of their own frame: the outer ones turn their back to y = -outer.
      AddRow(outer, -outer, side, true);
      AddRow(inner, -inner, side, false);
    }
    scene_.boxes.emplace_back(Eigen::Vector3d(-inner, -inner, 0.0),
                              Eigen::Vector3d(inner, inner, 40.0));
    AddFloating();
    return std::move(scene_);
  }

 private:
  void AddViews() {
    Camera camera;
    camera.model = FindCameraModel("SIMPLE_RADIAL");
    camera.width = 1000;
    camera.height = 750;
    camera.params = {700.0, 500.0, 375.0, -0.05};
    scene_.cameras = {camera};
    scene_.is_sequence = true;
    const double step = length_ / (num_images_ - num_loop_);
    for (int i = 0; i < num_images_; ++i) {
      const Way::Place place = way_.At(i * step);
      Eigen::Vector3d centre = place.position;
      for (double& x : centre) x += random_.Normal(0.05);
      centre.z() += kEyeHeight;
      // Towards the outer side, swaying as one who looks around while walking.
      const double sway = std::sin(2.0 * std::numbers::pi * i / 50.0);
      const double yaw = DegToRad(40.0 + 20.0 * sway);
      const Eigen::Vector3d outside(place.ahead.y(), -place.ahead.x(), 0.0);
      Eigen::Vector3d target =
          centre + 10.0 * (std::cos(yaw) * place.ahead + std::sin(yaw) * outside);
      for (double& x : target) x += random_.Normal(0.3);
      target.z() += 1.5;
      scene_.camera_of_view.push_back(0);
      scene_.cam_from_world.push_back(LookAt(centre, target, random_.Uniform(-0.05, 0.05)));
    }
  }

  // Houses from one corner to the next, `half_length` to both sides of the middle.
  void AddRow(double half_length, double y, int side, bool is_outer) {
    constexpr std::array<double, 3> kWidths = {8.0, 10.0, 13.0};
    constexpr double kShareOfCopies = 0.35;
    for (double x = -half_length; half_length - x > 1.0;) {
      const double left = half_length - x;
      Facade facade{kWidths[random_.Index(kWidths.size())], random_.Uniform(8.0, 14.0),
                    ++num_designs_ + 1000 * random_.Index(1000)};
      const size_t known = originals_.empty() ? 0 : random_.Index(originals_.size());
      const bool is_copy = !originals_.empty() && random_.Uniform() < kShareOfCopies &&
                           originals_[known].facade.width <= left;
      if (is_copy) {
        facade = originals_[known].facade;
      } else if (facade.width + 5.0 > left) {
        facade.width = left;  // the last one fills the row
      }
      const double set_back = random_.Uniform(0.0, kMaxSetBack);
      const ScenePart part = MakeFacade(facade, kPointsPerM2 * density_);
      // In the frame of the first side; the front looks to -y (inner) or to +y (outer).
      const Rigid3d in_row = is_outer ? TurnedAboutZ(2, {x + facade.width, y + set_back, 0.0})
                                      : TurnedAboutZ(0, {x, y - set_back, 0.0});
      const Rigid3d world_from_part = TurnedAboutZ(side, Eigen::Vector3d::Zero()) * in_row;
      const ScenePlace place = AddPart(part, world_from_part, &scene_.content);
      if (is_copy) {
        scene_.copies.push_back(CopyOf(part, originals_[known].place, place));
      } else {
        originals_.push_back({facade, place});
      }
      x += facade.width;
    }
  }

  // Trees, cars and people that stand still.
  void AddFloating() {
    ScenePart part;
    const auto num_points = static_cast<size_t>(kFloatingPerMetre * density_ * length_);
    for (size_t k = 0; k < num_points; ++k) {
      const Way::Place place = way_.At(random_.Uniform(0.0, length_));
      const Eigen::Vector3d outside(place.ahead.y(), -place.ahead.x(), 0.0);
      const double across = random_.Uniform(2.0, kHalfWidth - 0.7);
      const double side = random_.Uniform() < 0.7 ? 1.0 : -1.0;
      Eigen::Vector3d X = place.position + side * across * outside;
      X.z() = random_.Uniform(0.0, 5.0);
      const double tilt = random_.Uniform(-1.0, 0.3);
      part.structure.points.push_back(X);
      part.point_normals.push_back((tilt * place.ahead - side * outside).normalized());
      part.point_sizes.push_back(0.02 * std::pow(15.0, random_.Uniform()));
    }
    AddPart(part, Rigid3d(), &scene_.content);
  }

  static constexpr double kPointsPerM2 = 2.0, kFloatingPerMetre = 8.0;
  struct Original {
    Facade facade;
    ScenePlace place;
  };

  const int num_images_;
  const double density_;
  Random random_;
  const int num_loop_;
  const double length_;
  const Way way_;
  uint64_t num_designs_ = 0;
  std::vector<Original> originals_;
  PhotoScene scene_;
};

}  // namespace

PhotoScene MakeStreetScene(int num_images, double density, uint64_t seed) {
  return StreetMaker(num_images, density, seed).Make();
}

}  // namespace holba
