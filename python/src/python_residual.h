// SPDX-License-Identifier: BSD-3-Clause
// Residuals whose values, and derivatives if it has them, are functions in Python of whole arrays.
#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "holba/problem/problem.h"

namespace holba::python {

namespace nb = nanobind;

// The solver asks for residuals in chunks, several of them at a time and again at the same state.
// Python answers for many at once or is slow: derivatives are asked for the whole batch, values for
// the rows of a chunk that are not known yet. What was answered is kept with the parameters that it
// was answered for, and is the answer wherever these are the same: results do not depend on
// threads.
class PythonBatch final : public ResidualBatch {
 public:
  struct Functions {
    nb::object values;         // (slots, each (n, ambient)) -> (n, dim); NaN in a row: absent
    nb::object derivatives;    // -> one (n, dim, tangent or ambient) for each slot; none: numeric
    double relative_step = 0;  // of numeric derivatives; 0: by the accuracy of doubles
  };

  PythonBatch(std::string term, int dim, std::vector<const ManifoldOps*> manifolds,
              std::vector<int> tangents, Functions functions);
  ~PythonBatch() override;  // with or without the interpreter's lock

  void Add(std::span<const BlockId> blocks) { AddBlocks(blocks); }

  // To be called without the interpreter's lock.
  void EvaluateRange(const ResidualRange& range, const ParameterReader& parameters,
                     const ResidualPanel& panel) const override;

 private:
  // Of `rows` residuals; parameters row by row, slot after slot.
  struct Answers {
    std::vector<double> parameters, values;  // rows x width, rows x dim
    std::vector<uint8_t> known, present;
    std::vector<double> jacobians;  // rows x dim x (tangents of all slots); empty: not asked
  };
  // Numbers of each slot, one array each, of the rows of a list.
  using Columns = std::vector<std::vector<double>>;
  using Slots = uint32_t;  // a bit for each slot whose derivatives are wanted

  void Gather(size_t i, const ParameterReader& parameters, double* row) const;
  bool Knows(const Answers& answers, size_t at, const double* row) const;
  // With the lock; for the rows of a list.
  void Values(const std::vector<double>& rows, double* values, uint8_t* present) const;
  void ValuesOf(const nb::list& arguments, size_t n, double* values, uint8_t* present) const;
  void Derivatives(const std::vector<double>& rows, Slots wanted, double* jacobians) const;
  void GivenDerivatives(const std::vector<double>& rows, double* jacobians) const;
  void NumericDerivatives(const std::vector<double>& rows, Slots wanted, double* jacobians) const;
  void DifferencesOf(int slot, const double* column, const std::vector<nb::object>& arguments,
                     size_t begin, size_t end, const std::vector<double>& scales,
                     double* jacobians) const;
  std::vector<double> Scales(int slot, const std::vector<double>& column) const;
  nb::object Argument(int slot, const double* column, size_t n) const;
  Columns ColumnsOf(const std::vector<double>& rows) const;
  nb::list Arguments(const std::vector<double>& rows) const;
  // Answers for the whole batch, with derivatives by these slots and those that were wanted before.
  void LineariseAll(const ParameterReader& parameters, Slots wanted) const;

  std::vector<const ManifoldOps*> manifolds_;
  std::vector<int> first_;          // of each slot in a row of parameters
  std::vector<int> first_tangent_;  // in a row of Jacobians
  int width_ = 0, tangent_width_ = 0;
  Functions functions_;
  mutable std::mutex mutex_;
  mutable Answers linearised_, tried_;
  mutable Slots linearised_slots_ = 0;
};

}  // namespace holba::python
