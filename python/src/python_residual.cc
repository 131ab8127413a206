// SPDX-License-Identifier: BSD-3-Clause
#include "python_residual.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "arrays.h"

namespace holba::python {
namespace {

[[noreturn]] void WrongShape(const std::string& term, const std::string& what,
                             const std::string& expected) {
  throw nb::value_error(
      fmt::format("{} of the residual '{}': expected an array {}", what, term, expected).c_str());
}

// Any array of numbers in the memory order of C; empty: it is none.
using AnyArray = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

}  // namespace

PythonBatch::PythonBatch(std::string term, int dim, std::vector<const ManifoldOps*> manifolds,
                         std::vector<int> tangents, Functions functions)
    : ResidualBatch(std::move(term), dim, std::move(tangents)),
      manifolds_(std::move(manifolds)),
      functions_(std::move(functions)) {
  for (const ManifoldOps* manifold : manifolds_) {
    first_.push_back(width_);
    first_tangent_.push_back(tangent_width_);
    width_ += manifold->ambient;
    tangent_width_ += manifold->tangent;
  }
}

PythonBatch::~PythonBatch() {
  nb::gil_scoped_acquire locked;
  functions_ = {};
}

void PythonBatch::Gather(size_t i, const ParameterReader& parameters, double* row) const {
  for (int s = 0; s < num_slots(); ++s)
    std::copy_n(parameters.At(s, block(i, s)), manifolds_[s]->ambient, row + first_[s]);
}

bool PythonBatch::Knows(const Answers& answers, size_t at, const double* row) const {
  return at < answers.known.size() && answers.known[at] != 0 &&
         std::memcmp(answers.parameters.data() + at * width_, row, sizeof(double) * width_) == 0;
}

PythonBatch::Columns PythonBatch::ColumnsOf(const std::vector<double>& rows) const {
  const size_t n = rows.size() / width_;
  Columns columns;
  for (int s = 0; s < num_slots(); ++s) {
    const size_t ambient = manifolds_[s]->ambient;
    std::vector<double>& column = columns.emplace_back(n * ambient);
    for (size_t j = 0; j < n; ++j)
      std::copy_n(rows.data() + j * width_ + first_[s], ambient, column.data() + j * ambient);
  }
  return columns;
}

// A copy of its own, as the function may keep it, and not to be written, as it may be asked with it
// again.
nb::object PythonBatch::Argument(int slot, const double* column, size_t n) const {
  const size_t ambient = manifolds_[slot]->ambient;
  return nb::cast(Owned<Array<const double, -1, -1>>(
      std::vector<double>(column, column + n * ambient), {n, ambient}));
}

nb::list PythonBatch::Arguments(const std::vector<double>& rows) const {
  nb::list arguments;
  const Columns columns = ColumnsOf(rows);
  for (int s = 0; s < num_slots(); ++s)
    arguments.append(Argument(s, columns[s].data(), rows.size() / width_));
  return arguments;
}

void PythonBatch::Values(const std::vector<double>& rows, double* values, uint8_t* present) const {
  ValuesOf(Arguments(rows), rows.size() / width_, values, present);
}

void PythonBatch::ValuesOf(const nb::list& arguments, size_t n, double* values,
                           uint8_t* present) const {
  const nb::object answer = functions_.values(*arguments);
  AnyArray array;
  const bool fits = nb::try_cast(answer, array) && array.ndim() == 2 && array.shape(0) == n &&
                    array.shape(1) == static_cast<size_t>(dim());
  if (!fits) WrongShape(term(), "values", fmt::format("({}, {})", n, dim()));
  for (size_t j = 0; j < n; ++j) {
    const double* row = array.data() + j * dim();
    present[j] = std::all_of(row, row + dim(), [](double x) { return std::isfinite(x); });
    for (int k = 0; k < dim(); ++k) values[j * dim() + k] = present[j] ? row[k] : 0.0;
  }
}

void PythonBatch::GivenDerivatives(const std::vector<double>& rows, double* jacobians) const {
  const size_t n = rows.size() / width_;
  const nb::object answer = functions_.derivatives(*Arguments(rows));
  if (!nb::isinstance<nb::sequence>(answer) || nb::len(answer) != static_cast<size_t>(num_slots()))
    throw nb::value_error(
        fmt::format("derivatives of the residual '{}': expected one array for each of {} blocks",
                    term(), num_slots())
            .c_str());
  const size_t stride = static_cast<size_t>(dim()) * tangent_width_;
  for (int s = 0; s < num_slots(); ++s) {
    const size_t ambient = manifolds_[s]->ambient, tangent = manifolds_[s]->tangent;
    AnyArray array;
    const bool fits = nb::try_cast(answer[s], array) && array.ndim() == 3 && array.shape(0) == n &&
                      array.shape(1) == static_cast<size_t>(dim()) &&
                      (array.shape(2) == tangent || array.shape(2) == ambient);
    if (!fits)
      WrongShape(term(), fmt::format("derivatives by block {}", s),
                 fmt::format("({}, {}, {}) or ({}, {}, {})", n, dim(), tangent, n, dim(), ambient));
    const bool is_tangent = array.shape(2) == tangent;
    RowMajor<Eigen::Dynamic, Eigen::Dynamic> plus(ambient, tangent);
    for (size_t j = 0; j < n; ++j) {
      const Eigen::Map<const RowMajor<Eigen::Dynamic, Eigen::Dynamic>> given(
          array.data() + j * dim() * array.shape(2), dim(), static_cast<int>(array.shape(2)));
      Eigen::Map<RowMajor<Eigen::Dynamic, Eigen::Dynamic>> out(
          jacobians + j * stride + static_cast<size_t>(dim()) * first_tangent_[s], dim(), tangent);
      if (is_tangent) {
        out = given;
      } else {
        manifolds_[s]->plus_jacobian(rows.data() + j * width_ + first_[s], plus.data());
        out = given * plus;
      }
    }
  }
}

// For each tangent coordinate the step's unit: the root mean square of the numbers that it moves.
std::vector<double> PythonBatch::Scales(int slot, const std::vector<double>& column) const {
  const ManifoldOps& manifold = *manifolds_[slot];
  const size_t ambient = manifold.ambient, tangent = manifold.tangent, n = column.size() / ambient;
  std::vector<double> sums(tangent, 0.0), plus(ambient * tangent);
  std::vector<size_t> counts(tangent, 0);
  for (size_t j = 0; j < n; ++j) {
    const double* x = column.data() + j * ambient;
    manifold.plus_jacobian(x, plus.data());
    for (size_t a = 0; a < ambient; ++a) {
      for (size_t t = 0; t < tangent; ++t) {
        if (plus[a * tangent + t] == 0.0) continue;
        sums[t] += x[a] * x[a];
        ++counts[t];
      }
    }
  }
  std::vector<double> scales(tangent, 1.0);
  for (size_t t = 0; t < tangent; ++t)
    if (sums[t] > 0.0) scales[t] = std::sqrt(sums[t] / static_cast<double>(counts[t]));
  return scales;
}

// Central differences of the rows from begin to end by the tangent coordinates of one slot; of the
// other slots the function gets the same arrays every time.
void PythonBatch::DifferencesOf(int slot, const double* column,
                                const std::vector<nb::object>& arguments, size_t begin, size_t end,
                                const std::vector<double>& scales, double* jacobians) const {
  const ManifoldOps& manifold = *manifolds_[slot];
  const size_t ambient = manifold.ambient, tangent = manifold.tangent, n = end - begin;
  const size_t entries = dim(), stride = entries * tangent_width_;
  std::vector<double> moved(n * ambient), values[2];
  std::vector<uint8_t> present[2];
  for (int side : {0, 1}) {
    values[side].resize(n * entries);
    present[side].resize(n);
  }
  for (size_t t = 0; t < tangent; ++t) {
    double delta[kMaxTangent] = {};
    for (int side : {0, 1}) {
      delta[t] = side == 0 ? -scales[t] : scales[t];
      for (size_t j = 0; j < n; ++j)
        manifold.plus(column + j * ambient, delta, moved.data() + j * ambient);
      nb::list with_moved;
      for (int s = 0; s < num_slots(); ++s)
        with_moved.append(s == slot ? Argument(s, moved.data(), n) : arguments[s]);
      ValuesOf(with_moved, n, values[side].data(), present[side].data());
    }
    for (size_t j = 0; j < n; ++j) {
      double* out = jacobians + (begin + j) * stride + entries * first_tangent_[slot] + t;
      const bool both = present[0][j] != 0 && present[1][j] != 0;
      for (size_t k = 0; k < entries; ++k) {
        const double change = values[1][j * entries + k] - values[0][j * entries + k];
        out[k * tangent] = both ? change / (2.0 * scales[t]) : 0.0;
      }
    }
  }
}

// The step is that by which truncation and rounding are alike, in units of the numbers that a
// coordinate moves.
void PythonBatch::NumericDerivatives(const std::vector<double>& rows, Slots wanted,
                                     double* jacobians) const {
  // As many rows at a time as a processor's cache holds with what a function makes of them.
  constexpr size_t kRowsAtATime = 4096;
  const size_t n = rows.size() / width_;
  const double relative = functions_.relative_step > 0.0
                              ? functions_.relative_step
                              : std::cbrt(std::numeric_limits<double>::epsilon());
  const Columns columns = ColumnsOf(rows);
  std::vector<std::vector<double>> scales(num_slots());
  for (int s = 0; s < num_slots(); ++s) {
    if (!(wanted >> s & 1)) continue;
    scales[s] = Scales(s, columns[s]);
    for (double& scale : scales[s]) scale *= relative;
  }
  for (size_t begin = 0; begin < n; begin += kRowsAtATime) {
    const size_t end = std::min(begin + kRowsAtATime, n);
    const auto from_begin = [&](int s) {
      return columns[s].data() + begin * manifolds_[s]->ambient;
    };
    std::vector<nb::object> arguments;
    for (int s = 0; s < num_slots(); ++s)
      arguments.push_back(Argument(s, from_begin(s), end - begin));
    for (int s = 0; s < num_slots(); ++s) {
      if (wanted >> s & 1)
        DifferencesOf(s, from_begin(s), arguments, begin, end, scales[s], jacobians);
    }
  }
}

void PythonBatch::Derivatives(const std::vector<double>& rows, Slots wanted,
                              double* jacobians) const {
  if (functions_.derivatives.is_none()) {
    NumericDerivatives(rows, wanted, jacobians);
  } else {
    GivenDerivatives(rows, jacobians);
  }
}

void PythonBatch::LineariseAll(const ParameterReader& parameters, Slots wanted) const {
  const size_t n = size();
  Answers& all = linearised_;
  all.known.assign(n, 0);
  all.parameters.resize(n * width_);
  all.values.resize(n * dim());
  all.present.resize(n);
  all.jacobians.resize(n * dim() * tangent_width_);
  linearised_slots_ |= wanted;
  for (size_t i = 0; i < n; ++i) Gather(i, parameters, all.parameters.data() + i * width_);
  {
    nb::gil_scoped_acquire locked;
    Values(all.parameters, all.values.data(), all.present.data());
    Derivatives(all.parameters, linearised_slots_, all.jacobians.data());
  }
  all.known.assign(n, 1);
}

void PythonBatch::EvaluateRange(const ResidualRange& range, const ParameterReader& parameters,
                                const ResidualPanel& panel) const {
  const std::lock_guard lock(mutex_);
  Slots wanted = 0;
  for (int s = 0; s < num_slots(); ++s) wanted |= panel.jacobians[s] != nullptr ? Slots{1} << s : 0;
  const bool wants_jacobians = wanted != 0;
  std::vector<double> row(width_);
  const size_t jacobian_size = static_cast<size_t>(dim()) * tangent_width_;
  // Of a residual that is asked for alone, by its parameters: not part of a state.
  std::vector<double> own_jacobian;
  const bool is_single = parameters.state() == nullptr;

  // What is not known is asked for, once.
  std::vector<size_t> unknown;
  std::vector<double> unknown_rows;
  for (size_t j = 0; j < range.count; ++j) {
    const size_t i = range[j];
    Gather(i, parameters, row.data());
    if ((wanted & ~linearised_slots_) == 0 && Knows(linearised_, i, row.data())) continue;
    if (!is_single && wants_jacobians) {
      LineariseAll(parameters, wanted);
      break;
    }
    if (!wants_jacobians && Knows(tried_, i, row.data())) continue;
    unknown.push_back(i);
    unknown_rows.insert(unknown_rows.end(), row.begin(), row.end());
  }
  std::vector<double> values(unknown.size() * dim());
  std::vector<uint8_t> present(unknown.size());
  if (!unknown.empty()) {
    nb::gil_scoped_acquire locked;
    Values(unknown_rows, values.data(), present.data());
    if (wants_jacobians) {
      own_jacobian.resize(unknown.size() * jacobian_size);
      Derivatives(unknown_rows, wanted, own_jacobian.data());
    }
  }
  if (!unknown.empty() && !wants_jacobians) {
    tried_.known.resize(size());
    tried_.parameters.resize(size() * width_);
    tried_.values.resize(size() * dim());
    tried_.present.resize(size());
    for (size_t u = 0; u < unknown.size(); ++u) {
      const size_t i = unknown[u];
      tried_.known[i] = 1;
      tried_.present[i] = present[u];
      std::copy_n(unknown_rows.data() + u * width_, width_, tried_.parameters.data() + i * width_);
      std::copy_n(values.data() + u * dim(), dim(), tried_.values.data() + i * dim());
    }
  }
  for (size_t j = 0, u = 0; j < range.count; ++j) {
    const size_t i = range[j];
    const double* r = nullptr;
    const double* J = nullptr;
    if (u < unknown.size() && unknown[u] == i) {
      r = values.data() + u * dim();
      panel.present[j] = present[u] != 0;
      if (wants_jacobians) J = own_jacobian.data() + u * jacobian_size;
      ++u;
    } else {
      Gather(i, parameters, row.data());
      const bool is_linearised = Knows(linearised_, i, row.data());
      const Answers& answers = is_linearised ? linearised_ : tried_;
      r = answers.values.data() + i * dim();
      panel.present[j] = answers.present[i] != 0;
      if (wants_jacobians) J = answers.jacobians.data() + i * jacobian_size;
    }
    for (int k = 0; k < dim(); ++k) panel.residuals[k * panel.stride + j] = r[k];
    for (int s = 0; s < num_slots(); ++s) {
      if (panel.jacobians[s] == nullptr) continue;
      const size_t entries = static_cast<size_t>(dim()) * tangent(s);
      const double* of_slot = J + static_cast<size_t>(dim()) * first_tangent_[s];
      for (size_t k = 0; k < entries; ++k)
        panel.jacobians[s][k * panel.stride + j] = panel.present[j] ? of_slot[k] : 0.0;
    }
  }
}

}  // namespace holba::python
