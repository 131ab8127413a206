// SPDX-License-Identifier: BSD-3-Clause
// OpenCV's own threads: the program works on several images at a time, on as many threads as its
// option says.
#pragma once

namespace holba {

// From the first call on OpenCV works on the thread that calls it, in the whole process.
void HoldOpenCvThreads();

}  // namespace holba
