// SPDX-License-Identifier: BSD-3-Clause
// Matches that are missing. Two images that see the same points from nearly the same side and
// distance should share most of them; where they were compared and share next to none, one of them
// is not where the model has it: a window was taken for its neighbour, the back of a thing for its
// front (Zach, Irschara, Bischof, What can missing correspondences tell us about 3D structure and
// motion?, CVPR 2008). How much images of like views share is counted in the model itself.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "holba/sfm/mapper_state.h"

namespace holba {

class MissingMatches {
 public:
  // Counts, in pairs of images that have verified matches, how many of the points that one sees and
  // the other could the other does see, by the angle between the rays.
  explicit MissingMatches(const MapperState& state);

  // For images with poses that were compared: points of each that the other should see, and those
  // that it sees.
  struct Evidence {
    double expected = 0.0, seen = 0.0;
    bool Contradicts() const;
    double Missing() const { return Contradicts() ? expected - seen : 0.0; }
  };
  Evidence Between(image_t image_id1, image_t image_id2) const;

  // Missing with all images of the model whose views are alike.
  double MissingOf(image_t image_id) const;

  // Images that more contradicts than ties to the greatest part of the model without
  // contradictions.
  std::vector<image_t> ContradictedImages() const;

 private:
  struct View {
    image_t image_id;
    const Image* image;
    const Camera* camera;
    Eigen::Vector3d centre, axis;
    std::vector<point3D_t> points;  // some of those that it sees, evenly chosen
    double depth = 0.0;             // median of these
  };
  static constexpr int kNumBins = 4;

  const View* Find(image_t image_id) const;
  bool AreAlike(const View& a, const View& b) const;
  // The bin of a point that `from` sees, if `to` sees it from about there; -1: it does not.
  int BinOf(const View& from, const View& to, const Eigen::Vector3d& X) const;
  void CountOneWay(const View& from, const View& to, Evidence* evidence) const;
  bool WereCompared(image_t a, image_t b) const;

  const MapperState& state_;
  std::vector<View> views_;  // by image id
  std::array<double, kNumBins> share_seen_{};
};

}  // namespace holba
