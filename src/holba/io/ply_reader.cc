// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/ply_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <sstream>
#include <string_view>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/words.h"
#include "holba/io/binary_io.h"
#include "holba/io/text_io.h"

namespace holba {
namespace {

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

std::optional<PlyType> TypeOf(std::string_view name) {
  if (name == "char" || name == "int8") return PlyType::kInt8;
  if (name == "uchar" || name == "uint8") return PlyType::kUint8;
  if (name == "short" || name == "int16") return PlyType::kInt16;
  if (name == "ushort" || name == "uint16") return PlyType::kUint16;
  if (name == "int" || name == "int32") return PlyType::kInt32;
  if (name == "uint" || name == "uint32") return PlyType::kUint32;
  if (name == "float" || name == "float32") return PlyType::kFloat;
  if (name == "double" || name == "float64") return PlyType::kDouble;
  return std::nullopt;
}

size_t BytesOf(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kDouble:
      return 8;
    default:
      return 4;
  }
}

struct Property {
  std::string name;
  PlyType type;
  std::optional<PlyType> count_type;  // of a list
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

enum class PlyForm { kText, kLittleEndian, kBigEndian };

struct Header {
  PlyForm form = PlyForm::kText;
  std::vector<Element> elements;
  size_t size = 0;  // bytes, where the data begins
  uint64_t num_lines = 0;
};

Header ReadHeader(std::string_view bytes, const std::filesystem::path& path) {
  if (!bytes.starts_with("ply"))
    throw InputError(path, "expected a PLY file, which begins with 'ply', found another one");
  Header header;
  bool has_format = false;
  while (true) {
    const size_t newline = bytes.find('\n', header.size);
    if (newline == std::string_view::npos)
      throw InputError(path, "expected a line end_header, found the end of the file");
    std::string_view line = bytes.substr(header.size, newline - header.size);
    if (line.ends_with('\r')) line.remove_suffix(1);
    header.size = newline + 1;
    ++header.num_lines;
    const auto fail = [&](const std::string& message) {
      throw InputError::AtLine(path, header.num_lines, message);
    };
    std::istringstream fields{std::string(line)};
    std::string word;
    fields >> word;
    if (word == "end_header") break;
    if (word == "format") {
      std::string form;
      fields >> form;
      has_format = true;
      if (form == "ascii") {
        header.form = PlyForm::kText;
      } else if (form == "binary_little_endian") {
        header.form = PlyForm::kLittleEndian;
      } else if (form == "binary_big_endian") {
        header.form = PlyForm::kBigEndian;
      } else {
        fail("expected the format ascii, binary_little_endian or binary_big_endian, found '" +
             form + "'");
      }
    } else if (word == "element") {
      Element element;
      if (!(fields >> element.name >> element.count))
        fail("expected 'element NAME COUNT', found '" + std::string(line) + "'");
      header.elements.push_back(element);
    } else if (word == "property") {
      if (header.elements.empty())
        fail("expected an element before its first property, found a property");
      Property property;
      std::string type;
      fields >> type;
      if (type == "list") {
        std::string count_type;
        fields >> count_type >> type;
        property.count_type = TypeOf(count_type);
        if (!property.count_type)
          fail("expected the type of a list's length, found '" + count_type + "'");
      }
      const std::optional<PlyType> known = TypeOf(type);
      if (!known || !(fields >> property.name))
        fail("expected 'property TYPE NAME', found '" + std::string(line) + "'");
      property.type = *known;
      header.elements.back().properties.push_back(property);
    }
  }
  if (!has_format) throw InputError(path, "expected a line 'format' in the header, found none");
  return header;
}

// Numbers one after the other, whatever the form.
class PlyValues {
 public:
  PlyValues(std::string_view bytes, const Header& header, const std::filesystem::path& path)
      : bytes_(bytes), form_(header.form), path_(path), at_(header.size), line_(header.num_lines) {}

  double Next(PlyType type, const std::string& what) {
    return form_ == PlyForm::kText ? NextWord(what) : NextBytes(type, what);
  }

  // Elements of `min_bytes` each that can still be there.
  void CheckCount(uint64_t count, size_t min_bytes, const std::string& what) const {
    const size_t left = bytes_.size() - at_ + 1;  // text may lack its last newline
    if (count <= left / std::max<size_t>(1, min_bytes)) return;
    Fail(fmt::format("expected {} {} elements, found the end of the file: it is truncated", count,
                     what));
  }

  [[noreturn]] void Fail(const std::string& message) const {
    if (form_ == PlyForm::kText) throw InputError::AtLine(path_, line_ + 1, message);
    throw InputError::AtByte(path_, field_, message);
  }

 private:
  double NextWord(const std::string& what) {
    while (at_ < bytes_.size() && IsSpace(bytes_[at_])) {
      if (bytes_[at_] == '\n') ++line_;
      ++at_;
    }
    size_t end = at_;
    while (end < bytes_.size() && !IsSpace(bytes_[end])) ++end;
    const std::string_view word = bytes_.substr(at_, end - at_);
    const size_t sign = word.starts_with('+') ? 1 : 0;
    double value;
    const auto [stop, error] =
        std::from_chars(word.data() + sign, word.data() + word.size(), value);
    if (word.empty() || error != std::errc() || stop != word.data() + word.size()) {
      Fail(fmt::format("expected {} (a number), found {}", what,
                       word.empty() ? std::string("the end of the file")
                                    : "'" + std::string(word.substr(0, 40)) + "'"));
    }
    at_ = end;
    return value;
  }

  double NextBytes(PlyType type, const std::string& what) {
    const size_t size = BytesOf(type);
    field_ = at_;
    if (bytes_.size() - at_ < size) {
      Fail(fmt::format("expected {} of {}, found {} more only: the file is truncated", what,
                       Counted(size, "byte"), Counted(bytes_.size() - at_, "byte")));
    }
    char raw[8];
    for (size_t i = 0; i < size; ++i) {
      raw[i] = bytes_[at_ + (form_ == PlyForm::kBigEndian ? size - 1 - i : i)];
    }
    at_ += size;
    switch (type) {
      case PlyType::kInt8:
        return As<int8_t>(raw);
      case PlyType::kUint8:
        return As<uint8_t>(raw);
      case PlyType::kInt16:
        return As<int16_t>(raw);
      case PlyType::kUint16:
        return As<uint16_t>(raw);
      case PlyType::kInt32:
        return As<int32_t>(raw);
      case PlyType::kUint32:
        return As<uint32_t>(raw);
      case PlyType::kFloat:
        return As<float>(raw);
      case PlyType::kDouble:
        return As<double>(raw);
    }
    return 0.0;
  }

  static bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
  template <typename T>
  static double As(const char* raw) {
    T value;
    std::memcpy(&value, raw, sizeof(T));
    return static_cast<double>(value);
  }

  std::string_view bytes_;
  PlyForm form_;
  const std::filesystem::path& path_;
  size_t at_, field_ = 0;
  uint64_t line_;
};

uint32_t VertexIndex(double value, const PlyValues& values) {
  if (!(value >= 0.0 && value < std::numeric_limits<uint32_t>::max()) ||
      value != std::floor(value)) {
    values.Fail(fmt::format("expected the index of a vertex, found {}", value));
  }
  return static_cast<uint32_t>(value);
}

// The three that place a vertex, or none.
std::array<int, 3> PositionProperties(const Element& element) {
  std::array<int, 3> at{-1, -1, -1};
  for (size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    for (int axis = 0; axis < 3; ++axis) {
      if (!property.count_type && property.name == std::string(1, "xyz"[axis]))
        at[axis] = static_cast<int>(i);
    }
  }
  return at;
}

void ReadElement(const Element& element, PlyValues* values, FileGeometry* geometry) {
  size_t min_bytes = 0;
  for (const Property& property : element.properties) {
    min_bytes += BytesOf(property.count_type.value_or(property.type));
  }
  values->CheckCount(element.count, std::min<size_t>(min_bytes, 2 * element.properties.size()),
                     element.name);
  const bool is_vertex = element.name == "vertex", is_face = element.name == "face";
  const bool is_edge = element.name == "edge";
  const std::array<int, 3> position = PositionProperties(element);
  if (is_vertex && *std::min_element(position.begin(), position.end()) < 0)
    values->Fail("expected vertices with the properties x, y and z, found others");
  if (is_vertex) geometry->vertices.reserve(element.count);
  std::vector<uint32_t> corners;
  for (uint64_t i = 0; i < element.count; ++i) {
    Eigen::Vector3d xyz;
    std::array<uint32_t, 2> edge{};
    for (size_t k = 0; k < element.properties.size(); ++k) {
      const Property& property = element.properties[k];
      if (property.count_type) {
        const double length = values->Next(*property.count_type, property.name);
        if (!(length >= 0.0 && length == std::floor(length) && length < 1e9))
          values->Fail(fmt::format("expected the length of a list, found {}", length));
        const bool is_corners =
            is_face && (property.name == "vertex_indices" || property.name == "vertex_index");
        corners.clear();
        for (uint64_t n = static_cast<uint64_t>(length); n > 0; --n) {
          const double value = values->Next(property.type, property.name);
          if (is_corners) corners.push_back(VertexIndex(value, *values));
        }
        for (size_t n = 2; n < corners.size(); ++n) {
          geometry->triangles.push_back({corners[0], corners[n - 1], corners[n]});
        }
        continue;
      }
      const double value = values->Next(property.type, property.name);
      if (is_vertex) {
        for (int axis = 0; axis < 3; ++axis) {
          if (position[axis] != static_cast<int>(k)) continue;
          if (!std::isfinite(value))
            values->Fail(
                fmt::format("expected {} (a finite number), found {}", property.name, value));
          xyz[axis] = value;
        }
      } else if (is_edge && (property.name == "vertex1" || property.name == "vertex2")) {
        edge[property.name == "vertex2"] = VertexIndex(value, *values);
      }
    }
    if (is_vertex) geometry->vertices.push_back(xyz);
    if (is_edge) geometry->edges.push_back(edge);
  }
}

template <size_t n>
void CheckIndices(const std::vector<std::array<uint32_t, n>>& things, const char* what,
                  size_t num_vertices, const std::filesystem::path& path) {
  for (const auto& thing : things) {
    for (const uint32_t index : thing) {
      if (index < num_vertices) continue;
      throw InputError(path, fmt::format("expected {} of vertices 0 to {}, found the index {}",
                                         what, num_vertices - 1, index));
    }
  }
}

void CheckContent(const FileGeometry& geometry, GeometryContent content,
                  const std::filesystem::path& path) {
  CheckIndices(geometry.triangles, "faces", geometry.vertices.size(), path);
  CheckIndices(geometry.edges, "edges", geometry.vertices.size(), path);
  if (geometry.vertices.empty()) throw InputError(path, "expected vertices, found none");
  if (content == GeometryContent::kTriangles && geometry.triangles.empty()) {
    throw InputError(path,
                     "expected a mesh with faces, found vertices only; give a cloud of points by "
                     "--point_cloud_path");
  }
  if (content == GeometryContent::kEdges && geometry.edges.empty())
    throw InputError(path, "expected the element 'edge' with vertex1 and vertex2, found none");
}

FileGeometry ReadObj(const std::filesystem::path& path) {
  const std::string bytes = ReadFileBytes(path);
  FileGeometry geometry;
  std::vector<uint32_t> corners;
  TextIn in(bytes, path);
  while (in.NextRecord()) {
    const std::string_view kind = in.Word("the kind of the line", "a word");
    if (kind == "v") {
      const double x = in.Real("x"), y = in.Real("y"), z = in.Real("z");
      geometry.vertices.emplace_back(x, y, z);
    } else if (kind == "f") {
      corners.clear();
      while (!in.AtRecordEnd()) {
        const std::string_view word = in.Word("a corner", "an index");
        const std::string_view digits = word.substr(0, word.find('/'));
        int64_t index = 0;
        const std::errc error =
            std::from_chars(digits.data(), digits.data() + digits.size(), index).ec;
        // Indices count from 1, or backwards from the last vertex.
        const int64_t size = static_cast<int64_t>(geometry.vertices.size());
        if (index < 0) index += size + 1;
        if (error != std::errc() || index < 1 || index > size) {
          in.Fail(fmt::format("expected the index of a vertex (1 to {}), found '{}'", size,
                              std::string(word.substr(0, 40))));
        }
        corners.push_back(static_cast<uint32_t>(index - 1));
      }
      for (size_t n = 2; n < corners.size(); ++n) {
        geometry.triangles.push_back({corners[0], corners[n - 1], corners[n]});
      }
    }
  }
  CheckContent(geometry, GeometryContent::kTriangles, path);
  return geometry;
}

// The value of NAME="VALUE" in a tag. Empty: it has none.
std::optional<std::string> Attribute(std::string_view tag, const std::string& name) {
  const size_t at = tag.find(" " + name + "=\"");
  if (at == std::string_view::npos) return std::nullopt;
  const size_t begin = at + name.size() + 3, end = tag.find('"', begin);
  if (end == std::string_view::npos) return std::nullopt;
  return std::string(tag.substr(begin, end - begin));
}

Rigid3d RigidMotion(std::string_view text, const std::filesystem::path& path) {
  std::istringstream numbers{std::string(text)};
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 16; ++i) {
    if (!(numbers >> matrix(i / 4, i % 4)))
      throw InputError(path, "expected 16 numbers in <MLMatrix44>, found others");
  }
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  // Files hold some 7 digits.
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3) ||
      !(R.determinant() > 0.0)) {
    throw InputError(path, "a matrix of a scan must be a rotation and a translation");
  }
  return {Eigen::Quaterniond(R).normalized(), matrix.topRightCorner<3, 1>()};
}

}  // namespace

FileGeometry ReadPly(const std::filesystem::path& path, GeometryContent content) {
  return ParsePly(ReadFileBytes(path), path, content);
}

FileGeometry ParsePly(std::string_view bytes, const std::filesystem::path& path,
                      GeometryContent content) {
  const Header header = ReadHeader(bytes, path);
  PlyValues values(bytes, header, path);
  FileGeometry geometry;
  for (const Element& element : header.elements) ReadElement(element, &values, &geometry);
  CheckContent(geometry, content, path);
  return geometry;
}

FileGeometry ReadMesh(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".obj" || extension == ".OBJ") return ReadObj(path);
  return ReadPly(path, GeometryContent::kTriangles);
}

std::vector<LaserScan> ReadMeshLabProject(const std::filesystem::path& path) {
  const std::string bytes = ReadFileBytes(path);
  const std::string_view text = bytes;
  std::vector<LaserScan> scans;
  for (size_t at = text.find("<MLMesh "); at != std::string_view::npos;
       at = text.find("<MLMesh ", at + 1)) {
    const size_t tag_end = text.find('>', at);
    const auto name = Attribute(text.substr(at, std::min(tag_end, text.size()) - at), "filename");
    const size_t next = text.find("<MLMesh ", at + 1);
    const size_t open = text.find("<MLMatrix44>", at), close = text.find("</MLMatrix44>", at);
    if (!name || open == std::string_view::npos || close == std::string_view::npos ||
        close > std::min(next, text.size())) {
      throw InputError(path,
                       "expected each MLMesh with a filename and an MLMatrix44, found one without");
    }
    LaserScan scan;
    scan.path = path.parent_path() / *name;
    scan.world_from_scan = RigidMotion(text.substr(open + 12, close - open - 12), path);
    scan.points = ReadPly(scan.path, GeometryContent::kVertices).vertices;
    scans.push_back(std::move(scan));
  }
  if (scans.empty())
    throw InputError(path, "expected a MeshLab project with at least one MLMesh, found none");
  return scans;
}

void WriteTrianglePly(const std::vector<Eigen::Vector3d>& vertices,
                      const std::vector<std::array<uint32_t, 3>>& triangles, std::ostream* stream) {
  *stream << "ply\nformat binary_little_endian 1.0\n"
          << fmt::format("element vertex {}\n", vertices.size())
          << "property double x\nproperty double y\nproperty double z\n"
          << fmt::format("element face {}\n", triangles.size())
          << "property list uchar int vertex_indices\nend_header\n";
  BinaryOut out(stream);
  for (const Eigen::Vector3d& vertex : vertices) {
    for (int i = 0; i < 3; ++i) out.Real(vertex[i]);
    out.EndRecord();
  }
  for (const auto& triangle : triangles) {
    out.Byte(3);
    for (const uint32_t corner : triangle) out.Index(corner);
    out.EndRecord();
  }
}

}  // namespace holba
