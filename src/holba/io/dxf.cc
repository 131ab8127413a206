// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/dxf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string>
#include <vector>

#include "holba/io/files.h"
#include "holba/io/shapes.h"
#include "holba/scene/main_directions.h"

namespace holba {
namespace {

// Numbers of AutoCAD's colours: red, yellow, green, cyan, blue, magenta; others from the wheel.
constexpr int kColours[] = {1, 5, 3, 6, 4, 2, 30, 150, 94, 210, 40, 170};
constexpr int kGreyColour = 8;

// Layers of release 12 have capital letters, at most 31 of them.
std::string LayerName(std::string name) {
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return name.substr(0, 31);
}

std::string Place(int code, const Eigen::Vector3d& X) {
  return fmt::format("{}\n{:.12g}\n{}\n{:.12g}\n{}\n{:.12g}\n", code, X.x(), code + 10, X.y(),
                     code + 20, X.z());
}

}  // namespace

void WriteDxf(const Reconstruction& model, const std::filesystem::path& path) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatDxf(model, stream); });
}

void FormatDxf(const Reconstruction& model, std::ostream* stream) {
  const Eigen::Vector3d down = EstimateDown(model);
  const PlanAxes axes = EstimatePlanAxes(model, down);
  Eigen::Matrix3d upright;
  upright << axes.right.transpose(), -axes.below.transpose(), -down.transpose();
  const std::vector<LineLayer> lines = LineLayers(model);
  std::vector<GroupShape> shapes = GroupShapes(model);
  std::erase_if(shapes, [](const GroupShape& shape) { return shape.mesh.triangles.empty(); });

  *stream << "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n"
          << "0\nSECTION\n2\nTABLES\n"
          << "0\nTABLE\n2\nLTYPE\n70\n1\n"
          << "0\nLTYPE\n2\nCONTINUOUS\n70\n0\n3\nSolid line\n72\n65\n73\n0\n40\n0.0\n0\nENDTAB\n"
          << "0\nTABLE\n2\nLAYER\n70\n"
          << lines.size() + shapes.size() << "\n";
  size_t index = 0;
  const auto write_layer = [&](const std::string& name, bool is_grey) {
    const int colour = is_grey ? kGreyColour : kColours[index++ % std::size(kColours)];
    *stream << fmt::format("0\nLAYER\n2\n{}\n70\n0\n62\n{}\n6\nCONTINUOUS\n", LayerName(name),
                           colour);
  };
  for (const LineLayer& layer : lines) write_layer(layer.name, layer.name == "no_direction");
  for (const GroupShape& shape : shapes) write_layer(shape.name, false);
  *stream << "0\nENDTAB\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n";
  for (const LineLayer& layer : lines) {
    for (const line3D_t id : layer.line3D_ids) {
      const Line3D& line = model.lines3D.at(id);
      *stream << "0\nLINE\n8\n"
              << LayerName(layer.name) << "\n"
              << Place(10, upright * line.start) << Place(11, upright * line.end);
    }
  }
  for (const GroupShape& shape : shapes) {
    for (const auto& triangle : shape.mesh.triangles) {
      *stream << "0\n3DFACE\n8\n" << LayerName(shape.name) << "\n";
      // A triangle has its last corner twice.
      for (int k = 0; k < 4; ++k)
        *stream << Place(10 + k, upright * shape.mesh.vertices[triangle[std::min(k, 2)]]);
    }
  }
  *stream << "0\nENDSEC\n0\nEOF\n";
}

}  // namespace holba
