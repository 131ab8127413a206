// SPDX-License-Identifier: BSD-3-Clause
// What shells and `man` know about the program, made from the tables of options: `holba completion
// bash|zsh|fish` and `holba man [COMMAND]`, which the build runs and installs (cmake/program_docs).
#pragma once

#include <string>
#include <string_view>

namespace holba {

// A script that completes commands, options, their choices and paths. Throws InputError for a shell
// that is not one of the three.
std::string CompletionScript(std::string_view shell);

// A page in the macros of man(7): of the program (`command` empty) or of a command. Throws
// InputError for a command that does not exist.
std::string ManPage(std::string_view command);

}  // namespace holba
