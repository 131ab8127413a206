// SPDX-License-Identifier: BSD-3-Clause
// The reduced system as the native solver has it.
#include <nanobind/stl/tuple.h>

#include <limits>

#include "calls.h"
#include "holba/solver/native/normal_equations.h"
#include "problem.h"

namespace holba::python {
namespace {

struct System {
  std::vector<double> values, rhs;
  std::vector<int64_t> rows, columns;
  std::vector<uint32_t> block;      // of each unknown
  std::vector<int32_t> coordinate;  // of its tangent
};

System ReducedSystemOf(const Problem& problem, int num_threads) {
  native::NormalEquations equations;
  equations.Begin(problem, num_threads);
  equations.SetForm(native::SchurForm::kExplicit);
  native::Linearisation linearisation;
  equations.Linearise(std::numeric_limits<double>::infinity(), &linearisation);
  const BlockMatrix& S = equations.matrix();
  const BlockPattern& pattern = *S.pattern;
  System out;
  for (int a = 0; a < pattern.num_nodes(); ++a) {
    for (size_t k = pattern.row_start[a]; k < pattern.row_start[a + 1]; ++k) {
      const int b = pattern.column[k];
      const size_t padded = PaddedWidth(pattern.widths[a]);
      for (int j = 0; j < pattern.widths[b]; ++j) {
        for (int i = 0; i < pattern.widths[a]; ++i) {
          const double value = S.Block(k)[j * padded + i];
          const auto row = static_cast<int64_t>(pattern.offset[a] + i);
          const auto column = static_cast<int64_t>(pattern.offset[b] + j);
          out.values.push_back(value);
          out.rows.push_back(row);
          out.columns.push_back(column);
          if (a == b) continue;
          out.values.push_back(value);
          out.rows.push_back(column);
          out.columns.push_back(row);
        }
      }
    }
  }
  out.rhs.assign(equations.rhs().begin(), equations.rhs().end());
  out.block.assign(pattern.num_unknowns, 0);
  out.coordinate.assign(pattern.num_unknowns, -1);
  const native::Structure& structure = equations.structure();
  for (BlockId b = 0; b < problem.num_blocks(); ++b) {
    const native::KeptBlock& kept = structure.kept[b];
    if (kept.node == native::kNoNode) continue;
    const native::Columns& columns = structure.block_columns[b];
    for (int i = 0; i < columns.count; ++i) {
      const size_t unknown = pattern.offset[kept.node] + kept.first + i;
      out.block[unknown] = b;
      out.coordinate[unknown] = columns.tangent[i];
    }
  }
  return out;
}

}  // namespace

void BindReducedSystem(nb::class_<PyProblem>* type) {
  type->def(
      "_reduced_system",
      [](const PyProblem& p, int num_threads) {
        System s = Unlocked([&] { return ReducedSystemOf(p.problem(), num_threads); });
        return std::tuple(Owned1(std::move(s.values)), Owned1(std::move(s.rows)),
                          Owned1(std::move(s.columns)), Owned1(std::move(s.rhs)),
                          Owned1(std::move(s.block)), Owned1(std::move(s.coordinate)));
      },
      nb::arg("num_threads") = -1);
}

}  // namespace holba::python
