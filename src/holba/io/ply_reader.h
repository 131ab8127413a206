// SPDX-License-Identifier: BSD-3-Clause
// Geometry of other programs: PLY of any form (text, binary of either byte order, properties of any
// type in any order), OBJ, and MeshLab's projects of several scans. Frame and unit are the file's.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <ostream>
#include <string_view>
#include <vector>

#include "holba/geometry/rigid3d.h"

namespace holba {

struct FileGeometry {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;  // of faces with more corners: a fan
  std::vector<std::array<uint32_t, 2>> edges;      // "vertex1 vertex2"
};

// What a file must hold; one without it is refused.
enum class GeometryContent { kVertices, kTriangles, kEdges };

// PLY. Elements that are not asked for are read over. Throws InputError with the place of the
// fault, also for indices that are no vertices' and for coordinates that are not finite.
FileGeometry ReadPly(const std::filesystem::path& path, GeometryContent content);
// The bytes of such a file; `path` is for messages.
FileGeometry ParsePly(std::string_view bytes, const std::filesystem::path& path,
                      GeometryContent content);
// PLY, or OBJ by its extension (its vertices and faces; normals and textures are read over).
FileGeometry ReadMesh(const std::filesystem::path& path);

// One scan of a laser scanner in the frame of its scanner, which is at the origin.
struct LaserScan {
  std::filesystem::path path;
  Rigid3d world_from_scan;
  std::vector<Eigen::Vector3d> points;  // in the frame of the scan
};
// A MeshLab project (.mlp): each MLMesh with its matrix, PLY files beside it. Throws InputError,
// also for a matrix that is no rigid motion.
std::vector<LaserScan> ReadMeshLabProject(const std::filesystem::path& path);

// Triangles as binary PLY.
void WriteTrianglePly(const std::vector<Eigen::Vector3d>& vertices,
                      const std::vector<std::array<uint32_t, 3>>& triangles, std::ostream* stream);

}  // namespace holba
