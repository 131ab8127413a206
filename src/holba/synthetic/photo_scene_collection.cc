// SPDX-License-Identifier: BSD-3-Clause
// Photographs of a church in a square with houses around it as a PhotoScene.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "holba/base/random.h"
#include "holba/synthetic/photo_scene.h"
#include "holba/synthetic/random_streams.h"
#include "holba/synthetic/synthetic_cameras.h"

namespace holba {
namespace {

constexpr double kHalfSquare = 75.0;  // of the square, to the fronts around it
constexpr double kHalfTower = 4.0, kTowerHeight = 38.0;
// Buttresses, portals and ornaments.
constexpr double kShareOffChurch = 0.4, kReliefOfChurch = 2.5;
constexpr double kHalfNave = 9.0, kNaveLength = 34.0, kNaveHeight = 16.0;

Rigid3d FrontAt(const Eigen::Vector3d& left_foot, int quarter_turns) {
  const double half_angle = 0.25 * std::numbers::pi * quarter_turns;
  return {Eigen::Quaterniond(std::cos(half_angle), 0.0, 0.0, std::sin(half_angle)), left_foot};
}

// Where a front of this width stands whose middle is `distance` from `centre` and which looks away
// from it (or, inward, back at it) towards quarter_turns from -y.
Rigid3d FrontAround(const Eigen::Vector3d& centre, double distance, double width, double shift,
                    int quarter_turns, bool inward) {
  const Rigid3d turn = FrontAt(Eigen::Vector3d::Zero(), quarter_turns);
  const double half = 0.5 * width;
  if (inward) {
    const Rigid3d back = FrontAt({shift + half, -distance, 0.0}, 2);
    return Rigid3d(Eigen::Quaterniond::Identity(), centre) * turn * back;
  }
  const Rigid3d out = FrontAt({shift - half, -distance, 0.0}, 0);
  return Rigid3d(Eigen::Quaterniond::Identity(), centre) * turn * out;
}

class CollectionMaker {
 public:
  CollectionMaker(int num_images, double density, uint64_t seed)
      : num_images_(num_images),
        density_(density),
        random_(StreamOf(seed, 401)),
        camera_random_(StreamOf(seed, 402)) {}

  PhotoScene Make() {
    AddChurch();
    AddHouses();
    AddFloating();
    AddViews();
    return std::move(scene_);
  }

 private:
  // The tower stands before the west end of the nave, which runs along +x.
  void AddChurch() {
    const double west = kHalfTower;
    const auto church_front = [&](double width, double height) {
      return Facade{width, height, random_.Bits() >> 1, kShareOffChurch, kReliefOfChurch};
    };
    const Facade tower = church_front(2.0 * kHalfTower, kTowerHeight);
    const ScenePart side = MakeFacade(tower, kPointsPerM2 * density_);
    std::array<ScenePlace, 4> places;
    for (int turn = 0; turn < 4; ++turn) {
      places[turn] = AddPart(
          side, FrontAround(Eigen::Vector3d::Zero(), kHalfTower, tower.width, 0.0, turn, false),
          &scene_.content);
    }
    for (int a = 0; a < 4; ++a) {
      for (int b = a + 1; b < 4; ++b) scene_.copies.push_back(CopyOf(side, places[a], places[b]));
    }
    scene_.boxes.emplace_back(Eigen::Vector3d(-kHalfTower, -kHalfTower, 0.0),
                              Eigen::Vector3d(kHalfTower, kHalfTower, kTowerHeight));

    const Eigen::Vector3d middle(west + 0.5 * kNaveLength, 0.0, 0.0);
    const Facade flank = church_front(kNaveLength, kNaveHeight);
    const ScenePart flank_part = MakeFacade(flank, kPointsPerM2 * density_);
    const ScenePlace south = AddPart(
        flank_part, FrontAround(middle, kHalfNave, flank.width, 0.0, 0, false), &scene_.content);
    const ScenePlace north = AddPart(
        flank_part, FrontAround(middle, kHalfNave, flank.width, 0.0, 2, false), &scene_.content);
    scene_.copies.push_back(CopyOf(flank_part, south, north));
    const Facade choir = church_front(2.0 * kHalfNave, kNaveHeight);
    AddPart(MakeFacade(choir, kPointsPerM2 * density_),
            FrontAround(middle, 0.5 * kNaveLength, choir.width, 0.0, 1, false), &scene_.content);
    scene_.boxes.emplace_back(Eigen::Vector3d(west, -kHalfNave, 0.0),
                              Eigen::Vector3d(west + kNaveLength, kHalfNave, kNaveHeight));
  }

  void AddHouses() {
    for (int side = 0; side < 4; ++side) {
      for (double x = -kHalfSquare; x < kHalfSquare - 1.0;) {
        const double width = std::min(random_.Uniform(10.0, 18.0), kHalfSquare - x);
        const Facade facade{width, random_.Uniform(10.0, 16.0), random_.Bits() >> 1};
        AddPart(MakeFacade(facade, kHousePointsPerM2 * density_),
                FrontAround(Eigen::Vector3d::Zero(), kHalfSquare - random_.Uniform(0.0, 1.0), width,
                            x + 0.5 * width, side, true),
                &scene_.content);
        x += width;
      }
    }
  }

  // Statues, lamps and stalls in the square, seen from all sides but each point from its own.
  void AddFloating() {
    ScenePart part;
    const auto num_points = static_cast<size_t>(kFloatingPoints * density_);
    for (size_t k = 0; k < num_points; ++k) {
      const double angle = random_.Uniform(0.0, 2.0 * std::numbers::pi);
      const double distance = random_.Uniform(14.0, 40.0);
      const Eigen::Vector3d X(distance * std::cos(angle), distance * std::sin(angle),
                              random_.Uniform(0.2, 6.0));
      const double facing = random_.Uniform(0.0, 2.0 * std::numbers::pi);
      const bool is_in_church = X.x() > 0.0 && X.x() < kNaveLength + kHalfTower + 3.0 &&
                                std::abs(X.y()) < kHalfNave + 3.0;
      if (is_in_church) continue;
      part.structure.points.push_back(X);
      part.point_normals.emplace_back(std::cos(facing), std::sin(facing), 0.0);
      part.point_sizes.push_back(0.02 * std::pow(15.0, random_.Uniform()));
    }
    AddPart(part, Rigid3d(), &scene_.content);
  }

  struct Spot {
    Eigen::Vector3d centre;
    bool looks_at_houses = false;
  };

  // Outside of the church, more often before its west end.
  Spot MakeSpot() {
    Spot spot;
    do {
      const double angle = camera_random_.Normal(1.1) + std::numbers::pi;
      const double distance = camera_random_.Uniform(18.0, 65.0);
      spot.centre << distance * std::cos(angle), distance * std::sin(angle), 1.7;
    } while (spot.centre.x() > -kHalfTower - 6.0 && spot.centre.x() < kNaveLength + 14.0 &&
             std::abs(spot.centre.y()) < kHalfNave + 8.0);
    spot.looks_at_houses = camera_random_.Uniform() < 0.15;
    return spot;
  }

  void AddViews() {
    const int num_spots = std::max(6, num_images_ / 25);
    std::vector<Spot> spots;
    std::vector<double> popularity;
    for (int s = 0; s < num_spots; ++s) {
      spots.push_back(MakeSpot());
      popularity.push_back(PowerLaw(1.5, 15.0, &camera_random_) +
                           (s > 0 ? popularity.back() : 0.0));
    }
    for (int i = 0; i < num_images_; ++i) {
      const double at = camera_random_.Uniform(0.0, popularity.back());
      const size_t s = std::min<size_t>(
          std::upper_bound(popularity.begin(), popularity.end(), at) - popularity.begin(),
          spots.size() - 1);
      AddView(spots[s]);
    }
  }

  void AddView(const Spot& spot) {
    Random& random = camera_random_;
    constexpr std::array<std::array<uint64_t, 2>, 6> kFormats = {
        {{1024, 768}, {768, 1024}, {1000, 667}, {667, 1000}, {960, 540}, {800, 800}}};
    Camera camera;
    camera.model = FindCameraModel("SIMPLE_RADIAL");
    const auto& format = kFormats[random.Index(kFormats.size())];
    camera.width = format[0];
    camera.height = format[1];
    const double width = static_cast<double>(camera.width);
    const double height = static_cast<double>(camera.height);
    const double zoom = std::clamp(std::exp(random.Normal(0.35)), 0.7, 2.5);
    camera.params = {zoom * std::max(width, height), 0.5 * width, 0.5 * height,
                     random.Normal(0.03) - 0.03};

    Eigen::Vector3d centre = spot.centre;
    for (int k = 0; k < 2; ++k) centre[k] += random.Normal(3.0);
    centre.z() += random.Uniform(-0.2, 1.0);
    Eigen::Vector3d target(random.Normal(3.0), random.Normal(3.0), random.Uniform(8.0, 22.0));
    // From the sides the nave is in the picture, too.
    if (centre.x() > 0.0) target.x() += random.Uniform(0.0, 0.7 * kNaveLength);
    if (spot.looks_at_houses) {
      const Eigen::Vector3d away = Eigen::Vector3d(centre.x(), centre.y(), 0.0).normalized();
      const double turn = random.Uniform(-1.8, 1.8);
      target = centre + 20.0 * (Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) * away);
      target.z() = random.Uniform(4.0, 8.0);
    }
    scene_.camera_of_view.push_back(static_cast<uint32_t>(scene_.cameras.size()));
    scene_.cameras.push_back(camera);
    scene_.cam_from_world.push_back(LookAt(centre, target, random.Uniform(-0.1, 0.1)));
  }

  static constexpr double kPointsPerM2 = 4.0, kHousePointsPerM2 = 1.0;
  static constexpr double kFloatingPoints = 3000.0;

  const int num_images_;
  const double density_;
  Random random_, camera_random_;
  PhotoScene scene_;
};

}  // namespace

PhotoScene MakeCollectionScene(int num_images, double density, uint64_t seed) {
  return CollectionMaker(num_images, density, seed).Make();
}

}  // namespace holba
