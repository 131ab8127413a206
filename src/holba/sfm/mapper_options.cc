// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/mapper_options.h"

namespace holba {

BundleConfig ConfigOf(MapperStructure structure) {
  switch (structure) {
    case MapperStructure::kNone:
      return BundleConfig::kPoint;
    case MapperStructure::kLines:
      return BundleConfig::kPointLine;
    case MapperStructure::kGroups:
      return BundleConfig::kGroups;
    case MapperStructure::kHolistic:
      break;
  }
  return BundleConfig::kHolistic;
}

void MapperOptions::Describe(OptionTable* table) const {
  table->Section("Mapper");
  table
      ->Choice("structure", &structure,
               {{"none", MapperStructure::kNone},
                {"lines", MapperStructure::kLines},
                {"groups", MapperStructure::kGroups},
                {"holistic", MapperStructure::kHolistic}},
               "What takes part beside points: lines; vanishing points and primitives with them; "
               "the wireframe with both.")
      .Basic();
  table->Field("min_num_matches", &min_num_matches, AtLeast(1),
               "Verified matches that a pair of images has at least to count.");
  table->Field("ignore_watermarks", &ignore_watermarks,
               "Whether pairs are left out whose matches were taken for a watermark.");
  table->Field("multiple_models", &multiple_models,
               "Whether images that do not register start further models.");
  table->Field("max_num_models", &max_num_models, AtLeast(1), "Models at most.");
  table->Field("max_model_overlap", &max_model_overlap, AtLeast(0),
               "A further model ends when it shares this many images with earlier ones.");
  table->Field("min_model_size", &min_model_size, AtLeast(2),
               "Images that a model has at least; the first one may have fewer.");
  table->Field("fix_existing_frames", &fix_existing_frames,
               "Whether the poses of --input_path stay as they are.");
  table->Field("random_seed", &random_seed, AtLeast(0),
               "Seed of the samples of first pairs and registrations.");

  table->Field("init_image_id1", &initial.image_id1, AtLeast(-1),
               "First image of the model; -1: chosen.");
  table->Field("init_image_id2", &initial.image_id2, AtLeast(-1),
               "Second image of the model; -1: chosen.");
  table->Field("init_min_num_inliers", &initial.min_num_inliers, AtLeast(5),
               "Inliers of the first pair; halved, and halved again, where no pair has so many.");
  table->Field("init_max_error", &initial.max_error_px, GreaterThan(0),
               "Largest error of an inlier of the first pair in pixels.");
  table->Field("init_max_forward_motion", &initial.max_forward_motion, Between(0, 1),
               "Largest share of the first pair's baseline along the viewing direction.");
  table->Field("init_min_tri_angle", &initial.min_angle_deg, GreaterThan(0),
               "Smallest median angle in degrees between the rays of the first pair; halved, and "
               "halved again, where no pair has it.");
  table->Field("init_max_reg_trials", &initial.max_trials_per_image, AtLeast(1),
               "How many times an image is tried as the first one of a model.");
  table->Field("init_num_trials", &initial.max_num_trials, AtLeast(1),
               "Pairs that are tried as the first one at most.");

  table->Field("max_reg_trials", &next.max_trials, AtLeast(1),
               "How many times the registration of an image is tried.");
  registration.pose.Describe(table);
  table->Section("Mapper");
  table->Field("structure_less_registration", &registration.structure_less,
               "Whether images that see too few 3D points are registered by their matches with "
               "images of the model.");

  table->Field("tri_create_max_angle_error", &triangulation.create_max_angle_error_deg,
               GreaterThan(0), "Largest angle in degrees between a new point and its rays.");
  table->Field("tri_continue_max_angle_error", &triangulation.continue_max_angle_error_deg,
               GreaterThan(0),
               "Largest angle in degrees between a point and a ray that joins its track.");
  table->Field("tri_merge_max_reproj_error", &triangulation.merge_max_error_px, GreaterThan(0),
               "Largest error of an observation of merged points in pixels.");
  table->Field("tri_complete_max_reproj_error", &triangulation.complete_max_error_px,
               GreaterThan(0), "Largest error in pixels of an observation that completes a track.");
  table->Field("tri_complete_max_transitivity", &triangulation.complete_max_transitivity,
               AtLeast(1), "Matches that a track is followed along for its completion.");
  table->Field("tri_min_angle", &triangulation.min_angle_deg, GreaterThan(0),
               "Widest angle in degrees between two rays of a new point, at least.");
  table->Field("tri_ignore_two_view_tracks", &triangulation.ignore_two_view_tracks,
               "Whether matches that no third image knows give no points.");
  table->Field("tri_re_min_ratio", &triangulation.retriangulate_min_ratio, Between(0, 1),
               "Pairs of which a smaller share of matches is triangulated are tried again after a "
               "global adjustment.");
  table->Field("tri_re_max_angle_error", &triangulation.retriangulate_max_angle_error_deg,
               GreaterThan(0), "Largest angle in degrees for rays that join tracks then.");
  table->Field("tri_re_max_trials", &triangulation.retriangulate_max_trials, AtLeast(0),
               "How many times a pair is tried again.");

  table->Field("filter_max_reproj_error", &filter.max_error_px, GreaterThan(0),
               "Observations of larger errors in pixels are removed.");
  table->Field("filter_min_tri_angle", &filter.min_angle_deg, AtLeast(0),
               "Points whose rays all meet at smaller angles in degrees are removed.");
  table->Field("filter_contradicted_images", &filter.contradicted_images,
               "Whether images lose their pose that were compared with others of like views and "
               "share next to nothing with them (repeated structure).");
  table->Field("min_focal_length_ratio", &filter.min_focal_length_ratio, GreaterThan(0),
               "Cameras of smaller focal lengths (by the longer side) are wrong.");
  table->Field("max_focal_length_ratio", &filter.max_focal_length_ratio, GreaterThan(0),
               "Cameras of greater focal lengths (by the longer side) are wrong.");
  table->Field("max_extra_param", &filter.max_extra_param, GreaterThan(0),
               "Cameras of greater distortion parameters are wrong.");

  table->Field("ba_local_num_images", &local.num_images, AtLeast(2),
               "Images that are adjusted after each registration, with the new one.");
  table->Field("ba_local_max_num_iterations", &local.max_num_iterations, AtLeast(1),
               "Iterations of a local adjustment at most.");
  table->Field("ba_local_function_tolerance", &local.function_tolerance, AtLeast(0),
               "Relative change of the cost that ends a local adjustment.");
  table->Field("ba_local_max_refinements", &local.max_refinements, AtLeast(1),
               "Local adjustments after a registration, each with merging, completion and filter.");
  table->Field("ba_local_max_refinement_change", &local.max_refinement_change, AtLeast(0),
               "Share of observations that changes less ends these.");
  table->Field("ba_global_frames_ratio", &global.frames_ratio, GreaterThan(1),
               "Growth of the number of images that calls for a global adjustment.");
  table->Field("ba_global_points_ratio", &global.points_ratio, GreaterThan(1),
               "Growth of the number of points that calls for a global adjustment.");
  table->Field("ba_global_frames_freq", &global.frames_freq, AtLeast(1),
               "Number of new images that calls for a global adjustment.");
  table->Field("ba_global_points_freq", &global.points_freq, AtLeast(1),
               "Number of new points that calls for a global adjustment.");
  table->Field("ba_global_max_num_iterations", &global.max_num_iterations, AtLeast(1),
               "Iterations of a global adjustment at most.");
  table->Field("ba_global_function_tolerance", &global.function_tolerance, AtLeast(0),
               "Relative change of the cost that ends a global adjustment.");
  table->Field("groups_ratio", &global.groups_ratio, AtLeast(1),
               "Growth of the number of images that calls for forming groups anew; in between new "
               "features join those that are there.");
  table->Field("ba_global_max_refinements", &global.max_refinements, AtLeast(1),
               "Global adjustments in a row, each with merging, completion and filter.");
  table->Field("ba_global_max_refinement_change", &global.max_refinement_change, AtLeast(0),
               "Share of observations that changes less ends these.");
  table
      ->Field("ba_refine_focal_length", &global.refine_focal_length,
              "Whether growing models adjust focal lengths.")
      .Basic();
  table->Field("ba_refine_principal_point", &global.refine_principal_point,
               "Whether principal points are adjusted while the model grows.");
  table
      ->Field("ba_refine_extra_params", &global.refine_extra_params,
              "Whether distortion is adjusted while the model grows.")
      .Basic();
  table->Field("ba_refine_sensor_from_rig", &global.refine_sensor_from_rig,
               "Whether poses of sensors in their rigs are adjusted while the model grows.");
}

}  // namespace holba
