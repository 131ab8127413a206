// SPDX-License-Identifier: BSD-3-Clause
#include "holba/estimation/two_view/real_roots.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "holba/base/random.h"

namespace holba {
namespace {

std::vector<double> Roots(const std::vector<double>& coefficients) {
  std::vector<double> roots(kMaxPolynomialDegree);
  roots.resize(RealRoots(coefficients, roots.data()));
  return roots;
}

std::vector<double> Times(const std::vector<double>& p, const std::vector<double>& q) {
  std::vector<double> product(p.size() + q.size() - 1, 0.0);
  for (size_t i = 0; i < p.size(); ++i) {
    for (size_t j = 0; j < q.size(); ++j) product[i + j] += p[i] * q[j];
  }
  return product;
}

TEST(RealRoots, RootsOfProductsOfLinearAndIrreducibleFactorsAreFound) {
  Random random(3);
  for (int trial = 0; trial < 500; ++trial) {
    const int num_real = static_cast<int>(random.Index(6));
    const int num_pairs = static_cast<int>(random.Index(3));
    std::vector<double> expected, p = {random.Uniform(0.1, 3.0)};
    for (int k = 0; k < num_real; ++k) {
      double root = 0.0;
      do {
        root = random.Uniform(-4, 4);
      } while (std::any_of(expected.begin(), expected.end(),
                           [&](double r) { return std::abs(r - root) < 0.05; }));
      expected.push_back(root);
      p = Times(p, {-root, 1.0});
    }
    for (int k = 0; k < num_pairs; ++k) {
      const double a = random.Uniform(-2, 2), b = random.Uniform(0.3, 2);
      p = Times(p, {a * a + b * b, -2 * a, 1.0});
    }
    std::sort(expected.begin(), expected.end());
    const std::vector<double> found = Roots(p);
    ASSERT_EQ(found.size(), expected.size()) << trial;
    for (size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-8);
  }
}

TEST(RealRoots, AMultipleRootIsGivenOnce) {
  const std::vector<double> twice = Roots(Times({-1.0, 1.0}, Times({-1.0, 1.0}, {2.0, 1.0})));
  ASSERT_EQ(twice.size(), 2u);
  EXPECT_NEAR(twice[0], -2.0, 1e-9);
  EXPECT_NEAR(twice[1], 1.0, 1e-6);
}

TEST(RealRoots, ConstantsAndZeroHaveNone) {
  EXPECT_TRUE(Roots({}).empty());
  EXPECT_TRUE(Roots({0.0, 0.0, 0.0}).empty());
  EXPECT_TRUE(Roots({2.0}).empty());
  EXPECT_TRUE(Roots({1.0, 0.0, 1.0}).empty());
  EXPECT_TRUE(Roots({1.0, NAN}).empty());
}

TEST(RealRoots, LeadingZerosLowerTheDegree) {
  const std::vector<double> roots = Roots({-6.0, 3.0, 0.0, 0.0});
  ASSERT_EQ(roots.size(), 1u);
  EXPECT_NEAR(roots[0], 2.0, 1e-12);
}

}  // namespace
}  // namespace holba
