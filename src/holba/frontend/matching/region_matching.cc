// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/region_matching.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tuple>
#include <unordered_map>

#include "holba/base/check.h"
#include "holba/frontend/matching/label_maps.h"

namespace holba {
namespace {

// A group of an image by its position among all groups of the model.
struct GroupPlace {
  image_t image_id;
  group2D_t group2D_idx;
  const GroupType* type;
};

// Votes of pairs of groups, by (smaller position, larger).
class Ballot {
 public:
  explicit Ballot(const std::vector<GroupPlace>& places) : places_(places) {}

  void Vote(uint32_t a, uint32_t b) {
    const GroupPlace &x = places_[a], &y = places_[b];
    if (x.image_id == y.image_id || x.type != y.type) return;
    ++votes_[uint64_t{std::min(a, b)} << 32 | std::max(a, b)];
  }
  const std::unordered_map<uint64_t, uint32_t>& votes() const { return votes_; }

 private:
  const std::vector<GroupPlace>& places_;
  std::unordered_map<uint64_t, uint32_t> votes_;
};

// One vote for each pair of the groups that observe a feature.
void VoteForFeature(std::vector<uint32_t>* groups, Ballot* ballot) {
  std::sort(groups->begin(), groups->end());
  groups->erase(std::unique(groups->begin(), groups->end()), groups->end());
  for (size_t i = 0; i < groups->size(); ++i) {
    for (size_t k = i + 1; k < groups->size(); ++k) ballot->Vote((*groups)[i], (*groups)[k]);
  }
}

}  // namespace

void GroupVotingOptions::Describe(OptionTable* table) const {
  table->Section("GroupVoting");
  table->Field("min_num_votes", &min_num_votes, AtLeast(1),
               "Matched features that two groups must share to be one.");
}

std::vector<GroupMatch> MatchGroupsByVotes(const Reconstruction& model,
                                           const LineMatchMap* line_matches,
                                           const GroupVotingOptions& options,
                                           GroupVotingReport* report) {
  std::vector<GroupPlace> places;
  std::unordered_map<point3D_t, std::vector<uint32_t>> of_point;
  std::unordered_map<line3D_t, std::vector<uint32_t>> of_line;
  // Groups of each segment, for matches.
  std::map<image_t, std::vector<std::vector<uint32_t>>> of_segment;
  for (const auto& [image_id, image] : model.images) {
    if (line_matches != nullptr) of_segment[image_id].resize(image.lines2D.size());
    for (size_t g = 0; g < image.groups2D.size(); ++g) {
      const Group2D& group = image.groups2D[g];
      const uint32_t place = static_cast<uint32_t>(places.size());
      places.push_back({image_id, static_cast<group2D_t>(g), group.type});
      for (const point2D_t idx : group.point2D_idxs) {
        const point3D_t id = image.points2D.at(idx).point3D_id;
        if (id != kNoId) of_point[id].push_back(place);
      }
      for (const line2D_t idx : group.line2D_idxs) {
        const line3D_t id = image.lines2D.at(idx).line3D_id;
        if (id != kNoId) of_line[id].push_back(place);
        if (line_matches != nullptr) of_segment[image_id][idx].push_back(place);
      }
    }
  }
  Ballot ballot(places);
  // The order of the votes does not reach the result: they are counted.
  for (auto& [id, groups] : of_point) VoteForFeature(&groups, &ballot);
  for (auto& [id, groups] : of_line) VoteForFeature(&groups, &ballot);
  if (line_matches != nullptr) {
    for (const auto& [pair, matches] : *line_matches) {
      const Image* image1 = model.images.Find(pair.first);
      const Image* image2 = model.images.Find(pair.second);
      if (image1 == nullptr || image2 == nullptr) continue;
      // A segment with several matches in a group is still one feature.
      std::vector<std::tuple<uint32_t, uint32_t, line2D_t>> votes;
      for (const LineMatch& match : matches) {
        if (match.idx1 >= image1->lines2D.size() || match.idx2 >= image2->lines2D.size()) continue;
        if (image1->lines2D[match.idx1].line3D_id != kNoId &&
            image2->lines2D[match.idx2].line3D_id != kNoId) {
          continue;  // they have voted by their 3D lines, or are not one
        }
        for (const uint32_t a : of_segment[pair.first][match.idx1]) {
          for (const uint32_t b : of_segment[pair.second][match.idx2]) {
            votes.emplace_back(a, b, match.idx1);
          }
        }
      }
      std::sort(votes.begin(), votes.end());
      votes.erase(std::unique(votes.begin(), votes.end()), votes.end());
      for (const auto& [a, b, idx1] : votes) ballot.Vote(a, b);
    }
  }
  std::vector<GroupMatch> result;
  report->num_pairs_with_votes = ballot.votes().size();
  for (const auto& [key, num_votes] : ballot.votes()) {
    if (num_votes < static_cast<uint32_t>(options.min_num_votes)) {
      ++report->dropped["too few votes"];
      continue;
    }
    const GroupPlace* first = &places[key >> 32];
    const GroupPlace* second = &places[key & 0xffffffffu];
    if (first->image_id > second->image_id) std::swap(first, second);
    result.push_back(
        {first->image_id, first->group2D_idx, second->image_id, second->group2D_idx, num_votes});
  }
  std::sort(result.begin(), result.end(), [](const GroupMatch& a, const GroupMatch& b) {
    return std::tie(a.image_id1, a.group2D_idx1, a.image_id2, a.group2D_idx2) <
           std::tie(b.image_id1, b.group2D_idx1, b.image_id2, b.group2D_idx2);
  });
  report->num_matches = result.size();
  return result;
}

void RegionWarpOptions::Describe(OptionTable* table) const {
  table->Section("RegionWarp");
  table->Field("min_overlap", &min_overlap, Between(0, 1),
               "Intersection over union that a warped region and its match must exceed.");
  table->Field("min_intersection_px", &min_intersection_px, AtLeast(0),
               "Area that they must share, in pixels of an image whose long side is 800.");
  table->Field("min_certainty", &min_certainty, Between(0, 1),
               "Correspondences that are less certain count as not seen.");
}

std::vector<RegionMatch> MatchRegionsByWarping(const LabelMap& map1, const LabelMap& map2,
                                               const CorrespondenceField& field,
                                               const RegionWarpOptions& options,
                                               RegionWarpReport* report) {
  const size_t size = static_cast<size_t>(field.width) * static_cast<size_t>(field.height);
  HOLBA_CHECK(field.target.size() == size);
  HOLBA_CHECK(field.certainty.empty() || field.certainty.size() == size);
  std::vector<RegionMatch> result;
  if (map1.empty() || map2.empty() || size == 0) return result;
  std::map<uint16_t, size_t> area1, area2;  // pixels of the field that both images see
  std::map<std::pair<uint16_t, uint16_t>, size_t> both;
  const double to_map2_x = map2.width / field.target_width;
  const double to_map2_y = map2.height / field.target_height;
  for (int y = 0; y < field.height; ++y) {
    const int row1 =
        std::min(map1.height - 1, static_cast<int>((y + 0.5) * map1.height / field.height));
    for (int x = 0; x < field.width; ++x) {
      const size_t at = static_cast<size_t>(y) * field.width + static_cast<size_t>(x);
      if (!field.certainty.empty() && !(field.certainty[at] >= options.min_certainty)) continue;
      const double x2 = std::floor(field.target[at].x() * to_map2_x);
      const double y2 = std::floor(field.target[at].y() * to_map2_y);
      if (!(x2 >= 0.0 && y2 >= 0.0 && x2 < map2.width && y2 < map2.height)) continue;  // or NaN
      const int column1 =
          std::min(map1.width - 1, static_cast<int>((x + 0.5) * map1.width / field.width));
      const uint16_t label1 = map1.labels[static_cast<size_t>(row1) * map1.width + column1];
      const uint16_t label2 =
          map2.labels[static_cast<size_t>(y2) * map2.width + static_cast<size_t>(x2)];
      if (label1 != 0) ++area1[label1];
      if (label2 != 0) ++area2[label2];
      if (label1 != 0 && label2 != 0) ++both[{label1, label2}];
    }
  }
  const double scale = kReferenceLongSidePx / std::max(field.width, field.height);
  for (const auto& [labels, count] : both) {
    const auto type1 = map1.types.find(labels.first);
    const auto type2 = map2.types.find(labels.second);
    if (type1 == map1.types.end() || type2 == map2.types.end()) continue;  // no regions of ours
    const double all = static_cast<double>(area1[labels.first] + area2[labels.second] - count);
    const RegionMatch match{labels.first, labels.second, static_cast<double>(count) / all,
                            static_cast<double>(count) * scale * scale};
    if (type1->second != type2->second) {
      ++report->dropped["of different types"];
    } else if (!(match.intersection_px > options.min_intersection_px)) {
      ++report->dropped["too small an intersection"];
    } else if (!(match.overlap > options.min_overlap)) {
      ++report->dropped["too little overlap"];
    } else {
      result.push_back(match);
    }
  }
  report->num_matches += result.size();
  return result;
}

void FieldInterpolationOptions::Describe(OptionTable* table) const {
  table->Section("FieldInterpolation");
  table->Field("long_side", &long_side, AtLeast(16),
               "Long side of the grid of correspondences that is interpolated from matches.");
  table->Field("max_side_px", &max_side_px, GreaterThan(0),
               "Longest side of a triangle of matches that is filled, of an image whose long side "
               "is 800.");
}

CorrespondenceField InterpolateMatches(
    std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> matches,
    const Eigen::Vector2d& size1, const Eigen::Vector2d& size2,
    const FieldInterpolationOptions& options) {
  HOLBA_CHECK(size1.minCoeff() > 0.0 && size2.minCoeff() > 0.0);
  CorrespondenceField field;
  const double grid_per_px = options.long_side / size1.maxCoeff();
  field.width = std::max(1, static_cast<int>(std::lround(size1.x() * grid_per_px)));
  field.height = std::max(1, static_cast<int>(std::lround(size1.y() * grid_per_px)));
  field.target_width = size2.x();
  field.target_height = size2.y();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  field.target.assign(static_cast<size_t>(field.width) * field.height, {kNan, kNan});

  const auto inside = [](const Eigen::Vector2d& x, const Eigen::Vector2d& size) {
    return x.minCoeff() >= 0.0 && (size - x).minCoeff() >= 0.0;
  };
  cv::Subdiv2D delaunay(cv::Rect(0, 0, static_cast<int>(std::ceil(size1.x())) + 1,
                                 static_cast<int>(std::ceil(size1.y())) + 1));
  std::unordered_map<int, size_t> match_of_vertex;  // the first of several at one place
  for (size_t i = 0; i < matches.size(); ++i) {
    const auto& [x1, x2] = matches[i];
    if (!inside(x1, size1) || !inside(x2, size2)) continue;
    try {
      const int vertex =
          delaunay.insert(cv::Point2f(static_cast<float>(x1.x()), static_cast<float>(x1.y())));
      match_of_vertex.emplace(vertex, i);
    } catch (const cv::Exception&) {
      continue;  // rounding put it on the border of what OpenCV takes
    }
  }
  if (match_of_vertex.size() < 3) return field;

  const double max_side1 = options.max_side_px * size1.maxCoeff() / kReferenceLongSidePx;
  const double max_side2 = options.max_side_px * size2.maxCoeff() / kReferenceLongSidePx;
  const Eigen::Vector2d cell(size1.x() / field.width, size1.y() / field.height);
  std::vector<int> edges;
  delaunay.getLeadingEdgeList(edges);
  for (const int edge : edges) {
    std::array<Eigen::Vector2d, 3> a, b;  // corners in image 1 and 2
    bool known = true;
    int e = edge;
    for (int k = 0; k < 3; ++k) {
      const auto it = match_of_vertex.find(delaunay.edgeOrg(e));
      if (it == match_of_vertex.end()) {
        known = false;  // one of the corners that OpenCV adds around everything
        break;
      }
      std::tie(a[k], b[k]) = matches[it->second];
      e = delaunay.getEdge(e, cv::Subdiv2D::NEXT_AROUND_LEFT);
    }
    if (!known || e != edge) continue;
    double longest1 = 0.0, longest2 = 0.0;
    for (int k = 0; k < 3; ++k) {
      longest1 = std::max(longest1, (a[k] - a[(k + 1) % 3]).norm());
      longest2 = std::max(longest2, (b[k] - b[(k + 1) % 3]).norm());
    }
    if (longest1 > max_side1 || longest2 > max_side2) continue;
    Eigen::Matrix2d A, B;
    A << a[1] - a[0], a[2] - a[0];
    B << b[1] - b[0], b[2] - b[0];
    const double area1 = A.determinant(), area2 = B.determinant();
    constexpr double kSmallestAreaPx = 1e-6;
    if (std::abs(area1) < kSmallestAreaPx || area1 * area2 <= 0.0) continue;
    const Eigen::Matrix2d affine = B * A.inverse();
    const Eigen::Matrix2d inverse = A.inverse();
    // Grid points in the triangle, its border included: neighbours agree there.
    Eigen::Vector2d low = a[0].cwiseMin(a[1]).cwiseMin(a[2]);
    Eigen::Vector2d high = a[0].cwiseMax(a[1]).cwiseMax(a[2]);
    low = low.cwiseQuotient(cell);
    high = high.cwiseQuotient(cell);
    const int x0 = std::max(0, static_cast<int>(std::ceil(low.x() - 0.5)));
    const int y0 = std::max(0, static_cast<int>(std::ceil(low.y() - 0.5)));
    const int x1 = std::min(field.width - 1, static_cast<int>(std::floor(high.x() - 0.5)));
    const int y1 = std::min(field.height - 1, static_cast<int>(std::floor(high.y() - 0.5)));
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const Eigen::Vector2d p = cell.cwiseProduct(Eigen::Vector2d(x + 0.5, y + 0.5)) - a[0];
        const Eigen::Vector2d weights = inverse * p;
        constexpr double kRounding = 1e-9;
        if (weights.minCoeff() < -kRounding || weights.sum() > 1.0 + kRounding) continue;
        field.target[static_cast<size_t>(y) * field.width + static_cast<size_t>(x)] =
            (b[0] + affine * p).cast<float>();
      }
    }
  }
  return field;
}

}  // namespace holba
