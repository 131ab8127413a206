// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/junctions.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <tuple>
#include <utility>

#include "holba/base/threads.h"
#include "holba/estimation/points/point_triangulation.h"
#include "holba/estimation/wireframe/point_on_line.h"
#include "holba/geometry/angle.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

// Segment of a 3D line in one image. Images and lines are named by their positions in the model.
struct Segment {
  uint32_t line;
  LineSegment2d ideal;
  Eigen::Vector2d along;  // unit
  double length;
  Eigen::Vector2d low, high;  // bounds, widened by the overshoot
};

// Two segments of one image that meet.
struct Contact {
  uint32_t line1, line2;  // line1 < line2
  uint32_t image;
  double overshoot_px;          // of both together
  bool is_corner;               // both end there: neither runs on, as a line that covers another
  uint32_t segment1, segment2;  // positions in the image's list
};

std::optional<Eigen::Vector2d> Intersection(const Segment& s1, const Segment& s2) {
  const double cross = s1.along.x() * s2.along.y() - s1.along.y() * s2.along.x();
  if (cross == 0.0) return std::nullopt;
  const Eigen::Vector2d between = s2.ideal.start - s1.ideal.start;
  const double u = (between.x() * s2.along.y() - between.y() * s2.along.x()) / cross;
  return Eigen::Vector2d(s1.ideal.start + u * s1.along);
}

// How far a point of the segment's line lies beyond the segment.
double Overshoot(const Segment& s, const Eigen::Vector2d& x) {
  const double u = s.along.dot(x - s.ideal.start);
  return std::max({0.0, -u, u - s.length});
}

// Distance of a place on the segment's line from the nearer end.
double DistanceToEnd(const Segment& s, const Eigen::Vector2d& x) {
  const double u = s.along.dot(x - s.ideal.start);
  return std::min(std::abs(u), std::abs(u - s.length));
}

std::vector<Segment> SegmentsOfLines(const Reconstruction& model, const Image& image,
                                     const IdealView& view, double max_overshoot_px) {
  std::vector<Segment> segments;
  for (const Line2D& line2D : image.lines2D) {
    if (line2D.line3D_id == kNoId) continue;
    const auto ideal = view.ToIdeal(line2D.segment);
    if (!ideal) continue;
    const double length = ideal->Length();
    if (!(length > 0.0)) continue;
    Segment s{.line = static_cast<uint32_t>(model.lines3D.IndexOf(line2D.line3D_id)),
              .ideal = *ideal,
              .along = (ideal->end - ideal->start) / length,
              .length = length};
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(max_overshoot_px);
    s.low = ideal->start.cwiseMin(ideal->end) - margin;
    s.high = ideal->start.cwiseMax(ideal->end) + margin;
    segments.push_back(s);
  }
  return segments;
}

// All pairs of segments of different lines that meet, by a sweep over their bounds in x.
std::vector<Contact> FindContacts(const std::vector<Segment>& segments, uint32_t image,
                                  const JunctionOptions& options) {
  const double min_sine = std::sin(DegToRad(options.min_angle_deg));
  std::vector<uint32_t> order(segments.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](uint32_t i, uint32_t j) {
    return std::pair(segments[i].low.x(), i) < std::pair(segments[j].low.x(), j);
  });
  std::vector<Contact> contacts;
  for (size_t a = 0; a < order.size(); ++a) {
    const Segment& s1 = segments[order[a]];
    for (size_t b = a + 1; b < order.size(); ++b) {
      const Segment& s2 = segments[order[b]];
      if (s2.low.x() > s1.high.x()) break;
      if (s2.low.y() > s1.high.y() || s1.low.y() > s2.high.y() || s1.line == s2.line) continue;
      const double sine = s1.along.x() * s2.along.y() - s1.along.y() * s2.along.x();
      if (std::abs(sine) < min_sine) continue;
      const auto x = Intersection(s1, s2);
      if (!x) continue;
      const double overshoot1 = Overshoot(s1, *x), overshoot2 = Overshoot(s2, *x);
      if (std::max(overshoot1, overshoot2) > options.max_overshoot_px) continue;
      Contact contact{.line1 = s1.line,
                      .line2 = s2.line,
                      .image = image,
                      .overshoot_px = overshoot1 + overshoot2,
                      .is_corner = std::max(DistanceToEnd(s1, *x), DistanceToEnd(s2, *x)) <=
                                   options.max_overshoot_px,
                      .segment1 = order[a],
                      .segment2 = order[b]};
      if (contact.line1 > contact.line2) {
        std::swap(contact.line1, contact.line2);
        std::swap(contact.segment1, contact.segment2);
      }
      contacts.push_back(contact);
    }
  }
  return contacts;
}

// Two lines and where they meet: at most one contact for each image.
struct LinePair {
  uint32_t line1, line2;
  std::vector<Contact> contacts;
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  bool is_uncertain = false;  // wider apart than the gap, where their covariances allow it
};

// Several pairs at one place.
struct Cluster {
  Eigen::Vector3d seed = Eigen::Vector3d::Zero();  // of the pair with the most images
  std::vector<uint32_t> lines;
  std::vector<const LinePair*> pairs;
};

class JunctionFinder {
 public:
  JunctionFinder(const JunctionOptions& options, int num_threads, const Reconstruction& model)
      : options_(options),
        in_space_{options.max_gap_gsd, options.max_uncertain_gap_gsd, options.sigma_px},
        num_threads_(num_threads),
        model_(model),
        views_(model),
        segments_(views_.size()) {
    triangulation_.max_error_px = options.max_error_px;
    triangulation_.min_angle_deg = options.min_triangulation_angle_deg;
    triangulation_.min_num_views = static_cast<size_t>(std::max(2, options.min_num_images));
  }

  void Find(JunctionReport* report) {
    std::vector<LinePair> pairs = FindPairs(report);
    CheckPairs(&pairs, report);
    const std::vector<Cluster> clusters = Merge(pairs);
    found_.resize(clusters.size());
    std::vector<std::map<std::string, size_t>> dropped(clusters.size());
    ParallelTasks(num_threads_, clusters.size(),
                  [&](size_t i) { found_[i] = TriangulateCluster(clusters[i], &dropped[i]); });
    for (const auto& some : dropped) {
      for (const auto& [reason, count] : some) report->dropped[reason] += count;
    }
  }

  void AddTo(Reconstruction* model, JunctionReport* report) const {
    for (const auto& found : found_) {
      if (!found) continue;
      Junction junction{.num_images = found->observations.size(),
                        .is_uncertain = found->is_uncertain};
      Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
      for (uint32_t line : found->lines) {
        const auto& [line3D_id, line3D] = model->lines3D.begin()[line];
        junction.line3D_ids.push_back(line3D_id);
        rgb += Eigen::Vector3d(line3D.rgb[0], line3D.rgb[1], line3D.rgb[2]);
      }
      std::sort(junction.line3D_ids.begin(), junction.line3D_ids.end());
      rgb /= static_cast<double>(found->lines.size());
      junction.point3D_id = AddPointOfStructure(
          found->xyz, PointOrigin::kJunction,
          {static_cast<uint8_t>(std::lround(rgb.x())), static_cast<uint8_t>(std::lround(rgb.y())),
           static_cast<uint8_t>(std::lround(rgb.z()))},
          found->observations, model);
      report->num_observations += junction.num_images;
      report->junctions.push_back(std::move(junction));
    }
  }

 private:
  struct Found {
    Eigen::Vector3d xyz;
    bool is_uncertain = false;
    std::vector<uint32_t> lines;
    std::vector<std::pair<image_t, Eigen::Vector2d>> observations;  // pixels of the photographs
  };
  struct ClusterViews {
    std::vector<PointView> views;
    std::vector<uint32_t> images;
  };

  const PlueckerLine& LineOf(uint32_t line) const {
    return model_.lines3D.begin()[line].second.line;
  }

  std::vector<LinePair> FindPairs(JunctionReport* report) {
    std::vector<std::vector<Contact>> by_image(views_.size());
    ParallelTasks(num_threads_, views_.size(), [&](size_t i) {
      const Image& image = model_.images.begin()[i].second;
      segments_[i] = SegmentsOfLines(model_, image, views_[i], options_.max_overshoot_px);
      by_image[i] = FindContacts(segments_[i], static_cast<uint32_t>(i), options_);
    });
    std::vector<Contact> contacts;
    for (const auto& some : by_image) contacts.insert(contacts.end(), some.begin(), some.end());
    std::sort(contacts.begin(), contacts.end(), [](const Contact& a, const Contact& b) {
      return std::tie(a.line1, a.line2, a.image, a.overshoot_px, a.segment1, a.segment2) <
             std::tie(b.line1, b.line2, b.image, b.overshoot_px, b.segment1, b.segment2);
    });
    std::vector<LinePair> pairs;
    for (const Contact& contact : contacts) {
      if (pairs.empty() || pairs.back().line1 != contact.line1 ||
          pairs.back().line2 != contact.line2) {
        pairs.push_back({contact.line1, contact.line2, {}});
      }
      std::vector<Contact>& of_pair = pairs.back().contacts;
      // Of several segments of one line in an image, the pair that meets best counts.
      if (of_pair.empty() || of_pair.back().image != contact.image) of_pair.push_back(contact);
    }
    report->num_line_pairs = pairs.size();
    report->dropped["pairs of lines that meet in too few images"] = std::erase_if(
        pairs,
        [&](const LinePair& pair) { return pair.contacts.size() < triangulation_.min_num_views; });
    return pairs;
  }

  PointView ViewOf(const Contact& contact) const {
    const std::vector<Segment>& segments = segments_[contact.image];
    return {&views_[contact.image],
            *Intersection(segments[contact.segment1], segments[contact.segment2])};
  }

  // Removes the pairs that do not meet in space, and computes the points of the others.
  void CheckPairs(std::vector<LinePair>* pairs, JunctionReport* report) const {
    const double max_cosine = std::cos(DegToRad(options_.min_angle_deg));
    std::vector<const char*> reasons(pairs->size(), nullptr);
    ParallelTasks(num_threads_, pairs->size(), [&](size_t i) {
      LinePair& pair = (*pairs)[i];
      const PlueckerLine &line1 = LineOf(pair.line1), &line2 = LineOf(pair.line2);
      if (std::abs(line1.direction.dot(line2.direction)) > max_cosine) {
        reasons[i] = "pairs of lines at a small angle in space";
        return;
      }
      std::vector<PointView> views;
      for (const Contact& contact : pair.contacts) views.push_back(ViewOf(contact));
      PointTriangulationFailure failure;
      const auto point = TriangulatePoint(views, triangulation_, &failure);
      if (!point) {
        reasons[i] = failure == PointTriangulationFailure::kSmallAngle
                         ? "pairs of lines seen under a small angle of triangulation"
                         : "pairs of lines whose intersections are not one point";
        return;
      }
      pair.xyz = point->xyz;
      // Distance of skew lines: of unit directions and moments.
      const double gap =
          std::abs(line1.direction.dot(line2.moment) + line2.direction.dot(line1.moment)) /
          line1.direction.cross(line2.direction).norm();
      const double pixels_per_length = PixelsPerLength(views, pair.xyz);
      if (gap * pixels_per_length <= options_.max_gap_gsd) return;
      pair.is_uncertain = true;
      const auto num_corners =
          static_cast<size_t>(std::count_if(pair.contacts.begin(), pair.contacts.end(),
                                            [](const Contact& c) { return c.is_corner; }));
      if (num_corners < triangulation_.min_num_views) {
        reasons[i] = "pairs of lines that pass each other in space";
        return;
      }
      for (uint32_t line : {pair.line1, pair.line2}) {
        if (TestPointOnLine(model_, views_, in_space_, pair.xyz, point->covariance_1px,
                            pixels_per_length,
                            model_.lines3D.begin()[line].second) == PointOnLine::kApart) {
          reasons[i] = "pairs of lines that pass each other in space";
          return;
        }
      }
    });
    size_t i = 0;
    std::erase_if(*pairs, [&](const LinePair&) {
      const char* reason = reasons[i++];
      if (reason != nullptr) ++report->dropped[reason];
      return reason != nullptr;
    });
  }

  // Pairs that share a line and meet at one place, from the best seen on: a pair joins the cluster
  // whose seed explains its intersections. Compared with seeds, not with members: a row of narrow
  // bars is no chain of one corner.
  std::vector<Cluster> Merge(const std::vector<LinePair>& pairs) const {
    std::vector<size_t> order(pairs.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](size_t i, size_t j) {
      return pairs[i].contacts.size() > pairs[j].contacts.size();
    });
    std::vector<Cluster> clusters;
    std::vector<std::vector<size_t>> clusters_of_line(model_.lines3D.size());
    for (size_t i : order) {
      const LinePair& pair = pairs[i];
      std::vector<size_t> candidates = clusters_of_line[pair.line1];
      candidates.insert(candidates.end(), clusters_of_line[pair.line2].begin(),
                        clusters_of_line[pair.line2].end());
      std::optional<size_t> nearest;
      double least_px = options_.max_error_px;
      for (size_t candidate : candidates) {
        double sum_px = 0.0;
        for (const Contact& contact : pair.contacts) {
          const PointView at = ViewOf(contact);
          const auto x = at.view->Project(clusters[candidate].seed);
          // A seed behind a camera that sees the pair is another place.
          sum_px += x ? (*x - at.ideal).norm() : 1e9;
        }
        const double mean_px = sum_px / static_cast<double>(pair.contacts.size());
        if (mean_px < least_px) {
          least_px = mean_px;
          nearest = candidate;
        }
      }
      if (!nearest) {
        nearest = clusters.size();
        clusters.push_back({.seed = pair.xyz});
      }
      Cluster& cluster = clusters[*nearest];
      cluster.pairs.push_back(&pair);
      for (uint32_t line : {pair.line1, pair.line2}) {
        if (std::find(cluster.lines.begin(), cluster.lines.end(), line) != cluster.lines.end()) {
          continue;
        }
        cluster.lines.push_back(line);
        clusters_of_line[line].push_back(*nearest);
      }
    }
    return clusters;
  }

  // The common intersection, in each image, of the segments that meet there, in ideal pixels.
  ClusterViews ViewsOf(const Cluster& cluster) const {
    std::vector<std::pair<uint32_t, uint32_t>> members;  // image, segment
    for (const LinePair* pair : cluster.pairs) {
      for (const Contact& contact : pair->contacts) {
        members.emplace_back(contact.image, contact.segment1);
        members.emplace_back(contact.image, contact.segment2);
      }
    }
    std::sort(members.begin(), members.end());
    members.erase(std::unique(members.begin(), members.end()), members.end());
    ClusterViews result;
    for (size_t begin = 0, end = 0; begin < members.size(); begin = end) {
      const uint32_t image = members[begin].first;
      while (end < members.size() && members[end].first == image) ++end;
      const auto x = CommonIntersection(image, {members.data() + begin, end - begin}, cluster.seed);
      if (!x) continue;
      result.views.push_back({&views_[image], *x});
      result.images.push_back(image);
    }
    return result;
  }

  // Least squares, each segment's line weighted by the precision that it has at that place: with
  // ends of equal noise the variance at u (0 and 1 at the ends) is (1 - u)^2 + u^2 of theirs.
  std::optional<Eigen::Vector2d> CommonIntersection(
      uint32_t image, std::span<const std::pair<uint32_t, uint32_t>> members,
      const Eigen::Vector3d& seed) const {
    const auto near = views_[image].Project(seed);
    if (!near) return std::nullopt;
    Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
    for (const auto& [unused, index] : members) {
      const Segment& s = segments_[image][index];
      const double u = s.along.dot(*near - s.ideal.start) / s.length;
      const double weight = 1.0 / ((1.0 - u) * (1.0 - u) + u * u);
      const Eigen::Vector2d normal(-s.along.y(), s.along.x());
      // Relative to the seed's image, where rounding is small.
      A += weight * normal * normal.transpose();
      b += weight * normal * normal.dot(s.ideal.start - *near);
    }
    if (!(A.determinant() > 0.0)) return std::nullopt;
    return Eigen::Vector2d(*near + A.inverse() * b);
  }

  static bool HasUncertainPair(const Cluster& cluster, uint32_t line) {
    return std::any_of(cluster.pairs.begin(), cluster.pairs.end(), [&](const LinePair* pair) {
      return pair->is_uncertain && (pair->line1 == line || pair->line2 == line);
    });
  }

  // Removes the lines that pass beside the junction, the worst first, because each line takes part
  // in the intersections.
  std::optional<Found> TriangulateCluster(Cluster cluster,
                                          std::map<std::string, size_t>* dropped) const {
    while (true) {
      const ClusterViews seen = ViewsOf(cluster);
      const auto point = TriangulatePoint(seen.views, triangulation_);
      if (!point) {
        ++(*dropped)["junctions whose observations are not one point"];
        return std::nullopt;
      }
      const double pixels_per_length = PixelsPerLength(seen.views, point->xyz);
      std::optional<uint32_t> worst;
      double worst_gsd = options_.max_gap_gsd;
      bool is_uncertain = false;
      for (uint32_t line : cluster.lines) {
        const Line3D& line3D = model_.lines3D.begin()[line].second;
        const double gsd = line3D.line.Distance(point->xyz) * pixels_per_length;
        if (gsd <= worst_gsd) continue;
        if (HasUncertainPair(cluster, line) &&
            TestPointOnLine(model_, views_, in_space_, point->xyz, point->covariance_1px,
                            pixels_per_length, line3D) != PointOnLine::kApart) {
          is_uncertain = true;
          continue;
        }
        worst_gsd = gsd;
        worst = line;
      }
      if (worst) {
        const uint32_t line = *worst;
        ++(*dropped)["lines that pass beside their junction"];
        std::erase_if(cluster.pairs, [&](const LinePair* pair) {
          return pair->line1 == line || pair->line2 == line;
        });
        std::erase_if(cluster.lines, [&](uint32_t other) {
          return std::none_of(
              cluster.pairs.begin(), cluster.pairs.end(),
              [&](const LinePair* pair) { return pair->line1 == other || pair->line2 == other; });
        });
        if (cluster.pairs.empty()) {
          ++(*dropped)["junctions left with fewer than two lines"];
          return std::nullopt;
        }
        continue;
      }
      return Observe(cluster, seen, *point, is_uncertain, dropped);
    }
  }

  std::optional<Found> Observe(const Cluster& cluster, const ClusterViews& seen,
                               const TriangulatedPoint& point, bool is_uncertain,
                               std::map<std::string, size_t>* dropped) const {
    Found found{
        .xyz = point.xyz, .is_uncertain = is_uncertain, .lines = cluster.lines, .observations = {}};
    for (size_t i = 0; i < seen.views.size(); ++i) {
      const PointView& at = seen.views[i];
      const auto pixel = at.view->ToPixel(at.ideal);
      const Camera& camera = at.view->camera();
      if (!point.is_inlier[i]) {
        ++(*dropped)["observations far from their junction"];
      } else if (!pixel || !(pixel->x() >= 0.0 && pixel->x() <= camera.width && pixel->y() >= 0.0 &&
                             pixel->y() <= camera.height)) {
        ++(*dropped)["observations outside the photograph"];
      } else {
        found.observations.emplace_back(model_.images.begin()[seen.images[i]].first, *pixel);
      }
    }
    if (found.observations.size() < triangulation_.min_num_views) {
      ++(*dropped)["junctions observed in too few images"];
      return std::nullopt;
    }
    return found;
  }

  const JunctionOptions& options_;
  const PointOnLineOptions in_space_;
  const int num_threads_;
  const Reconstruction& model_;
  PointTriangulationOptions triangulation_;
  const ViewMap views_;
  std::vector<std::vector<Segment>> segments_;  // of lines, by image
  std::vector<std::optional<Found>> found_;
};

}  // namespace

void JunctionOptions::Describe(OptionTable* table) const {
  table->Section("Junctions");
  table->Field("max_overshoot_px", &max_overshoot_px, AtLeast(0),
               "Farthest intersection beyond the ends of segments that meet, pixels.");
  table->Field("min_angle_deg", &min_angle_deg, Between(0, 90),
               "Least angle between lines that meet, in images and in space.");
  table->Field("min_num_images", &min_num_images, AtLeast(2),
               "Images in which two lines must meet.");
  table->Field("max_gap_gsd", &max_gap_gsd, GreaterThan(0),
               "Farthest distance between lines that meet, in pixels of the nearest view.");
  table->Field("max_uncertain_gap_gsd", &max_uncertain_gap_gsd, AtLeast(0),
               "The same where covariances allow it and both lines end at the junction.");
  table->Field("sigma_px", &sigma_px, GreaterThan(0),
               "Standard deviation of ends of segments in that test, pixels.");
  table->Field("max_error_px", &max_error_px, GreaterThan(0),
               "Largest reprojection error of an observation of a junction.");
  table->Field("min_triangulation_angle_deg", &min_triangulation_angle_deg, Between(0, 90),
               "Least angle between two rays of a junction.");
}

JunctionReport TriangulateJunctions(const JunctionOptions& options, int num_threads,
                                    Reconstruction* model) {
  JunctionReport report;
  JunctionFinder finder(options, num_threads, *model);
  finder.Find(&report);
  finder.AddTo(model, &report);
  std::erase_if(report.dropped, [](const auto& entry) { return entry.second == 0; });
  return report;
}

}  // namespace holba
