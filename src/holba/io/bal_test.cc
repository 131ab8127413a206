// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/bal.h"

#include <bzlib.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "holba/base/data_testing.h"
#include "holba/base/error.h"
#include "holba/io/bzip2.h"
#include "holba/io/test_models.h"

namespace holba {
namespace {

using testing::HasSubstr;

constexpr const char* kProblem =
    "2 2 3\n"
    "0 0     -10.5 20.25\n"
    "1 0     3 -4\n"
    "1 1     1e2 7\n"
    "0.1\n-0.2\n0.3\n0.5\n0.25\n-7\n800\n-0.125\n0.0625\n"
    "0\n0\n0\n-1\n0\n-5\n750\n0\n1e-9\n"
    "0.5\n0.75\n-1\n"
    "-2\n1\n0.5\n";

// The numbers of a text, whatever lies between them.
std::vector<double> Numbers(const std::string& text) {
  std::istringstream stream(text);
  std::vector<double> numbers;
  double value;
  while (stream >> value) numbers.push_back(value);
  return numbers;
}

std::string Written(const Reconstruction& model) {
  std::ostringstream stream;
  FormatBal(model, &stream);
  return stream.str();
}

// The projection as Agarwal et al. state it.
Eigen::Vector2d BalPixel(const double* camera, const Eigen::Vector3d& X) {
  const Eigen::Vector3d w(camera[0], camera[1], camera[2]);
  const double angle = w.norm();
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  if (angle > 0.0) R = Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
  const Eigen::Vector3d P = R * X + Eigen::Vector3d(camera[3], camera[4], camera[5]);
  const Eigen::Vector2d p = -P.head<2>() / P.z();
  const double n = p.squaredNorm();
  return camera[6] * (1.0 + camera[7] * n + camera[8] * n * n) * p;
}

TEST(Bal, ItsProjectionIsOurRadialCameraWithYTurned) {
  const Reconstruction model = ParseBal(kProblem, "p.txt");
  const std::vector<double> numbers = Numbers(kProblem);
  for (int i = 0; i < 2; ++i) {
    const Image& image = model.images.at(i + 1);
    const Camera& camera = model.cameras.at(image.camera_id);
    for (int j = 0; j < 2; ++j) {
      const double* xyz = &numbers[3 + 12 + 18 + 3 * j];
      const Eigen::Vector2d expected = BalPixel(&numbers[3 + 12 + 9 * i], {xyz[0], xyz[1], xyz[2]});
      Eigen::Vector2d pixel;
      ASSERT_TRUE(camera.model->project(
          camera.params.data(), image.cam_from_world * model.points3D.at(j + 1).xyz, &pixel));
      EXPECT_NEAR(pixel.x(), expected.x(), 1e-9);
      EXPECT_NEAR(pixel.y(), -expected.y(), 1e-9);
    }
  }
}

TEST(Bal, AProblemBecomesOneRadialCameraForEachImage) {
  const Reconstruction model = ParseBal(kProblem, "p.txt");
  EXPECT_EQ(model.FindInconsistency(), std::nullopt);
  ASSERT_EQ(model.images.size(), 2u);
  EXPECT_THAT(model.cameras.at(1).params, testing::ElementsAre(800, 0, 0, -0.125, 0.0625));
  EXPECT_EQ(model.cameras.at(2).model->name, "RADIAL");
  EXPECT_EQ(model.cameras.at(2).width, 0u);
  EXPECT_EQ(model.images.at(1).points2D[0].xy, Eigen::Vector2d(-10.5, -20.25));
  EXPECT_EQ(model.images.at(2).points2D[1].point3D_id, 2u);
  EXPECT_EQ(model.points3D.at(1).track.size(), 2u);
}

void ExpectSameProblem(const std::string& a, const std::string& b) {
  const std::vector<double> x = Numbers(a), y = Numbers(b);
  ASSERT_EQ(x.size(), y.size());
  const size_t cameras = 3 + 4 * static_cast<size_t>(x[2]),
               points = cameras + 9 * static_cast<size_t>(x[0]);
  for (size_t i = 0; i < x.size(); ++i) {
    if (i < cameras || i >= points || (i - cameras) % 9 >= 3) {
      ASSERT_EQ(x[i], y[i]) << "number " << i;
    } else if ((i - cameras) % 9 == 0) {
      const Eigen::Vector3d v(x[i], x[i + 1], x[i + 2]), w(y[i], y[i + 1], y[i + 2]);
      ASSERT_LE((v - w).norm(), 4e-15 * std::max(1.0, v.norm())) << "number " << i;
    }
  }
}

TEST(Bal, WritingUndoesReading) {
  ExpectSameProblem(kProblem, Written(ParseBal(kProblem, "p.txt")));
  const std::string once = Written(ParseBal(kProblem, "p.txt"));
  const std::string twice = Written(ParseBal(once, "p.txt"));
  ExpectSameProblem(once, twice);
}

TEST(Bal, RealProblemsSurviveReadingAndWriting) {
  HOLBA_SKIP_WITHOUT_DATA();
  int num_problems = 0;
  for (const auto& entry : std::filesystem::directory_iterator(DataFolder() / "bal")) {
    ASSERT_TRUE(IsBalFile(entry.path()));
    const Reconstruction model = ReadBal(entry.path());
    EXPECT_EQ(model.FindInconsistency(), std::nullopt);
    ExpectSameProblem(ReadFileBytes(entry.path()), Written(model));
    const TestFolder folder;
    WriteBal(model, folder / "new" / "problem.txt");
    EXPECT_EQ(ReadFileBytes(folder / "new" / "problem.txt"), Written(model));
    ++num_problems;
  }
  EXPECT_EQ(num_problems, 2);
}

TEST(Bal, OtherFilesAreNoProblems) {
  const TestFolder folder;
  WriteBytes(folder / "problem.txt", kProblem);
  EXPECT_TRUE(IsBalFile(folder / "problem.txt"));
  EXPECT_FALSE(IsBalFile(folder.path()));
  EXPECT_FALSE(IsBalFile(folder / "none"));
  for (const auto& [name, text] : SmallModelText()) {
    WriteBytes(folder / name, text);
    EXPECT_FALSE(IsBalFile(folder / name)) << name;
  }
  WriteBytes(folder / "empty", "");
  EXPECT_FALSE(IsBalFile(folder / "empty"));
}

TEST(Bal, CorruptedProblemsAreRefusedWithTheirLine) {
  struct Case {
    const char *from, *to, *message;
  };
  const std::vector<Case> cases = {
      {"2 2 3", "2 2 4", "p.txt:5: expected CAMERA_IDX (a whole number), found '0.1'"},
      {"2 2 3", "2 2 1152921504606846976", "p.txt:1: expected NUM_OBSERVATIONS (at most"},
      {"2 2 3", "4000000000 2 3", "p.txt:1: expected NUM_CAMERAS (at most"},
      {"2 2 3", "-2 2 3", "p.txt:1: expected NUM_CAMERAS (a whole number), found '-2'"},
      {"1 0 ", "2 0 ", "p.txt:3: expected CAMERA_IDX below 2, found 2"},
      {"1 1 ", "1 2 ", "p.txt:4: expected POINT_IDX below 2, found 2"},
      {"3 -4", "nan -4", "p.txt:3: expected X (a finite number), found 'nan'"},
      {"800", "0", "p.txt:13: expected a rotation vector and a focal length"},
      {"0.1\n", "1e300\n", "p.txt:13: expected a rotation vector and a focal length"},
      {"1\n0.5\n", "1\n", "found the end of the file: it is truncated"},
      {"1\n0.5\n", "1\n0.5\n3\n", "expected the end of the file after 2 points, found more"},
  };
  for (const Case& c : cases) {
    std::string text = kProblem;
    text.replace(text.find(c.from), std::strlen(c.from), c.to);
    try {
      ParseBal(text, "p.txt");
      ADD_FAILURE() << c.from << " -> " << c.to;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(c.message));
    }
  }
}

// As the problems are handed out.
std::string Packed(std::string text) {
  std::string packed(text.size() + 1000, '\0');
  unsigned size = static_cast<unsigned>(packed.size());
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(packed.data(), &size, text.data(),
                                     static_cast<unsigned>(text.size()), 9, 0, 0),
            BZ_OK);
  packed.resize(size);
  return packed;
}

TEST(Bal, APackedFileIsReadAsTheFileItself) {
  const TestFolder folder;
  const std::filesystem::path path = folder / "p.txt.bz2";
  WriteBytes(path, Packed(kProblem));
  EXPECT_TRUE(IsBalFile(path));
  ExpectSameProblem(kProblem, Written(ReadBal(path)));
  const std::string text = kProblem;  // of two streams, as pbzip2 writes
  WriteBytes(path, Packed(text.substr(0, 50)) + Packed(text.substr(50)));
  ExpectSameProblem(kProblem, Written(ReadBal(path)));
}

TEST(Bal, APackedFileThatIsDamagedIsRefused) {
  const std::string packed = Packed(kProblem);
  const auto message = [](const std::string& bytes) -> std::string {
    try {
      UnpackBzip2(bytes, "p.bz2");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message(packed.substr(0, packed.size() / 2)), HasSubstr("p.bz2: the end of"));
  std::string changed = packed;
  changed[packed.size() / 2] ^= 0x55;
  EXPECT_THAT(message(changed), HasSubstr("p.bz2: the packed data (bzip2) is damaged"));
  EXPECT_EQ(UnpackBzip2(packed, "p.bz2", 10), std::string(kProblem).substr(0, 10));
}

TEST(Bal, CamerasThatDoNotFitAreRefusedByName) {
  Reconstruction model = ParseBal(kProblem, "p.txt");
  model.cameras.at(2).model = FindCameraModel("OPENCV");
  model.cameras.at(2).params.assign(8, 1.0);
  try {
    Written(model);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("camera 2 is OPENCV, which a BAL problem cannot hold"));
  }
}

TEST(Bal, ThePrincipalPointMovesIntoThePixels) {
  Reconstruction model = ParseBal(kProblem, "p.txt");
  model.cameras.at(1).params = {800, 100, 50, -0.125, 0.0625};
  for (Point2D& point : model.images.at(1).points2D) point.xy += Eigen::Vector2d(100, 50);
  ExpectSameProblem(kProblem, Written(model));
}

}  // namespace
}  // namespace holba
