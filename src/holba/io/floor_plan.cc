// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/floor_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "holba/group/known_types.h"
#include "holba/io/files.h"
#include "holba/io/shapes.h"
#include "holba/scene/main_directions.h"

namespace holba {
namespace {

constexpr double kSizePx = 1000.0, kMarginPx = 60.0;
// A plane within 20 degrees of upright has a trace; a line within 20 degrees of it is a dot.
constexpr double kMaxUprightSine = 0.342;
constexpr double kLowShare = 0.01, kHighShare = 0.99;

double Quantile(std::vector<double> values, double share) {
  const auto nth =
      values.begin() + static_cast<ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

std::string Css(const std::array<uint8_t, 3>& rgb) {
  return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

class FloorPlan {
 public:
  explicit FloorPlan(const Reconstruction& model)
      : model_(model), down_(EstimateDown(model)), axes_(EstimatePlanAxes(model, down_)) {
    Fit();
  }

  void Write(std::ostream* stream) const {
    const Eigen::Vector2d size =
        (high_ - low_) * scale_ + Eigen::Vector2d::Constant(2.0 * kMarginPx);
    *stream << fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
        "viewBox=\"0 0 {0:.0f} {1:.0f}\" data-px-per-unit=\"{2:.9g}\">\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        size.x(), size.y(), scale_);
    WritePlanes(stream);
    WriteLines(stream);
    WriteCameras(stream);
    WriteBar(size.y(), stream);
    *stream << "</svg>\n";
  }

 private:
  void Fit() {
    std::vector<double> x, y;
    const auto add = [&](const Eigen::Vector3d& X) {
      const Eigen::Vector2d p = axes_(X);
      if (!p.allFinite()) return;
      x.push_back(p.x());
      y.push_back(p.y());
    };
    for (const auto& [id, line] : model_.lines3D) {
      add(line.start);
      add(line.end);
    }
    if (x.empty()) {
      for (const auto& [id, point] : model_.points3D) add(point.xyz);
    }
    if (!x.empty()) {
      low_ = {Quantile(x, kLowShare), Quantile(y, kLowShare)};
      high_ = {Quantile(x, kHighShare), Quantile(y, kHighShare)};
    }
    bool first = x.empty();
    for (const auto& [id, image] : model_.images) {
      const Eigen::Vector2d p = axes_(image.cam_from_world.OriginInA());
      low_ = first ? p : Eigen::Vector2d(low_.cwiseMin(p));
      high_ = first ? p : Eigen::Vector2d(high_.cwiseMax(p));
      first = false;
    }
    const double extent = (high_ - low_).maxCoeff();
    scale_ = extent > 0.0 && std::isfinite(extent) ? kSizePx / extent : 1.0;
  }

  Eigen::Vector2d At(const Eigen::Vector3d& X) const {
    return (axes_(X) - low_) * scale_ + Eigen::Vector2d::Constant(kMarginPx);
  }

  static void WriteSegment(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                           std::ostream* stream) {
    *stream << fmt::format("<line x1=\"{:.2f}\" y1=\"{:.2f}\" x2=\"{:.2f}\" y2=\"{:.2f}\"/>\n",
                           a.x(), a.y(), b.x(), b.y());
  }

  void WritePlanes(std::ostream* stream) const {
    *stream << "<g id=\"planes\" stroke=\"#3b4656\" stroke-opacity=\"0.3\" stroke-width=\"9\" "
               "stroke-linecap=\"round\">\n";
    for (const auto& [id, group] : model_.groups3D) {
      if (!IsPlane(*group.type)) continue;
      const Eigen::Vector3d normal = Eigen::Vector3d(group.params.data()).normalized();
      const Eigen::Vector3d along = normal.cross(down_);
      if (std::abs(normal.dot(down_)) > kMaxUprightSine || along.norm() == 0.0) continue;
      std::vector<double> positions;
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      const auto add = [&](const Eigen::Vector3d& X) {
        positions.push_back(along.normalized().dot(X));
        sum += X;
      };
      for (const point3D_t point : group.point3D_ids) add(model_.points3D.at(point).xyz);
      for (const line3D_t line : group.line3D_ids) {
        add(model_.lines3D.at(line).start);
        add(model_.lines3D.at(line).end);
      }
      if (positions.size() < 2) continue;
      const Eigen::Vector3d middle = sum / static_cast<double>(positions.size());
      const double at = along.normalized().dot(middle);
      const auto end = [&](double share) {
        return At(middle + (Quantile(positions, share) - at) * along.normalized());
      };
      WriteSegment(end(0.02), end(0.98), stream);
    }
    *stream << "</g>\n";
  }

  void WriteLines(std::ostream* stream) const {
    for (const LineLayer& layer : LineLayers(model_)) {
      *stream << fmt::format(
          "<g id=\"{}\" stroke=\"{}\" stroke-width=\"1.6\" stroke-linecap=\"round\">\n", layer.name,
          Css(layer.rgb));
      for (const line3D_t id : layer.line3D_ids) {
        const Line3D& line = model_.lines3D.at(id);
        const Eigen::Vector3d d = line.end - line.start;
        const Eigen::Vector2d a = At(line.start), b = At(line.end);
        if (!a.allFinite() || !b.allFinite() || Far(a) || Far(b)) continue;
        if ((d - down_ * down_.dot(d)).norm() <= kMaxUprightSine * d.norm()) {
          const Eigen::Vector2d middle = 0.5 * (a + b);
          *stream << fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"2\"/>\n", middle.x(),
                                 middle.y());
        } else {
          WriteSegment(a, b, stream);
        }
      }
      *stream << "</g>\n";
    }
  }
  // Beyond the paper.
  static bool Far(const Eigen::Vector2d& p) { return p.cwiseAbs().maxCoeff() > 20.0 * kSizePx; }

  void WriteCameras(std::ostream* stream) const {
    *stream << "<g id=\"cameras\" fill=\"#111111\">\n";
    for (const auto& [id, image] : model_.images) {
      const Eigen::Vector2d at = At(image.cam_from_world.OriginInA());
      Eigen::Vector2d ahead =
          axes_(image.cam_from_world.rotation.normalized().conjugate() * Eigen::Vector3d::UnitZ());
      if (!at.allFinite()) continue;
      if (ahead.norm() < 0.1) {  // it looks up or down
        *stream << fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"4\"/>\n", at.x(), at.y());
        continue;
      }
      ahead = 9.0 * ahead.normalized();
      const Eigen::Vector2d aside(-0.45 * ahead.y(), 0.45 * ahead.x());
      const Eigen::Vector2d tip = at + ahead, left = at + aside, right = at - aside;
      *stream << fmt::format("<path d=\"M{:.2f} {:.2f}L{:.2f} {:.2f}L{:.2f} {:.2f}Z\"/>\n", tip.x(),
                             tip.y(), left.x(), left.y(), right.x(), right.y());
    }
    *stream << "</g>\n";
  }

  void WriteBar(double height, std::ostream* stream) const {
    const double extent = (high_ - low_).maxCoeff();
    if (!(extent > 0.0)) return;
    const double length = BarLength(extent);
    *stream << "<g id=\"bar\" stroke=\"#111111\" stroke-width=\"2\">\n";
    const Eigen::Vector2d left(kMarginPx, height - 0.4 * kMarginPx);
    WriteSegment(left, left + Eigen::Vector2d(length * scale_, 0.0), stream);
    *stream << fmt::format(
        "<text x=\"{:.2f}\" y=\"{:.2f}\" stroke=\"none\" fill=\"#111111\" "
        "font-family=\"sans-serif\" "
        "font-size=\"13\">{:g} {}</text>\n</g>\n",
        left.x(), left.y() - 6.0, length, length == 1.0 ? "unit" : "units");
  }

  const Reconstruction& model_;
  Eigen::Vector3d down_;
  PlanAxes axes_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero(), high_ = Eigen::Vector2d::Zero();
  double scale_ = 1.0;  // pixels of a unit
};

}  // namespace

void WriteFloorPlan(const Reconstruction& model, const std::filesystem::path& path) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatFloorPlan(model, stream); });
}

void FormatFloorPlan(const Reconstruction& model, std::ostream* stream) {
  FloorPlan(model).Write(stream);
}

}  // namespace holba
