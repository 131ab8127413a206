// SPDX-License-Identifier: BSD-3-Clause
// Messages go to a Python callable: holba's __init__ gives it that of the logger "holba".
#include <nanobind/stl/string.h>

#include "holba/base/log_sink.h"
#include "module.h"

namespace holba::python {
namespace {

// Of Python's logging.
int LevelOf(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return 10;
    case LogLevel::kInfo:
      return 20;
    case LogLevel::kWarning:
      return 30;
    default:
      return 40;
  }
}

PyObject* logger = nullptr;  // called with level and text; null: stderr

void ToPython(LogLevel level, std::string_view message) {
  if (Py_IsInitialized() == 0) return;
  nb::gil_scoped_acquire locked;
  // A call may be logging while an exception of the caller is on its way.
  PyObject *type, *value, *trace;
  PyErr_Fetch(&type, &value, &trace);
  PyObject* text =
      PyUnicode_DecodeUTF8(message.data(), static_cast<Py_ssize_t>(message.size()), "replace");
  PyObject* result =
      text != nullptr ? PyObject_CallFunction(logger, "iO", LevelOf(level), text) : nullptr;
  if (result == nullptr && PyErr_ExceptionMatches(PyExc_KeyboardInterrupt)) {
    // Ctrl-C came while the message was written: it is for the call that wrote it.
    PyErr_Clear();
    PyErr_SetInterrupt();
  } else if (result == nullptr) {
    PyErr_WriteUnraisable(logger);
  }
  Py_XDECREF(text);
  Py_XDECREF(result);
  PyErr_Restore(type, value, trace);
}

}  // namespace

void BindLogging(nb::module_& m) {
  m.def(
      "_set_logger",
      [](nb::object callable) {
        SetLogSink({});
        Py_XDECREF(logger);
        logger = nullptr;
        if (callable.is_none()) return;
        logger = callable.release().ptr();
        SetLogSink(ToPython);
      },
      nb::arg("callable").none(),
      "Sends messages to callable(level, text) instead of stderr; None: to stderr again.");
}

}  // namespace holba::python
