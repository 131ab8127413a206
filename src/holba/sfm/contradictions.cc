// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/contradictions.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "holba/bundle/reprojection.h"
#include "holba/geometry/angle.h"
#include "holba/robust/median.h"
#include "holba/scene/covisibility.h"

namespace holba {
namespace {

// Descriptors stand turns of 20 degrees of the viewing direction and changes of scale by 1.5 well
// (Mikolajczyk and Schmid 2005: over half of the matches are left).
constexpr double kBinWidthDeg = 5.0;
constexpr double kMaxScale = 1.5;
// Points of an image that are looked at.
constexpr size_t kMaxPoints = 300;
// A pair speaks if so many shared points are expected. Of 2193 such pairs in models of ten sets
// that hold together five share less than a fifth of them.
constexpr double kMinExpected = 20.0;
constexpr double kMaxShareSeen = 0.2;
// Pairs that a share is measured in, at least; before, nothing is known.
constexpr size_t kMinPairs = 3;
constexpr size_t kMinPointsOfPair = 10;

}  // namespace

bool MissingMatches::Evidence::Contradicts() const {
  return expected >= kMinExpected && seen < kMaxShareSeen * expected;
}

MissingMatches::MissingMatches(const MapperState& state) : state_(state) {
  const Reconstruction& model = state.model();
  for (const auto& [id, image] : model.images) {
    View view{.image_id = id, .image = &image, .camera = &model.cameras.at(image.camera_id)};
    view.centre = image.cam_from_world.OriginInA();
    view.axis = image.cam_from_world.RotationMatrix().row(2);
    std::vector<point3D_t> all;
    for (const Point2D& point : image.points2D) {
      if (point.point3D_id != kNoId) all.push_back(point.point3D_id);
    }
    const size_t count = std::min(all.size(), kMaxPoints);
    std::vector<double> depths;
    for (size_t k = 0; k < count; ++k) {
      view.points.push_back(all[k * all.size() / count]);
      depths.push_back((model.points3D.at(view.points.back()).xyz - view.centre).norm());
    }
    if (view.points.empty()) continue;
    view.depth = Median(std::move(depths));
    views_.push_back(std::move(view));
  }
  std::sort(views_.begin(), views_.end(),
            [](const View& a, const View& b) { return a.image_id < b.image_id; });

  // In the median over pairs, so that some wrong ones say nothing.
  std::array<std::vector<double>, kNumBins> shares;
  for (const View& from : views_) {
    for (const MatchedImage& matched : state.graph().MatchedImages(from.image_id)) {
      const View* to = Find(matched.image_id);
      if (to == nullptr || matched.num_matches == 0 || !AreAlike(from, *to)) continue;
      std::array<size_t, kNumBins> could{}, does{};
      for (const point3D_t id : from.points) {
        const Point3D& point = model.points3D.at(id);
        const int bin = BinOf(from, *to, point.xyz);
        if (bin < 0) continue;
        ++could[bin];
        does[bin] += std::any_of(point.track.begin(), point.track.end(),
                                 [&](const auto& o) { return o.image_id == to->image_id; });
      }
      for (int bin = 0; bin < kNumBins; ++bin) {
        if (could[bin] >= kMinPointsOfPair)
          shares[bin].push_back(static_cast<double>(does[bin]) / static_cast<double>(could[bin]));
      }
    }
  }
  for (int bin = 0; bin < kNumBins; ++bin) {
    if (shares[bin].size() >= kMinPairs) share_seen_[bin] = Median(std::move(shares[bin]));
  }
}

const MissingMatches::View* MissingMatches::Find(image_t image_id) const {
  const auto at = std::lower_bound(views_.begin(), views_.end(), image_id,
                                   [](const View& view, image_t id) { return view.image_id < id; });
  return at != views_.end() && at->image_id == image_id ? &*at : nullptr;
}

// Whether one may see points of the other from about where the other does.
bool MissingMatches::AreAlike(const View& a, const View& b) const {
  const double max_angle_deg = kBinWidthDeg * kNumBins;
  if ((a.centre - b.centre).norm() >
      2.0 * std::tan(DegToRad(max_angle_deg)) * std::max(a.depth, b.depth) +
          (kMaxScale - 1.0) * std::max(a.depth, b.depth))
    return false;
  // Fields of view are below 90 degrees, mostly: then they overlap.
  return a.axis.dot(b.axis) > 0.0;
}

int MissingMatches::BinOf(const View& from, const View& to, const Eigen::Vector3d& X) const {
  const auto seen = PixelOf(state_.model(), *to.image, X);
  if (!seen) return -1;
  const Eigen::Vector2d& pixel = *seen;
  // Not at the border, where a detector finds nothing.
  const auto width = static_cast<double>(to.camera->width),
             height = static_cast<double>(to.camera->height);
  if (pixel.x() < 0.03 * width || pixel.x() > 0.97 * width || pixel.y() < 0.03 * height ||
      pixel.y() > 0.97 * height)
    return -1;
  const Eigen::Vector3d a = X - from.centre, b = X - to.centre;
  const double scale = a.norm() / b.norm();
  if (!(scale < kMaxScale && scale > 1.0 / kMaxScale)) return -1;
  const double angle_deg = RadToDeg(std::atan2(a.cross(b).norm(), a.dot(b)));
  const int bin = static_cast<int>(angle_deg / kBinWidthDeg);
  return bin < kNumBins ? bin : -1;
}

void MissingMatches::CountOneWay(const View& from, const View& to, Evidence* evidence) const {
  for (const point3D_t id : from.points) {
    const Point3D& point = state_.model().points3D.at(id);
    const int bin = BinOf(from, to, point.xyz);
    if (bin < 0) continue;
    evidence->expected += share_seen_[bin];
    evidence->seen += std::any_of(point.track.begin(), point.track.end(),
                                  [&](const auto& o) { return o.image_id == to.image_id; });
  }
}

bool MissingMatches::WereCompared(image_t a, image_t b) const {
  return state_.input().compared_pairs.contains({std::min(a, b), std::max(a, b)});
}

MissingMatches::Evidence MissingMatches::Between(image_t image_id1, image_t image_id2) const {
  Evidence evidence;
  const View *a = Find(image_id1), *b = Find(image_id2);
  if (a == nullptr || b == nullptr || !WereCompared(image_id1, image_id2) || !AreAlike(*a, *b))
    return evidence;
  // Images of one frame are where the rig has them.
  if (a->image->frame_id == b->image->frame_id) return evidence;
  CountOneWay(*a, *b, &evidence);
  CountOneWay(*b, *a, &evidence);
  return evidence;
}

double MissingMatches::MissingOf(image_t image_id) const {
  double missing = 0.0;
  for (const View& other : views_) {
    if (other.image_id != image_id) missing += Between(image_id, other.image_id).Missing();
  }
  return missing;
}

std::vector<image_t> MissingMatches::ContradictedImages() const {
  // What ties two images together (points they share), less what is missing between them.
  std::map<std::pair<size_t, size_t>, double> weights;
  bool any = false;
  for (size_t i = 0; i < views_.size(); ++i) {
    for (size_t j = i + 1; j < views_.size(); ++j) {
      const double missing = Between(views_[i].image_id, views_[j].image_id).Missing();
      if (missing == 0.0) continue;
      weights[{i, j}] -= missing;
      any = true;
    }
  }
  if (!any) return {};
  const Reconstruction& model = state_.model();
  std::map<image_t, size_t> idx_of;
  for (size_t i = 0; i < views_.size(); ++i) idx_of[views_[i].image_id] = i;
  const Covisibility covisibility(model);
  for (size_t a = 0; a < model.images.size(); ++a) {
    const auto i = idx_of.find(model.images.begin()[a].first);
    if (i == idx_of.end()) continue;
    for (const Covisibility::Neighbour& neighbour : covisibility.NeighboursOf(a)) {
      const auto j = idx_of.find(model.images.begin()[neighbour.image_idx].first);
      if (j == idx_of.end() || i->second >= j->second) continue;
      weights[{i->second, j->second}] += static_cast<double>(neighbour.num_points);
    }
  }
  // Parts: the two that most ties together become one, while anything does.
  std::vector<size_t> part(views_.size());
  std::vector<std::map<size_t, double>> ties(views_.size());
  for (size_t i = 0; i < part.size(); ++i) part[i] = i;
  for (const auto& [pair, weight] : weights) {
    ties[pair.first][pair.second] = weight;
    ties[pair.second][pair.first] = weight;
  }
  while (true) {
    size_t best_a = 0, best_b = 0;
    double best = 0.0;
    for (size_t a = 0; a < ties.size(); ++a) {
      for (const auto& [b, weight] : ties[a]) {
        if (a < b && weight > best) {
          best = weight;
          best_a = a;
          best_b = b;
        }
      }
    }
    if (!(best > 0.0)) break;
    for (const auto& [other, weight] : ties[best_b]) {
      if (other == best_a) continue;
      ties[best_a][other] += weight;
      ties[other][best_a] += weight;
      ties[other].erase(best_b);
    }
    ties[best_a].erase(best_b);
    ties[best_b].clear();
    std::replace(part.begin(), part.end(), best_b, best_a);
  }
  std::map<size_t, size_t> sizes;
  for (const size_t p : part) ++sizes[p];
  const size_t greatest =
      std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      })->first;
  std::vector<image_t> contradicted;
  for (size_t i = 0; i < part.size(); ++i) {
    if (part[i] == greatest) continue;
    // Parts that nothing ties to the greatest are not contradicted by it.
    const auto tie = ties[greatest].find(part[i]);
    if (tie != ties[greatest].end() && tie->second < 0.0)
      contradicted.push_back(views_[i].image_id);
  }
  return contradicted;
}

}  // namespace holba
