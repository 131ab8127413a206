// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/directions/vp_tracks.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "holba/base/check.h"
#include "holba/estimation/directions/direction_fit.h"
#include "holba/geometry/angle.h"
#include "holba/group/known_types.h"
#include "holba/robust/median.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

// Largest number of starts of the search for one direction; of more image vanishing points an even
// selection is taken.
constexpr size_t kMaxStarts = 500;
constexpr int kMeanIterations = 10;
// A member deviates by at most this many medians (4.5 of them are three standard deviations of a
// normal distribution), but two degrees are allowed in any case.
constexpr double kMaxMedians = 4.5, kAllowedDeg = 2.0;
constexpr double kFewImagesShare = 0.6;
// The first refit has a wider scale, because the start is inaccurate.
constexpr double kFirstFactor = 3.0;

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))) * kDegPerRad;
}

// A vanishing point of an image.
struct Node {
  ImageVpId id;
  Eigen::Vector3d direction;                // world
  std::vector<DirectionEvidence> evidence;  // its segments, of world directions
  std::vector<line3D_t> line_ids;           // that its segments observe, ascending
};

struct Track {
  Eigen::Vector3d direction;
  std::vector<size_t> nodes;  // ascending, at most one of an image
  double median_deviation_deg = 0.0;
  size_t num_segments = 0;
};

std::vector<Node> NodesOfImage(image_t image_id, const ImageFeatures& features,
                               const Reconstruction& model, const ViewMap& views) {
  const IdealView& view = views.at(image_id);
  const Eigen::Matrix3d KR = view.K() * view.R();
  std::vector<Node> nodes;
  for (uint32_t i = 0; i < features.vanishing_points.size(); ++i) {
    const Eigen::Vector3d& in_cam = features.vanishing_points[i].direction_in_cam;
    nodes.push_back({{image_id, i}, view.R().transpose() * in_cam, {}, {}});
  }
  const std::vector<Line2D>& lines2D = model.images.at(image_id).lines2D;
  for (size_t k = 0; k < features.vp_of_segment.size(); ++k) {
    const int32_t vp_idx = features.vp_of_segment[k];
    if (vp_idx < 0) continue;
    HOLBA_CHECK(static_cast<size_t>(vp_idx) < nodes.size());
    const std::optional<LineSegment2d> ideal = view.ToIdeal(features.segments[k]);
    if (!ideal || !(ideal->Length() > 0.0)) continue;
    nodes[vp_idx].evidence.emplace_back(*ideal, KR);
    if (k < lines2D.size() && lines2D[k].line3D_id != kNoId) {
      nodes[vp_idx].line_ids.push_back(lines2D[k].line3D_id);
    }
  }
  for (Node& node : nodes) {
    std::sort(node.line_ids.begin(), node.line_ids.end());
    node.line_ids.erase(std::unique(node.line_ids.begin(), node.line_ids.end()),
                        node.line_ids.end());
  }
  return nodes;
}

class TrackSearch {
 public:
  TrackSearch(const VpTrackOptions& options, std::vector<Node> nodes, size_t num_images,
              VpTrackReport* report)
      : options_(options), nodes_(std::move(nodes)), report_(report) {
    const double n = static_cast<double>(num_images);
    const int few = std::max(2, static_cast<int>(std::ceil(kFewImagesShare * n)));
    const int share = static_cast<int>(std::ceil(options.min_image_share * n));
    min_images_ =
        std::max(std::min(options.min_images, few), std::min(options.max_min_images, share));
  }

  std::vector<Track> Run() {
    std::vector<bool> free(nodes_.size(), true);
    std::vector<Track> tracks;
    while (std::optional<Track> track = Strongest(free)) {
      for (const size_t k : track->nodes) free[k] = false;
      if (Refit(&*track)) tracks.push_back(std::move(*track));
    }
    Merge(&tracks);
    std::erase_if(tracks, [&](const Track& track) { return !IsTrue(track); });
    std::stable_sort(tracks.begin(), tracks.end(), [](const Track& a, const Track& b) {
      return a.nodes.size() > b.nodes.size();
    });
    return tracks;
  }

  const Node& node(size_t k) const { return nodes_[k]; }

 private:
  // Of each image the free node nearest to a direction, if it is within max_deg. Nodes of one image
  // follow each other.
  std::vector<size_t> NearestOfEachImage(const std::vector<bool>& free, const Eigen::Vector3d& d,
                                         double max_deg) const {
    const double min_cosine = std::cos(max_deg / kDegPerRad);
    std::vector<size_t> nearest;
    double best = 0.0;
    for (size_t k = 0; k < nodes_.size(); ++k) {
      const double cosine = std::abs(nodes_[k].direction.dot(d));
      if (!free[k] || cosine < min_cosine) continue;
      if (!nearest.empty() && nodes_[nearest.back()].id.image_id == nodes_[k].id.image_id) {
        if (!(cosine > best)) continue;
        nearest.pop_back();
      }
      nearest.push_back(k);
      best = cosine;
    }
    return nearest;
  }

  // Tukey's biweight of the deviation. Its scale keeps directions that are two from meeting midway.
  double Weight(size_t k, const Eigen::Vector3d& d) const {
    const double relative = AngleDeg(nodes_[k].direction, d) / options_.merge_deg;
    return relative < 1.0 ? (1.0 - relative * relative) * (1.0 - relative * relative) : 0.0;
  }

  // The direction with the largest sum of weights over the images; empty: nothing is free.
  std::optional<Track> Strongest(const std::vector<bool>& free) const {
    std::vector<size_t> starts;
    for (size_t k = 0; k < nodes_.size(); ++k) {
      if (free[k]) starts.push_back(k);
    }
    if (starts.empty()) return std::nullopt;
    const size_t step = (starts.size() + kMaxStarts - 1) / kMaxStarts;
    Eigen::Vector3d best_direction = nodes_[starts[0]].direction;
    double best = 0.0;
    for (size_t s = 0; s < starts.size(); s += step) {
      Eigen::Vector3d d = nodes_[starts[s]].direction;
      double score = 0.0;
      for (int i = 0; i < kMeanIterations; ++i) {
        // Axes have no sign: the mean is that of the outer products.
        Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
        double sum = 0.0;
        for (const size_t k : NearestOfEachImage(free, d, options_.merge_deg)) {
          const double weight = Weight(k, d);
          sum += weight;
          scatter += weight * nodes_[k].direction * nodes_[k].direction.transpose();
        }
        if (!(sum > score)) break;
        score = sum;
        if (score > best) {
          best = score;
          best_direction = d;
        }
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
        d = eigen.eigenvectors().col(2);
      }
    }
    Track track;
    track.direction = best_direction;
    std::vector<double> deviations;
    for (const size_t k : NearestOfEachImage(free, best_direction, options_.merge_deg)) {
      deviations.push_back(AngleDeg(nodes_[k].direction, best_direction));
    }
    if (deviations.empty()) {  // the weight of a lone node at its own direction is 1: not here
      track.nodes = {starts[0]};
      return track;
    }
    const double max_deg = std::min(options_.max_deviation_deg,
                                    std::max(kAllowedDeg, kMaxMedians * Median(deviations)));
    track.nodes = NearestOfEachImage(free, best_direction, max_deg);
    return track;
  }

  // Direction of the members' segments, and the figures of the track. False: they fix none.
  bool Refit(Track* track) const {
    std::vector<DirectionEvidence> evidence;
    for (const size_t k : track->nodes) {
      evidence.insert(evidence.end(), nodes_[k].evidence.begin(), nodes_[k].evidence.end());
    }
    auto refined =
        RefineDirection(evidence, kFirstFactor * options_.max_error_px, track->direction);
    if (refined) refined = RefineDirection(evidence, options_.max_error_px, *refined);
    if (!refined) {
      ++report_->dropped["track: segments fix no direction"];
      return false;
    }
    track->direction = *refined;
    track->num_segments = CountAgreeing(evidence, *refined);
    std::vector<double> deviations;
    for (const size_t k : track->nodes) {
      deviations.push_back(AngleDeg(nodes_[k].direction, *refined));
    }
    track->median_deviation_deg = Median(deviations);
    return true;
  }

  size_t CountAgreeing(const std::vector<DirectionEvidence>& evidence,
                       const Eigen::Vector3d& d) const {
    return std::count_if(evidence.begin(), evidence.end(), [&](const DirectionEvidence& e) {
      return e.SquaredError(d) < options_.max_error_px * options_.max_error_px;
    });
  }
  size_t CountAgreeing(const Track& track, const Eigen::Vector3d& d) const {
    size_t count = 0;
    for (const size_t k : track.nodes) count += CountAgreeing(nodes_[k].evidence, d);
    return count;
  }

  bool ShareLines(const Track& a, const Track& b) const {
    std::vector<line3D_t> common;
    for (const size_t i : a.nodes) {
      for (const size_t j : b.nodes) {
        common.clear();
        std::set_intersection(nodes_[i].line_ids.begin(), nodes_[i].line_ids.end(),
                              nodes_[j].line_ids.begin(), nodes_[j].line_ids.end(),
                              std::back_inserter(common));
        if (static_cast<int>(common.size()) >= options_.min_shared_lines) return true;
      }
    }
    return false;
  }

  // Empty: they are two directions.
  std::optional<Track> Joined(const Track& a, const Track& b) const {
    const double angle_deg = AngleDeg(a.direction, b.direction);
    const bool are_near = angle_deg < options_.merge_deg;
    if (!are_near && !(angle_deg < options_.max_deviation_deg && ShareLines(a, b)))
      return std::nullopt;
    Track joint;
    joint.direction = a.num_segments >= b.num_segments ? a.direction : b.direction;
    std::vector<bool> candidates(nodes_.size(), false);
    for (const size_t k : a.nodes) candidates[k] = true;
    for (const size_t k : b.nodes) candidates[k] = true;
    joint.nodes = NearestOfEachImage(candidates, joint.direction, 90.0);
    if (!Refit(&joint)) return std::nullopt;
    if (!are_near) {
      for (const Track* track : {&a, &b}) {
        if (!(CountAgreeing(*track, joint.direction) >=
              options_.min_kept_share * track->num_segments))
          return std::nullopt;
      }
    }
    return joint;
  }

  void Merge(std::vector<Track>* tracks) const {
    for (size_t i = 0; i < tracks->size(); ++i) {
      for (size_t j = i + 1; j < tracks->size();) {
        // A track that would not be accepted alone may be added to another, which must stay as
        // good.
        std::optional<Track> joint = Joined((*tracks)[i], (*tracks)[j]);
        if (!joint) {
          ++j;
          continue;
        }
        (*tracks)[i] = std::move(*joint);
        tracks->erase(tracks->begin() + j);
        ++report_->num_merged;
        j = i + 1;
      }
    }
  }

  bool IsTrue(const Track& track) const {
    if (static_cast<int>(track.nodes.size()) < min_images_) {
      ++report_->dropped["track: in too few images"];
    } else if (!(track.median_deviation_deg < options_.max_median_deviation_deg)) {
      ++report_->dropped["track: scatters too much"];
    } else {
      return true;
    }
    return false;
  }

  const VpTrackOptions& options_;
  std::vector<Node> nodes_;
  VpTrackReport* report_;
  int min_images_;
};

Eigen::Vector3d DirectionOf(const Group3D& vp) {
  return {vp.params[0], vp.params[1], vp.params[2]};
}

// The VP group of the model that is nearest to a direction and within max_deg.
std::optional<group3D_t> FindVp(const Reconstruction& model, const Eigen::Vector3d& d,
                                double max_deg) {
  std::optional<group3D_t> best;
  for (const auto& [id, group] : model.groups3D) {
    if (!group.type->IsParallelism()) continue;
    const double angle_deg = AngleDeg(DirectionOf(group), d);
    if (!(angle_deg < max_deg)) continue;
    best = id;
    max_deg = angle_deg;
  }
  return best;
}

}  // namespace

void VpTrackOptions::Describe(OptionTable* table) const {
  table->Section("VpTracks");
  table->Field("max_deviation_deg", &max_deviation_deg, Between(0, 90),
               "Largest angle between a direction and a vanishing point of an image.");
  table->Field("max_median_deviation_deg", &max_median_deviation_deg, Between(0, 90),
               "Largest median of these angles.");
  table->Field("min_images", &min_images, AtLeast(1), "Fewest images that show a direction.");
  table->Field("min_image_share", &min_image_share, Between(0, 1),
               "The same as a part of all images.");
  table->Field("max_min_images", &max_min_images, AtLeast(1),
               "Images that suffice, however many there are.");
  table->Field("merge_deg", &merge_deg, Between(0, 90), "Nearer directions are one.");
  table->Field("min_shared_lines", &min_shared_lines, AtLeast(1),
               "3D lines in common that join directions up to max_deviation_deg apart.");
  table->Field("min_kept_share", &min_kept_share, Between(0, 1),
               "Part of the segments of both that must agree with the joint direction then.");
  table->Field("max_error_px", &max_error_px, GreaterThan(0),
               "Largest distance of a segment's ends from the line to the vanishing point.");
}

VpTrackReport FormVanishingPoints(const VpTrackOptions& options, const ImageFeatureMap& features,
                                  Reconstruction* model) {
  VpTrackReport report;
  const ViewMap views(*model);
  std::vector<Node> nodes;
  for (const auto& [image_id, of_image] : features) {
    if (!model->images.contains(image_id)) {
      report.dropped["image vanishing point: image without a pose"] +=
          of_image.vanishing_points.size();
      continue;
    }
    ++report.num_images;
    for (Node& node : NodesOfImage(image_id, of_image, *model, views)) {
      nodes.push_back(std::move(node));
    }
  }
  report.num_image_vps = nodes.size();
  TrackSearch search(options, std::move(nodes), report.num_images, &report);
  const std::vector<Track> tracks = search.Run();

  size_t num_members = 0;
  for (const Track& track : tracks) {
    std::optional<group3D_t> id = FindVp(*model, track.direction, options.merge_deg);
    if (id && report.tracks.contains(*id)) {
      ++report.dropped["track: its vanishing point has another"];
      continue;
    }
    if (!id) {
      ++report.num_new_vps;
      id = model->AddGroup3D(VanishingPointType(),
                             {track.direction.x(), track.direction.y(), track.direction.z()});
    }
    VpTrackReport::Track& entry = report.tracks[*id];
    for (const size_t k : track.nodes) entry.members.push_back(search.node(k).id);
    entry.median_deviation_deg = track.median_deviation_deg;
    entry.num_segments = track.num_segments;
    num_members += track.nodes.size();
  }
  report.num_vps = report.tracks.size();
  if (report.num_image_vps > num_members) {
    report.dropped["image vanishing point: in no track"] = report.num_image_vps - num_members;
  }
  return report;
}

}  // namespace holba
