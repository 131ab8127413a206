// SPDX-License-Identifier: BSD-3-Clause
#include "module.h"

NB_MODULE(_core, m) {
  namespace py = holba::python;
  // Functions of residuals that name their problem keep it until the process ends.
  nanobind::set_leak_warnings(false);
  m.doc() = "The native part of holba; its users import holba.";
  m.attr("__version__") = HOLBA_VERSION;
  py::BindErrors(m);
  py::BindLogging(m);
  py::BindGeometry(m);
  py::BindCameras(m);
  py::BindRecords(m);
  py::BindReconstruction(m);
  py::BindOptions(m);
  py::BindCommands(m);
  py::BindAdjust(m);
  py::BindSelection(m);
  py::BindUncertainty(m);
  py::BindEvaluation(m);
#if HOLBA_WITH_FRONTEND
  py::BindMapper(m);
#endif
  py::BindProblem(m);
}
