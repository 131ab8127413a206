// SPDX-License-Identifier: BSD-3-Clause
// Options of Python's functions: a table of them over the structs that they belong to. Python sets
// them by name, so that types, ranges and messages are those of the program.
#pragma once

#include <nanobind/nanobind.h>

#include "holba/base/options.h"
#include "holba/bundle/bundle_options.h"
#include "holba/solver/solver.h"

namespace holba::python {

namespace nb = nanobind;

struct OptionSet {
  OptionSet() = default;
  virtual ~OptionSet() = default;
  OptionSet(const OptionSet&) = delete;  // the table refers to what is described
  OptionSet& operator=(const OptionSet&) = delete;

  OptionTable table;
};

template <typename Settings>
struct OptionsOf : OptionSet {
  OptionsOf() { table.Bind(&values); }

  Settings values;
};

struct AdjustSettings {
  BundleOptions bundle;
  SolverOptions solver;

  void Describe(OptionTable* table) const {
    bundle.Describe(table);
    solver.Describe(table);
  }
};
using AdjustOptions = OptionsOf<AdjustSettings>;
using SolveOptions = OptionsOf<SolverOptions>;

}  // namespace holba::python
