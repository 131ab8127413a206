// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/onnx/onnx_runtime.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "holba/base/error.h"
#include "holba/frontend/onnx/onnx_description.h"
#include "holba/frontend/onnx/onnx_testing.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class OnnxRuntime : public OnnxTest {
 protected:
  // sum = a + b, and where a is largest.
  std::filesystem::path WriteSum() const {
    TinyModel()
        .Input("a", TinyModel::kFloat, {-1})
        .Input("b", TinyModel::kFloat, {-1})
        .Output("sum", TinyModel::kFloat, {-1})
        .Output("largest", TinyModel::kInt64, {1})
        .Node("Add", {"a", "b"}, {"sum"})
        .Node("ArgMax", {"a"}, {"largest"}, {{"axis", 0}})
        .Write(folder_ / "sum.onnx");
    return folder_ / "sum.onnx";
  }
};

TEST_F(OnnxRuntime, RunsAModelOfAnySize) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  const OnnxModel model(WriteSum(), "");
  EXPECT_THAT(model.input_names(), ElementsAre("a", "b"));
  EXPECT_THAT(model.output_names(), ElementsAre("sum", "largest"));
  const auto found =
      model.Run({{"a", FloatTensor({3}, {1, 5, 2})}, {"b", FloatTensor({3}, {10, 20, 30})}},
                {"largest", "sum"});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_FALSE(found[0].is_float);
  EXPECT_THAT(found[0].integers, ElementsAre(1));
  EXPECT_THAT(found[1].floats, ElementsAre(11, 25, 32));
  EXPECT_THAT(found[1].shape, ElementsAre(3));
  const auto other =
      model.Run({{"a", FloatTensor({1}, {4})}, {"b", FloatTensor({1}, {-1})}}, {"sum"});
  EXPECT_THAT(other[0].floats, ElementsAre(3));
}

TEST_F(OnnxRuntime, SaysWhatIsWrongWithAModelOrItsInputs) {
  HOLBA_SKIP_WITHOUT_ONNX_RUNTIME();
  EXPECT_THROW(OnnxModel(folder_ / "missing.onnx", ""), InputError);
  const std::string no_model = Write("no.onnx", "this is no model");
  EXPECT_THAT([&] { OnnxModel(no_model, ""); },
              ThrowsMessage<InputError>(HasSubstr("no.onnx: the ONNX Runtime cannot use it")));
  const OnnxModel model(WriteSum(), "");
  EXPECT_THAT([&] { model.Run({{"a", FloatTensor({1}, {4})}}, {"sum"}); },
              ThrowsMessage<InputError>(HasSubstr("sum.onnx: the ONNX Runtime cannot use it")));
  EXPECT_THROW(
      model.Run({{"a", FloatTensor({2}, {4, 5})}, {"b", FloatTensor({3}, {1, 2, 3})}}, {"sum"}),
      InputError);
}

TEST_F(OnnxRuntime, ALibraryThatIsNoneIsNamed) {
  EXPECT_THAT([&] { OnnxModel(WriteSum(), folder_ / "libonnxruntime.so"); },
              ThrowsMessage<InputError>(HasSubstr("give the path of its library")));
  EXPECT_THAT([&] { OnnxModel(WriteSum(), "libm.so.6"); },
              ThrowsMessage<InputError>(HasSubstr("expected the library of ONNX Runtime")));
}

TEST_F(OnnxRuntime, DescriptionsAreCheckedKeyByKey) {
  const std::string good = R"({"kind": "points", "model": "m.onnx", "inputs": {"image": "x"},
      "outputs": {"keypoints": "k", "descriptors": "d"}, "colours": "rgb", "mean": [1, 2, 3]})";
  const OnnxDescription read = ReadOnnxDescription(Write("a.json", good), OnnxKind::kPoints);
  EXPECT_EQ(read.model, folder_ / "m.onnx");
  EXPECT_EQ(read.channels, 3);
  EXPECT_EQ(read.outputs.at("descriptors"), "d");
  EXPECT_THAT(read.mean, ElementsAre(1, 2, 3));
  const auto refuses = [&](const std::string& from, const std::string& to,
                           const std::string& message) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    const std::string path = Write("b.json", text);
    EXPECT_THAT([&] { ReadOnnxDescription(path, OnnxKind::kPoints); },
                ThrowsMessage<InputError>(HasSubstr(message)));
  };
  refuses("\"points\"", "\"segments\"", "'kind': expected 'points', found \"segments\"");
  refuses("\"image\"", "\"picture\"", "'image': expected a text, found nothing");
  refuses("\"rgb\"", "\"blue\"", "expected 'grey' or 'rgb'");
  refuses("[1, 2, 3]", "[1, 2]", "expected a list of 3 numbers");
  refuses("\"mean\"", "\"means\"", "found 'means'");
  refuses("\"m.onnx\"", "7", "'model': expected a text, found 7");
  refuses("{", "", "expected a JSON object");
}

}  // namespace
}  // namespace holba
