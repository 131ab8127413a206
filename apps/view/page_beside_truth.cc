// SPDX-License-Identifier: BSD-3-Clause
#include "apps/view/page_beside_truth.h"

#include "holba/base/log.h"
#include "holba/evaluation/alignment.h"
#include "holba/evaluation/image_pairing.h"
#include "holba/io/files.h"
#include "holba/view/view_model.h"
#include "holba/view/view_page.h"

namespace holba {

void WritePageBesideTruth(const Reconstruction& model, Reconstruction truth,
                          const std::filesystem::path& path) {
  const Eigen::Vector3d origin = OriginOfView(model);
  ViewPage page;
  page.model = MakeViewModel(model, {.title = "Model"}, origin).bytes;
  const auto alignment =
      AlignReconstructions(truth, model, PairImages(truth, model), AlignmentBasis::kAuto);
  if (alignment) {
    truth.Transform(alignment->truth_from_model);
    page.compare = MakeViewModel(truth, {.title = "Truth"}, origin).bytes;
  }
  WriteFileWhole(path, [&](std::ostream* stream) { FormatViewPage(page, stream); });
  LogInfo("Open {} in a browser to look at the model beside the truth", path.string());
}

}  // namespace holba
