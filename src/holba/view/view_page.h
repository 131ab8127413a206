// SPDX-License-Identifier: BSD-3-Clause
// One self-contained HTML page that shows a model, in any browser, without a network.
#pragma once

#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "holba/scene/types.h"

namespace holba {

// As a file holds it.
struct ViewPhotograph {
  size_t image_idx = 0;  // in the order of the model's images
  std::string jpeg;      // the bytes of a JPEG file
};

struct ViewPage {
  std::string model;                        // ViewModel::bytes
  std::string compare;                      // those of a second model; empty: none
  std::vector<ViewPhotograph> photographs;  // of the first
};

// The bytes of all of it stand in the page as base64, so that no name of a model can be taken for
// a part of the page.
void FormatViewPage(const ViewPage& page, std::ostream* stream);

}  // namespace holba
