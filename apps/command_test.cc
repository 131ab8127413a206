// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace holba {
namespace {

TEST(JsonText, IsValidAndPlainAsciiWhateverBytesANameHolds) {
  // Not UTF-8, an escape sequence, DEL, a control of Latin-1, letters.
  const std::string name = "a\xff\x1b[31m\x7f\xc2\x9b \xc3\xa9\xe6\x97\xa5";
  const std::string text = JsonText({{"name", name}});
  EXPECT_TRUE(std::all_of(text.begin(), text.end(), [](char c) {
    return c == '\n' || (c >= 0x20 && c < 0x7f);
  })) << text;
  // What is no UTF-8 is replaced, all else comes back as it was.
  EXPECT_EQ(nlohmann::json::parse(text).at("name").get<std::string>(),
            "a\xef\xbf\xbd\x1b[31m\x7f\xc2\x9b \xc3\xa9\xe6\x97\xa5");
  EXPECT_EQ(JsonText({{"x", 0.1}, {"n", nullptr}}), "{\n  \"n\": null,\n  \"x\": 0.1\n}\n");
}

}  // namespace
}  // namespace holba
