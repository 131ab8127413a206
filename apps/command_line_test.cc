// SPDX-License-Identifier: BSD-3-Clause
#include "apps/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "holba/base/error.h"
#include "holba/solver/solver.h"

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

  void Describe(OptionTable* table) const {
    table->Field("input_path", &input_path, "Where from.").Required();
    table->Field("shift", &shift, AnyValue(), "How far.");
    table->Section("Solver");
    table->Field("num_threads", &num_threads, AtLeast(1), "Threads.").Basic();
    table->Field("weight", &weight, Between(0, 1), "Weight.");
    table->Field("refine", &refine, "Whether to.");
  }
};

class ValuesJob : public Job {
 public:
  void Describe(OptionTable* table) const override { values_.Describe(table); }
  void ProbeOutputs(const Invocation&) const override {}
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
    table.Bind(&values_);
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
  EXPECT_THAT(Refusal({"--input_path", "--shift", "1"}),
              HasSubstr("--input_path: expected a value, found the option '--shift'"));
  EXPECT_THAT(Refusal({"--input_path", ""}), HasSubstr("--input_path must be given"));
}

TEST_F(CommandLine, ARequiredOptionMustBeGivenUnlessHelpIsAskedFor) {
  EXPECT_THAT(Refusal({"--Solver.num_threads", "1"}), HasSubstr("--input_path must be given"));
  Parse({"--help"});
  EXPECT_EQ(common_.help, HelpForm::kBasic);
  Parse({"-h"});
  EXPECT_EQ(common_.help, HelpForm::kBasic);
  Parse({"--help", "--Solver.num_threads", "1"});
  EXPECT_EQ(common_.help, HelpForm::kBasic);
  Parse({"--help", "all"});
  EXPECT_EQ(common_.help, HelpForm::kAll);
  Parse({"--help=json"});
  EXPECT_EQ(common_.help, HelpForm::kJson);
  EXPECT_THAT(Refusal({"--help", "everything"}), HasSubstr("basic, all or json"));
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
  EXPECT_THAT(Refusal({"--config", folder_.string()}),
              HasSubstr("the file of options cannot be opened"));
}

TEST_F(CommandLine, TheWholeHelpNamesEveryOptionWithTypeDefaultRangeAndSentence) {
  const std::string help = CommandHelp(TestCommand(true), HelpForm::kAll);
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
  EXPECT_THAT(CommandHelp(TestCommand(false), HelpForm::kAll), ::testing::Not(HasSubstr("--json")));
}

TEST_F(CommandLine, TheShortHelpHasALineForEachBasicOption) {
  const std::string help = CommandHelp(TestCommand(true), HelpForm::kBasic);
  EXPECT_THAT(help, HasSubstr("  --input_path VALUE      Where from.\n"));
  EXPECT_THAT(help, HasSubstr("  --shift 0,0,0           How far.\n"));
  EXPECT_THAT(help, HasSubstr("  --Solver.num_threads 2  Threads.\n"));
  EXPECT_THAT(help, HasSubstr("  --help                  Show"));
  EXPECT_THAT(help, ::testing::Not(HasSubstr("--Solver.weight")));
  EXPECT_THAT(help,
              HasSubstr("'holba try --help all' has every option in full, 2 more: Solver.\n"));
}

// A command with two structs of one kind.
struct TwoSolvers {
  SolverOptions solver;
  SolverOptions local_solver;

  void Describe(OptionTable* table) const {
    solver.Describe(table);
    table->Nest("Local", local_solver);
  }
};

TEST_F(CommandLine, TwoStructsOfOneKindAreSetApart) {
  const auto parsed = [&](const std::vector<std::string>& words) {
    TwoSolvers options;
    OptionTable table;
    table.Bind(&options);
    ParseCommandLine(TestCommand(false), words, table, &common_);
    return options;
  };
  const TwoSolvers by_words =
      parsed({"--Solver.max_num_iterations", "7", "--Local.Solver.max_num_iterations", "8",
              "--Local.Solver.linear_solver=dense"});
  const TwoSolvers by_file = parsed({"--config", Config("[Local]\n"
                                                        "Solver.linear_solver = dense\n"
                                                        "[Solver]\n"
                                                        "max_num_iterations = 7\n"
                                                        "[Local.Solver]\n"
                                                        "max_num_iterations = 8\n")});
  for (const TwoSolvers& options : {by_words, by_file}) {
    EXPECT_EQ(options.solver.max_num_iterations, 7);
    EXPECT_EQ(options.local_solver.max_num_iterations, 8);
    EXPECT_EQ(options.solver.linear_solver, LinearSolver::kAuto);
    EXPECT_EQ(options.local_solver.linear_solver, LinearSolver::kDense);
  }
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
    OptionTable common_table;
    common.Describe(&common_table);
    for (const Option& option : common_table.options()) {
      EXPECT_THAT(table.options(),
                  ::testing::Each(::testing::Field(&Option::name, ::testing::Ne(option.name))))
          << command.name;
    }
    for (const Option& option : table.options()) {
      EXPECT_TRUE(option.sentence.ends_with('.')) << command.name << " --" << option.name;
    }
  }
  EXPECT_THAT(names, ::testing::Not(SizeIs(0)));
}

TEST(AllCommands, TheShortHelpIsOneScreenOfWholeClauses) {
  for (const Command& command : AllCommands()) {
    const std::string help = CommandHelp(command, HelpForm::kBasic);
    std::istringstream lines(help);
    int num_lines = 0;
    for (std::string line; std::getline(lines, line); ++num_lines) {
      EXPECT_LE(line.size(), 100u) << line;
      EXPECT_FALSE(line.ends_with(" ...")) << "no clause of its sentence fits: " << line;
    }
    EXPECT_LE(num_lines, 40) << command.name;
  }
}

TEST(AllCommands, AProgramCanReadEveryOptionWithItsType) {
  for (const Command& command : AllCommands()) {
    const auto json = nlohmann::json::parse(CommandHelp(command, HelpForm::kJson));
    EXPECT_EQ(json.at("command"), command.name);
    const auto job = command.make_job();
    OptionTable table;
    job->Describe(&table);
    ASSERT_EQ(json.at("options").size(), table.options().size());
    for (size_t i = 0; i < table.options().size(); ++i) {
      const Option& option = table.options()[i];
      const nlohmann::json& found = json.at("options").at(i);
      EXPECT_EQ(found.at("name"), option.name);
      const nlohmann::json& value = found.at("default");
      const std::string type = found.at("type");
      if (type == "bool") {
        EXPECT_EQ(value, std::get<bool>(option.default_value));
      } else if (type == "int") {
        EXPECT_EQ(value, std::get<int>(option.default_value));
      } else if (type == "uint") {
        EXPECT_EQ(value, std::get<uint64_t>(option.default_value));
      } else if (type == "double") {
        EXPECT_EQ(value, std::get<double>(option.default_value));
      } else if (type == "doubles") {
        EXPECT_EQ(value, std::get<std::vector<double>>(option.default_value));
      } else {
        EXPECT_EQ(value, std::get<std::string>(option.default_value));
      }
      if (type == "choice") {
        EXPECT_THAT(found.at("choices"), ::testing::Contains(value)) << option.name;
      } else if (value.is_number() && !found.at("range").at("low").is_null()) {
        EXPECT_GE(value.get<double>(), found.at("range").at("low").get<double>()) << option.name;
      }
      const bool is_advanced_here = std::count(command.advanced_sections.begin(),
                                               command.advanced_sections.end(), option.section) > 0;
      const bool is_basic = option.level == OptionLevel::kBasic && !is_advanced_here;
      EXPECT_EQ(found.at("level"), is_basic ? "basic" : "advanced") << option.name;
    }
  }
}

}  // namespace
}  // namespace holba
