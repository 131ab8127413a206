// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "holba/base/error.h"

namespace holba {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

enum class Colour { kRed, kGreen };

struct Values {
  bool flag = true;
  int number = -3;
  uint64_t seed = 18446744073709551615ULL;
  double weight = 0.25;
  std::string path = "a b";
  std::vector<double> shift = {1, -2.5};
  Colour colour = Colour::kGreen;

  void Describe(OptionTable* table) const {
    table->Field("flag", &flag, "A flag.");
    table->Field("number", &number, AtLeast(-5), "A number.").Advanced();
    table->Section("More");
    table->Field("seed", &seed, AnyValue(), "A seed.");
    table->Field("weight", &weight, Between(0, 1), "A weight.").Basic();
    table->Field("path", &path, "A path.").Required();
    table->Field("shift", &shift, GreaterThan(-3), "A shift.");
    table->Choice("colour", &colour, {{"red", Colour::kRed}, {"green", Colour::kGreen}},
                  "A colour.");
  }
};

struct Pair {
  Values first, second;
  int between = 0;

  void Describe(OptionTable* table) const {
    table->Section("Pair");
    table->Nest("First", first);
    table->Field("between", &between, AnyValue(), "Between.");
    table->Nest("Second", second);
  }
};

std::vector<std::string> Names(const OptionTable& table) {
  std::vector<std::string> names;
  for (const Option& option : table.options()) names.push_back(option.name);
  return names;
}

TEST(OptionTable, OptionsOfAConstStructAreReadWithTheirTypes) {
  const Values values;
  OptionTable table;
  values.Describe(&table);
  const std::vector<Option>& options = table.options();
  EXPECT_THAT(Names(table), ElementsAre("flag", "number", "More.seed", "More.weight", "More.path",
                                        "More.shift", "More.colour"));
  const std::vector<std::pair<OptionType, OptionValue>> expected = {
      {OptionType::kBool, true},
      {OptionType::kInt, -3},
      {OptionType::kUint, uint64_t{18446744073709551615ULL}},
      {OptionType::kDouble, 0.25},
      {OptionType::kText, std::string("a b")},
      {OptionType::kDoubles, std::vector<double>{1, -2.5}},
      {OptionType::kChoice, std::string("green")}};
  ASSERT_EQ(options.size(), expected.size());
  for (size_t i = 0; i < options.size(); ++i) {
    EXPECT_EQ(options[i].type, expected[i].first) << options[i].name;
    EXPECT_EQ(options[i].Value(), expected[i].second) << options[i].name;
    EXPECT_EQ(options[i].default_value, expected[i].second) << options[i].name;
    EXPECT_THROW(options[i].Set(expected[i].second), CheckError) << options[i].name;
  }
  EXPECT_THAT(options[6].choices, ElementsAre("red", "green"));
  EXPECT_EQ(options[3].range.low, 0.0);
  EXPECT_EQ(options[3].range.high, 1.0);
  EXPECT_TRUE(options[5].range.low_is_open);
}

TEST(OptionTable, PlainOptionsAreBasicOnesInSectionsAdvancedUnlessMarked) {
  const Values values;
  OptionTable table;
  values.Describe(&table);
  std::vector<bool> basic, required;
  for (const Option& option : table.options()) {
    basic.push_back(option.level == OptionLevel::kBasic);
    required.push_back(option.required);
  }
  EXPECT_THAT(basic, ElementsAre(true, false, false, true, true, false, false));
  EXPECT_THAT(required, ElementsAre(false, false, false, false, true, false, false));
}

TEST(OptionTable, ATextThatWasReadSetsTheSameValue) {
  const Values values;
  OptionTable table;
  values.Describe(&table);
  Values other{false, 0, 0, 1.0, "", {}, Colour::kRed};
  OptionTable bound;
  bound.Bind(&other);
  for (size_t i = 0; i < table.options().size(); ++i)
    bound.options()[i].SetText(table.options()[i].Text());
  EXPECT_EQ(TextOfOptions(other), TextOfOptions(values));
  EXPECT_EQ(other.seed, values.seed);
  EXPECT_EQ(other.shift, values.shift);
  EXPECT_EQ(other.colour, values.colour);
  // The defaults are what was there first.
  EXPECT_EQ(bound.options()[1].default_value, OptionValue(0));
}

TEST(OptionTable, WhatIsNotAllowedIsRefusedAndChangesNothing) {
  Values values;
  OptionTable table;
  table.Bind(&values);
  const std::string before = TextOfOptions(values);
  const auto refusal = [&](size_t i, const OptionValue& value) -> std::string {
    try {
      table.options()[i].Set(value);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(1, -6),
              HasSubstr("--number: expected a whole number at least -5, found '-6'"));
  EXPECT_THAT(refusal(1, 2.0), HasSubstr("a whole number"));
  EXPECT_THAT(refusal(3, 1.5), HasSubstr("between 0 and 1"));
  EXPECT_THAT(refusal(3, std::nan("")), HasSubstr("a number"));
  EXPECT_THAT(refusal(5, std::vector<double>{0, -3}), HasSubstr("greater than -3"));
  EXPECT_THAT(refusal(6, std::string("blue")), HasSubstr("one of red|green"));
  for (const Option& option : table.options()) {
    if (option.type == OptionType::kText) continue;
    EXPECT_THROW(option.SetText("x"), InputError) << option.name;
  }
  EXPECT_EQ(TextOfOptions(values), before);
}

TEST(OptionTable, NestedStructsOfOneKindHaveNamesOfTheirOwn) {
  Pair pair;
  OptionTable table;
  table.Bind(&pair);
  EXPECT_THAT(Names(table),
              ElementsAre("First.flag", "First.number", "First.More.seed", "First.More.weight",
                          "First.More.path", "First.More.shift", "First.More.colour",
                          "Pair.between", "Second.flag", "Second.number", "Second.More.seed",
                          "Second.More.weight", "Second.More.path", "Second.More.shift",
                          "Second.More.colour"));
  EXPECT_EQ(table.options()[0].section, "First");
  EXPECT_EQ(table.options()[2].section, "First.More");
  EXPECT_EQ(table.options()[0].level, OptionLevel::kAdvanced);
  table.options()[1].SetText("4");
  table.options()[9].SetText("5");
  EXPECT_EQ(pair.first.number, 4);
  EXPECT_EQ(pair.second.number, 5);

  OptionTable outer;
  outer.Nest("Outer", pair);
  EXPECT_EQ(outer.options()[2].name, "Outer.First.More.seed");
}

TEST(OptionTable, OneNameIsDeclaredOnce) {
  const Values values;
  OptionTable table;
  values.Describe(&table);
  table.Section("");
  EXPECT_THROW(values.Describe(&table), CheckError);
}

TEST(Range, SaysWhatItContains) {
  EXPECT_EQ(AnyValue().Text(), "");
  EXPECT_EQ(AtLeast(-1).Text(), "at least -1");
  EXPECT_EQ(GreaterThan(0).Text(), "greater than 0");
  EXPECT_EQ(Between(0, 0.5).Text(), "between 0 and 0.5");
  EXPECT_TRUE(AtLeast(2).Contains(2));
  EXPECT_FALSE(GreaterThan(2).Contains(2));
  EXPECT_FALSE(Between(1, 2).Contains(2.1));
}

}  // namespace
}  // namespace holba
