// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/foreign/ply_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <map>
#include <string>

#include "holba/base/error.h"

namespace holba {
namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

struct Property {
  std::string name;
  Type type;
};

size_t SizeOf(Type type) {
  constexpr size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<int>(type)];
}

template <typename T>
double As(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

double Decode(Type type, const char* bytes) {
  switch (type) {
    case Type::kInt8:
      return As<int8_t>(bytes);
    case Type::kUint8:
      return As<uint8_t>(bytes);
    case Type::kInt16:
      return As<int16_t>(bytes);
    case Type::kUint16:
      return As<uint16_t>(bytes);
    case Type::kInt32:
      return As<int32_t>(bytes);
    case Type::kUint32:
      return As<uint32_t>(bytes);
    case Type::kFloat:
      return As<float>(bytes);
    case Type::kDouble:
      return As<double>(bytes);
  }
  return 0.0;
}

class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::filesystem::path& path)
      : rest_(bytes), path_(path) {}

  std::vector<PlyPoint> Read() {
    ReadHeader();
    size_t record_size = 0;
    for (const Property& property : properties_) record_size += SizeOf(property.type);
    // Of a text each value takes two characters at least.
    const size_t least = is_ascii_ ? 2 * properties_.size() : record_size;
    if (num_points_ > (rest_.size() + 1) / std::max<size_t>(least, 1)) {
      Fail(fmt::format("expected {} vertices, found only {} bytes: the file is truncated",
                       num_points_, rest_.size()));
    }
    std::vector<PlyPoint> points;
    points.reserve(num_points_);
    for (size_t i = 0; i < num_points_; ++i) {
      PlyPoint point;
      for (const Property& property : properties_) {
        const double value = is_ascii_ ? TextValue() : BinaryValue(property.type);
        Store(property, value, &point);
      }
      if (!point.xyz.allFinite())
        Fail(fmt::format("expected finite vertices, found another, {}", i));
      points.push_back(point);
    }
    return points;
  }

 private:
  [[noreturn]] void Fail(const std::string& message) const { throw InputError(path_, message); }

  std::vector<std::string> HeaderLine() {
    const size_t end = rest_.find('\n');
    if (end == std::string_view::npos)
      Fail("expected end_header, found that the file is truncated before it");
    std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    std::vector<std::string> words;
    while (true) {
      line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
      if (line.empty()) return words;
      const size_t size = std::min(line.find_first_of(" \t\r"), line.size());
      words.emplace_back(line.substr(0, size));
      line.remove_prefix(size);
    }
  }

  Type TypeOf(const std::string& word) const {
    static const std::map<std::string, Type> types = {
        {"char", Type::kInt8},     {"int8", Type::kInt8},     {"uchar", Type::kUint8},
        {"uint8", Type::kUint8},   {"short", Type::kInt16},   {"int16", Type::kInt16},
        {"ushort", Type::kUint16}, {"uint16", Type::kUint16}, {"int", Type::kInt32},
        {"int32", Type::kInt32},   {"uint", Type::kUint32},   {"uint32", Type::kUint32},
        {"float", Type::kFloat},   {"float32", Type::kFloat}, {"double", Type::kDouble},
        {"float64", Type::kDouble}};
    const auto found = types.find(word);
    if (found == types.end())
      Fail(fmt::format("expected a type of numbers for a property of vertices, found '{}'", word));
    return found->second;
  }

  void ReadHeader() {
    if (HeaderLine() != std::vector<std::string>{"ply"})
      Fail("expected a PLY file, found no 'ply'");
    bool in_vertices = false, before_vertices = true;
    while (true) {
      const std::vector<std::string> words = HeaderLine();
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      if (words[0] == "format" && words.size() > 1) {
        is_ascii_ = words[1] == "ascii";
        if (!is_ascii_ && words[1] != "binary_little_endian")
          Fail(fmt::format("expected ascii or binary_little_endian, found '{}'", words[1]));
      } else if (words[0] == "element" && words.size() == 3) {
        in_vertices = words[1] == "vertex";
        if (in_vertices) {
          const std::string& count = words[2];
          const auto [end, error] =
              std::from_chars(count.data(), count.data() + count.size(), num_points_);
          if (error != std::errc() || end != count.data() + count.size())
            Fail(fmt::format("expected the number of vertices, found '{}'", count));
          before_vertices = false;
        } else if (before_vertices) {
          Fail(fmt::format("expected vertices first, found the element '{}'", words[1]));
        }
      } else if (words[0] == "property" && in_vertices) {
        if (words.size() != 3) Fail("expected properties of one number of vertices, found a list");
        properties_.push_back({words[2], TypeOf(words[1])});
      }
    }
    for (const char* name : {"x", "y", "z"}) {
      if (std::none_of(properties_.begin(), properties_.end(),
                       [&](const Property& property) { return property.name == name; }))
        Fail(fmt::format("expected the property {} of vertices, found none", name));
    }
  }

  double BinaryValue(Type type) {
    const double value = Decode(type, rest_.data());
    rest_.remove_prefix(SizeOf(type));
    return value;
  }
  double TextValue() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size()));
    double value = 0.0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc()) Fail("expected another number of a vertex, found none");
    rest_.remove_prefix(static_cast<size_t>(end - rest_.data()));
    return value;
  }

  static void Store(const Property& property, double value, PlyPoint* point) {
    const bool is_real = property.type == Type::kFloat || property.type == Type::kDouble;
    const auto channel = [&] {
      // Colours as reals go from 0 to 1.
      const double scaled = is_real ? 255.0 * value : value;
      return static_cast<uint8_t>(std::isfinite(scaled) ? std::clamp(scaled, 0.0, 255.0) : 0.0);
    };
    if (property.name == "x") point->xyz.x() = value;
    if (property.name == "y") point->xyz.y() = value;
    if (property.name == "z") point->xyz.z() = value;
    if (property.name == "red") point->rgb[0] = channel();
    if (property.name == "green") point->rgb[1] = channel();
    if (property.name == "blue") point->rgb[2] = channel();
  }

  std::string_view rest_;
  const std::filesystem::path path_;
  std::vector<Property> properties_;
  size_t num_points_ = 0;
  bool is_ascii_ = true;
};

}  // namespace

std::vector<PlyPoint> ParsePlyPoints(std::string_view bytes, const std::filesystem::path& path) {
  return PlyReader(bytes, path).Read();
}

}  // namespace holba
