// SPDX-License-Identifier: BSD-3-Clause
// Robust losses rho(s) of a squared residual norm s (as in Ceres: rho(0) = 0, rho'(0) = 1). The
// cost of a residual is weight * rho(s) / 2: weights multiply the robustified cost.
#pragma once

#include <string_view>

namespace holba {

enum class LossType { kTrivial, kHuber, kSoftL1, kCauchy };

struct Loss {
  LossType type = LossType::kTrivial;
  double scale = 1.0;  // residual norm at which the loss departs from s, in the residual's unit

  // rho[0..2]: rho, rho', rho'' at s >= 0.
  void Evaluate(double s, double rho[3]) const;
  double Cost(double s) const {
    double rho[3];
    Evaluate(s, rho);
    return rho[0];
  }
};

std::string_view NameOf(LossType type);

}  // namespace holba
