// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/line_matching.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "holba/base/check.h"
#include "holba/geometry/angle.h"

namespace holba {
namespace {

constexpr float kDescriptorScale = 16384.0f;  // sums of 72 products stay below 2^31
// Shared points count by exp(-distance / this) for a segment, and not at all beyond kReach times
// it.
constexpr float kPointScalePx = 10.0f;
constexpr float kReach = 4.0f;
// Instead of (1 - cosine) / 2 if a segment has no shared point in reach.
constexpr float kDistanceWithoutPoints = 0.3f;
// From so many shared points on the rotation between the images is estimated.
constexpr size_t kMinPointsForRotation = 8;
constexpr float kEpipolarErrorPx = 1.0f;

// Weights of the shared points for the segments of one image, each segment's of unit norm, by
// segment and by point.
struct Signatures {
  struct Entry {
    uint32_t idx;  // of the point, or the segment
    float weight;
  };
  std::vector<std::vector<Entry>> of_segment;
  std::vector<std::vector<Entry>> of_point;
};

// Positions of the shared points in one image, found by their distance from a segment.
class PointsAround {
 public:
  template <typename GetPosition>
  PointsAround(const std::vector<SharedPoint>& points, const GetPosition& position)
      : by_x_(points.size()) {
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2f p = position(points[i]).template cast<float>();
      by_x_[i] = {p.x(), p.y(), static_cast<uint32_t>(i)};
    }
    std::sort(by_x_.begin(), by_x_.end(), [](const Point& a, const Point& b) {
      return std::pair(a.x, a.idx) < std::pair(b.x, b.idx);
    });
  }

  // Calls `found` with the index and the distance of each within `reach_px`.
  template <typename Found>
  void Visit(const LineSegment2d& segment, float reach_px, const Found& found) const {
    const Eigen::Vector2f start = segment.start.cast<float>();
    const Eigen::Vector2f d = (segment.end - segment.start).cast<float>();
    const Eigen::Vector2f low = start.cwiseMin(start + d).array() - reach_px;
    const Eigen::Vector2f high = start.cwiseMax(start + d).array() + reach_px;
    const float inverse_square = 1.0f / std::max(d.squaredNorm(), 1e-12f);
    for (auto point = std::lower_bound(by_x_.begin(), by_x_.end(), low.x(),
                                       [](const Point& p, float x) { return p.x < x; });
         point != by_x_.end() && point->x <= high.x(); ++point) {
      if (point->y < low.y() || point->y > high.y()) continue;
      const Eigen::Vector2f p(point->x, point->y);
      const float along = std::clamp((p - start).dot(d) * inverse_square, 0.0f, 1.0f);
      const float square = (p - start - along * d).squaredNorm();
      if (square <= reach_px * reach_px) found(point->idx, std::sqrt(square));
    }
  }

  // Distance of the `count`-th nearest; kPointScalePx if that many are nearer, or there are fewer.
  float ScalePx(const LineSegment2d& segment, size_t count) const {
    if (count == 0 || by_x_.size() < count) return kPointScalePx;
    size_t num_near = 0;
    Visit(segment, kPointScalePx, [&](uint32_t, float) { ++num_near; });
    if (num_near >= count) return kPointScalePx;
    std::vector<float> distances;
    Visit(segment, std::numeric_limits<float>::infinity(),
          [&](uint32_t, float distance) { distances.push_back(distance); });
    std::nth_element(distances.begin(), distances.begin() + (count - 1), distances.end());
    return std::max(kPointScalePx, distances[count - 1]);
  }

 private:
  struct Point {
    float x, y;
    uint32_t idx;
  };
  std::vector<Point> by_x_;
};

template <typename GetPosition>
Signatures MakeSignatures(const std::vector<LineSegment2d>& segments,
                          const std::vector<SharedPoint>& points, int num_near_points,
                          const GetPosition& position) {
  const PointsAround around(points, position);
  Signatures signatures;
  signatures.of_segment.resize(segments.size());
  signatures.of_point.resize(points.size());
  for (size_t i = 0; i < segments.size(); ++i) {
    auto& entries = signatures.of_segment[i];
    float squares = 0.0f;
    const float scale_px = around.ScalePx(segments[i], static_cast<size_t>(num_near_points));
    around.Visit(segments[i], kReach * scale_px, [&](uint32_t idx, float distance) {
      const float weight = std::exp(-distance / scale_px);
      entries.push_back({idx, weight});
      squares += weight * weight;
    });
    const float inverse_norm = squares > 0.0f ? 1.0f / std::sqrt(squares) : 0.0f;
    for (Signatures::Entry& entry : entries) {
      entry.weight *= inverse_norm;
      signatures.of_point[entry.idx].push_back({static_cast<uint32_t>(i), entry.weight});
    }
  }
  return signatures;
}

// Rotation of the second photograph against the first, from the shared points: of the similarity
// that takes one set of points to the other. Empty: too few points, or they agree on none.
std::optional<double> RotationBetween(const std::vector<SharedPoint>& points) {
  if (points.size() < kMinPointsForRotation) return std::nullopt;
  Eigen::Vector2d mean1 = Eigen::Vector2d::Zero(), mean2 = Eigen::Vector2d::Zero();
  for (const auto& [p1, p2] : points) {
    mean1 += p1;
    mean2 += p2;
  }
  mean1 /= static_cast<double>(points.size());
  mean2 /= static_cast<double>(points.size());
  double cosine = 0, sine = 0, squares1 = 0, squares2 = 0;
  for (const auto& [p1, p2] : points) {
    const Eigen::Vector2d a = p1 - mean1, b = p2 - mean2;
    cosine += a.dot(b);
    sine += a.x() * b.y() - a.y() * b.x();
    squares1 += a.squaredNorm();
    squares2 += b.squaredNorm();
  }
  if (!(std::hypot(cosine, sine) > 0.5 * std::sqrt(squares1 * squares2))) return std::nullopt;
  return std::atan2(sine, cosine);
}

// Whether the second segment and what lies between the epipolar lines of the first one's ends
// overlap, along the second, by at least that intersection over union. Crossings of an epipolar
// line are as uncertain as its angle to the segment is small: each may be kEpipolarErrorPx off.
// Lines are of unit normal.
bool OverlapsAlongEpipolarLines(const Eigen::Vector3f& line_of_start,
                                const Eigen::Vector3f& line_of_end, const LineSegment2d& segment2,
                                float min_overlap) {
  const Eigen::Vector2f a = segment2.start.cast<float>();
  const Eigen::Vector2f d = (segment2.end - segment2.start).cast<float>();
  // Distances of both ends from both lines, on one side of each positive.
  const Eigen::Vector2f at_a(line_of_start.head<2>().dot(a) + line_of_start.z(),
                             line_of_end.head<2>().dot(a) + line_of_end.z());
  const Eigen::Vector2f along(line_of_start.head<2>().dot(d), line_of_end.head<2>().dot(d));
  float low = std::numeric_limits<float>::infinity(), high = -low;
  float low_slack = 0.0f, high_slack = 0.0f;
  for (int k = 0; k < 2; ++k) {
    const float size = std::max(std::abs(along[k]), 1e-6f);
    const float t = -at_a[k] / std::copysign(size, along[k]);
    if (t < low) {
      low = t;
      low_slack = kEpipolarErrorPx / size;
    }
    if (t > high) {
      high = t;
      high_slack = kEpipolarErrorPx / size;
    }
  }
  // The best that the errors allow: towards the ends of the segment, 0 and 1.
  const auto toward = [](float t, float target, float slack) {
    return t < target ? std::min(t + slack, target) : std::max(t - slack, target);
  };
  low = toward(low, 0.0f, low_slack);
  high = toward(high, 1.0f, high_slack);
  if (!(high > 0.0f && low < 1.0f && low < high)) return false;
  return std::min(high, 1.0f) - std::max(low, 0.0f) >=
         min_overlap * (std::max(high, 1.0f) - std::min(low, 0.0f));
}

// Ends of segments in ideal pixels, laid out for a test of all of them; not a number: no ideal
// pixel.
struct SegmentEnds {
  std::vector<float> start_x, start_y, end_x, end_y;

  explicit SegmentEnds(const std::vector<std::optional<LineSegment2d>>& ideal) {
    const size_t size = ideal.size();
    for (auto* values : {&start_x, &start_y, &end_x, &end_y})
      values->assign(size, std::numeric_limits<float>::quiet_NaN());
    for (size_t i = 0; i < size; ++i) {
      if (!ideal[i]) continue;
      start_x[i] = static_cast<float>(ideal[i]->start.x());
      start_y[i] = static_cast<float>(ideal[i]->start.y());
      end_x[i] = static_cast<float>(ideal[i]->end.x());
      end_y[i] = static_cast<float>(ideal[i]->end.y());
    }
  }

  // Which segments lie beside the band between two epipolar lines: most do, and need no further
  // look. The lines' normals point to one side.
  void FindBeside(const Eigen::Vector3f& a, const Eigen::Vector3f& b,
                  std::vector<uint8_t>* beside) const {
    const size_t size = start_x.size();
    const float *sx = start_x.data(), *sy = start_y.data(), *ex = end_x.data(), *ey = end_y.data();
    const float ax = a.x(), ay = a.y(), az = a.z(), bx = b.x(), by = b.y(), bz = b.z();
    uint8_t* out = beside->data();
    for (size_t i = 0; i < size; ++i) {
      const float as = ax * sx[i] + ay * sy[i] + az, ae = ax * ex[i] + ay * ey[i] + az;
      const float bs = bx * sx[i] + by * sy[i] + bz, be = bx * ex[i] + by * ey[i] + bz;
      const float least = std::min(std::min(as, ae), std::min(bs, be));
      const float greatest = std::max(std::max(as, ae), std::max(bs, be));
      out[i] = (least > kEpipolarErrorPx) | (greatest < -kEpipolarErrorPx);
    }
  }
};

// In the second image, with unit normal.
Eigen::Vector3f EpipolarLine(const Eigen::Matrix3d& F, const Eigen::Vector2d& ideal1) {
  const Eigen::Vector3d line = F * ideal1.homogeneous();
  return (line / line.head<2>().norm()).cast<float>();
}

Eigen::Vector2f Direction(const LineSegment2d& segment) {
  return (segment.end - segment.start).normalized().cast<float>();
}

// The k smallest of a list that is filled one by one.
class KNearest {
 public:
  explicit KNearest(size_t k) : k_(k) {}
  void Add(float distance, uint32_t idx) {
    const std::pair entry(distance, idx);
    if (entries_.size() == k_) {
      if (!(entry < entries_.back())) return;
      entries_.pop_back();
    }
    entries_.insert(std::upper_bound(entries_.begin(), entries_.end(), entry), entry);
  }
  const std::vector<std::pair<float, uint32_t>>& entries() const { return entries_; }

 private:
  size_t k_;
  std::vector<std::pair<float, uint32_t>> entries_;
};

}  // namespace

void LineMatchingOptions::Describe(OptionTable* table) const {
  table->Section("LineMatching");
  table->Field("num_matches", &num_matches, AtLeast(1),
               "Matches kept for each segment of a pair of images.");
  table->Field("max_descriptor_distance", &max_descriptor_distance, Between(0.0, 2.0),
               "Largest distance of matched segments' descriptors.");
  table->Field("max_rotation_deg", &max_rotation_deg, Between(0.0, 180.0),
               "Largest turn of a segment against the rotation between the images.");
  table->Field("num_near_points", &num_near_points, AtLeast(0),
               "Shared points that tell where a segment is, however far they are; 0: those within "
               "40 pixels only.");
  table->Field("min_epipolar_overlap", &min_epipolar_overlap, Between(0.0, 1.0),
               "Least overlap of matched segments along the epipolar lines.");
}

MatchableSegments MakeMatchable(const ImageFeatures& features, const Camera& camera) {
  HOLBA_CHECK_MSG(
      features.segment_descriptors.size() == features.segments.size() * kSegmentDescriptorSize,
      "a descriptor for each segment");
  MatchableSegments result;
  result.segments = features.segments;
  result.ideal.reserve(features.segments.size());
  for (const LineSegment2d& segment : features.segments) {
    const auto start = IdealPixel(*camera.model, camera.params.data(), segment.start);
    const auto end = IdealPixel(*camera.model, camera.params.data(), segment.end);
    if (start && end) {
      result.ideal.push_back(LineSegment2d{*start, *end});
    } else {
      result.ideal.push_back(std::nullopt);
    }
  }
  result.descriptors.reserve(features.segment_descriptors.size());
  for (const float value : features.segment_descriptors)
    result.descriptors.push_back(
        static_cast<int16_t>(std::lround(std::clamp(value, -1.0f, 1.0f) * kDescriptorScale)));
  return result;
}

std::vector<LineMatch> MatchSegments(const LineMatchingOptions& options,
                                     const MatchableSegments& segments1,
                                     const MatchableSegments& segments2,
                                     const std::vector<SharedPoint>& shared_points,
                                     const std::optional<Eigen::Matrix3d>& F) {
  const size_t n1 = segments1.segments.size(), n2 = segments2.segments.size();
  const Signatures signatures1 =
      MakeSignatures(segments1.segments, shared_points, options.num_near_points,
                     [](const SharedPoint& p) { return p.first; });
  const Signatures signatures2 =
      MakeSignatures(segments2.segments, shared_points, options.num_near_points,
                     [](const SharedPoint& p) { return p.second; });
  const std::optional<double> rotation = RotationBetween(shared_points);
  const Eigen::Rotation2Df turn(static_cast<float>(rotation.value_or(0.0)));
  const float min_cosine =
      static_cast<float>(rotation ? std::cos(DegToRad(options.max_rotation_deg)) : -2.0);
  std::vector<Eigen::Vector2f> directions2(n2);
  for (size_t j = 0; j < n2; ++j) directions2[j] = Direction(segments2.segments[j]);
  // |a - b|^2 = 2 - 2 a.b
  const float max_distance = static_cast<float>(options.max_descriptor_distance);
  const float min_product = 1.0f - 0.5f * max_distance * max_distance;

  const float min_overlap = static_cast<float>(options.min_epipolar_overlap);

  std::vector<KNearest> nearest1(n1, KNearest(options.num_matches));
  std::vector<KNearest> nearest2(n2, KNearest(options.num_matches));
  std::vector<float> cosines(n2);
  const SegmentEnds ends2(segments2.ideal);
  std::vector<uint8_t> beside(n2, 0);
  for (size_t i = 0; i < n1; ++i) {
    if (F && !segments1.ideal[i]) continue;
    const bool has_points = !signatures1.of_segment[i].empty();
    std::fill(cosines.begin(), cosines.end(), 0.0f);
    for (const auto& [point, weight1] : signatures1.of_segment[i]) {
      for (const auto& [j, weight2] : signatures2.of_point[point]) cosines[j] += weight1 * weight2;
    }
    const Eigen::Vector2f direction = turn * Direction(segments1.segments[i]);
    Eigen::Vector3f line_of_start = Eigen::Vector3f::Zero(), line_of_end = line_of_start;
    if (F) {
      line_of_start = EpipolarLine(*F, segments1.ideal[i]->start);
      line_of_end = EpipolarLine(*F, segments1.ideal[i]->end);
      if (line_of_start.head<2>().dot(line_of_end.head<2>()) < 0.0f) line_of_end = -line_of_end;
      ends2.FindBeside(line_of_start, line_of_end, &beside);
    }
    const int16_t* descriptor1 = &segments1.descriptors[i * kSegmentDescriptorSize];
    for (size_t j = 0; j < n2; ++j) {
      if (beside[j] || direction.dot(directions2[j]) < min_cosine) continue;
      const int16_t* descriptor2 = &segments2.descriptors[j * kSegmentDescriptorSize];
      int32_t sum = 0;
      for (int k = 0; k < kSegmentDescriptorSize; ++k)
        sum += static_cast<int32_t>(descriptor1[k]) * descriptor2[k];
      const float product =
          static_cast<float>(sum) * (1.0f / (kDescriptorScale * kDescriptorScale));
      if (product < min_product) continue;
      if (F &&
          (!segments2.ideal[j] || !OverlapsAlongEpipolarLines(line_of_start, line_of_end,
                                                              *segments2.ideal[j], min_overlap)))
        continue;
      const float descriptor_distance = std::sqrt(std::max(0.0f, 2.0f - 2.0f * product));
      const float point_distance = has_points && !signatures2.of_segment[j].empty()
                                       ? 0.5f * (1.0f - cosines[j])
                                       : kDistanceWithoutPoints;
      const float distance = descriptor_distance + point_distance;
      nearest1[i].Add(distance, static_cast<uint32_t>(j));
      nearest2[j].Add(distance, static_cast<uint32_t>(i));
    }
  }

  std::vector<LineMatch> matches;
  for (size_t i = 0; i < n1; ++i) {
    for (const auto& [distance, j] : nearest1[i].entries())
      matches.push_back({static_cast<line2D_t>(i), j, distance});
  }
  for (size_t j = 0; j < n2; ++j) {
    for (const auto& [distance, i] : nearest2[j].entries())
      matches.push_back({i, static_cast<line2D_t>(j), distance});
  }
  const auto order = [](const LineMatch& m) { return std::tuple(m.idx1, m.distance, m.idx2); };
  std::sort(matches.begin(), matches.end(),
            [&](const LineMatch& a, const LineMatch& b) { return order(a) < order(b); });
  matches.erase(std::unique(matches.begin(), matches.end(),
                            [](const LineMatch& a, const LineMatch& b) {
                              return a.idx1 == b.idx1 && a.idx2 == b.idx2;
                            }),
                matches.end());
  return matches;
}

std::vector<LineMatch> MutualNearest(const std::vector<LineMatch>& matches, double max_ratio) {
  // The nearest two of each segment; ties leave none.
  constexpr float kNone = std::numeric_limits<float>::infinity();
  struct Two {
    float first = kNone, second = kNone;
    void Add(float distance) {
      if (distance < first) {
        second = std::exchange(first, distance);
      } else {
        second = std::min(second, distance);
      }
    }
  };
  std::map<line2D_t, Two> of1, of2;
  for (const LineMatch& match : matches) {
    of1[match.idx1].Add(match.distance);
    of2[match.idx2].Add(match.distance);
  }
  std::vector<LineMatch> mutual;
  for (const LineMatch& match : matches) {
    const Two& two1 = of1[match.idx1];
    const Two& two2 = of2[match.idx2];
    if (match.distance > two1.first || match.distance > two2.first) continue;
    if (!(match.distance < max_ratio * two1.second && match.distance < max_ratio * two2.second))
      continue;
    mutual.push_back(match);
  }
  return mutual;
}

}  // namespace holba
