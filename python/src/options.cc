// SPDX-License-Identifier: BSD-3-Clause
#include "options.h"

#include <fmt/format.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <optional>

#include "holba/base/error.h"
#include "module.h"

namespace holba::python {
namespace {

const Option* Find(const OptionSet& set, const std::string& name) {
  for (const Option& option : set.table.options()) {
    if (option.name == name) return &option;
  }
  return nullptr;
}

// A Python value as the alternative that the option wants; empty: it is of another type.
std::optional<OptionValue> ToValue(const Option& option, nb::handle value) {
  PyObject* p = value.ptr();
  switch (option.type) {
    case OptionType::kBool:
      if (PyBool_Check(p)) return p == Py_True;
      return std::nullopt;  // 0 and 1 are as good
    case OptionType::kInt: {
      int number;
      if (!PyBool_Check(p) && nb::try_cast(value, number)) return number;
      return std::nullopt;
    }
    case OptionType::kUint: {
      uint64_t number;
      if (!PyBool_Check(p) && nb::try_cast(value, number)) return number;
      return std::nullopt;
    }
    case OptionType::kDouble: {
      double number;
      if (!PyBool_Check(p) && nb::try_cast(value, number)) return number;
      return std::nullopt;
    }
    case OptionType::kDoubles: {
      std::vector<double> numbers;
      if (!PyUnicode_Check(p) && nb::try_cast(value, numbers)) return numbers;
      return std::nullopt;
    }
    default:
      return std::nullopt;
  }
}

nb::object ToPython(const OptionValue& value) {
  return std::visit([](const auto& v) { return nb::cast(v); }, value);
}

nb::dict Describe(const Option& option) {
  nb::dict d;
  d["name"] = option.name;
  d["section"] = option.section;
  d["type"] = NameOf(option.type);
  d["choices"] = option.choices;
  d["default"] = ToPython(option.default_value);
  d["range"] = option.range.Text();
  d["low"] = option.range.low;
  d["high"] = option.range.high;
  d["sentence"] = option.sentence;
  d["basic"] = option.level == OptionLevel::kBasic;
  d["required"] = option.required;
  return d;
}

}  // namespace

void BindOptions(nb::module_& m) {
  nb::class_<OptionSet> set(m, "OptionSet", "Options with their values.");
  set.def(
      "describe",
      [](const OptionSet& s) {
        nb::list all;
        for (const Option& option : s.table.options()) all.append(Describe(option));
        return all;
      },
      nb::sig("def describe(self) -> list[dict[str, typing.Any]]"),
      "Name, type, default, range and sentence of each.");
  set.def(
      "set",
      [](const OptionSet& s, const std::string& name, nb::object value) {
        const Option* option = Find(s, name);
        if (option == nullptr) throw InputError("--" + name + ": there is no such option");
        if (const auto typed = ToValue(*option, value)) return option->Set(*typed);
        option->SetText(nb::cast<std::string>(nb::str(value)));
      },
      nb::arg("name"), nb::arg("value").none(),
      "Raises InputError for a value that is not allowed.");
  set.def(
      "get",
      [](const OptionSet& s, const std::string& name) {
        const Option* option = Find(s, name);
        if (option == nullptr) throw InputError("--" + name + ": there is no such option");
        return ToPython(option->Value());
      },
      nb::arg("name"),
      nb::sig("def get(self, name: str) -> bool | int | float | str | list[float]"));
  nb::class_<AdjustOptions, OptionSet>(m, "AdjustOptions", "Of adjustments.").def(nb::init<>());
  nb::class_<SolveOptions, OptionSet>(m, "SolveOptions", "Of the solver.").def(nb::init<>());
}

}  // namespace holba::python
