// SPDX-License-Identifier: BSD-3-Clause
#include "holba/render/place_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "holba/base/check.h"
#include "holba/render/truth_model.h"

namespace holba {
namespace {

constexpr double kMeshDeviation = 1e-4;  // metres

template <typename T>
void Put(const T& value, std::ostream* stream) {
  stream->write(reinterpret_cast<const char*>(&value),
                sizeof(value));  // little-endian, as the files say
}

void PutNpyHeader(const std::string& shape, std::ostream* stream) {
  std::string header =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", shape);
  // The header ends with a line break at a multiple of 64 bytes.
  header.append(63 - (10 + header.size()) % 64, ' ');
  header.push_back('\n');
  *stream << "\x93NUMPY" << '\x01' << '\0';
  Put(static_cast<uint16_t>(header.size()), stream);
  *stream << header;
}

}  // namespace

void FormatPlaceMesh(const Place& place, std::ostream* stream) {
  std::vector<SurfaceMesh> meshes;
  size_t num_vertices = 0, num_triangles = 0;
  for (const Surface& surface : place.surfaces) {
    meshes.push_back(Tessellate(surface, kMeshDeviation));
    num_vertices += meshes.back().vertices.size();
    num_triangles += meshes.back().triangles.size();
  }
  *stream << "ply\nformat binary_little_endian 1.0\ncomment metres, z up\nelement vertex "
          << num_vertices
          << "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar "
             "red\nproperty uchar "
             "green\nproperty uchar blue\nproperty uint label\nelement face "
          << num_triangles << "\nproperty list uchar uint vertex_indices\nend_header\n";
  for (size_t i = 0; i < meshes.size(); ++i) {
    const Surface& surface = place.surfaces[i];
    const Material& material = place.materials[static_cast<size_t>(surface.material)];
    const Colour colour = material.tint.cwiseProduct(
                              place.textures[static_cast<size_t>(material.texture)].At(0, 0, 1e6)) +
                          material.emission;
    for (const Eigen::Vector3d& vertex : meshes[i].vertices) {
      for (int k = 0; k < 3; ++k) Put(vertex[k], stream);
      for (int k = 0; k < 3; ++k) {
        Put(static_cast<uint8_t>(
                std::lround(255.0f * SrgbFromLinear(std::clamp(colour[k], 0.0f, 1.0f)))),
            stream);
      }
      Put(surface.entity >= 0 ? static_cast<uint32_t>(GroupOfEntity(surface.entity)) : 0u, stream);
    }
  }
  uint32_t first = 0;
  for (const SurfaceMesh& mesh : meshes) {
    for (const auto& triangle : mesh.triangles) {
      Put(uint8_t{3}, stream);
      for (const uint32_t vertex : triangle) Put(first + vertex, stream);
    }
    first += static_cast<uint32_t>(mesh.vertices.size());
  }
}

void FormatDepthNpy(const TruthMaps& maps, std::ostream* stream) {
  PutNpyHeader(fmt::format("{}, {}", maps.height, maps.width), stream);
  for (const double depth : maps.depth_m) Put(static_cast<float>(depth), stream);
}

void FormatNormalsNpy(const TruthMaps& maps, std::ostream* stream) {
  PutNpyHeader(fmt::format("{}, {}, 3", maps.height, maps.width), stream);
  for (const Eigen::Vector3d& normal : maps.normals) {
    for (int i = 0; i < 3; ++i) Put(static_cast<float>(normal[i]), stream);
  }
}

std::vector<uint16_t> LabelsOf(const TruthMaps& maps) {
  std::vector<uint16_t> labels;
  labels.reserve(maps.entities.size());
  for (const int entity : maps.entities) {
    const uint64_t label = entity >= 0 ? GroupOfEntity(entity) : 0;
    HOLBA_CHECK(label <= std::numeric_limits<uint16_t>::max());
    labels.push_back(static_cast<uint16_t>(label));
  }
  return labels;
}

std::string LabelTypesJson(const Place& place) {
  std::string text = "{\"labels\": {";
  for (size_t i = 0; i < place.entities.size(); ++i) {
    std::string type(place.entities[i].type->name);
    for (char& letter : type)
      letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
    text += fmt::format("{}\"{}\": \"{}\"", i == 0 ? "" : ", ", GroupOfEntity(static_cast<int>(i)),
                        type);
  }
  return text + "}}\n";
}

}  // namespace holba
