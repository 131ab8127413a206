// SPDX-License-Identifier: BSD-3-Clause
// Our table of what pairs of images have several times (scene/pair_repetition.h). It came after the
// other tables: it is made when something is first put into it, and may be missing beside them.
//   holba_pair_repetition.ratios  f32 for each inlier
#include <utility>

#include "holba/base/check.h"
#include "holba/io/database_statement.h"

namespace holba {
namespace {

constexpr const char* kTable = "holba_pair_repetition";
constexpr const char* kCreate = R"sql(
CREATE TABLE IF NOT EXISTS holba_pair_repetition (image_id1 INTEGER NOT NULL,
  image_id2 INTEGER NOT NULL, settings TEXT NOT NULL, near1 INTEGER NOT NULL,
  near2 INTEGER NOT NULL, repeated1 INTEGER NOT NULL, repeated2 INTEGER NOT NULL,
  sampled INTEGER NOT NULL, agreeing INTEGER NOT NULL, undecided INTEGER NOT NULL,
  band1_px REAL, band2_px REAL, rows INTEGER NOT NULL, ratios BLOB NOT NULL,
  PRIMARY KEY(image_id1, image_id2), CHECK(image_id1 < image_id2),
  FOREIGN KEY(image_id1) REFERENCES images(image_id) ON DELETE CASCADE,
  FOREIGN KEY(image_id2) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE INDEX IF NOT EXISTS holba_pair_repetition_image2 ON holba_pair_repetition(image_id2);
)sql";

// Counts and bands of the second image first. The sampled keypoints stay those of the image with
// the smaller id.
void SwapImages(PairRepetition* repetition) {
  std::swap(repetition->num_near[0], repetition->num_near[1]);
  std::swap(repetition->num_repeated[0], repetition->num_repeated[1]);
  if (repetition->band_px) std::swap((*repetition->band_px)[0], (*repetition->band_px)[1]);
}

}  // namespace

std::optional<PairRepetition> Database::ReadPairRepetition(image_t image_id1, image_t image_id2,
                                                           const std::string& settings) const {
  HOLBA_CHECK(image_id1 != image_id2);
  if (!HasTable(kTable)) return std::nullopt;
  Statement row(*this, fmt::format("SELECT near1, near2, repeated1, repeated2, sampled, agreeing, "
                                   "undecided, band1_px, band2_px, rows, ratios FROM {} WHERE {} "
                                   "AND settings = ?",
                                   kTable, OurPairKey(image_id1, image_id2)));
  if (!row.Text(settings).Step()) return std::nullopt;
  const auto fail = [&](const std::string& message) {
    FailRow(kTable, OurPairKey(image_id1, image_id2), message);
  };
  const auto count = [&](int column) {
    const int64_t value = row.GetInteger(column);
    if (value < 0 || value > UINT32_MAX) fail(fmt::format("expected a count, found {}", value));
    return static_cast<uint32_t>(value);
  };
  PairRepetition result;
  result.num_near = {count(0), count(1)};
  result.num_repeated = {count(2), count(3)};
  result.num_sampled = count(4);
  result.num_agreeing = count(5);
  result.num_undecided = count(6);
  if (result.num_undecided > result.num_agreeing || result.num_agreeing > result.num_sampled) {
    fail(fmt::format("of {} points {} agree and {} are undecided, which cannot be",
                     result.num_sampled, result.num_agreeing, result.num_undecided));
  }
  if (!row.IsNull(7) && !row.IsNull(8)) {
    result.band_px = {{row.GetDouble(7), row.GetDouble(8)}};
    for (const double band : *result.band_px) {
      if (!(std::isfinite(band) && band >= 0.0)) fail("a band is not a finite width");
    }
  }
  auto ratios = row.GetArray<float>(10, row.GetInteger(9), 1);
  if (!ratios || !AllFinite(*ratios)) {
    fail(fmt::format("expected {} finite ratios, found {} bytes", row.GetInteger(9),
                     row.GetBytes(10).size()));
  }
  result.ratios = std::move(*ratios);
  if (image_id1 > image_id2) SwapImages(&result);
  return result;
}

std::optional<std::string> Database::ReadPairRepetitionSettings(image_t image_id1,
                                                                image_t image_id2) const {
  if (!HasTable(kTable)) return std::nullopt;
  return StoredSettings(kTable, OurPairKey(image_id1, image_id2));
}

void Database::WritePairRepetition(image_t image_id1, image_t image_id2,
                                   const std::string& settings, const PairRepetition& repetition) {
  HOLBA_CHECK(image_id1 != image_id2 && AllFinite(repetition.ratios));
  PairRepetition ordered = repetition;
  if (image_id1 > image_id2) {
    std::swap(image_id1, image_id2);
    SwapImages(&ordered);
  }
  Transaction transaction(this);
  CreateOurTables();
  Execute(kCreate);
  Statement insert(
      *this,
      "INSERT OR REPLACE INTO holba_pair_repetition(image_id1, image_id2, settings, "
      "near1, near2, repeated1, repeated2, sampled, agreeing, undecided, rows, ratios, "
      "band1_px, band2_px) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  insert.Integer(image_id1).Integer(image_id2).Text(settings);
  insert.Integer(ordered.num_near[0]).Integer(ordered.num_near[1]);
  insert.Integer(ordered.num_repeated[0]).Integer(ordered.num_repeated[1]);
  insert.Integer(ordered.num_sampled)
      .Integer(ordered.num_agreeing)
      .Integer(ordered.num_undecided)
      .Integer(static_cast<int64_t>(ordered.ratios.size()))
      .Bytes(ordered.ratios);
  for (int k = 0; k < 2; ++k) {
    ordered.band_px ? insert.Double((*ordered.band_px)[static_cast<size_t>(k)]) : insert.Null();
  }
  insert.Run();
  transaction.Commit();
}

}  // namespace holba
