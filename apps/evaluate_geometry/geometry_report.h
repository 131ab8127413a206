// SPDX-License-Identifier: BSD-3-Clause
// What `holba evaluate_geometry` has measured: as JSON, as a table, and feature by feature as
// files.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "holba/evaluation/edge_errors.h"
#include "holba/evaluation/geometry_errors.h"
#include "holba/evaluation/multi_view.h"
#include "holba/evaluation/primitive_errors.h"
#include "holba/io/files.h"
#include "holba/scene/reconstruction.h"

namespace holba {

struct GeometryReport {
  // Each is empty where no truth of its kind was given.
  std::optional<GeometryErrors> surface;
  std::optional<MultiViewErrors> multi_view;
  bool has_free_space = false;  // of multi_view
  std::optional<EdgeErrors> edges;
  std::optional<PrimitiveErrors> primitives;
};

nlohmann::ordered_json GeometryToJson(const GeometryReport& report, const Reconstruction& model,
                                      const Reconstruction& truth, const GeometryOptions& options,
                                      const MultiViewOptions& multi_view);
// The same figures for people.
std::string GeometryToText(const nlohmann::ordered_json& json);

// points.csv, lines.csv, edges.csv and primitives.csv, of what was measured, and errors.ply: points
// and pieces of lines in colours from green (no error) to red (the largest threshold), violet
// beyond.
void StageGeometryFiles(const GeometryReport& report, const Reconstruction& model,
                        const GeometryOptions& options, StagedFolder* stage);
bool IsGeometryFile(std::string_view name);

}  // namespace holba
