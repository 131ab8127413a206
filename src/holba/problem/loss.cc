// SPDX-License-Identifier: BSD-3-Clause
#include "holba/problem/loss.h"

#include <cmath>

namespace holba {

void Loss::Evaluate(double s, double rho[3]) const {
  const double a2 = scale * scale;
  switch (type) {
    case LossType::kTrivial:
      break;
    case LossType::kHuber:
      if (s > a2) {
        const double r = std::sqrt(s);
        rho[0] = 2.0 * scale * r - a2;
        rho[1] = scale / r;
        rho[2] = -rho[1] / (2.0 * s);
        return;
      }
      break;
    case LossType::kSoftL1: {
      const double sum = 1.0 + s / a2;
      const double root = std::sqrt(sum);
      rho[0] = 2.0 * s / (root + 1.0);  // 2 scale^2 (root - 1), without its cancellation
      rho[1] = 1.0 / root;
      rho[2] = -rho[1] / (2.0 * a2 * sum);
      return;
    }
    case LossType::kCauchy: {
      const double sum = 1.0 + s / a2;
      rho[0] = a2 * std::log1p(s / a2);
      rho[1] = 1.0 / sum;
      rho[2] = -rho[1] * rho[1] / a2;
      return;
    }
  }
  rho[0] = s;
  rho[1] = 1.0;
  rho[2] = 0.0;
}

std::string_view NameOf(LossType type) {
  switch (type) {
    case LossType::kTrivial:
      return "trivial";
    case LossType::kHuber:
      return "huber";
    case LossType::kSoftL1:
      return "soft_l1";
    case LossType::kCauchy:
      return "cauchy";
  }
  return "";
}

}  // namespace holba
