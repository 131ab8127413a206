// SPDX-License-Identifier: BSD-3-Clause
// The parts of the class Reconstruction, each in a file of its own.
#pragma once

#include <nanobind/nanobind.h>

#include "holba/scene/reconstruction.h"
#include "module.h"

namespace holba::python {

void BindMaps(nb::module_& m, nb::class_<Reconstruction>* model);  // record_maps.cc
void BindVerbs(nb::class_<Reconstruction>* model);                 // verbs.cc
void BindBulk(nb::class_<Reconstruction>* model);                  // bulk.cc

}  // namespace holba::python
