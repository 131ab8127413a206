// SPDX-License-Identifier: BSD-3-Clause
// Adjustments of a model and what they tell.
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "apps/command.h"
#include "apps/report.h"
#include "arrays.h"
#include "holba/base/error.h"
#include "holba/base/log.h"
#include "holba/bundle/adjust_bundle.h"
#include "holba/bundle/adjust_local.h"
#include "holba/bundle/bundle_problem.h"
#include "holba/bundle/plausibility.h"
#include "module.h"
#include "options.h"
#include "summaries.h"

namespace holba::python {

bool IterationCallback::operator()(const IterationRecord& record) {
  if (logs_) {
    if (record.iteration == 0) LogInfo("{}", IterationHeader(record));
    LogInfo("{}", IterationLine(record));
  }
  nb::gil_scoped_acquire locked;
  try {
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
    if (callable_.is_none()) return true;
    const nb::object answer = callable_(nb::cast(record));
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
    return !answer.is(nb::handle(Py_False));
  } catch (nb::python_error& error) {
    error_.emplace(std::move(error));
    return false;
  }
}

void IterationCallback::Finish() {
  if (!error_) return;
  nb::python_error error = std::move(*error_);
  error_.reset();
  error.restore();
  throw nb::python_error();
}

namespace {

std::map<std::string, TermCost> ByName(const std::vector<TermCost>& terms) {
  std::map<std::string, TermCost> by_name;
  for (const TermCost& term : terms) by_name.emplace(term.term, term);
  return by_name;
}

std::map<std::string, double> SecondsOf(const SolverSummary& s) {
  std::map<std::string, double> seconds = {{"build", s.build_seconds},
                                           {"linearise", s.linearise_seconds},
                                           {"eliminate", s.eliminate_seconds},
                                           {"total", s.total_seconds}};
  // Negative: the backend does not tell.
  if (s.factorise_seconds >= 0.0) seconds["factorise"] = s.factorise_seconds;
  if (s.back_substitute_seconds >= 0.0) seconds["back_substitute"] = s.back_substitute_seconds;
  return seconds;
}

void BindTerms(nb::module_& m) {
  nb::class_<TermCost> term(m, "TermCost", "Cost of one kind of residuals at one state.");
  term.def_ro("term", &TermCost::term);
  term.def_ro("angular", &TermCost::angular,
              "Residuals without unit (sines of angles) instead of px.");
  term.def_ro("residuals", &TermCost::residuals, "How many, including the absent ones.");
  term.def_ro("absent", &TermCost::absent,
              "Undefined at this state (behind the camera); they add nothing.");
  term.def_ro("sum_squares", &TermCost::sum_squares,
              "Of the residual norms, before weight and loss.");
  term.def_ro("cost", &TermCost::cost, "Half of the weighted, robustified sum.");
  term.def("__repr__", [](const TermCost& t) {
    return fmt::format(
        "TermCost(term='{}', residuals={}, absent={}, sum_squares={:.6g}, cost={:.6g})", t.term,
        t.residuals, t.absent, t.sum_squares, t.cost);
  });
  nb::class_<IterationRecord> record(m, "IterationRecord",
                                     "One iteration of a solver, for callbacks.");
  record.def_ro("iteration", &IterationRecord::iteration, "0: the start.");
  record.def_ro("accepted", &IterationRecord::accepted);
  record.def_ro("cost", &IterationRecord::cost);
  record.def_prop_ro("terms", [](const IterationRecord& r) { return ByName(r.terms); });
  record.def_ro("cost_change", &IterationRecord::cost_change);
  record.def_ro("gradient_max_norm", &IterationRecord::gradient_max_norm);
  record.def_ro("step_norm", &IterationRecord::step_norm);
  record.def_ro("trust_radius", &IterationRecord::trust_radius);
  record.def_ro("seconds", &IterationRecord::seconds);
}

template <typename Summary, typename Of>
void BindSolver(nb::class_<Summary>* type, Of of) {
  type->def_prop_ro("backend", [of](const Summary& s) { return of(s).backend; });
  type->def_prop_ro("linear_solver", [of](const Summary& s) { return of(s).linear_solver; });
  type->def_prop_ro("num_threads", [of](const Summary& s) { return of(s).num_threads; });
  type->def_prop_ro(
      "stop_reason", [of](const Summary& s) { return NameOf(of(s).stop_reason); },
      "A word: converged, max_iterations, stopped_by_caller, ...");
  type->def_prop_ro("message", [of](const Summary& s) { return of(s).message; });
  type->def_prop_ro(
      "iterations", [of](const Summary& s) { return of(s).iterations; }, "Steps tried.");
  type->def_prop_ro("accepted_steps", [of](const Summary& s) { return of(s).accepted_steps; });
  type->def_prop_ro(
      "initial_cost", [of](const Summary& s) { return of(s).initial_cost; },
      "Half of the weighted, robustified sum of squares.");
  type->def_prop_ro("final_cost", [of](const Summary& s) { return of(s).final_cost; });
  type->def_prop_ro("initial_terms",
                    [of](const Summary& s) { return ByName(of(s).initial_terms); });
  type->def_prop_ro("final_terms", [of](const Summary& s) { return ByName(of(s).final_terms); });
  type->def_prop_ro(
      "seconds", [of](const Summary& s) { return SecondsOf(of(s)); }, "By kind of work.");
  type->def_prop_ro("iteration_seconds",
                    [of](const Summary& s) { return Owned1(of(s).iteration_seconds); });
  type->def_prop_ro(
      "reduced_system_size", [of](const Summary& s) { return of(s).reduced_system.size; },
      "Scalar unknowns after the features were eliminated.");
  type->def_prop_ro("reduced_system_density",
                    [of](const Summary& s) { return of(s).reduced_system.density; });
}

void BindSummaries(nb::module_& m) {
  nb::class_<SolverSummary> solver(m, "SolverSummary", "What one solve did.");
  BindSolver(&solver, [](const SolverSummary& s) -> const SolverSummary& { return s; });
  solver.def("__repr__", [](const SolverSummary& s) {
    return fmt::format("SolverSummary({}, {} iterations, cost {:.6g} -> {:.6g})",
                       NameOf(s.stop_reason), s.iterations, s.initial_cost, s.final_cost);
  });
  nb::class_<BundleSummary> bundle(
      m, "AdjustSummary", "What an adjustment did; times and iterations are sums over its rounds.");
  BindSolver(&bundle, [](const BundleSummary& s) -> const SolverSummary& { return s.solver; });
  bundle.def_ro("rounds", &BundleSummary::rounds, "Of solving.");
  bundle.def_ro("auto_scales", &BundleSummary::auto_scales,
                "Scale of each loss that was measured, by term; px or sine.");
  bundle.def_ro("auto_sigmas", &BundleSummary::auto_sigmas,
                "Robust standard deviation of those terms' residuals.");
  bundle.def_prop_ro(
      "associations",
      [](const BundleSummary& s) {
        std::map<std::string, std::tuple<size_t, size_t>> out;
        for (const auto& [kind, count] : s.associations) out[kind] = {count.tested, count.rejected};
        return out;
      },
      "Tested and rejected members and incidences, by kind.");
  bundle.def_ro("groups_dropped", &BundleSummary::groups_dropped);
  bundle.def_prop_ro(
      "camera_weights", [](const BundleSummary& s) { return s.weight_choice.weights.Text(); },
      "What moved the cameras.");
  bundle.def_ro("points_seen_once", &BundleSummary::points_seen_once);
  bundle.def_ro("lines_seen_once", &BundleSummary::lines_seen_once);
  bundle.def_ro("num_parts", &BundleSummary::num_parts);
  bundle.def_prop_ro(
      "held_intrinsics",
      [](const BundleSummary& s) {
        std::vector<camera_t> ids;
        for (const HeldIntrinsics& held : s.held_intrinsics) ids.push_back(held.camera_id);
        return ids;
      },
      "Cameras whose intrinsics were held, as too few observations say something about them.");
  bundle.def(
      "to_json", [](const BundleSummary& s) { return JsonText(SummaryToJson(s)); },
      "As `holba adjust --json` prints it.");
  bundle.def("__str__", [](const BundleSummary& s) { return SummaryToText(s); });
  bundle.def("__repr__", [](const BundleSummary& s) {
    return fmt::format("AdjustSummary({}, {} iterations in {} rounds, cost {:.6g} -> {:.6g})",
                       NameOf(s.solver.stop_reason), s.solver.iterations, s.rounds,
                       s.solver.initial_cost, s.solver.final_cost);
  });
}

using Measurement = std::tuple<image_t, group3D_t, Vec<3>, double>;

std::vector<GroupMeasurement> ToMeasurements(const std::vector<Measurement>& given,
                                             const Reconstruction& model) {
  std::vector<GroupMeasurement> out;
  for (const auto& [image_id, group_id, direction, sigma_deg] : given) {
    if (!model.images.contains(image_id) || !model.groups3D.contains(group_id))
      throw InputError(fmt::format(
          "measurements: expected ids of an image with a pose and of a group, found {} and {}",
          image_id, group_id));
    if (!(direction.value.norm() > 0.0) || !(sigma_deg > 0.0))
      throw InputError(
          "measurements: expected a direction that is not 0 and a standard deviation above 0");
    out.push_back({image_id, group_id, direction.value.normalized(), sigma_deg});
  }
  return out;
}

BundleSummary Adjust(Reconstruction& model, const AdjustOptions& options,
                     const BundleSelection* selection, const std::vector<Measurement>& measurements,
                     nb::object on_iteration) {
  const std::string who = "the model";
  BundleOptions bundle = options.values.bundle;
  SolverOptions solver = options.values.solver;
  const std::vector<GroupMeasurement> directions = ToMeasurements(measurements, model);
  IterationCallback callback(std::move(on_iteration), /*logs=*/true);
  bundle.SetDefaultLosses(false);
  solver.analyse_reduced_system = true;
  solver.on_iteration = [&](const IterationRecord& record) { return callback(record); };
  const RoundLog log = [](const std::string& text) { LogInfo("{}", text); };
  BundleSummary summary = Unlocked([&] {
    RefuseWithoutResiduals(who, model);
    WarnOfDoubts("Before the adjustment", model);
    return selection != nullptr ? AdjustBundle(bundle, solver, *selection, &model, directions, log)
                                : AdjustBundle(bundle, solver, &model, directions, log);
  });
  callback.Finish();
  Unlocked([&] {
    if (NothingWasAdjusted(summary)) throw InputError(who, WhyNothingIsLeft(model));
    WarnOfWhatWasHeld(summary);
    WarnOfDoubts("After the adjustment", model);
  });
  return summary;
}

SolverSummary Local(Reconstruction& model, const BundleSelection& selection,
                    const AdjustOptions& options, SolverWorkspace* workspace,
                    nb::object on_iteration) {
  SolverOptions solver = options.values.solver;
  IterationCallback callback(std::move(on_iteration), /*logs=*/false);
  solver.on_iteration = [&](const IterationRecord& record) { return callback(record); };
  LocalSummary summary = Unlocked(
      [&] { return AdjustLocal(options.values.bundle, solver, selection, workspace, &model); });
  callback.Finish();
  return summary.solver;
}

}  // namespace

void BindAdjust(nb::module_& m) {
  nb::class_<BundleSelection>(m, "BundleSelection");  // selection.cc adds to it
  nb::class_<SolverWorkspace>(
      m, "SolverWorkspace",
      "Memory and analysis that one solve leaves for the next of the same structure. "
      "Results are the same with and without; one thread may use it at a time.")
      .def(nb::init<>());
  BindTerms(m);
  BindSummaries(m);
  m.def(
      "_adjust", Adjust, nb::arg("model"), nb::arg("options"), nb::arg("selection").none(),
      nb::arg("measurements"), nb::arg("on_iteration").none(),
      nb::sig(
          "def _adjust(model: Reconstruction, options: AdjustOptions, selection: BundleSelection | "
          "None, "
          "measurements: collections.abc.Sequence[tuple[int, int, holba._types.ArrayLike, float]], "
          "on_iteration: collections.abc.Callable[[IterationRecord], bool | None] | None) -> "
          "AdjustSummary"));
  m.def("_adjust_local", Local, nb::arg("model"), nb::arg("selection"), nb::arg("options"),
        nb::arg("workspace").none(), nb::arg("on_iteration").none(),
        nb::sig("def _adjust_local(model: Reconstruction, selection: BundleSelection, options: "
                "AdjustOptions, "
                "workspace: SolverWorkspace | None, "
                "on_iteration: collections.abc.Callable[[IterationRecord], bool | None] | None) -> "
                "SolverSummary"));
  m.def(
      "update_errors", [](Reconstruction& model) { Unlocked([&] { UpdateErrors(&model); }); },
      nb::arg("model"), "Sets the mean reprojection errors of all points and lines, px.");
}

}  // namespace holba::python
