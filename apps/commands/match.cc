// SPDX-License-Identifier: BSD-3-Clause
// holba match: verified matches for a database of features.
#include <string>

#include "apps/command.h"
#include "apps/match/match_stage.h"
#include "holba/io/database.h"

namespace holba {
namespace {

class MatchJob : public Job {
 public:
  void Describe(OptionTable* table) const override {
    table
        ->Field("database_path", &database_path_, "COLMAP database with keypoints and descriptors.")
        .Required();
    options_.pairs.Describe(table);
    options_.matching.Describe(table);
    options_.segments.Describe(table);
  }

  void ProbeOutputs(const Invocation&) const override {
    ProbeExistingDatabase(database_path_);
    ProbeResult();
  }

  void Run(const Invocation& invocation) override {
    const MatchOutput output = RunMatch(options_, database_path_);
    PrintResult(invocation.json ? JsonText(MatchToJson(output)) : MatchToText(output));
  }

 private:
  std::string database_path_;
  MatchStageOptions options_;
};

}  // namespace

Command MatchCommand() {
  return {.name = "match",
          .summary = "Match the features of a database's images and verify the matches",
          .details =
              "Takes keypoints and descriptors from a COLMAP database (of holba extract, COLMAP's "
              "feature_extractor, hloc, ...),\n"
              "and puts matches and two-view geometries into it, as COLMAP's matchers do. Pairs "
              "that are there already stay as\n"
              "they are: a run that was stopped goes on where it ended. Segments of holba are "
              "matched by the points around them. Options have the names "
              "that COLMAP 4 gives them.",
          .supports_json = true,
          .make_job = [] { return std::make_unique<MatchJob>(); }};
}

}  // namespace holba
