// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/uncertainty_file.h"

#include <fmt/format.h>

#include "holba/io/files.h"

namespace holba {
namespace {

template <typename Matrix>
void AppendUpperTriangle(const Matrix& matrix, std::string* text, int digits = 9) {
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    for (Eigen::Index c = r; c < matrix.cols(); ++c)
      fmt::format_to(std::back_inserter(*text), " {:.{}g}", matrix(r, c), digits);
  }
}

}  // namespace

void FormatUncertainty(const ModelUncertainty& uncertainty, std::ostream* stream) {
  std::string text = fmt::format(
      "# Covariances (upper triangles, row by row); noise of an observed coordinate: {:.6g} px\n"
      "# POSE FRAME_ID C[21]: rotation vector w (rad, R' = exp(w) R), translation\n"
      "# SENSOR RIG_ID CAMERA_ID C[21]: sensor_from_rig, alike\n"
      "# POINT POINT3D_ID C[6]: position\n"
      "# LINE LINE3D_ID C_START[6] C_END[6]: end points, held along the line\n"
      "# GROUP GROUP3D_ID NUM_PARAMS C[NUM_PARAMS (NUM_PARAMS + 1) / 2]: parameters of groups3D\n",
      uncertainty.sigma_px);
  for (const auto& [id, C] : uncertainty.poses) {
    // All digits: where the origin is far away, the covariance of the camera's centre is a small
    // difference of these.
    text += fmt::format("POSE {}", id);
    AppendUpperTriangle(C, &text, 17);
    text += '\n';
  }
  for (const auto& [id, C] : uncertainty.sensors) {
    text += fmt::format("SENSOR {} {}", id.first, id.second);
    AppendUpperTriangle(C, &text);
    text += '\n';
  }
  for (const auto& [id, C] : uncertainty.points) {
    text += fmt::format("POINT {}", id);
    AppendUpperTriangle(C, &text);
    text += '\n';
  }
  for (const auto& [id, line] : uncertainty.lines) {
    text += fmt::format("LINE {}", id);
    AppendUpperTriangle(line.start, &text);
    AppendUpperTriangle(line.end, &text);
    text += '\n';
  }
  for (const auto& [id, C] : uncertainty.groups) {
    text += fmt::format("GROUP {} {}", id, C.rows());
    AppendUpperTriangle(C, &text);
    text += '\n';
  }
  *stream << text;
}

void WriteUncertainty(const ModelUncertainty& uncertainty, const std::filesystem::path& path) {
  WriteFileWhole(path, [&](std::ostream* stream) { FormatUncertainty(uncertainty, stream); });
}

}  // namespace holba
