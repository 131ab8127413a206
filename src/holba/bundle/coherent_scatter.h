// SPDX-License-Identifier: BSD-3-Clause
// Scatter about a group that members side by side have in common. Walls have bays and skirtings,
// and what was taken for one plane may be two: their points lie off the group together, so that a
// hundred of them say no more about it than one. Where errors are independent, the mean of n of
// them has a variance of 1/n; how much more it has is what the members' weight is too large by (the
// variance over blocks of growing size, as Allan's for clocks and the block variance of correlated
// series).
#pragma once

#include <Eigen/Core>
#include <vector>

namespace holba {

struct MemberOffset {
  Eigen::Vector3d X;       // where the member is, model units
  Eigen::Vector3d offset;  // from the group, in standard deviations of the member
};

// The greatest variance, over blocks of neighbours of 4 members and more, of the sum of a block's
// offsets divided by the number of its members: about 1 where members are independent. What chance
// explains (95 %, after the `unknowns` of the group were fitted to the members) is taken off: at
// most 1 where nothing is in common. 0: too few members to tell. Permutes `members`.
double CoherentVariance(int unknowns, std::vector<MemberOffset>* members);

}  // namespace holba
