// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "holba/base/error.h"

namespace holba {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

struct Values {
  std::string input_path;
  int num_threads = 2;
  double weight = 0.5;
  bool refine = true;
  std::vector<double> shift = {0, 0, 0};

  void Describe(OptionTable* table) {
    table->Field("input_path", &input_path, "Where from.");
    table->Required();
    table->Field("shift", &shift, AnyValue(), "How far.");
    table->Section("Solver");
    table->Field("num_threads", &num_threads, AtLeast(1), "Threads.");
    table->Field("weight", &weight, Between(0, 1), "Weight.");
    table->Field("refine", &refine, "Whether to.");
  }
};

class ValuesJob : public Job {
 public:
  void Describe(OptionTable* table) override { values_.Describe(table); }
  void Run(const Invocation&) override {}

 private:
  Values values_;
};

Command TestCommand(bool supports_json) {
  return {.name = "try", .summary = "Try it", .supports_json = supports_json, .make_job = [] {
            return std::make_unique<ValuesJob>();
          }};
}

class CommandLine : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("holba_cli_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Config(const std::string& text) {
    const std::string path = (folder_ / "config.ini").string();
    std::ofstream(path) << text;
    return path;
  }
  void Parse(const std::vector<std::string>& words, bool supports_json = false) {
    values_ = {};
    common_ = {};
    OptionTable table;
    values_.Describe(&table);
    ParseCommandLine(TestCommand(supports_json), words, table, &common_);
  }
  // Message of the InputError; empty: none was thrown.
  std::string Refusal(const std::vector<std::string>& words) {
    try {
      Parse(words);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  std::filesystem::path folder_;
  Values values_;
  CommonOptions common_;
};

TEST_F(CommandLine, BothWaysOfGivingAValueSetIt) {
  Parse({"--input_path", "a", "--Solver.num_threads=7", "--Solver.refine", "0"});
  EXPECT_EQ(values_.input_path, "a");
  EXPECT_EQ(values_.num_threads, 7);
  EXPECT_FALSE(values_.refine);
  EXPECT_EQ(values_.weight, 0.5);
}

TEST_F(CommandLine, AValueMayBeginWithAMinusSign) {
  Parse({"--input_path", "-a", "--shift", "-1,2.5,-3e2"});
  EXPECT_EQ(values_.input_path, "-a");
  EXPECT_EQ(values_.shift, (std::vector<double>{-1, 2.5, -300}));
}

TEST_F(CommandLine, AnUnknownOptionIsRefusedWithTheNearest) {
  EXPECT_THAT(Refusal({"--input_path", "a", "--Solver.num_thread", "3"}),
              HasSubstr("'--Solver.num_thread', did you mean '--Solver.num_threads'?"));
  EXPECT_THAT(Refusal({"--input_path", "a", "--num_threads", "3"}),
              HasSubstr("did you mean '--Solver.num_threads'?"));
  const std::string far = Refusal({"--input_path", "a", "--zzzzzzzzzz=3"});
  EXPECT_THAT(far, HasSubstr("unknown option '--zzzzzzzzzz=3'"));
  EXPECT_THAT(far, ::testing::Not(HasSubstr("did you mean")));
}

TEST_F(CommandLine, WhatIsNoOptionIsRefused) {
  EXPECT_THAT(Refusal({"--input_path", "a", "b"}), HasSubstr("unexpected argument 'b'"));
}

TEST_F(CommandLine, AMissingValueIsRefusedByName) {
  EXPECT_THAT(Refusal({"--input_path"}), HasSubstr("--input_path"));
  EXPECT_THAT(Refusal({"--input_path", "--shift", "1"}), HasSubstr("--input_path needs a value"));
  EXPECT_THAT(Refusal({"--input_path", ""}), HasSubstr("--input_path needs a value"));
}

TEST_F(CommandLine, ARequiredOptionMustBeGivenUnlessHelpIsAskedFor) {
  EXPECT_THAT(Refusal({"--Solver.num_threads", "1"}), HasSubstr("--input_path is required"));
  Parse({"--help"});
  EXPECT_TRUE(common_.help);
  Parse({"-h"});
  EXPECT_TRUE(common_.help);
}

TEST_F(CommandLine, AnOptionGivenTwiceIsRefused) {
  EXPECT_THAT(Refusal({"--input_path", "a", "--input_path", "b"}), HasSubstr("given twice"));
}

TEST_F(CommandLine, AValueOutOfRangeIsRefusedWithTheRange) {
  EXPECT_THAT(Refusal({"--input_path", "a", "--Solver.num_threads", "0"}), HasSubstr("at least 1"));
  EXPECT_THAT(Refusal({"--input_path", "a", "--Solver.num_threads", "two"}), HasSubstr("'two'"));
}

TEST_F(CommandLine, JsonIsAnOptionOnlyOfCommandsThatSupportIt) {
  Parse({"--input_path", "a", "--json"}, true);
  EXPECT_TRUE(common_.json);
  EXPECT_THAT(Refusal({"--input_path", "a", "--json"}), HasSubstr("unknown option '--json'"));
}

TEST_F(CommandLine, TheCommandLineOverridesTheConfigFileAndBothTheDefault) {
  const std::string config = Config(
      "# a comment\n"
      "input_path = \"from config\"\n"
      "quiet=1\n"
      "; another\n"
      "\n"
      "[Solver]\n"
      "  num_threads =  5 \r\n"
      "refine = 0\n");
  Parse({"--Solver.num_threads", "9", "--config", config});
  EXPECT_EQ(values_.input_path, "from config");
  EXPECT_EQ(values_.num_threads, 9);
  EXPECT_FALSE(values_.refine);
  EXPECT_EQ(values_.weight, 0.5);
  EXPECT_TRUE(common_.quiet);
}

TEST_F(CommandLine, AConfigFileIsRefusedWithFileAndLine) {
  const auto refusal = [&](const std::string& text) {
    return Refusal({"--input_path", "a", "--config", Config(text)});
  };
  EXPECT_THAT(refusal("\n[Solver]\nthreads = 1\n"),
              HasSubstr("config.ini:3: unknown option 'Solver.threads'"));
  EXPECT_THAT(refusal("[Solver]\nnum_threads = 0\n"), HasSubstr("config.ini:2: "));
  EXPECT_THAT(refusal("[Solver]\nnum_threads = 0\n"), HasSubstr("at least 1"));
  EXPECT_THAT(refusal("input_path\n"), HasSubstr("config.ini:1: expected 'name = value'"));
  EXPECT_THAT(refusal("= 3\n"), HasSubstr("config.ini:1: expected 'name = value'"));
  EXPECT_THAT(refusal("[Solver\n"), HasSubstr("config.ini:1: expected '[Section]'"));
  EXPECT_THAT(refusal("shift = 1\n\nshift = 2\n"),
              HasSubstr("config.ini:3: 'shift' is given twice, first in line 1"));
  EXPECT_THAT(refusal("config = other.ini\n"), HasSubstr("config.ini:1: unknown option 'config'"));
  EXPECT_THAT(Refusal({"--config", (folder_ / "absent.ini").string()}), HasSubstr("absent.ini"));
  EXPECT_THAT(Refusal({"--config", folder_.string()}), HasSubstr("cannot open the config file"));
}

TEST_F(CommandLine, HelpNamesEveryOptionWithTypeDefaultRangeAndSentence) {
  const std::string help = CommandHelp(TestCommand(true));
  for (const char* text :
       {"--input_path text  (required)", "Where from.",
        "--Solver.num_threads int  (default: 2; at least 1)", "Threads.",
        "--Solver.weight float  (default: 0.5; between 0 and 1)",
        "--Solver.refine bool  (default: 1)", "--shift float,...  (default: 0,0,0)",
        "Options [Solver]:", "--config text", "--json\n",
        "--log_level debug|info|warning|error|off  (default: info)", "--quiet\n", "--help\n",
        "Usage: holba try --input_path VALUE [options]"}) {
    EXPECT_THAT(help, HasSubstr(text));
  }
  EXPECT_THAT(CommandHelp(TestCommand(false)), ::testing::Not(HasSubstr("--json")));
}

TEST(AllCommands, NamesAreUniqueAndOptionsDoNotHideTheCommonOnes) {
  std::vector<std::string> names;
  for (const Command& command : AllCommands()) {
    EXPECT_THAT(names, ::testing::Not(::testing::Contains(command.name)));
    names.push_back(command.name);
    EXPECT_FALSE(command.summary.empty()) << command.name;
    EXPECT_FALSE(command.summary.ends_with('.')) << command.name;
    const auto job = command.make_job();
    OptionTable table;
    job->Describe(&table);
    CommonOptions common;
    EXPECT_NO_THROW(ParseCommandLine(command, {"--help"}, table, &common)) << command.name;
    for (const Option& option : table.options()) {
      EXPECT_TRUE(option.sentence.ends_with('.')) << command.name << " --" << option.name;
    }
  }
  EXPECT_THAT(names, ::testing::Not(SizeIs(0)));
}

}  // namespace
}  // namespace holba
