// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/calibrated_pair.h"

namespace holba {
namespace {

Keypoints KeypointsOf(const Image& image) {
  Keypoints keypoints;
  keypoints.data.reserve(2 * image.points2D.size());
  for (const Point2D& point : image.points2D) keypoints.Add(point.xy);
  return keypoints;
}

}  // namespace

TwoViewResult EstimateCalibratedPair(const CalibratedPairOptions& options, const MapperState& state,
                                     image_t image_id1, image_t image_id2) {
  TwoViewOptions two_view;
  two_view.min_num_inliers = options.min_num_inliers;
  two_view.max_error = options.max_error_px;
  two_view.random_seed = options.random_seed;
  // The essential matrix is wanted even where a fundamental matrix agrees with more.
  two_view.min_E_F_inlier_ratio = 0.0;
  two_view.detect_watermark = false;
  const Image &image1 = *state.model().FindImage(image_id1),
              &image2 = *state.model().FindImage(image_id2);
  const Keypoints keypoints1 = KeypointsOf(image1), keypoints2 = KeypointsOf(image2);
  return EstimateTwoView(two_view, {&state.model().cameras.at(image1.camera_id), true, &keypoints1},
                         {&state.model().cameras.at(image2.camera_id), true, &keypoints2},
                         state.graph().MatchesBetween(image_id1, image_id2), false,
                         (uint64_t{image_id1} << 32) + image_id2);
}

}  // namespace holba
