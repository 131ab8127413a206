// SPDX-License-Identifier: BSD-3-Clause
// Options of the incremental mapper (mapper.h), stage by stage. Names and defaults are COLMAP's
// where they mean the same.
#pragma once

#include <cstddef>
#include <cstdint>

#include "holba/base/options.h"
#include "holba/bundle/bundle_options.h"
#include "holba/estimation/pose/absolute_pose.h"
#include "holba/scene/types.h"
#include "holba/sfm/structure.h"

namespace holba {

// What of structure takes part in mapping: the paper's rows "Point baseline", "Point-Line SfM",
// and "Holistic SfM" without and with the wireframe.
enum class MapperStructure { kNone, kLines, kGroups, kHolistic };
// The same of an adjustment.
BundleConfig ConfigOf(MapperStructure structure);

struct InitialPairOptions {
  int image_id1 = -1, image_id2 = -1;  // -1: chosen
  int min_num_inliers = 100;
  double max_error_px = 4.0;
  // Largest share of the baseline along the viewing direction: depth is ill determined beyond.
  double max_forward_motion = 0.95;
  double min_angle_deg = 16.0;
  int max_trials_per_image = 2;  // as the first image of a model
  int max_num_trials = 200;      // pairs whose geometry is estimated
};

struct NextImageOptions {
  int max_trials = 3;        // of registering an image
  int min_num_visible = 30;  // features with a 3D feature; below, the image waits
};

struct RegistrationOptions {
  AbsolutePoseOptions pose;
  // Whether poses from two-view geometries are tried where points are missing.
  bool structure_less = true;
};

struct TriangulationOptions {
  // Angles between an observed ray and the direction to the point.
  double create_max_angle_error_deg = 2.0;
  double continue_max_angle_error_deg = 2.0;
  double merge_max_error_px = 4.0;
  double complete_max_error_px = 4.0;
  int complete_max_transitivity = 5;
  double min_angle_deg = 1.5;  // widest angle between two rays of a point
  bool ignore_two_view_tracks = true;
  // Pairs of images of which fewer than this share of the matches is triangulated are tried again,
  // once the global adjustment has corrected drift.
  double retriangulate_min_ratio = 0.2;
  double retriangulate_max_angle_error_deg = 5.0;
  int retriangulate_max_trials = 1;
};

struct FilterOptions {
  // Whether images lose their pose that share next to nothing with others of like views.
  bool contradicted_images = true;
  double max_error_px = 4.0;
  double min_angle_deg = 1.5;
  // Focal lengths by the longer side of the image, and the largest distortion parameter: cameras
  // beyond are wrong.
  double min_focal_length_ratio = 0.1, max_focal_length_ratio = 10.0, max_extra_param = 1.0;
};

struct LocalAdjustmentOptions {
  int num_images = 6;  // with the new one
  int max_num_iterations = 25;
  // Relative change of the cost that ends an adjustment: the next image moves all of it by more.
  double function_tolerance = 1e-3;
  int max_refinements = 2;               // adjust, merge, complete, filter
  double max_refinement_change = 0.001;  // share of observations; smaller changes end it
};

struct GlobalAdjustmentOptions {
  // Growth since the last one that calls for the next, of registered images and of points.
  double frames_ratio = 1.1, points_ratio = 1.1;
  int frames_freq = 500, points_freq = 250000;
  int max_num_iterations = 50;
  double function_tolerance = 1e-4;
  int max_refinements = 5;
  double max_refinement_change = 0.0005;
  bool refine_focal_length = true;
  bool refine_principal_point = false;
  bool refine_extra_params = true;
  bool refine_sensor_from_rig = true;
  // Growth of the number of images since cameras were chosen that calls for choosing anew, and the
  // fewest to choose on: with fewer, points are seen too seldom to be predicted.
  double cameras_ratio = 1.5;
  size_t min_images_for_cameras = 7;
  // Growth of the number of images since groups were formed that calls for forming them anew.
  double groups_ratio = 1.5;
};

struct MapperOptions {
  // Of the choice of cameras (choose_cameras.h): those of the last adjustment, which chooses again.
  // Principal points move in it where they will then, for else richer lens models stand in for
  // that.
  BundleOptions cameras;
  MapperStructure structure = MapperStructure::kHolistic;
  int min_num_matches = 15;  // of a pair that counts
  bool ignore_watermarks = false;
  bool multiple_models = true;
  int max_num_models = 50;
  int max_model_overlap = 20;  // images that a further model shares with earlier ones at most
  int min_model_size = 10;     // images of a model, but for the first
  bool fix_existing_frames = false;
  int random_seed = 0;
  InitialPairOptions initial;
  NextImageOptions next;
  RegistrationOptions registration;
  TriangulationOptions triangulation;
  FilterOptions filter;
  LocalAdjustmentOptions local;
  GlobalAdjustmentOptions global;
  // Of lines and groups; `refine` has the same, so that the command describes them once.
  StructureOptions structure_options;

  // Section "Mapper".
  void Describe(OptionTable* table) const;
};

}  // namespace holba
