// SPDX-License-Identifier: BSD-3-Clause
// A problem's state, residuals and Jacobians as arrays.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>

#include "calls.h"
#include "holba/problem/weigh.h"
#include "problem.h"
#include "records.h"

namespace holba::python {
namespace {

// Panels of a whole batch: entry k of residual j at [k * stride + j]. Arrays show them transposed.
struct Panels {
  size_t size = 0, stride = 0;
  std::vector<double> residuals;
  std::array<std::vector<double>, kMaxSlots> jacobians;
  std::unique_ptr<bool[]> present;

  Panels(const Problem& problem, const ResidualBatch& batch, bool wants_jacobians, bool weighted)
      : size(batch.size()), stride((size + kPanelLanes - 1) / kPanelLanes * kPanelLanes) {
    ResidualPanel panel;
    panel.stride = stride;
    residuals.resize(stride * batch.dim());
    present = std::make_unique<bool[]>(stride);
    panel.residuals = residuals.data();
    panel.present = present.get();
    for (int s = 0; s < batch.num_slots(); ++s) {
      if (!wants_jacobians) continue;
      jacobians[s].resize(stride * batch.dim() * batch.tangent(s));
      panel.jacobians[s] = jacobians[s].data();
    }
    batch.Evaluate(0, size, problem.Reader(), panel);
    if (weighted) WeighPanel(batch, size, panel);
  }
};

nb::object OwnerOf(std::vector<double>* values) {
  return nb::capsule(values, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
}

Array<double, -1, -1> ResidualArray(Panels* panels, int dim) {
  auto* held = new std::vector<double>(std::move(panels->residuals));
  const size_t shape[] = {panels->size, static_cast<size_t>(dim)};
  const int64_t strides[] = {1, static_cast<int64_t>(panels->stride)};
  return Array<double, -1, -1>(held->data(), 2, shape, OwnerOf(held), strides);
}

Array<double, -1, -1, -1> JacobianArray(Panels* panels, int slot, int dim, int tangent) {
  auto* held = new std::vector<double>(std::move(panels->jacobians[slot]));
  const size_t shape[] = {panels->size, static_cast<size_t>(dim), static_cast<size_t>(tangent)};
  const auto stride = static_cast<int64_t>(panels->stride);
  const int64_t strides[] = {1, tangent * stride, stride};
  return Array<double, -1, -1, -1>(held->data(), 3, shape, OwnerOf(held), strides);
}

Array<bool, -1> PresentArray(Panels* panels) {
  bool* held = panels->present.release();
  nb::capsule owner(held, [](void* p) noexcept { delete[] static_cast<bool*>(p); });
  return Array<bool, -1>(held, {panels->size}, owner);
}

// First column of each block among all variable tangent coordinates, -1: none; and their number.
std::pair<std::vector<int64_t>, int64_t> Columns(const Problem& problem) {
  std::vector<int64_t> first(problem.num_blocks(), -1);
  int64_t count = 0;
  for (BlockId b = 0; b < problem.num_blocks(); ++b) {
    const int free = problem.block(b).FreeTangent();
    if (free == 0) continue;
    first[b] = count;
    count += free;
  }
  return {std::move(first), count};
}

struct Triplets {
  std::vector<double> values, residuals;
  std::vector<int64_t> rows, columns;
};

Triplets JacobianOf(const Problem& problem, const std::vector<int64_t>& first) {
  Triplets out;
  for (const auto& batch : problem.batches()) {
    const Panels panels(problem, *batch, /*wants_jacobians=*/true, /*weighted=*/true);
    const int dim = batch->dim();
    for (size_t j = 0; j < panels.size; ++j) {
      for (int k = 0; k < dim; ++k) {
        const auto row = static_cast<int64_t>(out.residuals.size());
        out.residuals.push_back(panels.present[j] ? panels.residuals[k * panels.stride + j] : 0.0);
        if (!panels.present[j]) continue;
        for (int s = 0; s < batch->num_slots(); ++s) {
          const BlockId b = batch->block(j, s);
          if (first[b] < 0) continue;
          const uint32_t free = problem.block(b).FreeMask();
          int64_t column = first[b];
          for (int t = 0; t < batch->tangent(s); ++t) {
            if ((free >> t & 1) == 0) continue;
            out.rows.push_back(row);
            out.columns.push_back(column++);
            out.values.push_back(
                panels.jacobians[s][(k * batch->tangent(s) + t) * panels.stride + j]);
          }
        }
      }
    }
  }
  return out;
}

}  // namespace

void BindProblemArrays(nb::class_<PyProblem>* type) {
  type->def_prop_ro(
      "state",
      [](nb::object self) {
        auto& state = nb::cast<PyProblem&>(self).problem().state();
        return Array<double, -1>(state.data(), {state.size()}, Pin(state.data(), self));
      },
      nb::for_getter(nb::sig("def state(self) -> numpy.typing.NDArray[numpy.float64]")),
      "All numbers of all blocks, one block after the other: a view, no copy. While it lives no "
      "block can be added.");
  type->def(
      "values",
      [](nb::object self, uint32_t block) {
        auto& p = nb::cast<PyProblem&>(self);
        p.CheckBlock(block);
        const size_t size = p.problem().block(block).manifold->ambient;
        return Array<double, -1>(p.problem().values(block), {size},
                                 Pin(p.problem().state().data(), self));
      },
      nb::arg("block"),
      nb::sig("def values(self, block: int) -> numpy.typing.NDArray[numpy.float64]"),
      "The numbers of a block: a view, no copy.");
  type->def_prop_ro(
      "batches",
      [](const PyProblem& p) {
        nb::list out;
        for (const auto& batch : p.problem().batches()) {
          nb::dict d;
          d["term"] = batch->term();
          d["size"] = batch->size();
          d["dim"] = batch->dim();
          nb::list tangents;
          for (int s = 0; s < batch->num_slots(); ++s) tangents.append(batch->tangent(s));
          d["tangents"] = tangents;
          d["loss"] = std::string(NameOf(batch->loss.type));
          d["loss_scale"] = batch->loss.scale;
          d["weight"] = batch->weight;
          d["angular"] = batch->angular;
          out.append(d);
        }
        return out;
      },
      nb::for_getter(nb::sig("def batches(self) -> list[dict[str, typing.Any]]")),
      "Term, size, dimension, tangent sizes of the blocks, loss and weight of each batch; their "
      "order is that of rows "
      "of jacobian().");
  type->def(
      "blocks_of",
      [](const PyProblem& p, size_t i) {
        const ResidualBatch& batch = p.CheckBatch(i);
        std::vector<uint32_t> blocks(batch.blocks().begin(), batch.blocks().end());
        return Owned<Array<uint32_t, -1, -1>>(
            std::move(blocks), {batch.size(), static_cast<size_t>(batch.num_slots())});
      },
      nb::arg("batch"), "(n, k) the blocks of each residual of a batch; a copy.");
  type->def(
      "residuals",
      [](const PyProblem& p, size_t i, bool weighted) {
        const ResidualBatch& batch = p.CheckBatch(i);
        Panels panels = Unlocked([&] { return Panels(p.problem(), batch, false, weighted); });
        auto residuals = ResidualArray(&panels, batch.dim());
        return std::tuple(residuals, PresentArray(&panels));
      },
      nb::arg("batch"), nb::kw_only(), nb::arg("weighted") = false,
      "Residuals (n, dim) of a batch at the state, and which of them are defined (n,); the others "
      "are 0. weighted: "
      "times sqrt(weight * rho').");
  type->def(
      "jacobians",
      [](const PyProblem& p, size_t i, bool weighted) {
        const ResidualBatch& batch = p.CheckBatch(i);
        Panels panels = Unlocked([&] { return Panels(p.problem(), batch, true, weighted); });
        std::vector<Array<double, -1, -1, -1>> out;
        for (int s = 0; s < batch.num_slots(); ++s)
          out.push_back(JacobianArray(&panels, s, batch.dim(), batch.tangent(s)));
        return out;
      },
      nb::arg("batch"), nb::kw_only(), nb::arg("weighted") = false,
      "Derivatives (n, dim, t) of a batch by the tangent of each of its blocks, held coordinates "
      "included.");
  type->def("_columns", [](const PyProblem& p) {
    auto [first, count] = Columns(p.problem());
    return std::tuple(Owned1(std::move(first)), count);
  });
  type->def("_jacobian", [](const PyProblem& p) {
    const auto [first, count] = Columns(p.problem());
    Triplets t = Unlocked([&] { return JacobianOf(p.problem(), first); });
    return std::tuple(Owned1(std::move(t.values)), Owned1(std::move(t.rows)),
                      Owned1(std::move(t.columns)), Owned1(std::move(t.residuals)), count);
  });
}

}  // namespace holba::python
