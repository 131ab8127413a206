// SPDX-License-Identifier: BSD-3-Clause
#include "holba/scene/correspondence_graph.h"

#include <algorithm>
#include <limits>
#include <string>
#include <tuple>
#include <unordered_set>

#include "holba/base/check.h"

namespace holba {
namespace correspondence_graph_internal {

template <typename Entry>
void FeatureRows<Entry>::AddImage(size_t num_features,
                                  std::span<const std::pair<uint32_t, Entry>> entries) {
  HOLBA_CHECK(entries.size() <= std::numeric_limits<uint32_t>::max());
  size_t next = 0;
  for (size_t feature = 0; feature < num_features; ++feature) {
    offsets_.push_back(static_cast<uint32_t>(next));
    for (; next < entries.size() && entries[next].first == feature; ++next) {
      entries_.push_back(entries[next].second);
    }
  }
  HOLBA_CHECK_MSG(next == entries.size(), "a match of a feature that its image does not have");
  offsets_.push_back(static_cast<uint32_t>(next));
  first_offset_.push_back(offsets_.size());
  first_entry_.push_back(entries_.size());
}

}  // namespace correspondence_graph_internal

namespace {

ImagePair Ordered(image_t image_id1, image_t image_id2) {
  HOLBA_CHECK_MSG(image_id1 != image_id2,
                  "image " + std::to_string(image_id1) + " cannot be matched with itself");
  return std::minmax(image_id1, image_id2);
}

bool IsSame(const LineMatch& a, const LineMatch& b) { return a.idx1 == b.idx1 && a.idx2 == b.idx2; }

// Sorted, each once. Returns how many were dropped.
size_t DropDuplicates(PointMatches* matches) {
  const size_t before = matches->size();
  std::sort(matches->begin(), matches->end());
  matches->erase(std::unique(matches->begin(), matches->end()), matches->end());
  return before - matches->size();
}

// Of matches of the same segments the best stays.
size_t DropDuplicates(std::vector<LineMatch>* matches) {
  const size_t before = matches->size();
  std::sort(matches->begin(), matches->end(), [](const LineMatch& a, const LineMatch& b) {
    return std::tie(a.idx1, a.idx2, a.distance) < std::tie(b.idx1, b.idx2, b.distance);
  });
  matches->erase(std::unique(matches->begin(), matches->end(), IsSame), matches->end());
  return before - matches->size();
}

}  // namespace

size_t CorrespondenceGraph::At(image_t image_id) const {
  const auto it = position_.find(image_id);
  HOLBA_CHECK_MSG(it != position_.end(),
                  "image " + std::to_string(image_id) + " is not in the graph");
  return it->second;
}

const MatchedImage* CorrespondenceGraph::FindMatched(image_t image_id1, image_t image_id2) const {
  const std::span<const MatchedImage> matched = MatchedImages(image_id1);
  const auto it = std::lower_bound(
      matched.begin(), matched.end(), image_id2,
      [](const MatchedImage& entry, image_t image_id) { return entry.image_id < image_id; });
  return it != matched.end() && it->image_id == image_id2 ? &*it : nullptr;
}

size_t CorrespondenceGraph::NumMatches(image_t image_id1, image_t image_id2) const {
  const MatchedImage* matched = FindMatched(image_id1, image_id2);
  return matched == nullptr ? 0 : matched->num_matches;
}

size_t CorrespondenceGraph::NumLineMatches(image_t image_id1, image_t image_id2) const {
  const MatchedImage* matched = FindMatched(image_id1, image_id2);
  return matched == nullptr ? 0 : matched->num_line_matches;
}

PointMatches CorrespondenceGraph::MatchesBetween(image_t image_id1, image_t image_id2) const {
  PointMatches matches;
  const size_t num_matches = NumMatches(image_id1, image_id2);
  if (num_matches == 0) return matches;
  matches.reserve(num_matches);
  const size_t i = At(image_id1);
  for (point2D_t idx1 = 0; idx1 < points_.NumFeatures(i); ++idx1) {
    const auto of_keypoint = points_.Of(i, idx1);
    for (auto it = std::lower_bound(of_keypoint.begin(), of_keypoint.end(),
                                    Correspondence{image_id2, 0});
         it != of_keypoint.end() && it->image_id == image_id2; ++it) {
      matches.push_back({idx1, it->point2D_idx});
    }
  }
  return matches;
}

TwoViewGeometry CorrespondenceGraph::GeometryBetween(image_t image_id1, image_t image_id2) const {
  const auto it = geometries_.find(Ordered(image_id1, image_id2));
  if (it == geometries_.end()) return {};
  return image_id1 < image_id2 ? it->second : it->second.Swapped();
}

std::span<const Correspondence> CorrespondenceGraph::CorrespondencesOf(
    image_t image_id, point2D_t point2D_idx) const {
  const size_t i = At(image_id);
  HOLBA_CHECK(point2D_idx < points_.NumFeatures(i));
  return points_.Of(i, point2D_idx);
}

std::span<const LineCorrespondence> CorrespondenceGraph::LineCorrespondencesOf(
    image_t image_id, line2D_t line2D_idx) const {
  const size_t i = At(image_id);
  HOLBA_CHECK(line2D_idx < lines_.NumFeatures(i));
  return lines_.Of(i, line2D_idx);
}

bool CorrespondenceGraph::IsTwoViewObservation(image_t image_id, point2D_t point2D_idx) const {
  const auto own = CorrespondencesOf(image_id, point2D_idx);
  return own.size() == 1 && CorrespondencesOf(own[0].image_id, own[0].point2D_idx).size() == 1;
}

void CorrespondenceGraph::FindTransitive(image_t image_id, point2D_t point2D_idx, int depth,
                                         std::vector<Correspondence>* found) const {
  found->clear();
  const auto direct = CorrespondencesOf(image_id, point2D_idx);
  found->assign(direct.begin(), direct.end());
  if (depth <= 1) {
    if (depth < 1) found->clear();
    return;
  }
  const auto key = [](image_t image, point2D_t idx) { return uint64_t{image} << 32 | idx; };
  std::unordered_set<uint64_t> seen = {key(image_id, point2D_idx)};
  for (const Correspondence& c : *found) seen.insert(key(c.image_id, c.point2D_idx));
  size_t begin = 0;
  for (int step = 2; step <= depth && begin < found->size(); ++step) {
    const size_t end = found->size();
    for (; begin < end; ++begin) {
      const Correspondence from = (*found)[begin];
      for (const Correspondence& next : CorrespondencesOf(from.image_id, from.point2D_idx)) {
        if (seen.insert(key(next.image_id, next.point2D_idx)).second) found->push_back(next);
      }
    }
  }
}

void CorrespondenceGraphBuilder::AddImage(image_t image_id, size_t num_keypoints,
                                          size_t num_segments) {
  HOLBA_CHECK_MSG(images_.emplace(image_id, Features{num_keypoints, num_segments}).second,
                  "image " + std::to_string(image_id) + " was added twice");
}

void CorrespondenceGraphBuilder::AddTwoViewGeometry(image_t image_id1, image_t image_id2,
                                                    const TwoViewGeometry& geometry) {
  AddMatches(image_id1, image_id2, geometry.inlier_matches);
  TwoViewGeometry ordered = image_id1 < image_id2 ? geometry : geometry.Swapped();
  ordered.inlier_matches = {};
  geometries_.insert_or_assign(Ordered(image_id1, image_id2), std::move(ordered));
}

void CorrespondenceGraphBuilder::AddMatches(image_t image_id1, image_t image_id2,
                                            const PointMatches& matches) {
  PointMatches& of_pair = matches_[Ordered(image_id1, image_id2)];
  for (const auto& [idx1, idx2] : matches) {
    of_pair.push_back(image_id1 < image_id2 ? std::array{idx1, idx2} : std::array{idx2, idx1});
  }
}

void CorrespondenceGraphBuilder::AddLineMatches(image_t image_id1, image_t image_id2,
                                                const std::vector<LineMatch>& matches) {
  std::vector<LineMatch>& of_pair = line_matches_[Ordered(image_id1, image_id2)];
  for (LineMatch match : matches) {
    if (image_id1 > image_id2) std::swap(match.idx1, match.idx2);
    of_pair.push_back(match);
  }
}

CorrespondenceGraph CorrespondenceGraphBuilder::Build() {
  CorrespondenceGraph graph;
  num_duplicates_ = 0;
  for (const auto& [image_id, features] : images_) {
    graph.position_.emplace(image_id, static_cast<uint32_t>(graph.image_ids_.size()));
    graph.image_ids_.push_back(image_id);
  }
  for (auto& [pair, matches] : matches_) num_duplicates_ += DropDuplicates(&matches);
  for (auto& [pair, matches] : line_matches_) num_duplicates_ += DropDuplicates(&matches);

  // What each image is matched with, ascending.
  std::vector<std::map<image_t, MatchedImage>> matched(images_.size());
  const auto count = [&](const ImagePair& pair, size_t MatchedImage::*number, size_t num_matches) {
    const size_t i = graph.At(pair.first), j = graph.At(pair.second);
    if (num_matches == 0) return;
    matched[i].try_emplace(pair.second, MatchedImage{pair.second}).first->second.*number =
        num_matches;
    matched[j].try_emplace(pair.first, MatchedImage{pair.first}).first->second.*number =
        num_matches;
  };
  for (const auto& [pair, matches] : matches_) {
    count(pair, &MatchedImage::num_matches, matches.size());
  }
  for (const auto& [pair, matches] : line_matches_) {
    count(pair, &MatchedImage::num_line_matches, matches.size());
  }

  graph.first_matched_.push_back(0);
  std::vector<std::pair<uint32_t, Correspondence>> points;
  std::vector<std::pair<uint32_t, LineCorrespondence>> lines;
  for (size_t i = 0; i < graph.image_ids_.size(); ++i) {
    const image_t image_id = graph.image_ids_[i];
    points.clear();
    lines.clear();
    for (const auto& [other, numbers] : matched[i]) {
      graph.matched_.push_back(numbers);
      const ImagePair pair = Ordered(image_id, other);
      const int own = image_id < other ? 0 : 1;
      if (numbers.num_matches > 0) {
        for (const auto& match : matches_.at(pair)) {
          points.push_back({match[own], {other, match[1 - own]}});
        }
      }
      if (numbers.num_line_matches > 0) {
        for (const LineMatch& match : line_matches_.at(pair)) {
          const auto [own_idx, other_idx] = own == 0 ? std::pair(match.idx1, match.idx2)
                                                     : std::pair(match.idx2, match.idx1);
          lines.push_back({own_idx, {other, other_idx, match.distance}});
        }
      }
    }
    std::sort(points.begin(), points.end());
    std::sort(lines.begin(), lines.end(), [](const auto& a, const auto& b) {
      return std::tie(a.first, a.second.image_id, a.second.distance, a.second.line2D_idx) <
             std::tie(b.first, b.second.image_id, b.second.distance, b.second.line2D_idx);
    });
    const Features& features = images_.at(image_id);
    graph.points_.AddImage(features.num_keypoints, points);
    graph.lines_.AddImage(features.num_segments, lines);
    graph.first_matched_.push_back(graph.matched_.size());
    size_t num_observations = 0;
    for (size_t k = 0; k < points.size(); ++k) {
      num_observations += k == 0 || points[k].first != points[k - 1].first;
    }
    graph.num_observations_.push_back(num_observations);
  }
  graph.geometries_ = std::move(geometries_);
  images_.clear();
  matches_.clear();
  line_matches_.clear();
  geometries_.clear();
  return graph;
}

}  // namespace holba
