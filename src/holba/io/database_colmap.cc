// SPDX-License-Identifier: BSD-3-Clause
// COLMAP's own tables of a Database.
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "holba/base/check.h"
#include "holba/base/error.h"
#include "holba/io/database_statement.h"
#include "holba/scene/validity.h"

namespace holba {
namespace {

int64_t PairId(image_t image_id1, image_t image_id2) {
  HOLBA_CHECK_MSG(image_id1 != image_id2 && image_id1 < kMaxNumImages && image_id2 < kMaxNumImages,
                  fmt::format("images {} and {} are no pair", image_id1, image_id2));
  const auto [id1, id2] = std::minmax(image_id1, image_id2);
  return static_cast<int64_t>(kMaxNumImages) * id1 + id2;
}

std::string PairKey(image_t image_id1, image_t image_id2) {
  const auto [id1, id2] = std::minmax(image_id1, image_id2);
  return fmt::format("pair_id = {} /* images {} and {} */", PairId(id1, id2), id1, id2);
}

PointMatches ToMatches(const std::vector<uint32_t>& values) {
  PointMatches matches(values.size() / 2);
  for (size_t i = 0; i < matches.size(); ++i) matches[i] = {values[2 * i], values[2 * i + 1]};
  return matches;
}

std::optional<std::vector<double>> ToBlob(const std::optional<Eigen::Matrix3d>& matrix) {
  if (!matrix) return std::nullopt;
  const RowMajor<3, 3> rows = *matrix;
  return std::vector<double>(rows.data(), rows.data() + 9);
}

}  // namespace

std::string ToString(const Camera& camera) {
  return fmt::format("{} {} {} {}", camera.model->name, camera.width, camera.height,
                     fmt::join(camera.params, " "));
}

std::map<camera_t, DatabaseCamera> Database::ReadCameras() const {
  std::map<camera_t, DatabaseCamera> cameras;
  Statement rows(*this,
                 "SELECT camera_id, model, width, height, params, prior_focal_length FROM cameras");
  while (rows.Step()) {
    const int64_t id = rows.GetInteger(0);
    const std::string key = fmt::format("camera_id = {}", id);
    if (id < 0 || id >= kInvalidId32) FailRow("cameras", key, "the id is no camera's");
    DatabaseCamera entry;
    Camera& camera = entry.camera;
    camera.model = FindCameraModel(static_cast<int>(rows.GetInteger(1)));
    if (camera.model == nullptr) {
      FailRow("cameras", key, fmt::format("there is no camera model {}", rows.GetInteger(1)));
    }
    if (rows.GetInteger(2) < 0 || rows.GetInteger(3) < 0) {
      FailRow("cameras", key, "width or height is negative");
    }
    camera.width = static_cast<uint64_t>(rows.GetInteger(2));
    camera.height = static_cast<uint64_t>(rows.GetInteger(3));
    const auto params = rows.GetArray<double>(4, camera.model->num_params, 1);
    if (!params) {
      FailRow("cameras", key,
              fmt::format("{} has {} parameters ({}), found {} bytes", camera.model->name,
                          camera.model->num_params, camera.model->param_names,
                          rows.GetBytes(4).size()));
    }
    camera.params = *params;
    if (const Fault fault = FindFault(camera)) FailRow("cameras", key, *fault);
    entry.has_prior_focal_length = rows.GetInteger(5) != 0;
    cameras.emplace(static_cast<camera_t>(id), std::move(entry));
  }
  return cameras;
}

std::map<image_t, DatabaseImage> Database::ReadImages() const {
  std::map<image_t, DatabaseImage> images;
  Statement rows(*this, "SELECT image_id, name, camera_id FROM images");
  while (rows.Step()) {
    const int64_t id = rows.GetInteger(0), camera_id = rows.GetInteger(2);
    const std::string key = fmt::format("image_id = {}", id);
    if (id < 0 || id >= kMaxNumImages) FailRow("images", key, "the id is no image's");
    if (camera_id < 0 || camera_id >= kInvalidId32) {
      FailRow("images", key, fmt::format("there is no camera {}", camera_id));
    }
    images.emplace(static_cast<image_t>(id),
                   DatabaseImage{rows.GetText(1), static_cast<camera_t>(camera_id)});
  }
  return images;
}

std::optional<image_t> Database::FindImage(const std::string& name) const {
  Statement row(*this, "SELECT image_id FROM images WHERE name = ?");
  if (!row.Text(name).Step()) return std::nullopt;
  return static_cast<image_t>(row.GetInteger(0));
}

camera_t Database::AddCamera(std::optional<camera_t> camera_id, const DatabaseCamera& entry) {
  HOLBA_CHECK(!FindFault(entry.camera));
  Statement insert(*this,
                   "INSERT INTO cameras(camera_id, model, width, height, params, "
                   "prior_focal_length) VALUES(?, ?, ?, ?, ?, ?)");
  camera_id ? insert.Integer(*camera_id) : insert.Null();
  const Camera& camera = entry.camera;
  insert.Integer(camera.model->id)
      .Integer(static_cast<int64_t>(camera.width))
      .Integer(static_cast<int64_t>(camera.height))
      .Bytes(camera.params)
      .Integer(entry.has_prior_focal_length ? 1 : 0)
      .Run();
  return static_cast<camera_t>(sqlite3_last_insert_rowid(handle_));
}

image_t Database::InsertImage(std::optional<image_t> image_id, const DatabaseImage& image) {
  Statement insert(*this, "INSERT INTO images(image_id, name, camera_id) VALUES(?, ?, ?)");
  image_id ? insert.Integer(*image_id) : insert.Null();
  insert.Text(image.name).Integer(image.camera_id).Run();
  return static_cast<image_t>(sqlite3_last_insert_rowid(handle_));
}

image_t Database::AddImage(std::optional<image_t> image_id, const DatabaseImage& image) {
  Transaction transaction(this);
  const bool keeps_frames = EveryImageHasAFrame();
  const image_t added = InsertImage(image_id, image);
  if (keeps_frames) AddFrame({{added, image.camera_id}});
  transaction.Commit();
  return added;
}

std::optional<size_t> Database::NumRows(const char* table, image_t image_id) const {
  Statement row(*this, fmt::format("SELECT rows FROM {} WHERE image_id = ?", table));
  if (!row.Integer(image_id).Step()) return std::nullopt;
  return static_cast<size_t>(std::max<int64_t>(row.GetInteger(0), 0));
}

std::optional<size_t> Database::NumKeypoints(image_t image_id) const {
  return NumRows("keypoints", image_id);
}

std::optional<Keypoints> Database::ReadKeypoints(image_t image_id) const {
  Statement row(*this, "SELECT rows, cols, data FROM keypoints WHERE image_id = ?");
  if (!row.Integer(image_id).Step()) return std::nullopt;
  const int64_t num_rows = row.GetInteger(0), num_cols = row.GetInteger(1);
  Keypoints keypoints;
  const auto fail = [&](const std::string& message) {
    FailRow("keypoints", ImageKey(image_id), message);
  };
  // Old COLMAPs wrote 0 columns for no keypoints.
  if (num_cols != 2 && num_cols != 4 && num_cols != 6 && !(num_rows == 0 && num_cols == 0)) {
    fail(fmt::format("expected 2, 4 or 6 columns, found {}", num_cols));
  }
  auto data = row.GetArray<float>(2, num_rows, num_cols);
  if (!data) {
    fail(fmt::format("expected {} rows of {} floats, found {} bytes", num_rows, num_cols,
                     row.GetBytes(2).size()));
  }
  if (!AllFinite(*data)) fail("a coordinate is not a finite number");
  keypoints.num_cols = num_cols == 0 ? 2 : static_cast<int>(num_cols);
  keypoints.data = std::move(*data);
  return keypoints;
}

void Database::WriteKeypoints(image_t image_id, const Keypoints& keypoints) {
  HOLBA_CHECK(keypoints.num_cols == 2 || keypoints.num_cols == 4 || keypoints.num_cols == 6);
  HOLBA_CHECK(keypoints.data.size() % keypoints.num_cols == 0 && AllFinite(keypoints.data));
  Statement(*this,
            "INSERT OR REPLACE INTO keypoints(image_id, rows, cols, data) VALUES(?, ?, ?, ?)")
      .Integer(image_id)
      .Integer(static_cast<int64_t>(keypoints.size()))
      .Integer(keypoints.num_cols)
      .Bytes(keypoints.data)
      .Run();
}

bool Database::HasDescriptors(image_t image_id) const {
  return NumRows("descriptors", image_id).has_value();
}

std::optional<Descriptors> Database::ReadDescriptors(image_t image_id) const {
  Statement row(*this,
                fmt::format("SELECT rows, cols, data, {} FROM descriptors WHERE image_id = ?",
                            has_descriptor_type_ ? "type" : "0"));
  if (!row.Integer(image_id).Step()) return std::nullopt;
  const int64_t num_rows = row.GetInteger(0), num_cols = row.GetInteger(1);
  auto data = row.GetArray<uint8_t>(2, num_rows, num_cols);
  // Whatever the columns are called, a descriptor of no bytes or of megabytes is none.
  if (!data || (num_rows > 0 && num_cols == 0) || num_cols > (1 << 20)) {
    FailRow("descriptors", ImageKey(image_id),
            fmt::format("expected {} rows of {} bytes, found {} bytes", num_rows, num_cols,
                        row.GetBytes(2).size()));
  }
  Descriptors descriptors;
  descriptors.type = static_cast<int>(row.GetInteger(3));
  if (num_cols > 0) descriptors.num_bytes = static_cast<int>(num_cols);
  descriptors.data = std::move(*data);
  return descriptors;
}

void Database::WriteDescriptors(image_t image_id, const Descriptors& descriptors) {
  HOLBA_CHECK(descriptors.num_bytes > 0 && descriptors.data.size() % descriptors.num_bytes == 0);
  Statement insert(
      *this, fmt::format("INSERT OR REPLACE INTO descriptors(image_id, rows, cols, data{}) "
                         "VALUES(?, ?, ?, ?{})",
                         has_descriptor_type_ ? ", type" : "", has_descriptor_type_ ? ", ?" : ""));
  insert.Integer(image_id)
      .Integer(static_cast<int64_t>(descriptors.size()))
      .Integer(descriptors.num_bytes)
      .Bytes(descriptors.data);
  if (has_descriptor_type_) insert.Integer(descriptors.type);
  insert.Run();
}

void Database::CheckMatches(const char* table, image_t image_id1, image_t image_id2,
                            const PointMatches& matches) const {
  const auto [id1, id2] = std::minmax(image_id1, image_id2);
  const std::array<image_t, 2> ids = {id1, id2};
  for (int k = 0; k < 2; ++k) {
    const std::optional<size_t> num_keypoints = NumRows("keypoints", ids[k]);
    if (!num_keypoints) continue;  // nothing that they could be wrong about
    for (const auto& match : matches) {
      if (match[k] < *num_keypoints) continue;
      FailRow(table, PairKey(id1, id2),
              fmt::format("a match names keypoint {} of image {}, which has {}", match[k], ids[k],
                          *num_keypoints));
    }
  }
}

std::optional<PointMatches> Database::ReadMatches(image_t image_id1, image_t image_id2) const {
  Statement row(*this, "SELECT rows, cols, data FROM matches WHERE pair_id = ?");
  if (!row.Integer(PairId(image_id1, image_id2)).Step()) return std::nullopt;
  const auto values = row.GetArray<uint32_t>(2, row.GetInteger(0), 2);
  if (!values) {
    FailRow("matches", PairKey(image_id1, image_id2),
            fmt::format("expected {} pairs of indices, found {} bytes", row.GetInteger(0),
                        row.GetBytes(2).size()));
  }
  PointMatches matches = ToMatches(*values);
  CheckMatches("matches", image_id1, image_id2, matches);
  return image_id1 < image_id2 ? matches : Swapped(std::move(matches));
}

void Database::WriteMatches(image_t image_id1, image_t image_id2, const PointMatches& matches) {
  const PointMatches ordered = image_id1 < image_id2 ? matches : Swapped(matches);
  Statement(*this, "INSERT OR REPLACE INTO matches(pair_id, rows, cols, data) VALUES(?, ?, 2, ?)")
      .Integer(PairId(image_id1, image_id2))
      .Integer(static_cast<int64_t>(ordered.size()))
      .Bytes(ordered)
      .Run();
}

std::optional<TwoViewGeometry> Database::ReadTwoViewGeometry(image_t image_id1,
                                                             image_t image_id2) const {
  Statement row(*this,
                fmt::format("SELECT rows, cols, data, config, F, E, H, {} FROM two_view_geometries "
                            "WHERE pair_id = ?",
                            has_two_view_pose_ ? "qvec, tvec" : "NULL, NULL"));
  if (!row.Integer(PairId(image_id1, image_id2)).Step()) return std::nullopt;
  const auto fail = [&](const std::string& message) {
    FailRow("two_view_geometries", PairKey(image_id1, image_id2), message);
  };
  TwoViewGeometry geometry;
  const auto values = row.GetArray<uint32_t>(2, row.GetInteger(0), 2);
  if (!values) {
    fail(fmt::format("expected {} pairs of indices, found {} bytes", row.GetInteger(0),
                     row.GetBytes(2).size()));
  }
  geometry.inlier_matches = ToMatches(*values);
  CheckMatches("two_view_geometries", image_id1, image_id2, geometry.inlier_matches);
  const int64_t config = row.GetInteger(3);
  if (config < 0 || config > static_cast<int>(TwoViewConfig::kCalibratedRig)) {
    fail(fmt::format("expected a config from 0 to 9, found {}", config));
  }
  geometry.config = static_cast<TwoViewConfig>(config);
  // NULL, no bytes or (COLMAP up to 3.13) only zeros: not set.
  const auto read = [&](int column, const char* name, int size) {
    if (row.GetBytes(column).empty()) return std::vector<double>();
    auto entries = row.GetArray<double>(column, size, 1);
    if (!entries) {
      fail(fmt::format("expected {} numbers in {}, found {} bytes", size, name,
                       row.GetBytes(column).size()));
    }
    if (!AllFinite(*entries)) fail(fmt::format("{} holds a number that is not finite", name));
    const bool set =
        std::any_of(entries->begin(), entries->end(), [](double v) { return v != 0.0; });
    return set ? std::move(*entries) : std::vector<double>();
  };
  const auto read_matrix = [&](int column, const char* name) -> std::optional<Eigen::Matrix3d> {
    const std::vector<double> entries = read(column, name, 9);
    if (entries.empty()) return std::nullopt;
    return Eigen::Map<const RowMajor<3, 3>>(entries.data());
  };
  geometry.F = read_matrix(4, "F");
  geometry.E = read_matrix(5, "E");
  geometry.H = read_matrix(6, "H");
  const std::vector<double> q = read(7, "qvec", 4), t = read(8, "tvec", 3);
  // COLMAP up to 3.13 wrote the identity where no pose was estimated.
  const bool is_identity = !q.empty() && q[0] == 1.0 && t.empty();
  if (!q.empty() && !is_identity) {
    Rigid3d pose;
    pose.rotation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    if (!t.empty()) pose.translation = {t[0], t[1], t[2]};
    if (const Fault fault = FindFault(pose)) fail("qvec and tvec: " + *fault);
    geometry.cam2_from_cam1 = pose;
  }
  return image_id1 < image_id2 ? geometry : geometry.Swapped();
}

void Database::WriteTwoViewGeometry(image_t image_id1, image_t image_id2,
                                    const TwoViewGeometry& given) {
  const TwoViewGeometry geometry = image_id1 < image_id2 ? given : given.Swapped();
  const auto F = ToBlob(geometry.F), E = ToBlob(geometry.E), H = ToBlob(geometry.H);
  std::optional<std::vector<double>> qvec, tvec;
  if (geometry.cam2_from_cam1) {
    const Eigen::Quaterniond& q = geometry.cam2_from_cam1->rotation;
    const Eigen::Vector3d& t = geometry.cam2_from_cam1->translation;
    qvec = std::vector<double>{q.w(), q.x(), q.y(), q.z()};
    tvec = std::vector<double>{t.x(), t.y(), t.z()};
  }
  Statement insert(
      *this,
      fmt::format("INSERT OR REPLACE INTO two_view_geometries(pair_id, rows, cols, data, "
                  "config, F, E, H{}) VALUES(?, ?, 2, ?, ?, ?, ?, ?{})",
                  has_two_view_pose_ ? ", qvec, tvec" : "", has_two_view_pose_ ? ", ?, ?" : ""));
  insert.Integer(PairId(image_id1, image_id2))
      .Integer(static_cast<int64_t>(geometry.inlier_matches.size()))
      .Bytes(geometry.inlier_matches)
      .Integer(static_cast<int>(geometry.config))
      .Bytes(F)
      .Bytes(E)
      .Bytes(H);
  if (has_two_view_pose_) insert.Bytes(qvec).Bytes(tvec);
  insert.Run();
}

std::vector<ImagePair> Database::Pairs(const char* table, size_t min_rows) const {
  std::vector<ImagePair> pairs;
  Statement rows(*this,
                 fmt::format("SELECT pair_id FROM {} WHERE rows >= ? ORDER BY pair_id", table));
  rows.Integer(static_cast<int64_t>(min_rows));
  while (rows.Step()) {
    const int64_t id = rows.GetInteger(0);
    const int64_t id2 = id % kMaxNumImages, id1 = id / kMaxNumImages;
    if (id < 0 || id1 >= id2) {
      FailRow(table, fmt::format("pair_id = {}", id), "the id is no pair's");
    }
    pairs.emplace_back(static_cast<image_t>(id1), static_cast<image_t>(id2));
  }
  return pairs;
}

std::vector<ImagePair> Database::MatchedPairs(size_t min_num_matches) const {
  return Pairs("matches", min_num_matches);
}

std::vector<ImagePair> Database::VerifiedPairs(size_t min_num_inliers) const {
  return Pairs("two_view_geometries", min_num_inliers);
}

}  // namespace holba
