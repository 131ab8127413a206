// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/words.h"

#include <gtest/gtest.h>

namespace holba {
namespace {

TEST(Words, NounsAndVerbsAgreeWithTheirNumbers) {
  EXPECT_EQ(Counted(0, "image"), "0 images");
  EXPECT_EQ(Counted(1, "image"), "1 image");
  EXPECT_EQ(Counted(2, "vanishing point"), "2 vanishing points");
  EXPECT_EQ(Counted(1, "segment match"), "1 segment match");
  EXPECT_EQ(Counted(2, "segment match"), "2 segment matches");
  EXPECT_EQ(Counted(1234567, "point"), "1234567 points");
  EXPECT_EQ(Agree(1, "is", "are"), "is");
  EXPECT_EQ(Agree(0, "is", "are"), "are");
}

}  // namespace
}  // namespace holba
