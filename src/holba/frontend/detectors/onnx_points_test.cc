// SPDX-License-Identifier: BSD-3-Clause
// Models of key points and of segments whose outputs are known from the picture.
#include "holba/frontend/detectors/onnx_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "holba/base/error.h"
#include "holba/frontend/detectors/onnx_image.h"
#include "holba/frontend/detectors/segment_onnx.h"
#include "holba/frontend/onnx/onnx_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr int kWidth = 40, kHeight = 30;

class OnnxDetectors : public OnnxTest {
 protected:
  // The three brightest pixels (their places, and the brightness twice as descriptor) of pictures
  // of 40 x 30 pixels.
  void WriteBrightest() const {
    TinyModel()
        .Input("image", TinyModel::kFloat, {1, 1, kHeight, kWidth})
        .Output("points", TinyModel::kFloat, {1, 3, 2})
        .Output("looks", TinyModel::kFloat, {1, 3, 2})
        .Output("values", TinyModel::kFloat, {3})
        .Constant<int64_t>("flat", {1}, {kWidth * kHeight})
        .Constant<int64_t>("three", {1}, {3})
        .Constant<int64_t>("width", {1}, {kWidth})
        .Constant<int64_t>("column", {2}, {3, 1})
        .Constant<int64_t>("one_table", {3}, {1, 3, 2})
        .Node("Reshape", {"image", "flat"}, {"pixels"})
        .Node("TopK", {"pixels", "three"}, {"values", "places"}, {{"axis", 0}})
        .Node("Div", {"places", "width"}, {"y"})
        .Node("Mul", {"y", "width"}, {"row"})
        .Node("Sub", {"places", "row"}, {"x"})
        .Node("Reshape", {"x", "column"}, {"x_column"})
        .Node("Reshape", {"y", "column"}, {"y_column"})
        .Node("Concat", {"x_column", "y_column"}, {"xy"}, {{"axis", 1}})
        .Node("Cast", {"xy"}, {"xy_float"}, {{"to", 1}})
        .Node("Reshape", {"xy_float", "one_table"}, {"points"})
        .Node("Reshape", {"values", "column"}, {"value_column"})
        .Node("Concat", {"value_column", "value_column"}, {"looks_table"}, {{"axis", 1}})
        .Node("Reshape", {"looks_table", "one_table"}, {"looks"})
        .Write(folder_ / "brightest.onnx");
  }
  std::string DescribeBrightest(const std::string& more) const {
    return Write("points.json", R"({"kind": "points", "model": "brightest.onnx",
        "inputs": {"image": "image"}, "outputs": {"keypoints": "points", "descriptors": "looks",
        "scores": "values"})" + more +
                                    "}");
  }

  static ColourImage Picture(int scale) {
    ColourImage image{scale * kWidth, scale * kHeight, {}};
    image.pixels.assign(size_t{3} * image.width * image.height, 10);
    const auto bright = [&](int x, int y, uint8_t value) {
      for (int v = scale * y; v < scale * (y + 1); ++v) {
        for (int u = scale * x; u < scale * (x + 1); ++u)
          std::fill_n(&image.pixels[3 * (size_t(v) * image.width + u)], 3, value);
      }
    };
    bright(5, 7, 255);
    bright(30, 20, 204);
    bright(12, 3, 102);
    return image;
  }
};

std::vector<float> Floats(const Descriptors& descriptors) {
  std::vector<float> values(descriptors.data.size() / 4);
  std::memcpy(values.data(), descriptors.data.data(), descriptors.data.size());
  return values;
}

TEST_F(OnnxDetectors, PointsAreAtTheCentresOfTheirPixels) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  WriteBrightest();
  const auto model = std::make_unique<DescribedModel>(DescribeBrightest(""), OnnxKind::kPoints);
  const SiftFeatures found = DetectOnnxPoints(*model, Picture(1));
  EXPECT_THAT(found.keypoints.data, ElementsAre(5.5f, 7.5f, 30.5f, 20.5f, 12.5f, 3.5f));
  EXPECT_EQ(found.descriptors.type, -1);
  EXPECT_THAT(Floats(found.descriptors), ElementsAre(1.0f, 1.0f, 0.8f, 0.8f, 0.4f, 0.4f));
  // The same picture four times as large comes to the model in its size.
  const auto scaled = std::make_unique<DescribedModel>(
      DescribeBrightest(R"(, "max_image_size": 40)"), OnnxKind::kPoints);
  const SiftFeatures large = DetectOnnxPoints(*scaled, Picture(4));
  EXPECT_THAT(large.keypoints.data, ElementsAre(22, 30, 122, 82, 50, 14));
}

TEST_F(OnnxDetectors, ScoresMasksAndNumbersLimitThem) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  WriteBrightest();
  const DescribedModel good(DescribeBrightest(R"(, "min_score": 0.5)"), OnnxKind::kPoints);
  EXPECT_EQ(DetectOnnxPoints(good, Picture(1)).keypoints.size(), 2u);
  const DescribedModel one(DescribeBrightest(R"(, "max_num": 1, "first_pixel": 0.5)"),
                           OnnxKind::kPoints);
  EXPECT_THAT(DetectOnnxPoints(one, Picture(1)).keypoints.data, ElementsAre(5, 7));
  GreyImage mask{kWidth, kHeight, std::vector<uint8_t>(kWidth * kHeight, 255)};
  mask.pixels[7 * kWidth + 5] = 0;
  EXPECT_EQ(DetectOnnxPoints(good, Picture(1), &mask).keypoints.size(), 1u);
}

TEST_F(OnnxDetectors, WhatTheModelLacksIsSaid) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  WriteBrightest();
  const std::string other = Write("other.json", R"({"kind": "points", "model": "brightest.onnx",
      "inputs": {"image": "image"}, "outputs": {"keypoints": "points", "descriptors": "desc"}})");
  EXPECT_THAT([&] { DescribedModel(other, OnnxKind::kPoints); },
              ThrowsMessage<InputError>(
                  HasSubstr("'descriptors': expected one of the model's outputs (points, looks")));
  // A picture of another size than the model's.
  const DescribedModel model(DescribeBrightest(""), OnnxKind::kPoints);
  EXPECT_THROW(DetectOnnxPoints(model, Picture(2)), InputError);
  const std::string confused = Write("c.json", R"({"kind": "points", "model": "brightest.onnx",
      "inputs": {"image": "image"}, "outputs": {"keypoints": "points", "descriptors": "values"}})");
  const DescribedModel flat(confused, OnnxKind::kPoints);
  EXPECT_THAT([&] { DetectOnnxPoints(flat, Picture(1)); },
              ThrowsMessage<InputError>(HasSubstr("'values': expected a table")));
}

TEST_F(OnnxDetectors, SegmentsComeBackInPixelsOfThePhotograph) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  // Two segments whatever the picture: as two points each, and scores.
  TinyModel()
      .Input("image", TinyModel::kFloat, {1, 3, -1, -1})
      .Output("lines", TinyModel::kFloat, {2, 2, 2})
      .Output("scores", TinyModel::kFloat, {2})
      .Constant<float>("lines_constant", {2, 2, 2}, {1, 2, 3, 4, 10, 10, 10, 20})
      .Constant<float>("scores_constant", {2}, {0.25f, 0.75f})
      .Node("Identity", {"lines_constant"}, {"lines"})
      .Node("Identity", {"scores_constant"}, {"scores"})
      .Write(folder_ / "lines.onnx");
  SegmentOptions options;
  options.detector = "onnx";
  options.model_path = Write("lines.json", R"({"kind": "segments", "model": "lines.onnx",
      "colours": "rgb", "max_image_size": 40, "multiple_of": 32, "inputs": {"image": "image"},
      "outputs": {"segments": "lines", "scores": "scores"}, "min_score": 0.5})");
  const GreyImage photograph{2 * kWidth, 2 * kHeight,
                             std::vector<uint8_t>(4 * kWidth * kHeight, 100)};
  const auto segments = FindSegmentDetector("onnx").detect(options, photograph);
  ASSERT_EQ(segments.size(), 1u);
  EXPECT_EQ(segments[0].start, Eigen::Vector2d(21, 21));
  EXPECT_EQ(segments[0].end, Eigen::Vector2d(21, 41));
  options.model_path.clear();
  EXPECT_THROW(DetectWithOnnx(options, photograph), InputError);
}

TEST_F(OnnxDetectors, PicturesAreScaledShiftedAndFilledUp) {
  OnnxDescription description;
  description.channels = 3;
  description.multiple_of = 32;
  description.mean = {0.5, 0.0, 0.0};
  description.deviation = {0.25, 1.0, 1.0};
  ColourImage image{2, 1, {255, 0, 51, 0, 255, 102}};
  const OnnxImage made = MakeOnnxImage(description, image);
  EXPECT_THAT(made.tensor.shape, ElementsAre(1, 3, 32, 32));
  const auto at = [&](int channel, int x) { return made.tensor.floats[channel * 32 * 32 + x]; };
  EXPECT_FLOAT_EQ(at(0, 0), 2.0f);
  EXPECT_FLOAT_EQ(at(0, 1), -2.0f);
  EXPECT_FLOAT_EQ(at(0, 2), -2.0f);  // black
  EXPECT_FLOAT_EQ(at(1, 1), 1.0f);
  EXPECT_FLOAT_EQ(at(2, 0), 0.2f);
  EXPECT_FLOAT_EQ(at(2, 2), 0.0f);
}

}  // namespace
}  // namespace holba
