// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ostream>
#include <string_view>

#include "apps/evaluate_geometry/geometry_report.h"
#include "holba/io/ply.h"
#include "holba/io/text_io.h"

namespace holba {
namespace {

constexpr std::array<std::string_view, 5> kFiles = {"points.csv", "lines.csv", "edges.csv",
                                                    "primitives.csv", "errors.ply"};
constexpr std::string_view kPlyFile = "errors.ply";

std::string ShareColumns(const std::vector<double>& thresholds_mm) {
  std::string columns;
  for (const double t : thresholds_mm) columns += fmt::format(",share_within_{:g}_mm", t);
  return columns;
}

std::string Shares(const std::vector<double>& share) {
  std::string text;
  for (const double s : share) text += "," + RealToText(s);
  return text;
}

// Green without an error, yellow half-way, red at `max_m`, violet beyond.
std::array<uint8_t, 3> ErrorColour(double error_m, double max_m) {
  if (!(error_m <= max_m)) return {160, 0, 200};
  const double part = error_m / max_m;
  const auto channel = [](double x) {
    return static_cast<uint8_t>(std::lround(220.0 * std::clamp(x, 0.0, 1.0)));
  };
  return {channel(2.0 * part), channel(2.0 - 2.0 * part), 0};
}

void WritePoints(const GeometryErrors& errors, const Reconstruction& model, std::ostream* out) {
  *out << "point3D_id,x,y,z,images,distance_mm\n";
  for (const PointError& error : errors.points) {
    const Point3D& point = model.points3D.at(error.point3D_id);
    *out << error.point3D_id;
    for (int i = 0; i < 3; ++i) *out << ',' << RealToText(point.xyz[i]);
    *out << ',' << NumImagesOf(point) << ',' << RealToText(1000.0 * error.distance_m) << '\n';
  }
}

void WriteLines(const GeometryErrors& errors, const GeometryOptions& options, std::ostream* out) {
  *out << "line3D_id,images,length_m,mean_mm,max_mm" << ShareColumns(options.thresholds_mm) << '\n';
  for (const LineError& error : errors.lines) {
    *out << error.line3D_id << ',' << error.num_images << ',' << RealToText(error.length_m) << ','
         << RealToText(1000.0 * error.mean_m) << ',' << RealToText(1000.0 * error.max_m)
         << Shares(error.share) << '\n';
  }
}

void WriteEdges(const EdgeErrors& errors, const GeometryOptions& options, std::ostream* out) {
  *out << "line3D_id,length_m" << ShareColumns(options.thresholds_mm)
       << ",edge,angle_deg,offset_mm\n";
  for (const LineEdgeError& error : errors.lines) {
    *out << error.line3D_id << ',' << RealToText(error.length_m) << Shares(error.share);
    if (error.match) {
      *out << ',' << error.match->edge << ',' << RealToText(error.match->angle_deg) << ','
           << RealToText(1000.0 * error.match->offset_m) << '\n';
    } else {
      *out << ",,,\n";
    }
  }
}

void WritePrimitives(const PrimitiveErrors& errors, double metres_per_unit, std::ostream* out) {
  *out << "type,true_group3D_id,group3D_id,members,quantity,error\n";
  for (const PrimitivePair& pair : errors.pairs) {
    const auto write = [&](const std::string& quantity, double error) {
      *out << pair.type->name << ',' << pair.truth_id << ',' << pair.model_id << ','
           << pair.num_members << ',' << quantity << ',' << RealToText(error) << '\n';
    };
    for (const auto& [name, error] : pair.errors) {
      if (name.ends_with("_deg")) {
        write(name, error);
      } else {
        write(name + "_mm", 1000.0 * metres_per_unit * error);
      }
    }
    if (pair.radius_percent) write("radius_percent", *pair.radius_percent);
  }
}

// The points, and the lines in pieces, coloured.
Reconstruction Coloured(const GeometryErrors& errors, const Reconstruction& model, double max_m) {
  Reconstruction coloured;
  for (const PointError& error : errors.points) {
    coloured.AddPoint3D(model.points3D.at(error.point3D_id).xyz, {}, PointOrigin::kDetected,
                        ErrorColour(error.distance_m, max_m));
  }
  for (const LineError& error : errors.lines) {
    const Line3D& line = model.lines3D.at(error.line3D_id);
    for (int piece = 0; piece < kNumPieces; ++piece) {
      const auto at = [&](int i) {
        return Eigen::Vector3d(line.start +
                               (static_cast<double>(i) / kNumPieces) * (line.end - line.start));
      };
      const line3D_t id = coloured.AddLine3D(line.line, at(piece), at(piece + 1));
      coloured.lines3D.at(id).rgb = ErrorColour(error.piece_mean_m[piece], max_m);
    }
  }
  return coloured;
}

}  // namespace

bool IsGeometryFile(std::string_view name) {
  return std::find(kFiles.begin(), kFiles.end(), name) != kFiles.end();
}

void StageGeometryFiles(const GeometryReport& report, const Reconstruction& model,
                        const GeometryOptions& options, StagedFolder* stage) {
  if (report.surface) {
    stage->Write("points.csv",
                 [&](std::ostream* out) { WritePoints(*report.surface, model, out); });
    stage->Write("lines.csv",
                 [&](std::ostream* out) { WriteLines(*report.surface, options, out); });
    const double max_mm =
        *std::max_element(options.thresholds_mm.begin(), options.thresholds_mm.end());
    const Reconstruction coloured = Coloured(*report.surface, model, max_mm / 1000.0);
    stage->Write(std::string(kPlyFile),
                 [&](std::ostream* out) { FormatPly(coloured, PlyContent(), out); });
  }
  if (report.edges) {
    stage->Write("edges.csv", [&](std::ostream* out) { WriteEdges(*report.edges, options, out); });
  }
  if (report.primitives) {
    stage->Write("primitives.csv", [&](std::ostream* out) {
      WritePrimitives(*report.primitives, options.metres_per_unit, out);
    });
  }
}

}  // namespace holba
