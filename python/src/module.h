// SPDX-License-Identifier: BSD-3-Clause
// The parts of the module holba._core, each in a file of its name.
#pragma once

#include <nanobind/nanobind.h>

namespace holba::python {

namespace nb = nanobind;

void BindErrors(nb::module_& m);
void BindLogging(nb::module_& m);
void BindGeometry(nb::module_& m);
void BindCameras(nb::module_& m);
void BindRecords(nb::module_& m);         // one image, point, line, ... of a model
void BindReconstruction(nb::module_& m);  // whole models, reconstruction.h
void BindOptions(nb::module_& m);
void BindCommands(nb::module_& m);
void BindAdjust(nb::module_& m);
void BindSelection(nb::module_& m);
void BindUncertainty(nb::module_& m);
void BindEvaluation(nb::module_& m);
void BindMapper(nb::module_& m);
void BindProblem(nb::module_& m);

}  // namespace holba::python
