// SPDX-License-Identifier: BSD-3-Clause
// What extraction and matching of a set of photographs would give, made without photographs and
// with the truth: keypoints, segments, vanishing points, labelled regions and verified matches of
// the images of a PhotoScene, for measuring mappers at any size.
//
// Wrong matches are those that verification leaves: matches along epipolar lines, in every pair,
// and whole pairs that match a part of the scene with its copy, all of whose matches agree with one
// wrong relative pose. Counts of missing and of wrong matches are exact over the whole set: each is
// the nearest whole number to its share.
//
// Image i (from 1) is view i - 1 of the scene. Track elements of the truth are indices of these
// keypoints and segments. Results do not depend on the number of threads.
#pragma once

#include <cstdint>
#include <vector>

#include "holba/base/options.h"
#include "holba/scene/image_features.h"
#include "holba/scene/keypoints.h"
#include "holba/scene/reconstruction.h"
#include "holba/scene/two_view_geometry.h"
#include "holba/synthetic/photo_scene.h"
#include "holba/synthetic/scene_views.h"

namespace holba {

// What is known of focal lengths. kExact: all intrinsics. kExif: the focal length with an error, no
// distortion. kUnknown: 1.2 times the longer side, as COLMAP guesses, no distortion.
enum class FocalLengthPrior { kExact, kExif, kUnknown };

struct PhotoSetOptions {
  PhotoSceneKind scene = PhotoSceneKind::kStreet;
  uint64_t seed = 0;
  int num_images = 100;
  int num_threads = -1;
  // Keypoints, mean over the images, within a few percent.
  double points_per_image = 600.0;
  double clutter = 0.3;  // share of keypoints and segments that belong to nothing
  // Standard deviations: of a keypoint's coordinates; of a segment's ends across it.
  double point_noise_px = 0.7;
  double segment_noise_px = 0.5;
  FocalLengthPrior focal_length = FocalLengthPrior::kExact;
  double exif_error = 0.03;  // standard deviation, share of the focal length

  // Which images are matched. Of a street: the next `sequential_overlap` ones, and ones that see
  // the same later. Else, and for these, the `max_pairs_per_image` that share most.
  int sequential_overlap = 10;
  int max_pairs_per_image = 40;
  int min_num_matches = 15;  // of a pair, as COLMAP verifies them
  // A feature is matched in views whose rays differ by less, at sizes within this factor.
  double max_match_angle_deg = 45.0;
  double max_match_scale = 2.5;
  double missing_matches = 0.2;     // share of the matches of shared features that are not there
  double wrong_matches = 0.03;      // share of the verified matches, of points
  double wrong_pairs = 0.0;         // share of the verified pairs
  double wrong_line_matches = 0.1;  // share of the matches of segments
  double rejected_matches = 0.2;    // share of the raw matches that verification removes

  VisibilityOptions sightings;

  // All but scene, seed, num_images and num_threads.
  void Describe(OptionTable* table) const;
};

struct PhotoSetImage {
  Keypoints keypoints;  // x y
  std::vector<LineSegment2d> segments;
  std::vector<ImageVanishingPoint> vanishing_points;
  std::vector<int32_t> vp_of_segment;
  LabelMap label_map;
};

struct PhotoSetCamera {
  Camera camera;  // what is known of it
  bool has_prior_focal_length = false;
};

struct PhotoSetPair {
  image_t image_id1 = kInvalidId32, image_id2 = kInvalidId32;  // ascending
  Rigid3d cam2_from_cam1;  // which the matches obey, metric; of a wrong pair not the true one
  bool is_wrong = false;   // matches a part with its copy
  PointMatches matches;    // verified, ascending
  std::vector<bool> is_wrong_match;     // along the epipolar line
  PointMatches raw_matches;             // with those that verification removes, ascending
  std::vector<LineMatch> line_matches;  // ascending
  std::vector<bool> is_wrong_line_match;
};

struct PhotoSet {
  // Poses, intrinsics, points, lines, groups, wireframe and relations. Of the features that at
  // least two images have; image by image all keypoints and segments.
  Reconstruction truth;
  std::vector<PhotoSetCamera> cameras;  // of camera_id k + 1
  std::vector<PhotoSetImage> images;    // of image_id k + 1
  std::vector<PhotoSetPair> pairs;      // in the order of ids
};

// A wrong match is at most this far from its epipolar line in the second image.
inline constexpr double kWrongMatchMaxErrorPx = 3.0;

// Throws InputError for options that the scene cannot fulfil.
PhotoSet MakePhotoSet(const PhotoSetOptions& options);

}  // namespace holba
