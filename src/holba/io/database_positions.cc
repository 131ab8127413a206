// SPDX-License-Identifier: BSD-3-Clause
// Position priors of a Database: COLMAP 4 has a table of sensors' data, 3.9 to 3.12 one of images;
// up to 3.8 they are columns of the images, without a system.
#include "holba/io/database_statement.h"

namespace holba {
namespace {

constexpr int kCameraSensor = 0;
constexpr int kWgs84 = 0;

}  // namespace

std::map<image_t, PositionPrior> Database::ReadPositionPriors() const {
  std::map<image_t, PositionPrior> priors;
  if (HasTable("pose_priors")) {
    const bool of_sensors = HasColumn("pose_priors", "corr_data_id");
    Statement rows(*this, of_sensors ? fmt::format("SELECT corr_data_id, position, "
                                                   "coordinate_system FROM pose_priors WHERE "
                                                   "corr_sensor_type = {}",
                                                   kCameraSensor)
                                     : "SELECT image_id, position, coordinate_system FROM "
                                       "pose_priors");
    while (rows.Step()) {
      if (rows.GetBytes(1).empty()) continue;
      const int64_t id = rows.GetInteger(0);
      const auto values = rows.GetArray<double>(1, 3, 1);
      if (!values) {
        FailRow(
            "pose_priors", fmt::format("image {}", id),
            fmt::format("expected 3 numbers in position, found {} bytes", rows.GetBytes(1).size()));
      }
      const Eigen::Vector3d position((*values)[0], (*values)[1], (*values)[2]);
      if (!position.allFinite()) continue;  // not set
      priors[static_cast<image_t>(id)] = {position, rows.GetInteger(2) == kWgs84};
    }
  }
  if (priors.empty() && HasColumn("images", "prior_tx")) {
    Statement rows(*this,
                   "SELECT image_id, prior_tx, prior_ty, prior_tz FROM images WHERE prior_tx IS "
                   "NOT NULL AND prior_ty IS NOT NULL AND prior_tz IS NOT NULL");
    while (rows.Step()) {
      const Eigen::Vector3d position(rows.GetDouble(1), rows.GetDouble(2), rows.GetDouble(3));
      if (position.allFinite())
        priors[static_cast<image_t>(rows.GetInteger(0))] = {position, false};
    }
  }
  return priors;
}

}  // namespace holba
