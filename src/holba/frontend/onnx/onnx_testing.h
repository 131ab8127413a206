// SPDX-License-Identifier: BSD-3-Clause
// Tiny ONNX models for tests, written byte by byte (protocol buffers: a key of field number and
// wire type, then a number in groups of 7 bits, or a length and bytes), and whether there is a
// runtime to run them.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "holba/frontend/onnx/onnx_runtime.h"

namespace holba {

#define HOLBA_SKIP_WITHOUT_ONNX_RUNTIME()                                                 \
  if (!::holba::FindOnnxRuntime()) {                                                      \
    GTEST_SKIP() << "SKIPPED, NOT TESTED: no ONNX Runtime (set HOLBA_ONNXRUNTIME to its " \
                    "libonnxruntime.so; PyPI's onnxruntime has one)";                     \
  }                                                                                       \
  static_assert(true)

// A message of protocol buffers.
class ProtoMessage {
 public:
  ProtoMessage& Number(int field, int64_t value) {
    Varint(static_cast<uint64_t>(field) << 3);
    Varint(static_cast<uint64_t>(value));
    return *this;
  }
  ProtoMessage& Text(int field, const std::string& bytes) {
    Varint((static_cast<uint64_t>(field) << 3) | 2);
    Varint(bytes.size());
    bytes_ += bytes;
    return *this;
  }
  ProtoMessage& Message(int field, const ProtoMessage& message) {
    return Text(field, message.bytes_);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void Varint(uint64_t value) {
    for (; value >= 0x80; value >>= 7) bytes_ += static_cast<char>((value & 0x7f) | 0x80);
    bytes_ += static_cast<char>(value);
  }
  std::string bytes_;
};

// A graph of nodes; fields have the numbers of onnx.proto.
class TinyModel {
 public:
  static constexpr int kFloat = 1, kInt64 = 7;

  // A dimension of -1: any size.
  TinyModel& Input(const std::string& name, int type, const std::vector<int64_t>& shape) {
    inputs_.push_back(ValueInfo(name, type, shape));
    return *this;
  }
  TinyModel& Output(const std::string& name, int type, const std::vector<int64_t>& shape) {
    outputs_.push_back(ValueInfo(name, type, shape));
    return *this;
  }
  template <typename T>
  TinyModel& Constant(const std::string& name, const std::vector<int64_t>& shape,
                      const std::vector<T>& values) {
    static_assert(std::is_same_v<T, float> || std::is_same_v<T, int64_t>);
    ProtoMessage tensor;
    for (const int64_t n : shape) tensor.Number(1, n);
    tensor.Number(2, std::is_same_v<T, float> ? kFloat : kInt64).Text(8, name);
    std::string raw(values.size() * sizeof(T), '\0');
    if (!values.empty()) std::memcpy(raw.data(), values.data(), raw.size());
    constants_.push_back(tensor.Text(9, raw));
    return *this;
  }
  // Attributes: whole numbers.
  TinyModel& Node(const std::string& op, const std::vector<std::string>& inputs,
                  const std::vector<std::string>& outputs,
                  const std::vector<std::pair<std::string, int64_t>>& attributes = {}) {
    ProtoMessage node;
    for (const std::string& name : inputs) node.Text(1, name);
    for (const std::string& name : outputs) node.Text(2, name);
    node.Text(4, op);
    for (const auto& [name, value] : attributes)
      node.Message(5, ProtoMessage().Text(1, name).Number(3, value).Number(20, 2));
    nodes_.push_back(node);
    return *this;
  }

  void Write(const std::filesystem::path& path) const {
    ProtoMessage graph;
    for (const ProtoMessage& node : nodes_) graph.Message(1, node);
    graph.Text(2, "tiny");
    for (const ProtoMessage& tensor : constants_) graph.Message(5, tensor);
    for (const ProtoMessage& input : inputs_) graph.Message(11, input);
    for (const ProtoMessage& output : outputs_) graph.Message(12, output);
    const ProtoMessage operators = ProtoMessage().Text(1, "").Number(2, 13);
    const ProtoMessage model = ProtoMessage().Number(1, 7).Message(7, graph).Message(8, operators);
    std::ofstream(path, std::ios::binary) << model.bytes();
  }

 private:
  static ProtoMessage ValueInfo(const std::string& name, int type,
                                const std::vector<int64_t>& shape) {
    ProtoMessage dims;
    for (const int64_t n : shape)
      dims.Message(1, n < 0 ? ProtoMessage().Text(2, "n") : ProtoMessage().Number(1, n));
    const ProtoMessage tensor = ProtoMessage().Number(1, type).Message(2, dims);
    return ProtoMessage().Text(1, name).Message(2, ProtoMessage().Message(1, tensor));
  }

  std::vector<ProtoMessage> nodes_, constants_, inputs_, outputs_;
};

// A folder for models and their descriptions.
class OnnxTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::path(testing::TempDir()) / "holba_onnx_XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }

  std::filesystem::path folder_;
};

}  // namespace holba
