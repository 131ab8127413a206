// SPDX-License-Identifier: BSD-3-Clause
// A least-squares problem as Python has it, its own or that of a model.
#pragma once

#include <nanobind/nanobind.h>

#include "arrays.h"
#include "holba/bundle/bundle_problem.h"

namespace holba::python {

struct PyProblem {
  PyProblem() = default;
  PyProblem(PyProblem&&) = default;
  PyProblem& operator=(PyProblem&&) = default;

  BundleProblem bundle;
  nb::object model;  // that it was built of; none: none

  Problem& problem() { return bundle.problem; }
  const Problem& problem() const { return bundle.problem; }
  // Raises IndexError.
  BlockId CheckBlock(uint32_t block) const;
  ResidualBatch& CheckBatch(size_t batch) const;
};

void BindProblemArrays(nb::class_<PyProblem>* type);  // problem_arrays.cc
void BindReducedSystem(nb::class_<PyProblem>* type);  // reduced_system.cc

}  // namespace holba::python
