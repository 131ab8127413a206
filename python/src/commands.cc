// SPDX-License-Identifier: BSD-3-Clause
// The commands of the program as functions: their options and their Run are the program's.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>

#include "apps/command.h"
#include "calls.h"
#include "holba/base/error.h"
#include "module.h"
#include "options.h"

namespace holba::python {
namespace {

struct CommandRun : OptionSet {
  explicit CommandRun(const std::string& name) : command(FindCommand(name)) {
    if (command == nullptr)
      throw InputError("unknown command '" + name + "'; see holba.commands()");
    job = command->make_job();
    table.Bind(job.get());
  }

  std::string Run() {
    return Interruptible([&] {
      ResultCapture capture;
      const Invocation invocation{.json = command->supports_json};
      job->ProbeOutputs(invocation);
      job->Run(invocation);
      return capture.text();
    });
  }

  const Command* command;
  std::unique_ptr<Job> job;
};

}  // namespace

void BindCommands(nb::module_& m) {
  nb::class_<CommandRun, OptionSet> run(m, "CommandRun", "One run of a command of the program.");
  run.def(nb::init<const std::string&>(), nb::arg("name"));
  run.def_prop_ro("summary", [](const CommandRun& r) { return r.command->summary; });
  run.def_prop_ro("details", [](const CommandRun& r) { return r.command->details; });
  run.def_prop_ro("supports_json", [](const CommandRun& r) { return r.command->supports_json; });
  run.def("run", &CommandRun::Run,
          "Runs it with the options that were set; returns what the program prints (JSON where it "
          "can). "
          "The interpreter's lock is released; Ctrl-C leaves the old output.");
  m.def(
      "command_names",
      [] {
        std::vector<std::string> names;
        for (const Command& command : AllCommands()) names.push_back(command.name);
        return names;
      },
      "Names of the program's commands.");
}

}  // namespace holba::python
