// SPDX-License-Identifier: BSD-3-Clause
// What a sighting of a squared error adds to the agreement with a pose: the mean over thresholds R
// of (1 - e^2/R^2)^2 where |e| < R, the logarithms of R^2 spread evenly over a range. So no
// threshold tells wrong from right, and one that is exact to a pixel counts more than one that is
// near.
#pragma once

#include <algorithm>
#include <cmath>

namespace holba {

class Gain {
 public:
  // Thresholds from `smallest` to `largest`, both positive.
  Gain(double smallest, double largest)
      : low_{smallest * smallest},
        high_{largest * largest},
        scale_{1.0 / std::log(high_ / low_)},
        constant_{std::log(high_) - 1.5} {}

  double low() const { return low_; }    // squared, as all here
  double high() const { return high_; }  // from here on nothing is gained

  // In [0, 1].
  double Of(double e2) const {
    if (!(e2 < high_)) return 0.0;
    return OfMany(1, std::log(std::max(e2, low_)), Rest(e2));
  }
  // Of `count` errors below high(): from the sum of log(max(e2, low())) and that of Rest(e2). One
  // logarithm of a product serves several.
  double OfMany(double count, double sum_of_logarithms, double sum_of_rests) const {
    return scale_ * (count * constant_ - sum_of_logarithms + sum_of_rests);
  }
  double Rest(double e2) const {
    const double a = e2 / high_, b = std::min(e2 / low_, 1.0);
    // The second part is 0 from low() on.
    return a * (2.0 - 0.5 * a) + (1.5 - b * (2.0 - 0.5 * b));
  }

  // Of a squared error in least squares that climb the gain, in units of that of an error of 0.
  double Weight(double e2) const {
    if (!(e2 < high_)) return 0.0;
    return Slope(e2) / Slope(0.0);
  }

  // -d/d(e2) of the gain at 0.
  double SlopeAtZero() const { return scale_ * Slope(0.0); }

 private:
  // -d/d(e2) of the gain, up to its scale.
  double Slope(double e2) const {
    if (e2 < low_) return 2.0 / low_ - 2.0 / high_ - e2 / (low_ * low_) + e2 / (high_ * high_);
    const double left = 1.0 - e2 / high_;
    return left * left / e2;
  }

  double low_, high_, scale_, constant_;
};

}  // namespace holba
