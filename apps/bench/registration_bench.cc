// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/registration_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <string>
#include <utility>

#include "apps/bench/view_blocks.h"
#include "holba/base/random.h"
#include "holba/geometry/angle.h"
#include "holba/robust/median.h"

namespace holba {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kRoomSize = 5.0, kMaxCentreError = 0.1, kMaxRotationErrorDeg = 2.0;

RegistrationResult Estimate(const AbsolutePoseOptions& options, const Camera& camera,
                            bool focal_is_known, const AbsolutePoseMatches& matches,
                            uint64_t seed) {
  RegistrationResult result;
  const std::clock_t begin = std::clock();
  result.pose = EstimateAbsolutePose(options, camera, focal_is_known, matches, seed);
  result.cpu_us = 1e6 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return result;
}

// What one solver did on many views.
struct Score {
  size_t num_right = 0;
  std::vector<double> centre_errors, rotation_errors_deg, cpu_us;

  void Add(const RoomView& view, const RegistrationResult& result) {
    cpu_us.push_back(result.cpu_us);
    double centre_error = kRoomSize, rotation_error_deg = 180.0;
    if (result.pose) {
      const Rigid3d& pose = result.pose->cam_from_world;
      centre_error = (pose.OriginInA() - view.cam_from_world.OriginInA()).norm();
      rotation_error_deg =
          RadToDeg(LogRotation(pose.rotation * view.cam_from_world.rotation.conjugate()).norm());
    }
    centre_errors.push_back(centre_error);
    rotation_errors_deg.push_back(rotation_error_deg);
    num_right += centre_error < kMaxCentreError && rotation_error_deg < kMaxRotationErrorDeg;
  }
  // "97 % 0.0040 0.3 ms".
  std::string Text() const {
    return fmt::format("{:.0f} % {:.4f} {:.1f} ms",
                       100.0 * static_cast<double>(num_right) /
                           static_cast<double>(std::max<size_t>(centre_errors.size(), 1)),
                       Median(centre_errors), 1e-3 * Median(cpu_us));
  }
};

}  // namespace

std::vector<RegistrationView> ReadRegistrationViews(const std::filesystem::path& path) {
  std::vector<RegistrationView> views;
  for (ViewBlock& block :
       ReadViewBlocks(path, "view", "X Y Z PIXEL_X PIXEL_Y", "benchmark/registration.py")) {
    RegistrationView& view = views.emplace_back();
    view.camera = std::move(block.camera);
    for (const std::vector<double>& row : block.rows)
      view.matches.points.push_back({.pixel = {row[3], row[4]}, .X = {row[0], row[1], row[2]}});
  }
  return views;
}

std::vector<RegistrationResult> EstimatePoses(const AbsolutePoseOptions& options,
                                              const std::vector<RegistrationView>& views,
                                              uint64_t seed) {
  std::vector<RegistrationResult> results;
  for (size_t i = 0; i < views.size(); ++i)
    results.push_back(Estimate(options, views[i].camera, true, views[i].matches, seed + i));
  return results;
}

Table RegistrationSummary(const std::vector<RegistrationResult>& results) {
  size_t num_poses = 0;
  std::vector<double> times_us;
  for (const RegistrationResult& result : results) {
    num_poses += result.pose.has_value();
    times_us.push_back(result.cpu_us);
  }
  return {.title = "",
          .header = {"views", "with a pose", "median us"},
          .rows = {{std::to_string(results.size()), std::to_string(num_poses),
                    fmt::format("{:.0f}", Median(times_us))}}};
}

nlohmann::json RegistrationsToJson(const std::vector<RegistrationResult>& results) {
  nlohmann::json json = nlohmann::json::array();
  for (const RegistrationResult& result : results) {
    nlohmann::json entry = {{"cpu_us", result.cpu_us}};
    if (result.pose) {
      const Eigen::Quaterniond& q = result.pose->cam_from_world.rotation;
      const Vector3d& t = result.pose->cam_from_world.translation;
      entry["qvec"] = {q.w(), q.x(), q.y(), q.z()};
      entry["tvec"] = {t.x(), t.y(), t.z()};
      entry["inliers"] = result.pose->num_inliers.points;
      entry["trials"] = result.pose->num_trials;
    }
    json.push_back(std::move(entry));
  }
  return json;
}

RoomView MakeRoomView(const RoomViewOptions& options) {
  Random random(options.seed);
  RoomView view;
  view.camera.model = FindCameraModel("SIMPLE_PINHOLE");
  view.camera.width = 800;
  view.camera.height = 600;
  view.camera.params = {700.0, 400.0, 300.0};
  const auto vector = [&]() -> Vector3d {
    const double x = random.Normal(), y = random.Normal();
    return {x, y, random.Normal()};
  };
  // In the room's middle half, upright within 10 degrees.
  const double heading = random.Uniform(-3.14, 3.14);
  const Eigen::Quaterniond level = ExpRotation(Vector3d(0, heading, 0)).normalized();
  view.cam_from_world.rotation = (ExpRotation(0.1 * vector()) * level).normalized();
  const Vector3d centre(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
  view.cam_from_world.translation = -(view.cam_from_world.rotation * centre);
  const auto random_pixel = [&] {
    const double x = random.Uniform(0, 800);
    return Vector2d(x, random.Uniform(0, 600));
  };
  const double half = 0.5 * kRoomSize;
  const double* params = view.camera.params.data();
  // Along a ray to the wall, or to a thing before it.
  const auto point_at = [&](const Vector2d& pixel) -> Vector3d {
    const Vector3d ray =
        view.cam_from_world.rotation.conjugate() * *view.camera.model->unproject(params, pixel);
    double distance = 1e9;
    for (int k = 0; k < 3; ++k) {
      if (ray[k] != 0.0)
        distance = std::min(distance, (std::copysign(half, ray[k]) - centre[k]) / ray[k]);
    }
    if (random.Uniform() < 0.3) distance *= random.Uniform(0.5, 1.0);
    return centre + distance * ray;
  };
  const auto num_right = [&](size_t count) {
    return count - static_cast<size_t>(std::lround(options.share_wrong * count));
  };
  for (size_t i = 0; i < options.num_points; ++i) {
    PointSighting point;
    point.pixel = random_pixel();
    point.X = point_at(point.pixel);
    const double dx = random.Normal(options.noise_px);
    const Vector2d noise(dx, random.Normal(options.noise_px));
    point.pixel =
        i < num_right(options.num_points) ? Vector2d(point.pixel + noise) : random_pixel();
    view.matches.points.push_back(point);
  }
  while (view.matches.lines.size() < options.num_lines) {
    const Vector3d along = Vector3d::Unit(static_cast<int>(random.Index(3)));
    const Vector3d X = point_at(random_pixel());
    const double reach = random.Uniform(0.3, 1.0);
    Vector2d start, end;
    if (!view.camera.model->project(params, view.cam_from_world * (X - reach * along), &start) ||
        !view.camera.model->project(params, view.cam_from_world * (X + reach * along), &end))
      continue;
    const auto is_inside = [](const Vector2d& x) {
      return x.x() > 0 && x.y() > 0 && x.x() < 800 && x.y() < 600;
    };
    if (!is_inside(start) || !is_inside(end) || (end - start).norm() < 30.0) continue;
    LineSighting line;
    line.line = PlueckerLine::FromPointDirection(X, along);
    if (view.matches.lines.size() < num_right(options.num_lines)) {
      const Vector2d direction = (end - start).normalized();
      const Vector2d across(-direction.y(), direction.x());
      const double at_start = random.Normal(options.noise_px);
      line.segment = {start + at_start * across, end + random.Normal(options.noise_px) * across};
    } else {
      // The segment of another line.
      const Vector3d other = Vector3d::Unit(static_cast<int>(random.Index(3)));
      line.line = PlueckerLine::FromPointDirection(point_at(random_pixel()), other);
      line.segment = {start, end};
    }
    view.matches.lines.push_back(line);
  }
  for (size_t seen = 0; seen < options.num_directions; ++seen) {
    const Vector3d turn = DegToRad(options.direction_noise_deg) * vector();
    const Vector3d in_cam = ExpRotation(turn) * (view.cam_from_world.rotation *
                                                 Vector3d::Unit(static_cast<int>(seen % 3)));
    // Which direction of the room it is nobody knows.
    for (int k = 0; k < 3; ++k)
      view.matches.directions.push_back({in_cam.normalized(), Vector3d::Unit(k)});
  }
  return view;
}

Table RegistrationTable(const AbsolutePoseOptions& options, size_t num_views, bool focal_is_known,
                        uint64_t seed) {
  Table table{
      .title = "",
      .header = {"points", "wrong", "points alone", "and 20 lines", "and 3 directions", "and both"},
      .rows = {}};
  for (size_t num_points : {100u, 50u, 20u, 10u, 5u, 3u}) {
    for (double wrong : {0.0, 0.4, 0.8}) {
      Score scores[4];
      for (size_t v = 0; v < num_views; ++v) {
        for (int k = 0; k < 4; ++k) {
          RoomViewOptions room;
          room.num_points = num_points;
          room.num_lines = k % 2 == 1 ? 20 : 0;
          room.num_directions = k >= 2 ? 3 : 0;
          room.share_wrong = wrong;
          room.seed = seed + v;
          RoomView view = MakeRoomView(room);
          if (!focal_is_known) {
            const IdealCalibration truth =
                view.camera.model->ideal_calibration(view.camera.params.data());
            view.camera.params[0] = 1.2 * 800;
            for (DirectionSighting& d : view.matches.directions) {
              d.direction_in_cam =
                  Vector3d(d.direction_in_cam.x() * truth.fx / 960.0,
                           d.direction_in_cam.y() * truth.fy / 960.0, d.direction_in_cam.z())
                      .normalized();
            }
          }
          scores[k].Add(view,
                        Estimate(options, view.camera, focal_is_known, view.matches, seed + v));
        }
      }
      table.rows.push_back({std::to_string(num_points), fmt::format("{:.0f} %", 100.0 * wrong),
                            scores[0].Text(), scores[1].Text(), scores[2].Text(),
                            scores[3].Text()});
    }
  }
  return table;
}

}  // namespace holba
