// SPDX-License-Identifier: BSD-3-Clause
// The page that shows a model in a browser, with its photographs.
#pragma once

#include <cstddef>
#include <filesystem>
#include <ostream>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "holba/base/options.h"
#include "holba/io/files.h"
#include "holba/pipeline/photograph_folder.h"
#include "holba/scene/reconstruction.h"
#include "holba/view/view_page.h"

namespace holba {

struct ViewPhotographOptions {
  int photograph_px = 1000;
  double max_photographs_mb = 40.0;

  void Describe(OptionTable* table) const;
};

// The photographs of the images, small, but for those in `without_photograph` and those that
// cannot be read, of which the log says how many. Over max_photographs_mb all are made smaller
// still.
std::vector<ViewPhotograph> MakeViewPhotographs(const Reconstruction& model,
                                                const PhotographFolder& folder,
                                                const std::set<image_t>& without_photograph,
                                                const ViewPhotographOptions& options,
                                                int num_threads);

// view.html for the stage of a model's folder. `prefix`: "", or "FOLDER/" in the stage.
// `photographs`: null: without. Nothing in the page depends on where, when or how fast the model
// was made.
void StageViewPage(const Reconstruction& model, const PhotographFolder* photographs,
                   const std::set<image_t>& without_photograph,
                   const ViewPhotographOptions& options, int num_threads, const std::string& prefix,
                   StagedFolder* stage);

// Says where it is, once the stage is committed.
void LogViewPage(const std::filesystem::path& model_folder);

// The name of it, for the stage's Commit.
bool IsViewPage(std::string_view name);
inline constexpr const char* kViewPage = "view.html";

}  // namespace holba
