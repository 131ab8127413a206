// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/matching/onnx_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "holba/base/error.h"
#include "holba/frontend/onnx/onnx_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

using Match = std::array<point2D_t, 2>;

Descriptors Floats(const std::vector<float>& values, int length) {
  Descriptors descriptors;
  descriptors.type = -1;
  descriptors.num_bytes = 4 * length;
  descriptors.data.resize(4 * values.size());
  std::memcpy(descriptors.data.data(), values.data(), descriptors.data.size());
  return descriptors;
}

class OnnxMatching : public OnnxTest {
 protected:
  OnnxMatchEnd End1() const { return {{640, 480}, &keypoints1_, &descriptors1_}; }
  OnnxMatchEnd End2() const { return {{640, 480}, &keypoints2_, &descriptors2_}; }

  static TinyModel Inputs() {
    TinyModel model;
    for (const char* name : {"kpts0", "kpts1"}) model.Input(name, TinyModel::kFloat, {1, -1, 2});
    for (const char* name : {"desc0", "desc1"}) model.Input(name, TinyModel::kFloat, {1, -1, 2});
    return model;
  }
  std::string Describe(const std::string& model, const std::string& more) const {
    return Write(model + ".json", R"({"kind": "matcher", "model": ")" + model + R"(.onnx",
        "inputs": {"keypoints1": "kpts0", "keypoints2": "kpts1", "descriptors1": "desc0",
        "descriptors2": "desc1"})" + more +
                                      "}");
  }

  Keypoints keypoints1_{2, {320, 240, 640, 480, 0, 0}}, keypoints2_{2, {1, 2, 3, 4}};
  Descriptors descriptors1_ = Floats({1, 0, 0, 1, 0.6f, 0.8f}, 2),
              descriptors2_ = Floats({0, 1, 1, 0}, 2);
};

TEST_F(OnnxMatching, TheMostSimilarOfEachPointAreMatched) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  // For each point of the first image the one of the second with the greatest product, which is its
  // score.
  Inputs()
      .Output("matches0", TinyModel::kInt64, {1, -1})
      .Output("scores0", TinyModel::kFloat, {1, -1, 1})
      .Constant<int64_t>("table", {2}, {-1, 2})
      .Constant<int64_t>("one", {1}, {1})
      .Node("Reshape", {"desc0", "table"}, {"d0"})
      .Node("Reshape", {"desc1", "table"}, {"d1"})
      .Node("Transpose", {"d1"}, {"d1t"})
      .Node("MatMul", {"d0", "d1t"}, {"products"})
      .Node("TopK", {"products", "one"}, {"best", "places"}, {{"axis", 1}})
      .Constant<int64_t>("row", {2}, {1, -1})
      .Constant<int64_t>("box", {3}, {1, -1, 1})
      .Node("Reshape", {"places", "row"}, {"matches0"})
      .Node("Reshape", {"best", "box"}, {"scores0"})
      .Write(folder_ / "nearest.onnx");
  const OnnxMatcher matcher(
      Describe("nearest",
               R"(, "form": "of_first", "outputs": {"matches": "matches0", "scores": "scores0"})"));
  // The third one's best is taken by the second, whose score is better.
  EXPECT_THAT(matcher.Match(End1(), End2(), 100).matches, ElementsAre(Match{0, 1}, Match{1, 0}));
  // Only the first ones take part.
  EXPECT_THAT(matcher.Match(End1(), End2(), 1).matches, ElementsAre(Match{0, 0}));
}

TEST_F(OnnxMatching, KeyPointsComeNormalisedOrInPixelsOfTheModel) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  // Matches the points 1 and 0; its score is the sum of the coordinates of the first one.
  Inputs()
      .Output("matches", TinyModel::kInt64, {1, 3})
      .Output("scores", TinyModel::kFloat, {1})
      .Constant<int64_t>("rows", {1, 3}, {0, 1, 0})
      .Constant<int64_t>("which", {1}, {1})
      .Constant<int64_t>("flat", {1}, {1})
      .Constant<int64_t>("table", {2}, {-1, 2})
      .Constant<float>("ones", {2, 1}, {1, 1})
      .Node("Identity", {"rows"}, {"matches"})
      .Node("Reshape", {"kpts0", "table"}, {"points"})
      .Node("Gather", {"points", "which"}, {"point"}, {{"axis", 0}})
      .Node("MatMul", {"point", "ones"}, {"sum"})
      .Node("Reshape", {"sum", "flat"}, {"scores"})
      .Write(folder_ / "sum.onnx");
  const auto num_matches = [&](const std::string& more) {
    const OnnxMatcher matcher(
        Describe("sum", R"(, "outputs": {"matches": "matches", "scores": "scores"}, )" + more));
    return matcher.Match(End1(), End2(), 100).matches.size();
  };
  // The second point is the right lower corner: (1, 0.75) of half of the longer side from the
  // middle; (639.5, 479.5) where the first pixel is (0, 0).
  EXPECT_EQ(num_matches(R"("first_pixel": 0.5, "min_score": 1.7499)"), 1u);
  EXPECT_EQ(num_matches(R"("first_pixel": 0.5, "min_score": 1.7501)"), 0u);
  EXPECT_EQ(num_matches(R"("normalised": false, "min_score": 1118.99)"), 1u);
  EXPECT_EQ(num_matches(R"("normalised": false, "min_score": 1119.01)"), 0u);
}

TEST_F(OnnxMatching, PointsThatAreNotThereAreRefused) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  Inputs()
      .Output("matches", TinyModel::kInt64, {2, 2})
      .Constant<int64_t>("rows", {2, 2}, {0, 1, 0, 2})
      .Node("Identity", {"rows"}, {"matches"})
      .Write(folder_ / "far.onnx");
  const OnnxMatcher matcher(Describe("far", R"(, "outputs": {"matches": "matches"})"));
  EXPECT_THAT([&] { matcher.Match(End1(), End2(), 100); },
              ThrowsMessage<InputError>(HasSubstr("expected points below 3 and 2, found 0 and 2")));
  // An image without points has no matches.
  descriptors2_ = Floats({}, 2);
  EXPECT_TRUE(matcher.Match(End1(), End2(), 100).matches.empty());
}

}  // namespace
}  // namespace holba
