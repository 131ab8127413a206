// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/obj.h"

#include <fmt/format.h>

#include <string>

#include "holba/io/files.h"
#include "holba/io/shapes.h"

namespace holba {
namespace {

// With the colour behind the place, as MeshLab, Blender and CloudCompare read it.
std::string Vertex(const Eigen::Vector3d& X, const std::array<uint8_t, 3>& rgb) {
  return fmt::format("v {:.12g} {:.12g} {:.12g} {:.3f} {:.3f} {:.3f}\n", X.x(), X.y(), X.z(),
                     rgb[0] / 255.0, rgb[1] / 255.0, rgb[2] / 255.0);
}

}  // namespace

void WriteObj(const Reconstruction& model, const std::filesystem::path& path) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatObj(model, stream); });
}

void FormatObj(const Reconstruction& model, std::ostream* stream) {
  size_t next = 1;  // vertices are counted from 1
  *stream << "# Lines and groups of a model, in its frame and units\n";
  for (const LineLayer& layer : LineLayers(model)) {
    *stream << "o " << layer.name << "\n";
    for (const line3D_t id : layer.line3D_ids) {
      const Line3D& line = model.lines3D.at(id);
      *stream << Vertex(line.start, layer.rgb) << Vertex(line.end, layer.rgb)
              << fmt::format("l {} {}\n", next, next + 1);
      next += 2;
    }
  }
  for (const GroupShape& shape : GroupShapes(model)) {
    if (shape.mesh.triangles.empty()) continue;
    *stream << "o " << shape.name << "\n";
    for (const Eigen::Vector3d& vertex : shape.mesh.vertices) *stream << Vertex(vertex, shape.rgb);
    for (const auto& [a, b, c] : shape.mesh.triangles)
      *stream << fmt::format("f {} {} {}\n", next + a, next + b, next + c);
    next += shape.mesh.vertices.size();
  }
}

}  // namespace holba
