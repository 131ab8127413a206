// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/uncertainty_file.h"

#include <gtest/gtest.h>

#include "holba/io/files.h"

namespace holba {
namespace {

TEST(UncertaintyFile, HoldsTheUpperTrianglesRowByRow) {
  ModelUncertainty uncertainty;
  uncertainty.sigma_px = 0.25;
  Matrix6d pose = Matrix6d::Zero();
  pose(0, 1) = pose(1, 0) = 0.5;
  uncertainty.poses[3] = pose;
  Eigen::Matrix3d point;
  point << 1, 2, 3, 2, 4, 5, 3, 5, 6;
  uncertainty.points[9] = point;
  uncertainty.lines[4] = {point, 2 * point};
  uncertainty.groups[2] = Eigen::MatrixXd::Identity(2, 2);
  const std::filesystem::path path =
      std::filesystem::path(::testing::TempDir()) / "holba_uncertainty" / "covariances.txt";
  WriteUncertainty(uncertainty, path);
  const std::string text = ReadFileBytes(path);
  EXPECT_NE(text.find("0.25 px"), std::string::npos);
  EXPECT_NE(text.find("\nPOSE 3 0 0.5 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n"), std::string::npos);
  EXPECT_NE(text.find("\nPOINT 9 1 2 3 4 5 6\n"), std::string::npos);
  EXPECT_NE(text.find("\nLINE 4 1 2 3 4 5 6 2 4 6 8 10 12\n"), std::string::npos);
  EXPECT_NE(text.find("\nGROUP 2 2 1 0 1\n"), std::string::npos);
  std::filesystem::remove_all(path.parent_path());
}

}  // namespace
}  // namespace holba
