// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/printable.h"

#include <gtest/gtest.h>

namespace holba {
namespace {

TEST(Printable, LeavesTextAsItIs) {
  for (const char* text :
       {"", "points3D.txt:3: expected X\n\tnext", "caf\xc3\xa9 \xe2\x82\xac \xf0\x9f\x93\xb7"})
    EXPECT_EQ(Printable(text), text);
}

TEST(Printable, ShowsBytesThatATerminalWouldObey) {
  EXPECT_EQ(Printable("\x1b[2Jx\x07\r\x7f"), "\\x1b[2Jx\\x07\\x0d\\x7f");
  EXPECT_EQ(Printable(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(Printable("\xc2\x9b"), "\\xc2\\x9b") << "a control character of Latin-1";
}

TEST(Printable, ShowsBytesThatAreNoUtf8) {
  EXPECT_EQ(Printable("\xff\xfe"), "\\xff\\xfe");
  EXPECT_EQ(Printable("caf\xe9"), "caf\\xe9") << "Latin-1";
  EXPECT_EQ(Printable("\xe2\x82"), "\\xe2\\x82") << "cut";
  EXPECT_EQ(Printable("\xc0\xaf"), "\\xc0\\xaf") << "a long form";
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
}

}  // namespace
}  // namespace holba
