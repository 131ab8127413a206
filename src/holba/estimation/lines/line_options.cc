// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/lines/line_options.h"

namespace holba {

void LineOptions::Describe(OptionTable* table) const {
  table->Section("Lines");
  table->Field("min_segment_px", &min_segment_px, AtLeast(2), "Shortest segment used, pixels.");
  table->Field("max_neighbours", &max_neighbours, Between(1, 1000),
               "Images that a segment is looked for in: those that share most points.");
  table->Field("min_neighbour_angle_deg", &min_neighbour_angle_deg, Between(0, 90),
               "Least angle (upper quartile) between the rays of points that two images share.");
  table->Field("min_epipolar_iou", &min_epipolar_iou, Between(0, 1),
               "Least overlap of a segment with the epipolar band of its candidate.");
  table->Field("min_ray_plane_angle_deg", &min_ray_plane_angle_deg, Between(0, 45),
               "Least angle between the rays of a segment and the plane of its candidate.");
  table->Field("min_depth_factor", &min_depth_factor, Between(0, 1),
               "Least depth of a line, times the 2nd percentile of an image's points.");
  table->Field("max_depth_factor", &max_depth_factor, AtLeast(1),
               "Greatest depth of a line, times the 98th percentile of an image's points.");
  table->Field("max_descriptor_distance", &max_descriptor_distance, Between(0, 2),
               "Greatest distance of the descriptors of two candidates.");
  table->Field("max_candidates", &max_candidates, Between(1, 1000),
               "Candidates kept for each segment in each neighbouring image.");
  table->Field(
      "oriented", &oriented,
      "Whether segments are directed by brightness: opposite ones are then no candidates.");
  table->Field("propose_from_points", &propose_from_points,
               "Whether points beside segments propose lines.");
  table->Field("propose_from_groups", &propose_from_groups,
               "Whether vanishing points and planes propose lines.");
  table->Field(
      "min_score", &min_score, GreaterThan(0),
      "Least support of a proposal: number of images that agree, each weighed by 0.5 to 1.");
  table->Field("min_score_of_few", &min_score_of_few, GreaterThan(0),
               "Least support of the best proposal of a line that is seen in fewer than 4 images.");
  table->Field("max_distance_px", &max_distance_px, GreaterThan(0),
               "Greatest distance of a segment's ends from the image of its line.");
  table->Field("max_angle_deg", &max_angle_deg, Between(0, 90),
               "Greatest angle between a segment and the image of its line.");
  table->Field("min_overlap", &min_overlap, Between(0, 1),
               "Least overlap of a segment with the image of its line.");
  table->Field("refinement_rounds", &refinement_rounds, Between(0, 10),
               "Rounds of merging lines, claiming free segments and refitting.");
  table->Field("claim_distance_px", &claim_distance_px, GreaterThan(0),
               "Greatest distance of a free segment that a line claims.");
  table->Field("claim_angle_deg", &claim_angle_deg, Between(0, 90),
               "Greatest angle of a free segment that a line claims.");
  table->Field("claim_overlap", &claim_overlap, Between(0, 1),
               "Least overlap of a free segment that a line claims.");
  table->Field("claim_descriptor_distance", &claim_descriptor_distance, Between(0, 2),
               "Greatest descriptor distance of a free segment that a line claims.");
  table->Field("vp_weight_px_per_rad", &vp_weight_px_per_rad, AtLeast(0),
               "Weight of the direction of a vanishing point in the fit of a line; 0: not used.");
  table->Field("plane_weight", &plane_weight, AtLeast(0),
               "Weight of the plane that proposed a line, where its depth is uncertain; 0: not "
               "used.");
  table->Field("min_images", &min_images, Between(2, 100), "Least number of images of a line.");
  table->Field("sigma_px", &sigma_px, GreaterThan(0),
               "Standard deviation of the ends of segments, for the uncertainty of lines.");
  table->Field("max_relative_sigma", &max_relative_sigma, GreaterThan(0),
               "Standard deviation of a line's ends, relative to their depth, below which it is "
               "reliable.");
}

}  // namespace holba
