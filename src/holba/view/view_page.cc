// SPDX-License-Identifier: BSD-3-Clause
#include "holba/view/view_page.h"

#include <string_view>

#include "holba/base/check.h"
#include "holba/view/array_bundle.h"
#include "holba/view/viewer_page.h"

namespace holba {

void FormatViewPage(const ViewPage& page, std::ostream* stream) {
  const std::string_view viewer = ViewerPage();
  const size_t place = viewer.find(kDataPlace);
  HOLBA_CHECK(place != std::string_view::npos);
  *stream << viewer.substr(0, place);
  const auto write_model = [&](std::string_view name, const std::string& bytes) {
    if (bytes.empty()) return;
    *stream << "<script type=\"application/octet-stream\" id=\"holba-" << name << "\">"
            << Base64(Deflate(bytes)) << "</script>\n";
  };
  write_model("model", page.model);
  write_model("compare", page.compare);
  for (const ViewPhotograph& photograph : page.photographs) {
    *stream << "<script type=\"application/octet-stream\" id=\"holba-photograph-"
            << photograph.image_idx << "\">" << Base64(photograph.jpeg) << "</script>\n";
  }
  *stream << viewer.substr(place + kDataPlace.size());
}

}  // namespace holba
