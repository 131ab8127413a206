// SPDX-License-Identifier: BSD-3-Clause
#include "apps/bench/results_page.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "apps/bench/paper_tables.h"
#include "holba/base/error.h"
#include "holba/base/file_faults.h"
#include "holba/base/log.h"
#include "holba/base/words.h"

namespace holba {
namespace {

struct PageSection {
  std::string_view benchmark, heading;
  std::string_view differs;  // what differs from the paper, and why
};

constexpr PageSection kSections[] = {
    {"geometry", "Geometry (Tables 2 and 3)",
     "Cameras are held where they truly are and points and lines estimated anew, as in the paper. "
     "The rooms are rendered, their "
     "surfaces known exactly; points are SIFT's and corners, lines LSD's, planes found among the "
     "points, where the paper has "
     "ALIKED, DeepLSD and planes of a network that sees depth. The scan of Table 3 is of all "
     "surfaces, also "
     "those that no camera sees, so that completeness cannot be compared with ETH3D's."},
    {"poses", "Poses (Table 4)",
     "The paper's first row is COLMAP itself; ours is the mapper with points alone and without the "
     "refinement at its end. \"points, "
     "refined\" is this with the refinement (measured noise, robust loss), which the paper has no "
     "row for. Intrinsics are known and held."},
    {"ablation", "2D against 3D form (Table 5)",
     "All rows but the last take the weights as given, as the paper does; the last one is the "
     "default, where points left out choose what "
     "moves the cameras. Weights of the 3D form are per metre here, so that they mean the same in "
     "every room, "
     "which models of unknown scale cannot have. Cameras start where the mapper with points alone "
     "has put them. With held cameras there is no gauge, "
     "so that accuracy stands once."},
    {"sfm", "Structure from motion (Table 1)",
     "Synthetic databases in place of 1DSfM's photographs, with a few percent of wrong matches and "
     "a fifth missing, tens of "
     "images in place of a thousand. User seconds and their ratio are processor time of all "
     "threads; wall seconds and milliseconds "
     "an iteration are the clock's, on a machine that others used."},
    {"density", "Density of the reduced system",
     "True tracks of synthetic scenes in place of maps of 1DSfM. "
     "A hundred images of the collection couple more of their pairs than the paper's 750 to 963 "
     "do; on the street three quarters of the pairs share nothing."},
    {"scaling", "Time per iteration (runtime figure a)",
     "The paper's scenes, and Ceres there: its exponents are 1.6 to 1.9 with the sparse and 2.6 to "
     "2.8 with the dense Schur complement, from 100 to "
     "2000 images. "
     "Ours are of the native solver from 50 to 200 images, where random visibility fills the "
     "sparse system nearly as full as the dense one, so that both grow alike."},
    {"wireframe", "Wireframe in 2D and in 3D (runtime figure b)",
     "As the paper's: lines that a 3D wireframe ties to points cannot be eliminated, and stay in "
     "the reduced system."},
    {"breakdown", "First and later iterations (runtime figure c)",
     "The paper's first iterations pay for the analysis of the sparsity pattern. The native solver "
     "keeps an analysis "
     "for the next problem of equal structure; local problems differ from each other, so that "
     "nearly each pays."},
    {"primitives", "Primitives (teaser)",
     "Label maps are exact here and SAM's in the paper, which has no figures for them."},
};

// By fewer cases no order is settled.
constexpr size_t kMinCases = 5;

constexpr const char* kOpening =
    "# Results\n\n"
    "The paper's tables and figures beside ours. This page is written by `holba bench --benchmark "
    "report` from the files in\n"
    "[results](results), which `benchmark/results.sh` makes; other measurements, on photographs, "
    "are in\n"
    "[measurements.md](measurements.md). Cells are means ± standard deviations over the scenes or "
    "seeds, in parentheses\n"
    "the paper's figures; differences are case by case, ± the standard error of their mean. An "
    "order of two rows *holds* where the difference goes\n"
    "the paper's way by more than its standard error, and is *undecided* where it is smaller than "
    "that.\n";

// The paper's figure; empty: none.
std::string PaperFigure(const PaperTable* paper, const SeedTable& table, size_t row,
                        size_t measure) {
  if (paper == nullptr) return "";
  const auto m =
      std::find(paper->measures.begin(), paper->measures.end(), table.measures[measure].name);
  const auto r = std::find_if(paper->rows.begin(), paper->rows.end(),
                              [&](const auto& of) { return of.name == table.rows[row]; });
  if (m == paper->measures.end() || r == paper->rows.end()) return "";
  return fmt::format(" ({:.{}f})", r->values[static_cast<size_t>(m - paper->measures.begin())],
                     table.measures[measure].digits);
}

std::string FindingText(const OrderFinding& finding) {
  return fmt::format("{}, \"{}\" against \"{}\": {}", finding.measure, finding.better_row,
                     finding.worse_row, DifferenceText(finding.difference, finding.digits));
}

std::string ListOf(const std::vector<OrderFinding>& findings, Verdict verdict) {
  std::vector<std::string> texts;
  for (const OrderFinding& finding : findings)
    if (finding.verdict == verdict) texts.push_back(FindingText(finding));
  return fmt::format("{}", fmt::join(texts, "; "));
}

std::string CasesText(const SeedTable& table) {
  return fmt::format("{}: {}", Counted(table.cases.size(), "case"), fmt::join(table.cases, ", "));
}

}  // namespace

std::vector<std::string> BenchmarksOfPage() {
  std::vector<std::string> names;
  for (const PageSection& section : kSections) names.emplace_back(section.benchmark);
  return names;
}

std::map<std::string, std::vector<SeedTable>> ReadResults(const std::filesystem::path& folder) {
  std::map<std::string, std::vector<SeedTable>> results;
  std::vector<std::string> absent;
  for (const std::string& benchmark : BenchmarksOfPage()) {
    const std::filesystem::path path = folder / (benchmark + ".json");
    if (!std::filesystem::is_regular_file(path)) {
      absent.push_back(benchmark);
      continue;
    }
    const nlohmann::json json = nlohmann::json::parse(ReadFileBytes(path), nullptr, false);
    std::vector<SeedTable>& tables = results[benchmark];
    // What has no tables is refused as a table is that is none.
    const nlohmann::json list =
        json.is_object() ? json.value("tables", nlohmann::json()) : nlohmann::json();
    if (!list.is_array() || list.empty()) tables.push_back(SeedTableFromJson({}, path));
    for (const nlohmann::json& table : list) tables.push_back(SeedTableFromJson(table, path));
  }
  if (results.empty()) {
    throw InputError(folder,
                     "expected results of benchmarks, as 'holba bench --benchmark scaling "
                     "--output_path' writes them, found none");
  }
  for (const std::string& benchmark : absent) {
    LogWarning("The page lacks {0}: 'holba bench --benchmark {0} --output_path {1}' makes its file",
               benchmark, folder.string());
  }
  return results;
}

Table BesidePaper(const SeedTable& table) {
  Table beside = TablesOf(table).front();
  const PaperTable* paper = FindPaperTable(table.name);
  for (size_t r = 0; r < table.rows.size(); ++r) {
    for (size_t m = 0; m < table.measures.size(); ++m)
      beside.rows[r][m + 1] += PaperFigure(paper, table, r, m);
  }
  if (paper != nullptr)
    beside.title += fmt::format(" In parentheses the paper's {}.", paper->place);
  return beside;
}

std::string OrderText(const SeedTable& table) {
  const PaperTable* paper = FindPaperTable(table.name);
  if (paper == nullptr) return "";
  const std::vector<OrderFinding> findings = CompareOrder(table, *paper);
  if (findings.empty()) return "";
  const auto count = [&](Verdict verdict) {
    return static_cast<size_t>(
        std::count_if(findings.begin(), findings.end(),
                      [&](const OrderFinding& finding) { return finding.verdict == verdict; }));
  };
  std::string text =
      fmt::format("The paper's order of {} holds in {} of {}.",
                  paper->order == OrderAgainst::kLastRow ? "the last row and the others" : "rows",
                  count(Verdict::kHolds), Counted(findings.size(), "comparison"));
  if (table.cases.size() < kMinCases) {
    text += fmt::format(" {} {} too few to judge by, which needs {}.",
                        Counted(table.cases.size(), "case"), Agree(table.cases.size(), "is", "are"),
                        kMinCases);
  }
  if (count(Verdict::kUndecided) > 0)
    text += " Undecided: " + ListOf(findings, Verdict::kUndecided) + ".";
  if (count(Verdict::kOtherWay) > 0)
    text += " The other way round: " + ListOf(findings, Verdict::kOtherWay) + ".";
  return text;
}

std::string ResultsPage(const std::map<std::string, std::vector<SeedTable>>& results,
                        const std::string& plots) {
  std::string page = kOpening;
  std::vector<std::string> missing;
  for (const std::string& benchmark : BenchmarksOfPage())
    if (!results.contains(benchmark)) missing.push_back(benchmark);
  if (!missing.empty())
    page +=
        fmt::format("\nNot measured yet, and not on this page: {}.\n", fmt::join(missing, ", "));
  for (const PageSection& section : kSections) {
    const auto found = results.find(std::string(section.benchmark));
    if (found == results.end()) continue;
    page += fmt::format("\n## {}\n    holba bench --benchmark {}\n\n{}\n", section.heading,
                        section.benchmark, section.differs);
    for (const SeedTable& table : found->second) {
      page += "\n" + BesidePaper(table).Markdown();
      const std::vector<Table> tables = TablesOf(table);
      for (size_t i = 1; i < tables.size(); ++i) page += "\n" + tables[i].Markdown();
      if (const std::string order = OrderText(table); !order.empty()) page += "\n" + order + "\n";
    }
    page += fmt::format("\n{}.\n\n![{}]({}/{}.svg)\n", CasesText(found->second.front()),
                        section.heading, plots, section.benchmark);
  }
  return page;
}

}  // namespace holba
