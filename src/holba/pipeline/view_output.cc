// SPDX-License-Identifier: BSD-3-Clause
#include "holba/pipeline/view_output.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/base/threads.h"
#include "holba/base/words.h"
#include "holba/frontend/photographs/jpeg_file.h"
#include "holba/frontend/photographs/photograph.h"
#include "holba/frontend/photographs/shrink.h"
#include "holba/view/view_model.h"

namespace holba {
namespace {

constexpr int kQuality = 80;
// What a pixel of a sharp photograph takes at that quality, with base64: 0.25 bytes by 4/3, rounded
// up.
constexpr double kBytesPerPixel = 0.4;
// Less than this shows nothing.
constexpr int kMinSidePx = 120;

}  // namespace

void ViewPhotographOptions::Describe(OptionTable* table) const {
  table
      ->Field("photograph_px", &photograph_px, AtLeast(0),
              "Longer side of the photographs in the page, in pixels; 0: without photographs.")
      .Advanced();
  table
      ->Field("max_photographs_mb", &max_photographs_mb, GreaterThan(0),
              "About how many megabytes of the page its photographs may take, which are made "
              "smaller for it.")
      .Advanced();
}

std::vector<ViewPhotograph> MakeViewPhotographs(const Reconstruction& model,
                                                const PhotographFolder& folder,
                                                const std::set<image_t>& without_photograph,
                                                const ViewPhotographOptions& options,
                                                int num_threads) {
  std::vector<size_t> shown;
  for (size_t i = 0; i < model.images.size(); ++i) {
    if (!without_photograph.contains((model.images.begin() + i)->first)) shown.push_back(i);
  }
  if (shown.empty() || options.photograph_px == 0) return {};
  // Of photographs of three by four.
  const double pixels =
      1e6 * options.max_photographs_mb / kBytesPerPixel / static_cast<double>(shown.size());
  const int side = std::min(options.photograph_px,
                            std::max(kMinSidePx, static_cast<int>(std::sqrt(pixels * 4.0 / 3.0))));
  std::vector<std::string> jpegs(shown.size());
  ParallelTasks(num_threads, shown.size(), [&](size_t i) {
    const Image& image = (model.images.begin() + shown[i])->second;
    try {
      jpegs[i] = EncodeJpeg(Shrunk(ReadColourImage(folder / image.name), side), kQuality);
    } catch (const InputError& error) {
      LogDebug("{}", error.what());
    }
  });
  std::vector<ViewPhotograph> photographs;
  for (size_t i = 0; i < shown.size(); ++i) {
    if (!jpegs[i].empty()) photographs.push_back({shown[i], std::move(jpegs[i])});
  }
  const size_t num_missing = shown.size() - photographs.size();
  if (num_missing > 0) {
    LogWarning("The page shows {} without their photographs, as these cannot be read",
               Counted(num_missing, "image"));
  }
  return photographs;
}

void StageViewPage(const Reconstruction& model, const PhotographFolder* photographs,
                   const std::set<image_t>& without_photograph,
                   const ViewPhotographOptions& options, int num_threads, const std::string& prefix,
                   StagedFolder* stage) {
  ViewPage page;
  page.model = MakeViewModel(
                   model, {.title = prefix.empty() ? "Model"
                                                   : "Model " + prefix.substr(0, prefix.size() - 1),
                           .num_threads = num_threads})
                   .bytes;
  if (photographs) {
    page.photographs =
        MakeViewPhotographs(model, *photographs, without_photograph, options, num_threads);
  }
  stage->Write(prefix + kViewPage, [&](std::ostream* stream) { FormatViewPage(page, stream); });
}

void LogViewPage(const std::filesystem::path& model_folder) {
  LogInfo("Open {} in a browser to look at the model", (model_folder / kViewPage).string());
}

bool IsViewPage(std::string_view name) { return name == kViewPage; }

}  // namespace holba
