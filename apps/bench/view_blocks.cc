// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/view_blocks.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <utility>

#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/words.h"

namespace holba {

std::vector<ViewBlock> ReadViewBlocks(const std::filesystem::path& path, const std::string& kind,
                                      const std::string& columns, const std::string& script) {
  const auto num_columns = static_cast<size_t>(std::count(columns.begin(), columns.end(), ' ')) + 1;
  std::istringstream file(ReadFileBytes(path));
  std::vector<ViewBlock> blocks;
  size_t num_open = 0;
  std::string text;
  uint64_t line = 1;
  for (; std::getline(file, text); ++line) {
    std::istringstream words(text);
    if (num_open > 0) {
      std::vector<double> row(num_columns);
      for (double& number : row) {
        if (!(words >> number)) throw InputError::AtLine(path, line, "expected " + columns);
      }
      blocks.back().rows.push_back(std::move(row));
      --num_open;
      continue;
    }
    std::string word;
    if (!(words >> word)) continue;
    ViewBlock block;
    block.camera.model = FindCameraModel("PINHOLE");
    block.camera.params.resize(4);
    double* p = block.camera.params.data();
    if (word != kind || !(words >> block.camera.width >> block.camera.height >> p[0] >> p[1] >>
                          p[2] >> p[3] >> num_open)) {
      throw InputError::AtLine(path, line, "expected " + kind + " WIDTH HEIGHT FX FY CX CY COUNT");
    }
    blocks.push_back(std::move(block));
  }
  if (num_open > 0) {
    throw InputError::AtLine(path, line,
                             fmt::format("the last {} lacks {}; make the file anew with {}", kind,
                                         Counted(num_open, "line"), script));
  }
  return blocks;
}

}  // namespace holba
