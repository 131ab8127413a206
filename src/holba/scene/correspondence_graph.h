// SPDX-License-Identifier: BSD-3-Clause
// The graph that an incremental mapper walks: features of images (keypoints and segments) as nodes,
// verified matches of keypoints and candidate matches of segments as edges. It is built once and
// read only; CorrespondenceGraphBuilder builds it.
//
// As in COLMAP (3.13 and later), a keypoint may have several correspondences in one image, and a
// match that is there already is dropped. A match goes both ways.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "holba/scene/image_features.h"
#include "holba/scene/two_view_geometry.h"
#include "holba/scene/types.h"

namespace holba {

// A keypoint in another image.
struct Correspondence {
  image_t image_id = kInvalidId32;
  point2D_t point2D_idx = kInvalidId32;
  friend auto operator<=>(const Correspondence&, const Correspondence&) = default;
};

// A segment in another image.
struct LineCorrespondence {
  image_t image_id = kInvalidId32;
  line2D_t line2D_idx = kInvalidId32;
  float distance = 0.0f;  // of descriptors; smaller is better
};

// An image that an image has matches with.
struct MatchedImage {
  image_t image_id = kInvalidId32;
  size_t num_matches = 0;       // of keypoints
  size_t num_line_matches = 0;  // of segments
};

namespace correspondence_graph_internal {

// Entries of the features of images, one after the other (compressed rows). Offsets are 32 bits
// wide and count from the first entry of the image.
template <typename Entry>
class FeatureRows {
 public:
  // For each image (by position) its number of features, and (feature, entry) pairs in the order of
  // features.
  void AddImage(size_t num_features, std::span<const std::pair<uint32_t, Entry>> entries);

  size_t NumFeatures(size_t image) const {
    return first_offset_[image + 1] - first_offset_[image] - 1;
  }
  std::span<const Entry> Of(size_t image, uint32_t feature) const {
    const uint32_t* offset = offsets_.data() + first_offset_[image] + feature;
    return {entries_.data() + first_entry_[image] + offset[0], size_t{offset[1]} - offset[0]};
  }
  std::span<const Entry> OfImage(size_t image) const {
    return {entries_.data() + first_entry_[image], first_entry_[image + 1] - first_entry_[image]};
  }

 private:
  std::vector<size_t> first_offset_{0}, first_entry_{0};  // of each image, and the end
  std::vector<uint32_t> offsets_;                         // one more than features, for each image
  std::vector<Entry> entries_;
};

}  // namespace correspondence_graph_internal

class CorrespondenceGraph {
 public:
  // Ascending. Images without matches are there, too.
  std::span<const image_t> image_ids() const { return image_ids_; }
  bool Contains(image_t image_id) const { return position_.contains(image_id); }

  // All that follow take images of the graph and features that these have.
  size_t NumKeypoints(image_t image_id) const { return points_.NumFeatures(At(image_id)); }
  size_t NumSegments(image_t image_id) const { return lines_.NumFeatures(At(image_id)); }

  // Of all keypoints of an image: their correspondences, and how many have any.
  size_t NumCorrespondences(image_t image_id) const { return points_.OfImage(At(image_id)).size(); }
  size_t NumObservations(image_t image_id) const { return num_observations_[At(image_id)]; }
  // Of two images; 0: they are not matched.
  size_t NumMatches(image_t image_id1, image_t image_id2) const;
  size_t NumLineMatches(image_t image_id1, image_t image_id2) const;

  // Images that an image has matches of keypoints or segments with, ascending.
  std::span<const MatchedImage> MatchedImages(image_t image_id) const {
    const size_t i = At(image_id);
    return {matched_.data() + first_matched_[i], first_matched_[i + 1] - first_matched_[i]};
  }
  // Matches of keypoints of two images, ascending.
  PointMatches MatchesBetween(image_t image_id1, image_t image_id2) const;
  // The geometry that verified them, first image first; its inlier_matches are empty, they are
  // MatchesBetween. Undefined geometry where there is none.
  TwoViewGeometry GeometryBetween(image_t image_id1, image_t image_id2) const;

  // Of a keypoint, ascending.
  std::span<const Correspondence> CorrespondencesOf(image_t image_id, point2D_t point2D_idx) const;
  bool HasCorrespondences(image_t image_id, point2D_t point2D_idx) const {
    return !CorrespondencesOf(image_id, point2D_idx).empty();
  }
  // Whether a keypoint and its only correspondence know nothing but each other: a point that no
  // third image confirms.
  bool IsTwoViewObservation(image_t image_id, point2D_t point2D_idx) const;
  // Keypoints that are at most `depth` matches away (1: CorrespondencesOf), nearest first, without
  // the keypoint itself. `found` is overwritten.
  void FindTransitive(image_t image_id, point2D_t point2D_idx, int depth,
                      std::vector<Correspondence>* found) const;

  // Of a segment, ascending by image, then the best first.
  std::span<const LineCorrespondence> LineCorrespondencesOf(image_t image_id,
                                                            line2D_t line2D_idx) const;

 private:
  friend class CorrespondenceGraphBuilder;
  size_t At(image_t image_id) const;
  const MatchedImage* FindMatched(image_t image_id1, image_t image_id2) const;

  std::vector<image_t> image_ids_;
  std::unordered_map<image_t, uint32_t> position_;
  correspondence_graph_internal::FeatureRows<Correspondence> points_;
  correspondence_graph_internal::FeatureRows<LineCorrespondence> lines_;
  std::vector<size_t> num_observations_;  // of each image
  std::vector<size_t> first_matched_;     // of each image, and the end
  std::vector<MatchedImage> matched_;
  std::map<ImagePair, TwoViewGeometry> geometries_;  // without matches
};

class CorrespondenceGraphBuilder {
 public:
  // Images and matches come in any order; an image comes once.
  void AddImage(image_t image_id, size_t num_keypoints, size_t num_segments = 0);
  // Verified matches of a pair of different images, with the geometry that verified them. What is
  // added to a pair adds up; the geometry is the last one's.
  void AddTwoViewGeometry(image_t image_id1, image_t image_id2, const TwoViewGeometry& geometry);
  void AddMatches(image_t image_id1, image_t image_id2, const PointMatches& matches);
  void AddLineMatches(image_t image_id1, image_t image_id2, const std::vector<LineMatch>& matches);

  // All images of matches must have been added, with that many features. Empties the builder.
  CorrespondenceGraph Build();
  // Matches that were there already (after Build).
  size_t num_duplicates() const { return num_duplicates_; }

 private:
  struct Features {
    size_t num_keypoints = 0, num_segments = 0;
  };
  std::map<image_t, Features> images_;
  std::map<ImagePair, PointMatches> matches_;
  std::map<ImagePair, std::vector<LineMatch>> line_matches_;
  std::map<ImagePair, TwoViewGeometry> geometries_;
  size_t num_duplicates_ = 0;
};

}  // namespace holba
