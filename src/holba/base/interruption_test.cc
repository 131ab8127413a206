// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/interruption.h"

#include <gtest/gtest.h>

#include <atomic>
#include <exception>
#include <type_traits>

#include "holba/base/threads.h"

namespace holba {
namespace {

TEST(Interruption, EndsTheNextShareOfWorkAndNoTaskOfItIsBegun) {
  for (int num_threads : {1, 2}) {
    bool wants_to_end = true;
    const auto ask = [&] { return wants_to_end; };
    std::atomic<int> num_begun = 0;
    {
      const InterruptionScope scope(ask);
      EXPECT_THROW(ParallelTasks(num_threads, 4, [&](size_t) { ++num_begun; }), Interruption);
    }
    EXPECT_EQ(num_begun, 0);
    ParallelTasks(num_threads, 4, [&](size_t) { ++num_begun; });
    EXPECT_EQ(num_begun, 4);
  }
}

TEST(Interruption, TheInnermostScopeOfTheThreadIsAsked) {
  const auto end = [] { return true; };
  const auto go_on = [] { return false; };
  const InterruptionScope outer(end);
  {
    const InterruptionScope inner(go_on);
    EXPECT_NO_THROW(ThrowIfInterrupted());
  }
}

TEST(Interruption, WorkInsideOfTasksIsNotTornApart) {
  int num_asked = 0;
  const auto ask = [&] { return ++num_asked > 1; };
  const InterruptionScope scope(ask);
  std::atomic<int> num_done = 0;
  ParallelTasks(2, 4, [&](size_t) { ParallelTasks(2, 3, [&](size_t) { ++num_done; }); });
  EXPECT_EQ(num_done, 12);
  EXPECT_EQ(num_asked, 1);
}

TEST(Interruption, IsNotTakenForAFaultOfOneItem) {
  EXPECT_FALSE((std::is_base_of_v<std::exception, Interruption>));
}

}  // namespace
}  // namespace holba
