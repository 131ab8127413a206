// SPDX-License-Identifier: BSD-3-Clause
// Our tables of a Database. Blobs, row by row:
//   holba_segments.data             f64 x1 y1 x2 y2
//   holba_segment_descriptors.data  f32[kSegmentDescriptorSize]
//   holba_corners.data              f64 x y; descriptors: u8[kCornerDescriptorSize] or NULL
//   holba_vanishing_points.data     f64 direction x y z; support: u32; vp_of_segment: i32
//   holba_label_maps.data           runs of pixels: u16 label, then the run's length in groups of 7
//                                   bits, low ones first, the high bit set in all but the last;
//                                   types: lines "LABEL TYPE"
//   holba_normals.labels            u16; data: f64 normal x y z, sigma in degrees
//   holba_line_matches.data         u32 idx1 idx2; distances: f32
#include <algorithm>
#include <sstream>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/io/database_statement.h"

namespace holba {
namespace {

constexpr double kUnitTolerance = 1e-6;
// Of a label map, so that a damaged row cannot ask for all memory.
constexpr int64_t kMaxNumPixels = int64_t{1} << 28;

std::string SizeFault(int64_t num_rows, const char* what, size_t num_bytes) {
  return fmt::format("expected {} {}, found {} bytes", num_rows, what, num_bytes);
}

bool IsUnit(const Eigen::Vector3d& v) { return std::abs(v.norm() - 1.0) <= kUnitTolerance; }

std::vector<uint8_t> EncodeRuns(const std::vector<uint16_t>& labels) {
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < labels.size();) {
    size_t end = i + 1;
    while (end < labels.size() && labels[end] == labels[i]) ++end;
    bytes.push_back(static_cast<uint8_t>(labels[i] & 0xff));
    bytes.push_back(static_cast<uint8_t>(labels[i] >> 8));
    for (size_t length = end - i; length > 0; length >>= 7) {
      bytes.push_back(static_cast<uint8_t>((length & 0x7f) | (length > 0x7f ? 0x80 : 0)));
    }
    i = end;
  }
  return bytes;
}

// Empty: these are no runs that fill `num_labels`.
std::optional<std::vector<uint16_t>> DecodeRuns(std::span<const uint8_t> bytes, size_t num_labels) {
  std::vector<uint16_t> labels;
  labels.reserve(num_labels);
  for (size_t i = 0; i < bytes.size();) {
    if (bytes.size() - i < 3) return std::nullopt;
    const auto label = static_cast<uint16_t>(bytes[i] | (bytes[i + 1] << 8));
    i += 2;
    size_t length = 0;
    for (int shift = 0;; shift += 7) {
      if (i == bytes.size() || shift > 28) return std::nullopt;
      const uint8_t byte = bytes[i++];
      length |= static_cast<size_t>(byte & 0x7f) << shift;
      if ((byte & 0x80) == 0) break;
    }
    if (length == 0 || length > num_labels - labels.size()) return std::nullopt;
    labels.insert(labels.end(), length, label);
  }
  if (labels.size() != num_labels) return std::nullopt;
  return labels;
}

}  // namespace

std::optional<std::vector<LineSegment2d>> Database::ReadSegments(
    image_t image_id, const std::string& settings) const {
  if (!HasOurTables()) return std::nullopt;
  Statement row(*this, "SELECT rows, data FROM holba_segments WHERE image_id = ? AND settings = ?");
  if (!row.Integer(image_id).Text(settings).Step()) return std::nullopt;
  const auto values = row.GetArray<double>(1, row.GetInteger(0), 4);
  if (!values) {
    FailRow("holba_segments", ImageKey(image_id),
            SizeFault(row.GetInteger(0), "segments of 4 doubles", row.GetBytes(1).size()));
  }
  std::vector<LineSegment2d> segments(values->size() / 4);
  for (size_t i = 0; i < segments.size(); ++i) {
    const double* v = values->data() + 4 * i;
    segments[i] = {{v[0], v[1]}, {v[2], v[3]}};
    if (!segments[i].start.allFinite() || !segments[i].end.allFinite()) {
      FailRow("holba_segments", ImageKey(image_id),
              fmt::format("the ends of segment {} are not finite", i));
    }
    if (segments[i].start == segments[i].end) {
      FailRow("holba_segments", ImageKey(image_id), fmt::format("segment {} has no length", i));
    }
  }
  return segments;
}

std::optional<std::string> Database::ReadSegmentSettings(image_t image_id) const {
  return StoredSettings("holba_segments", ImageKey(image_id));
}

std::optional<std::string> Database::ReadCornerSettings(image_t image_id) const {
  return StoredSettings("holba_corners", ImageKey(image_id));
}

std::optional<std::string> Database::ReadVanishingPointSettings(image_t image_id) const {
  return StoredSettings("holba_vanishing_points", ImageKey(image_id));
}

std::optional<std::string> Database::ReadLineMatchSettings(image_t image_id1,
                                                           image_t image_id2) const {
  return StoredSettings("holba_line_matches", OurPairKey(image_id1, image_id2));
}

std::optional<std::string> Database::StoredSettings(const char* table,
                                                    const std::string& key) const {
  if (!HasOurTables()) return std::nullopt;
  Statement row(*this, fmt::format("SELECT settings FROM {} WHERE {}", table, key));
  if (!row.Step()) return std::nullopt;
  return row.GetText(0);
}

void Database::WriteSegments(image_t image_id, const std::string& settings,
                             const std::vector<LineSegment2d>& segments) {
  std::vector<double> values;
  values.reserve(4 * segments.size());
  for (const LineSegment2d& segment : segments) {
    HOLBA_CHECK(segment.start.allFinite() && segment.end.allFinite());
    HOLBA_CHECK(segment.start != segment.end);
    values.insert(values.end(),
                  {segment.start.x(), segment.start.y(), segment.end.x(), segment.end.y()});
  }
  Transaction transaction(this);
  CreateOurTables();
  for (const char* table : {"holba_segment_descriptors", "holba_vanishing_points"}) {
    Statement(*this, fmt::format("DELETE FROM {} WHERE image_id = ?", table))
        .Integer(image_id)
        .Run();
  }
  Statement(*this, "DELETE FROM holba_line_matches WHERE image_id1 = ? OR image_id2 = ?")
      .Integer(image_id)
      .Integer(image_id)
      .Run();
  Statement(*this,
            "INSERT OR REPLACE INTO holba_segments(image_id, settings, rows, data) "
            "VALUES(?, ?, ?, ?)")
      .Integer(image_id)
      .Text(settings)
      .Integer(static_cast<int64_t>(segments.size()))
      .Bytes(values)
      .Run();
  transaction.Commit();
}

std::optional<std::vector<float>> Database::ReadSegmentDescriptors(
    image_t image_id, const std::string& settings) const {
  if (!HasOurTables()) return std::nullopt;
  const std::optional<size_t> num_segments = NumRows("holba_segments", image_id);
  if (!num_segments) return std::nullopt;  // they would belong to nothing
  const char* table = "holba_segment_descriptors";
  Statement row(
      *this, fmt::format("SELECT rows, data FROM {} WHERE image_id = ? AND settings = ?", table));
  if (!row.Integer(image_id).Text(settings).Step()) return std::nullopt;
  auto values = row.GetArray<float>(1, row.GetInteger(0), kSegmentDescriptorSize);
  if (!values) {
    FailRow(table, ImageKey(image_id),
            SizeFault(row.GetInteger(0), "descriptors of 72 floats", row.GetBytes(1).size()));
  }
  if (values->size() != *num_segments * kSegmentDescriptorSize) {
    FailRow(table, ImageKey(image_id),
            fmt::format("the image has {} segments, found descriptors of {}", *num_segments,
                        row.GetInteger(0)));
  }
  if (!AllFinite(*values)) FailRow(table, ImageKey(image_id), "a value is not a finite number");
  return values;
}

void Database::WriteSegmentDescriptors(image_t image_id, const std::string& settings,
                                       const std::vector<float>& descriptors) {
  HOLBA_CHECK(descriptors.size() % kSegmentDescriptorSize == 0 && AllFinite(descriptors));
  const size_t num = descriptors.size() / kSegmentDescriptorSize;
  Transaction transaction(this);
  CreateOurTables();
  HOLBA_CHECK_MSG(NumRows("holba_segments", image_id) == num,
                  "segment descriptors are written after their segments, one for each");
  Statement(*this,
            "INSERT OR REPLACE INTO holba_segment_descriptors(image_id, settings, rows, data) "
            "VALUES(?, ?, ?, ?)")
      .Integer(image_id)
      .Text(settings)
      .Integer(static_cast<int64_t>(num))
      .Bytes(descriptors)
      .Run();
  transaction.Commit();
}

std::optional<ImageCorners> Database::ReadCorners(image_t image_id,
                                                  const std::string& settings) const {
  if (!HasOurTables()) return std::nullopt;
  Statement row(*this,
                "SELECT rows, data, descriptors FROM holba_corners WHERE image_id = ? AND "
                "settings = ?");
  if (!row.Integer(image_id).Text(settings).Step()) return std::nullopt;
  const int64_t num_rows = row.GetInteger(0);
  const auto fail = [&](const std::string& message) {
    FailRow("holba_corners", ImageKey(image_id), message);
  };
  const auto values = row.GetArray<double>(1, num_rows, 2);
  if (!values) fail(SizeFault(num_rows, "corners of 2 doubles", row.GetBytes(1).size()));
  if (!AllFinite(*values)) fail("a coordinate is not a finite number");
  ImageCorners corners;
  for (size_t i = 0; i < values->size(); i += 2) {
    corners.positions.emplace_back((*values)[i], (*values)[i + 1]);
  }
  if (!row.IsNull(2)) {
    auto descriptors = row.GetArray<uint8_t>(2, num_rows, kCornerDescriptorSize);
    if (!descriptors) {
      fail(SizeFault(num_rows, "descriptors of 128 bytes", row.GetBytes(2).size()));
    }
    corners.descriptors = std::move(*descriptors);
  }
  return corners;
}

void Database::WriteCorners(image_t image_id, const std::string& settings,
                            const ImageCorners& corners) {
  HOLBA_CHECK(corners.descriptors.empty() ||
              corners.descriptors.size() == corners.positions.size() * kCornerDescriptorSize);
  std::vector<double> values;
  for (const Eigen::Vector2d& corner : corners.positions) {
    HOLBA_CHECK(corner.allFinite());
    values.insert(values.end(), {corner.x(), corner.y()});
  }
  Transaction transaction(this);
  CreateOurTables();
  Statement insert(*this,
                   "INSERT OR REPLACE INTO holba_corners(image_id, settings, rows, data, "
                   "descriptors) VALUES(?, ?, ?, ?, ?)");
  insert.Integer(image_id)
      .Text(settings)
      .Integer(static_cast<int64_t>(corners.positions.size()))
      .Bytes(values);
  corners.descriptors.empty() ? insert.Null() : insert.Bytes(corners.descriptors);
  insert.Run();
  transaction.Commit();
}

std::optional<ImageVanishingPoints> Database::ReadVanishingPoints(
    image_t image_id, const std::string& settings) const {
  if (!HasOurTables()) return std::nullopt;
  const std::optional<size_t> num_segments = NumRows("holba_segments", image_id);
  if (!num_segments) return std::nullopt;
  Statement row(*this,
                "SELECT rows, data, support, num_segments, vp_of_segment FROM "
                "holba_vanishing_points WHERE image_id = ? AND settings = ?");
  if (!row.Integer(image_id).Text(settings).Step()) return std::nullopt;
  const int64_t num_rows = row.GetInteger(0);
  const auto fail = [&](const std::string& message) {
    FailRow("holba_vanishing_points", ImageKey(image_id), message);
  };
  const auto values = row.GetArray<double>(1, num_rows, 3);
  if (!values) fail(SizeFault(num_rows, "directions of 3 doubles", row.GetBytes(1).size()));
  const auto support = row.GetArray<uint32_t>(2, num_rows, 1);
  if (!support) fail(SizeFault(num_rows, "counts of 4 bytes", row.GetBytes(2).size()));
  auto labels = row.GetArray<int32_t>(4, row.GetInteger(3), 1);
  if (!labels) {
    fail(SizeFault(row.GetInteger(3), "labels of 4 bytes", row.GetBytes(4).size()));
  }
  if (labels->size() != *num_segments) {
    fail(fmt::format("the image has {} segments, found labels of {}", *num_segments,
                     labels->size()));
  }
  ImageVanishingPoints result;
  for (size_t i = 0; i < support->size(); ++i) {
    const Eigen::Vector3d direction(values->data() + 3 * i);
    if (!IsUnit(direction)) {
      fail(fmt::format("direction {} has length {}, expected 1", i, direction.norm()));
    }
    result.points.push_back({direction, (*support)[i]});
  }
  for (const int32_t label : *labels) {
    if (label < -1 || label >= num_rows) {
      fail(fmt::format("a segment has the label {}, expected -1 to {}", label, num_rows - 1));
    }
  }
  result.vp_of_segment = std::move(*labels);
  return result;
}

void Database::WriteVanishingPoints(image_t image_id, const std::string& settings,
                                    const ImageVanishingPoints& vanishing_points) {
  std::vector<double> values;
  std::vector<uint32_t> support;
  for (const ImageVanishingPoint& point : vanishing_points.points) {
    const Eigen::Vector3d& d = point.direction_in_cam;
    HOLBA_CHECK(IsUnit(d));
    values.insert(values.end(), {d.x(), d.y(), d.z()});
    support.push_back(point.num_segments);
  }
  for (const int32_t label : vanishing_points.vp_of_segment) {
    HOLBA_CHECK(label >= -1 && label < static_cast<int64_t>(support.size()));
  }
  const size_t num_labels = vanishing_points.vp_of_segment.size();
  Transaction transaction(this);
  CreateOurTables();
  HOLBA_CHECK_MSG(NumRows("holba_segments", image_id) == num_labels,
                  "vanishing points are written after their segments, a label for each");
  Statement(*this,
            "INSERT OR REPLACE INTO holba_vanishing_points(image_id, settings, rows, data, "
            "support, num_segments, vp_of_segment) VALUES(?, ?, ?, ?, ?, ?, ?)")
      .Integer(image_id)
      .Text(settings)
      .Integer(static_cast<int64_t>(support.size()))
      .Bytes(values)
      .Bytes(support)
      .Integer(static_cast<int64_t>(num_labels))
      .Bytes(vanishing_points.vp_of_segment)
      .Run();
  transaction.Commit();
}

std::optional<LabelMap> Database::ReadLabelMap(image_t image_id,
                                               const std::string& settings) const {
  if (!HasOurTables()) return std::nullopt;
  Statement row(*this,
                "SELECT width, height, types, data FROM holba_label_maps WHERE image_id = ? AND "
                "settings = ?");
  if (!row.Integer(image_id).Text(settings).Step()) return std::nullopt;
  const auto fail = [&](const std::string& message) {
    FailRow("holba_label_maps", ImageKey(image_id), message);
  };
  const int64_t width = row.GetInteger(0), height = row.GetInteger(1);
  if (width < 0 || height < 0 || width > kMaxNumPixels || height > kMaxNumPixels ||
      width * height > kMaxNumPixels) {
    fail(fmt::format("a map of {} x {} labels is too large", width, height));
  }
  LabelMap map;
  map.width = static_cast<int>(width);
  map.height = static_cast<int>(height);
  auto labels = DecodeRuns(row.GetBytes(3), static_cast<size_t>(width * height));
  if (!labels) fail(fmt::format("the runs of labels do not fill {} x {} pixels", width, height));
  map.labels = std::move(*labels);
  std::istringstream lines(row.GetText(2));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    int64_t label = -1;
    std::string name;
    fields >> label >> name;
    const GroupType* type = FindGroupType(name);
    if (!fields || label < 0 || label > 0xffff || type == nullptr) {
      fail(fmt::format("expected a label and a group type, found '{}'", line));
    }
    map.types.emplace(static_cast<uint16_t>(label), type);
  }
  return map;
}

void Database::WriteLabelMap(image_t image_id, const std::string& settings,
                             const LabelMap& label_map) {
  HOLBA_CHECK(label_map.width >= 0 && label_map.height >= 0);
  const auto num_pixels = static_cast<int64_t>(label_map.labels.size());
  HOLBA_CHECK(static_cast<int64_t>(label_map.width) * label_map.height == num_pixels);
  HOLBA_CHECK_MSG(num_pixels <= kMaxNumPixels, "a label map of more than 2^28 pixels");
  std::string types;
  for (const auto& [label, type] : label_map.types) {
    types += fmt::format("{} {}\n", label, type->name);
  }
  const std::vector<uint8_t> runs = EncodeRuns(label_map.labels);
  Transaction transaction(this);
  CreateOurTables();
  Statement(*this,
            "INSERT OR REPLACE INTO holba_label_maps(image_id, settings, width, height, types, "
            "data) VALUES(?, ?, ?, ?, ?, ?)")
      .Integer(image_id)
      .Text(settings)
      .Integer(label_map.width)
      .Integer(label_map.height)
      .Text(types)
      .Bytes(runs)
      .Run();
  transaction.Commit();
}

std::optional<std::map<uint16_t, RegionNormal>> Database::ReadNormals(
    image_t image_id, const std::string& settings) const {
  if (!HasOurTables()) return std::nullopt;
  Statement row(*this,
                "SELECT rows, labels, data FROM holba_normals WHERE image_id = ? AND settings = ?");
  if (!row.Integer(image_id).Text(settings).Step()) return std::nullopt;
  const int64_t num_rows = row.GetInteger(0);
  const auto fail = [&](const std::string& message) {
    FailRow("holba_normals", ImageKey(image_id), message);
  };
  const auto labels = row.GetArray<uint16_t>(1, num_rows, 1);
  if (!labels) fail(SizeFault(num_rows, "labels of 2 bytes", row.GetBytes(1).size()));
  const auto values = row.GetArray<double>(2, num_rows, 4);
  if (!values) fail(SizeFault(num_rows, "normals of 4 doubles", row.GetBytes(2).size()));
  std::map<uint16_t, RegionNormal> normals;
  for (size_t i = 0; i < labels->size(); ++i) {
    const double* v = values->data() + 4 * i;
    const RegionNormal normal{{v[0], v[1], v[2]}, v[3]};
    if (!IsUnit(normal.normal_in_cam) || !(normal.sigma_deg >= 0.0 && normal.sigma_deg < 1e6)) {
      fail(fmt::format("label {}: expected a unit normal and a standard deviation", (*labels)[i]));
    }
    if (!normals.emplace((*labels)[i], normal).second) {
      fail(fmt::format("label {} has two normals", (*labels)[i]));
    }
  }
  return normals;
}

void Database::WriteNormals(image_t image_id, const std::string& settings,
                            const std::map<uint16_t, RegionNormal>& normals) {
  std::vector<uint16_t> labels;
  std::vector<double> values;
  for (const auto& [label, normal] : normals) {
    const Eigen::Vector3d& n = normal.normal_in_cam;
    HOLBA_CHECK(IsUnit(n) && normal.sigma_deg >= 0.0 && normal.sigma_deg < 1e6);
    labels.push_back(label);
    values.insert(values.end(), {n.x(), n.y(), n.z(), normal.sigma_deg});
  }
  Transaction transaction(this);
  CreateOurTables();
  Statement(*this,
            "INSERT OR REPLACE INTO holba_normals(image_id, settings, rows, labels, data) "
            "VALUES(?, ?, ?, ?, ?)")
      .Integer(image_id)
      .Text(settings)
      .Integer(static_cast<int64_t>(labels.size()))
      .Bytes(labels)
      .Bytes(values)
      .Run();
  transaction.Commit();
}

std::optional<std::vector<LineMatch>> Database::ReadLineMatches(image_t image_id1,
                                                                image_t image_id2,
                                                                const std::string& settings) const {
  HOLBA_CHECK(image_id1 != image_id2);
  if (!HasOurTables()) return std::nullopt;
  const bool swap = image_id1 > image_id2;
  if (swap) std::swap(image_id1, image_id2);
  const std::optional<size_t> num1 = NumRows("holba_segments", image_id1),
                              num2 = NumRows("holba_segments", image_id2);
  if (!num1 || !num2) return std::nullopt;  // they would belong to nothing
  Statement row(*this,
                "SELECT rows, data, distances FROM holba_line_matches WHERE image_id1 = ? AND "
                "image_id2 = ? AND settings = ?");
  if (!row.Integer(image_id1).Integer(image_id2).Text(settings).Step()) return std::nullopt;
  const auto fail = [&](const std::string& message) {
    FailRow("holba_line_matches", OurPairKey(image_id1, image_id2), message);
  };
  const int64_t num_rows = row.GetInteger(0);
  const auto idxs = row.GetArray<uint32_t>(1, num_rows, 2);
  if (!idxs) fail(SizeFault(num_rows, "pairs of indices", row.GetBytes(1).size()));
  const auto distances = row.GetArray<float>(2, num_rows, 1);
  if (!distances) fail(SizeFault(num_rows, "floats", row.GetBytes(2).size()));
  std::vector<LineMatch> matches(distances->size());
  for (size_t i = 0; i < matches.size(); ++i) {
    LineMatch& match = matches[i];
    match = {(*idxs)[2 * i], (*idxs)[2 * i + 1], (*distances)[i]};
    if (match.idx1 >= *num1 || match.idx2 >= *num2) {
      fail(fmt::format("a match names segments {} and {}, the images have {} and {}", match.idx1,
                       match.idx2, *num1, *num2));
    }
    if (!std::isfinite(match.distance)) fail("a distance is not a finite number");
    if (swap) std::swap(match.idx1, match.idx2);
  }
  return matches;
}

void Database::WriteLineMatches(image_t image_id1, image_t image_id2, const std::string& settings,
                                const std::vector<LineMatch>& matches) {
  HOLBA_CHECK(image_id1 != image_id2);
  const bool swap = image_id1 > image_id2;
  if (swap) std::swap(image_id1, image_id2);
  Transaction transaction(this);
  CreateOurTables();
  const std::optional<size_t> num1 = NumRows("holba_segments", image_id1),
                              num2 = NumRows("holba_segments", image_id2);
  HOLBA_CHECK_MSG(num1 && num2, "line matches are written after their segments");
  std::vector<uint32_t> idxs;
  std::vector<float> distances;
  for (LineMatch match : matches) {
    if (swap) std::swap(match.idx1, match.idx2);
    HOLBA_CHECK(match.idx1 < *num1 && match.idx2 < *num2 && std::isfinite(match.distance));
    idxs.insert(idxs.end(), {match.idx1, match.idx2});
    distances.push_back(match.distance);
  }
  Statement(*this,
            "INSERT OR REPLACE INTO holba_line_matches(image_id1, image_id2, settings, rows, "
            "data, distances) VALUES(?, ?, ?, ?, ?, ?)")
      .Integer(image_id1)
      .Integer(image_id2)
      .Text(settings)
      .Integer(static_cast<int64_t>(matches.size()))
      .Bytes(idxs)
      .Bytes(distances)
      .Run();
  transaction.Commit();
}

}  // namespace holba
