// SPDX-License-Identifier: BSD-3-Clause
#include "holba/frontend/photographs/opencv_threads.h"

#include <opencv2/core/utility.hpp>

namespace holba {

void HoldOpenCvThreads() {
  static const bool once = [] {
    cv::setNumThreads(1);
    return true;
  }();
  static_cast<void>(once);
}

}  // namespace holba
