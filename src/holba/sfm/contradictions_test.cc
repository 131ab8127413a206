// SPDX-License-Identifier: BSD-3-Clause
#include "holba/sfm/contradictions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "holba/sfm/mapper_testing.h"
#include "holba/sfm/refine_testing.h"
#include "holba/sfm/triangulate_points.h"

namespace holba {
namespace {

using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Eight images, 7 degrees from one to the next, registered at the truth.
class MissingMatchesTest : public ::testing::Test {
 protected:
  Reconstruction truth_ = MakeRefineScene({.noise_px = 0.3, .num_clutter = 0}).house.model;

  // All pairs are compared; `unmatched` ones have no matches.
  MappingProblem Problem(const std::set<std::pair<image_t, image_t>>& unmatched) const {
    MappingProblem problem = MakeMappingProblem(truth_, {.unmatched = unmatched});
    for (image_t a = 1; a <= 8; ++a) {
      for (image_t b = a + 1; b <= 8; ++b) problem.input.compared_pairs.insert({a, b});
    }
    return problem;
  }
  void RegisterAll(MapperState* state) const {
    for (const auto& [id, image] : truth_.images) {
      state->RegisterFrame(state->model().unregistered_images.at(id).frame_id,
                           image.cam_from_world);
    }
    for (const auto& [id, image] : truth_.images)
      TriangulateImage(TriangulationOptions(), id, state);
  }
  // Odd and even images share nothing: as if one half were of another side that looks alike.
  static std::set<std::pair<image_t, image_t>> OddFromEven() {
    std::set<std::pair<image_t, image_t>> pairs;
    for (image_t a = 1; a <= 8; ++a) {
      for (image_t b = a + 1; b <= 8; ++b) {
        if ((a + b) % 2 == 1) pairs.insert({a, b});
      }
    }
    return pairs;
  }
};

TEST_F(MissingMatchesTest, NothingIsMissingWhereAllIsMatched) {
  const MappingProblem problem = Problem({});
  MapperState state(problem.input, problem.scene);
  RegisterAll(&state);
  const MissingMatches missing(state);
  const auto evidence = missing.Between(3, 4);
  EXPECT_GT(evidence.expected, 20.0);
  EXPECT_GT(evidence.seen, 0.7 * evidence.expected);
  EXPECT_EQ(missing.MissingOf(4), 0.0);
  EXPECT_THAT(missing.ContradictedImages(), IsEmpty());
}

TEST_F(MissingMatchesTest, HalvesThatShouldShareAndDoNotAreTakenApart) {
  const MappingProblem problem = Problem(OddFromEven());
  MapperState state(problem.input, problem.scene);
  RegisterAll(&state);
  const MissingMatches missing(state);
  EXPECT_TRUE(missing.Between(3, 4).Contradicts());
  EXPECT_FALSE(missing.Between(3, 5).Contradicts());
  EXPECT_GT(missing.MissingOf(4), 20.0);
  EXPECT_THAT(missing.ContradictedImages(),
              AnyOf(ElementsAre(1, 3, 5, 7), ElementsAre(2, 4, 6, 8)));
}

TEST_F(MissingMatchesTest, PairsThatWereNotComparedSayNothing) {
  MappingProblem problem = Problem(OddFromEven());
  problem.input.compared_pairs.clear();
  MapperState state(problem.input, problem.scene);
  RegisterAll(&state);
  EXPECT_THAT(MissingMatches(state).ContradictedImages(), IsEmpty());
}

}  // namespace
}  // namespace holba
