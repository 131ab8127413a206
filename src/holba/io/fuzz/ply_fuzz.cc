// SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>
#include <sstream>

#include "holba/base/error.h"
#include "holba/io/ply_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  holba::FileGeometry geometry;
  try {
    geometry = holba::ParsePly(bytes, "input", holba::GeometryContent::kTriangles);
  } catch (const holba::InputError&) {
    return 0;
  }
  std::ostringstream stream;
  holba::WriteTrianglePly(geometry.vertices, geometry.triangles, &stream);
  const holba::FileGeometry again =
      holba::ParsePly(stream.str(), "written", holba::GeometryContent::kTriangles);
  if (again.vertices != geometry.vertices || again.triangles != geometry.triangles) std::abort();
  return 0;
}
