// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/ply.h"

#include <fmt/format.h>

#include <vector>

#include "holba/io/binary_io.h"
#include "holba/io/files.h"
#include "holba/io/shapes.h"

namespace holba {
namespace {

using Rgb = std::array<uint8_t, 3>;

struct Scene {
  struct Vertex {
    Eigen::Vector3d xyz;
    Rgb rgb;
  };
  struct Edge {
    std::array<uint32_t, 2> vertices;
    Rgb rgb;
  };
  std::vector<Vertex> vertices;
  std::vector<std::array<uint32_t, 3>> faces;
  std::vector<Edge> edges;
};

void AddGroups(const Reconstruction& model, Scene* scene) {
  for (const GroupShape& shape : GroupShapes(model)) {
    const auto first = static_cast<uint32_t>(scene->vertices.size());
    for (const Eigen::Vector3d& vertex : shape.mesh.vertices)
      scene->vertices.push_back({vertex, shape.rgb});
    for (const auto& [a, b, c] : shape.mesh.triangles) {
      scene->faces.push_back({first + a, first + b, first + c});
    }
  }
}

}  // namespace

void WritePly(const Reconstruction& model, const std::filesystem::path& path,
              const PlyContent& content) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatPly(model, content, stream); });
}

void FormatPly(const Reconstruction& model, const PlyContent& content, std::ostream* stream) {
  Scene scene;
  if (content.points) {
    for (const auto& [point3D_id, point] : model.points3D) {
      scene.vertices.push_back({point.xyz, point.rgb});
    }
  }
  if (content.lines) {
    for (const auto& [line3D_id, line] : model.lines3D) {
      const auto first = static_cast<uint32_t>(scene.vertices.size());
      scene.vertices.push_back({line.start, line.rgb});
      scene.vertices.push_back({line.end, line.rgb});
      scene.edges.push_back({{first, first + 1}, line.rgb});
    }
  }
  if (content.groups) AddGroups(model, &scene);

  *stream << "ply\nformat binary_little_endian 1.0\n"
          << fmt::format("element vertex {}\n", scene.vertices.size())
          << "property double x\nproperty double y\nproperty double z\n"
          << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  // Viewers take a file with an empty list of faces for a broken mesh, and without it for a point
  // cloud.
  if (!scene.faces.empty()) {
    *stream << fmt::format("element face {}\n", scene.faces.size())
            << "property list uchar int vertex_indices\n";
  }
  if (!scene.edges.empty()) {
    *stream << fmt::format("element edge {}\n", scene.edges.size())
            << "property int vertex1\nproperty int vertex2\n"
            << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  }
  *stream << "end_header\n";
  BinaryOut out(stream);
  const auto write_colour = [&](const Rgb& rgb) {
    for (const uint8_t channel : rgb) out.Byte(channel);
  };
  for (const Scene::Vertex& vertex : scene.vertices) {
    for (int i = 0; i < 3; ++i) out.Real(vertex.xyz[i]);
    write_colour(vertex.rgb);
    out.EndRecord();
  }
  for (const auto& face : scene.faces) {
    out.Byte(3);
    for (const uint32_t vertex : face) out.Index(vertex);
    out.EndRecord();
  }
  for (const Scene::Edge& edge : scene.edges) {
    for (const uint32_t vertex : edge.vertices) out.Index(vertex);
    write_colour(edge.rgb);
    out.EndRecord();
  }
}

}  // namespace holba
