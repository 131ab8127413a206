// SPDX-License-Identifier: BSD-3-Clause
// The benchmark `registration`: poses of images from what they see of a model, of which much is
// wrong. Without a file it makes a table of what lines and vanishing directions are worth as points
// become fewer, on views of a room; benchmark/registration.py makes views of points, gives them to
// other programs too, and judges the poses.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "apps/bench/table.h"
#include "holba/estimation/pose/absolute_pose.h"

namespace holba {

// An image of a pinhole camera. As text, one after the other:
//   view WIDTH HEIGHT FX FY CX CY NUM_POINTS
//   X Y Z PIXEL_X PIXEL_Y          as many lines
struct RegistrationView {
  Camera camera;
  AbsolutePoseMatches matches;
};

// Throws InputError with file and line.
std::vector<RegistrationView> ReadRegistrationViews(const std::filesystem::path& path);

struct RegistrationResult {
  std::optional<AbsolutePose> pose;
  double cpu_us = 0.0;
};
std::vector<RegistrationResult> EstimatePoses(const AbsolutePoseOptions& options,
                                              const std::vector<RegistrationView>& views,
                                              uint64_t seed);
Table RegistrationSummary(const std::vector<RegistrationResult>& results);
nlohmann::json RegistrationsToJson(const std::vector<RegistrationResult>& results);

// What an image of a room sees of it: points of walls and of things, and of each kind as many wrong
// ones as `share_wrong` says; the lines are along three directions, which the vanishing points are.
struct RoomViewOptions {
  size_t num_points = 100, num_lines = 0, num_directions = 0;  // right and wrong ones together
  double share_wrong = 0.0;                                    // of points and lines
  double noise_px = 1.0;  // of a coordinate of a point, and of segments' ends across them
  double direction_noise_deg = 0.5;
  uint64_t seed = 0;
};
struct RoomView {
  Camera camera;
  Rigid3d cam_from_world;
  AbsolutePoseMatches matches;
};
RoomView MakeRoomView(const RoomViewOptions& options);

// Success: within 2 degrees and 0.1 of the room's 5 units. Columns: what is matched; a row for each
// number of points and share of wrong ones.
Table RegistrationTable(const AbsolutePoseOptions& options, size_t num_views, bool focal_is_known,
                        uint64_t seed);

}  // namespace holba
