// SPDX-License-Identifier: BSD-3-Clause
// The files in which scripts give views to benchmarks: blocks of a line
//   KIND WIDTH HEIGHT FX FY CX CY COUNT
// (a PINHOLE camera) and COUNT lines of numbers.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

struct ViewBlock {
  Camera camera;
  std::vector<std::vector<double>> rows;  // as many numbers each as `columns` has words
};

// `kind`: the first word of a block. `columns`: what a row holds, for messages ("X1 Y1 X2 Y2").
// `script`: what makes such files. Throws InputError with the line.
std::vector<ViewBlock> ReadViewBlocks(const std::filesystem::path& path, const std::string& kind,
                                      const std::string& columns, const std::string& script);

}  // namespace holba
