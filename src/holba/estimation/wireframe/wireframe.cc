// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/wireframe/wireframe.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "holba/estimation/wireframe/point_on_line.h"
#include "holba/estimation/points/point_triangulation.h"
#include "holba/scene/views.h"

namespace holba {
namespace {

// A point seen near a line in one image. Points, lines and images are named by their positions in
// the model.
struct Meeting {
  uint32_t point, line, image;
  double overshoot_px;
  double offset_px;  // signed: on which side of the line, the same side in space in all images
};

class WireframeFormer {
 public:
  WireframeFormer(const WireframeOptions& options, Reconstruction* model)
      : options_(options),
        in_space_{options.max_gap_gsd, options.max_uncertain_gap_gsd, options.sigma_px},
        model_(model),
        views_(*model) {}

  WireframeReport Form() {
    std::vector<Meeting> meetings;
    for (uint32_t i = 0; i < views_.size(); ++i) FindMeetings(i, &meetings);
    // Of several segments of a line in an image, the one that the point lies on counts.
    const auto key = [](const Meeting& m) { return std::tie(m.point, m.line, m.image); };
    std::sort(meetings.begin(), meetings.end(), [](const Meeting& a, const Meeting& b) {
      return std::tuple(a.point, a.line, a.image, a.overshoot_px, std::abs(a.offset_px)) <
             std::tuple(b.point, b.line, b.image, b.overshoot_px, std::abs(b.offset_px));
    });
    meetings.erase(
        std::unique(meetings.begin(), meetings.end(),
                    [&](const Meeting& a, const Meeting& b) { return key(a) == key(b); }),
        meetings.end());

    model_->DeleteEdges([](const WireframeEdge&) { return true; });
    for (size_t begin = 0, end = 0; begin < meetings.size(); begin = end) {
      while (end < meetings.size() && meetings[end].point == meetings[begin].point &&
             meetings[end].line == meetings[begin].line) {
        ++end;
      }
      if (const char* reason = Test({meetings.data() + begin, end - begin})) {
        ++report_.dropped[reason];
        continue;
      }
      model_->AddEdge({model_->points3D.begin()[meetings[begin].point].first,
                       model_->lines3D.begin()[meetings[begin].line].first, end - begin});
    }
    Count();
    return std::move(report_);
  }

 private:
  void FindMeetings(uint32_t image_idx, std::vector<Meeting>* meetings) const {
    const Image& image = model_->images.begin()[image_idx].second;
    const IdealView& view = views_[image_idx];
    struct Seen {
      Eigen::Vector2d x;
      uint32_t point;
    };
    std::vector<Seen> seen;
    for (const Point2D& point2D : image.points2D) {
      if (point2D.point3D_id == kNoId) continue;
      const auto x = view.ToIdeal(point2D.xy);
      if (x)
        seen.push_back({*x, static_cast<uint32_t>(model_->points3D.IndexOf(point2D.point3D_id))});
    }
    std::stable_sort(seen.begin(), seen.end(),
                     [](const Seen& a, const Seen& b) { return a.x.x() < b.x.x(); });

    for (const Line2D& line2D : image.lines2D) {
      if (line2D.line3D_id == kNoId) continue;
      const auto segment = view.ToIdeal(line2D.segment);
      if (!segment) continue;
      const double length = segment->Length();
      if (!(length > 0.0)) continue;
      const Line3D& line3D = model_->lines3D.at(line2D.line3D_id);
      const auto projected = view.Project(line3D.line);
      if (!projected) continue;
      const Eigen::Vector2d along = (segment->end - segment->start) / length;
      Eigen::Vector3d l = segment->Line();
      if (l.head<2>().dot(projected->head<2>()) < 0.0) l = -l;
      const uint32_t line = static_cast<uint32_t>(model_->lines3D.IndexOf(line2D.line3D_id));
      const double margin = std::max(options_.max_overshoot_px, options_.max_distance_px);
      const double low = std::min(segment->start.x(), segment->end.x()) - margin;
      const double high = std::max(segment->start.x(), segment->end.x()) + margin;
      const double low_y = std::min(segment->start.y(), segment->end.y()) - margin;
      const double high_y = std::max(segment->start.y(), segment->end.y()) + margin;
      for (auto it = std::lower_bound(seen.begin(), seen.end(), low,
                                      [](const Seen&s, double x) { return s.x.x() < x; });
           it != seen.end() && it->x.x() <= high; ++it) {
        if (it->x.y() < low_y || it->x.y() > high_y) continue;
        const double offset = l.dot(it->x.homogeneous());
        if (std::abs(offset) > options_.max_distance_px) continue;
        const double u = along.dot(it->x - segment->start);
        const double overshoot = std::max({0.0, -u, u - length});
        if (overshoot > options_.max_overshoot_px) continue;
        meetings->push_back({it->point, line, image_idx, overshoot, offset});
      }
    }
  }

  // Null: the pair is an edge. Otherwise the reason why it is not.
  const char* Test(std::span<const Meeting> meetings) {
    const double count = static_cast<double>(meetings.size());
    if (count < options_.min_num_images) return "meet in too few images";
    double mean = 0.0, sum_squares = 0.0;
    for (const Meeting& m : meetings) mean += m.offset_px / count;
    for (const Meeting& m : meetings) sum_squares += (m.offset_px - mean) * (m.offset_px - mean);
    const double scatter = std::sqrt(sum_squares / (count - 1.0));
    if (scatter > options_.max_offset_scatter_px) return "scattered about the line";
    if (std::abs(mean) > std::max(options_.max_mean_offset_px, 3.0 * scatter / std::sqrt(count))) {
      return "beside the edge";
    }
    return TestInSpace(meetings[0]);
  }

  const char* TestInSpace(const Meeting& meeting) {
    const Point3D& point = model_->points3D.begin()[meeting.point].second;
    const Line3D& line = model_->lines3D.begin()[meeting.line].second;
    const std::vector<PointView> views = ViewsOf(point);
    const double pixels_per_length = PixelsPerLength(views, point.xyz);
    if (!(pixels_per_length > 0.0)) return "behind the cameras";
    switch (TestPointOnLine(*model_, views_, in_space_, point.xyz,
                            PointCovariance(views, point.xyz), pixels_per_length, line)) {
      case PointOnLine::kApart:
        return "apart in space";
      case PointOnLine::kAllowed:
        ++report_.num_uncertain;
        break;
      case PointOnLine::kNear:
        break;
    }
    return nullptr;
  }

  std::vector<PointView> ViewsOf(const Point3D& point) const {
    std::vector<PointView> result;
    for (const PointObservation& observation : point.track) {
      const IdealView& view = views_.at(observation.image_id);
      const auto x = view.ToIdeal(
          model_->images.at(observation.image_id).points2D.at(observation.point2D_idx).xy);
      if (x && view.Depth(point.xyz) > 0.0) result.push_back({&view, *x});
    }
    return result;
  }

  void Count() {
    report_.num_edges = model_->wireframe.size();
    std::vector<line3D_t> lines;
    size_t of_point = 0;
    for (size_t i = 0; i < model_->wireframe.size(); ++i) {
      const WireframeEdge& edge = model_->wireframe[i];
      lines.push_back(edge.line3D_id);
      const bool is_new = i == 0 || model_->wireframe[i - 1].point3D_id != edge.point3D_id;
      of_point = is_new ? 1 : of_point + 1;
      report_.num_points += is_new;
      report_.num_joints += of_point == 2;
    }
    std::sort(lines.begin(), lines.end());
    report_.num_lines =
        static_cast<size_t>(std::unique(lines.begin(), lines.end()) - lines.begin());
  }

  const WireframeOptions& options_;
  const PointOnLineOptions in_space_;
  Reconstruction* model_;
  const ViewMap views_;
  WireframeReport report_;
};

}  // namespace

void WireframeOptions::Describe(OptionTable* table) const {
  table->Section("Wireframe");
  table->Field("max_distance_px", &max_distance_px, GreaterThan(0),
               "Farthest observed point from the line of a segment that it meets, pixels.");
  table->Field("max_overshoot_px", &max_overshoot_px, AtLeast(0),
               "Farthest observed point beyond the end of a segment that it meets, pixels.");
  table->Field("min_num_images", &min_num_images, AtLeast(2),
               "Images in which a point and a line must meet.");
  table->Field("max_mean_offset_px", &max_mean_offset_px, GreaterThan(0),
               "Largest mean signed distance of a point from a line that it lies on (more only "
               "within 3 standard errors), pixels.");
  table->Field("max_offset_scatter_px", &max_offset_scatter_px, GreaterThan(0),
               "Largest standard deviation of these distances, pixels.");
  table->Field("max_gap_gsd", &max_gap_gsd, GreaterThan(0),
               "Farthest point from its line in space, in pixels of the nearest view (more only "
               "where covariances allow it).");
  table->Field("max_uncertain_gap_gsd", &max_uncertain_gap_gsd, AtLeast(0),
               "Farthest point from its line, whatever their covariances, in the same unit.");
  table->Field("sigma_px", &sigma_px, GreaterThan(0),
               "Standard deviation of points and ends of segments in that test, pixels.");
}

WireframeReport FormWireframe(const WireframeOptions& options, Reconstruction* model) {
  return WireframeFormer(options, model).Form();
}

}  // namespace holba
