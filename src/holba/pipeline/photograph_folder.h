// SPDX-License-Identifier: BSD-3-Clause
// Where the photographs of a model's images are. Names in models and on disk may differ as those of
// two models do (scene/name_pairing.h): another extension or case, '\' for '/', folders before.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "holba/scene/reconstruction.h"

namespace holba {

// Files below a folder that are photographs by their extensions, relative to it with '/', in the
// order of their names.
std::vector<std::string> FindPhotographs(const std::filesystem::path& folder);

class PhotographFolder {
 public:
  // Photographs are where the names say. Implicit: every folder is one.
  PhotographFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}  // NOLINT
  // Looks through the folder for those that are not. Says on the log what was paired how; throws
  // InputError with two names if there are photographs, and none is of this model. One that is not
  // found stays where its name says.
  PhotographFolder(std::filesystem::path folder, const Reconstruction& model);

  std::filesystem::path operator/(const std::string& name) const;

 private:
  std::filesystem::path folder_;
  std::map<std::string, std::string> file_of_name_;  // of names that are not that of their file
};

}  // namespace holba
