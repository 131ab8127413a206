// SPDX-License-Identifier: BSD-3-Clause
#include "holba/io/shapes.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <unordered_set>
#include <utility>

#include "holba/base/check.h"

namespace holba {
namespace {

constexpr std::array<uint8_t, 3> kGrey = {110, 110, 110};

// Hues in steps of the golden angle.
std::array<uint8_t, 3> Colour(size_t index) {
  const double hue = 6.0 * std::fmod(0.08 + 0.61803398875 * static_cast<double>(index), 1.0);
  const auto channel = [hue](double offset) {
    const double k = std::fmod(hue + offset, 6.0);
    const double value = 0.9 - 0.6 * std::max(0.0, std::min({k, 4.0 - k, 1.0}));
    return static_cast<uint8_t>(std::lround(255.0 * value));
  };
  return {channel(5.0), channel(3.0), channel(1.0)};
}

}  // namespace

std::vector<GroupShape> GroupShapes(const Reconstruction& model) {
  std::vector<GroupShape> shapes;
  for (const auto& [id, group] : model.groups3D) {
    std::vector<Eigen::Vector3d> members;
    for (const point3D_t point : group.point3D_ids) members.push_back(model.points3D.at(point).xyz);
    for (const line3D_t line : group.line3D_ids) {
      members.push_back(model.lines3D.at(line).start);
      members.push_back(model.lines3D.at(line).end);
    }
    double g[kMaxGroupParams];
    HOLBA_CHECK(group.type->from_file(group.params.data(), g));
    std::string name(group.type->name);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    shapes.push_back(
        {id, name + "_" + std::to_string(id), Colour(shapes.size()), group.type->mesh(g, members)});
  }
  return shapes;
}

std::vector<LineLayer> LineLayers(const Reconstruction& model) {
  std::vector<LineLayer> layers;
  std::unordered_set<line3D_t> taken;
  size_t index = 0;
  for (const auto& [id, group] : model.groups3D) {
    const size_t colour = index++;
    if (!group.type->IsParallelism()) continue;
    LineLayer layer{"direction_" + std::to_string(id), Colour(colour), {}};
    for (const line3D_t line : group.line3D_ids) {
      if (taken.insert(line).second) layer.line3D_ids.push_back(line);
    }
    if (!layer.line3D_ids.empty()) layers.push_back(std::move(layer));
  }
  LineLayer others{"no_direction", kGrey, {}};
  for (const auto& [id, line] : model.lines3D) {
    if (!taken.contains(id)) others.line3D_ids.push_back(id);
  }
  if (!others.line3D_ids.empty()) layers.push_back(std::move(others));
  return layers;
}

}  // namespace holba
