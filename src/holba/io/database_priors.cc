// SPDX-License-Identifier: BSD-3-Clause
// Pose priors of a Database, and what it holds in numbers.
#include <limits>

#include "holba/base/check.h"
#include "holba/io/database_statement.h"

namespace holba {
namespace {

// Not set: not a number, as COLMAP has it.
std::vector<double> ToBlob(const std::optional<Eigen::Vector3d>& vector) {
  const Eigen::Vector3d v =
      vector.value_or(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  return {v.x(), v.y(), v.z()};
}

}  // namespace

void Database::WritePosePrior(image_t image_id, camera_t camera_id, const PosePrior& prior) {
  Transaction transaction(this);
  // COLMAP 3.8 takes positions from these.
  if (prior.position && HasColumn("images", "prior_tx")) {
    Execute(
        fmt::format("UPDATE images SET prior_tx = {:.17g}, prior_ty = {:.17g}, prior_tz = "
                    "{:.17g} WHERE image_id = {}",
                    prior.position->x(), prior.position->y(), prior.position->z(), image_id));
  }
  if (HasTable("pose_priors") && HasColumn("pose_priors", "corr_data_id")) {
    Statement(*this, "DELETE FROM pose_priors WHERE corr_data_id = ? AND corr_sensor_type = ?")
        .Integer(image_id)
        .Integer(kDatabaseCamera)
        .Run();
    const bool has_gravity = HasColumn("pose_priors", "gravity");
    const std::vector<double> position = ToBlob(prior.position),
                              gravity = ToBlob(prior.gravity_in_cam),
                              covariance(9, std::numeric_limits<double>::quiet_NaN());
    Statement insert(*this, fmt::format("INSERT INTO pose_priors(corr_data_id, corr_sensor_id, "
                                        "corr_sensor_type, position, position_covariance, "
                                        "coordinate_system{}) VALUES(?, ?, ?, ?, ?, ?{})",
                                        has_gravity ? ", gravity" : "", has_gravity ? ", ?" : ""));
    insert.Integer(image_id)
        .Integer(camera_id)
        .Integer(kDatabaseCamera)
        .Bytes(position)
        .Bytes(covariance)
        .Integer(static_cast<int>(prior.system));
    if (has_gravity) insert.Bytes(gravity);
    insert.Run();
  }
  transaction.Commit();
}

std::map<image_t, PosePrior> Database::ReadPosePriors() const {
  std::map<image_t, PosePrior> priors;
  if (HasTable("pose_priors")) {
    // COLMAP 4 has a table of sensors' data, 3.9 to 3.12 one of images.
    const bool of_sensors = HasColumn("pose_priors", "corr_data_id");
    Statement rows(
        *this, fmt::format(
                   "SELECT {}, position, coordinate_system, {} FROM pose_priors{}",
                   of_sensors ? "corr_data_id" : "image_id",
                   HasColumn("pose_priors", "gravity") ? "gravity" : "NULL",
                   of_sensors ? fmt::format(" WHERE corr_sensor_type = {}", kDatabaseCamera) : ""));
    while (rows.Step()) {
      const int64_t id = rows.GetInteger(0);
      const auto read = [&](int column, const char* name) -> std::optional<Eigen::Vector3d> {
        if (rows.GetBytes(column).empty()) return std::nullopt;
        const auto values = rows.GetArray<double>(column, 3, 1);
        if (!values) {
          FailRow("pose_priors", fmt::format("image {}", id),
                  fmt::format("expected 3 numbers in {}, found {} bytes", name,
                              rows.GetBytes(column).size()));
        }
        if (!AllFinite(*values)) return std::nullopt;  // not set
        return Eigen::Vector3d(values->data());
      };
      PosePrior prior;
      prior.position = read(1, "position");
      prior.gravity_in_cam = read(3, "gravity");
      const int64_t system = rows.GetInteger(2);
      if (system == 0) prior.system = PosePrior::System::kWgs84;
      if (system == 1) prior.system = PosePrior::System::kCartesian;
      if (!prior.empty()) priors.emplace(static_cast<image_t>(id), prior);
    }
  }
  // Up to 3.8 positions are columns of the images, without a system.
  if (priors.empty() && HasColumn("images", "prior_tx")) {
    Statement rows(*this,
                   "SELECT image_id, prior_tx, prior_ty, prior_tz FROM images WHERE prior_tx IS "
                   "NOT NULL AND prior_ty IS NOT NULL AND prior_tz IS NOT NULL");
    while (rows.Step()) {
      PosePrior prior;
      prior.position = Eigen::Vector3d(rows.GetDouble(1), rows.GetDouble(2), rows.GetDouble(3));
      if (prior.position->allFinite())
        priors.emplace(static_cast<image_t>(rows.GetInteger(0)), prior);
    }
  }
  return priors;
}

DatabaseSummary Database::Summarise() const {
  DatabaseSummary summary;
  summary.cameras = ReadCameras();
  const bool ours = HasOurTables();
  const bool priors = HasTable("pose_priors") && HasColumn("pose_priors", "corr_data_id");
  const auto rows_of = [](const char* table) {
    return fmt::format(", (SELECT rows FROM {0} WHERE {0}.image_id = images.image_id)", table);
  };
  std::string sql =
      "SELECT image_id, name, camera_id" + rows_of("keypoints") + rows_of("descriptors");
  for (const char* table : {"holba_segments", "holba_corners", "holba_vanishing_points"})
    sql += ours ? rows_of(table) : ", NULL";
  sql += ours ? ", (SELECT 1 FROM holba_label_maps m WHERE m.image_id = images.image_id)" : ", 0";
  sql += priors ? ", (SELECT 1 FROM pose_priors p WHERE p.corr_data_id = images.image_id AND "
                  "p.corr_sensor_type = 0)"
                : ", 0";
  {
    Statement rows(*this, sql + " FROM images ORDER BY image_id");
    while (rows.Step()) {
      const auto count = [&](int column) -> std::optional<size_t> {
        if (rows.IsNull(column)) return std::nullopt;
        return static_cast<size_t>(std::max<int64_t>(rows.GetInteger(column), 0));
      };
      DatabaseSummary::OfImage image;
      image.image_id = static_cast<image_t>(rows.GetInteger(0));
      image.name = rows.GetText(1);
      image.camera_id = static_cast<camera_t>(rows.GetInteger(2));
      image.num_keypoints = count(3);
      image.num_descriptors = count(4);
      image.num_segments = count(5);
      image.num_corners = count(6);
      image.num_vanishing_points = count(7);
      image.has_label_map = rows.GetInteger(8) != 0;
      image.has_pose_prior = rows.GetInteger(9) != 0;
      summary.images.push_back(std::move(image));
    }
  }
  const auto counts = [&](const std::string& what, std::vector<size_t*> results) {
    Statement row(*this, "SELECT " + what);
    if (!row.Step()) return;
    for (size_t i = 0; i < results.size(); ++i)
      *results[i] = static_cast<size_t>(std::max<int64_t>(row.GetInteger(static_cast<int>(i)), 0));
  };
  if (has_rigs_) {
    counts("(SELECT COUNT(*) FROM rigs), (SELECT COUNT(*) FROM frames)",
           {&summary.num_rigs, &summary.num_frames});
  }
  if (HasTable("pose_priors")) counts("COUNT(*) FROM pose_priors", {&summary.num_pose_priors});
  counts("COUNT(*), COALESCE(SUM(rows > 0), 0), COALESCE(SUM(rows), 0) FROM matches",
         {&summary.num_pairs_tried, &summary.num_matched_pairs, &summary.num_matches});
  counts("COALESCE(SUM(rows > 0), 0), COALESCE(SUM(rows), 0) FROM two_view_geometries",
         {&summary.num_verified_pairs, &summary.num_inliers});
  {
    Statement rows(*this, "SELECT config, COUNT(*) FROM two_view_geometries GROUP BY config");
    while (rows.Step()) {
      const int64_t config = rows.GetInteger(0);
      if (config < 0 || config > static_cast<int>(TwoViewConfig::kCalibratedRig)) continue;
      summary.num_of_config[static_cast<TwoViewConfig>(config)] =
          static_cast<size_t>(rows.GetInteger(1));
    }
  }
  if (ours) {
    counts("COALESCE(SUM(rows > 0), 0), COALESCE(SUM(rows), 0) FROM holba_line_matches",
           {&summary.num_line_matched_pairs, &summary.num_line_matches});
  }
  return summary;
}

}  // namespace holba
