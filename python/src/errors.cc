// SPDX-License-Identifier: BSD-3-Clause
// Exceptions with our messages, and signals.
#include <filesystem>

#include "calls.h"
#include "holba/base/check.h"
#include "holba/base/error.h"
#include "module.h"

namespace holba::python {

bool SignalCame() {
  nb::gil_scoped_acquire locked;
  return PyErr_CheckSignals() != 0;
}

namespace {

// What is thrown as T is raised as a class of Python.
template <typename T>
void Translate(PyObject* raised) {
  nb::register_exception_translator(
      [](const std::exception_ptr& thrown, void* raised) {
        try {
          std::rethrow_exception(thrown);
        } catch (const T& error) {
          PyErr_SetString(static_cast<PyObject*>(raised), error.what());
        }
      },
      raised);
}

}  // namespace

void BindErrors(nb::module_&) {
  const nb::module_ errors = nb::module_::import_("holba._errors");
  // The classes live as long as the interpreter.
  Translate<std::filesystem::filesystem_error>(PyExc_OSError);
  Translate<InputError>(nb::object(errors.attr("InputError")).release().ptr());
  Translate<CheckError>(nb::object(errors.attr("CheckError")).release().ptr());
}

}  // namespace holba::python
