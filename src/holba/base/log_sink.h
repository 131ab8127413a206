// SPDX-License-Identifier: BSD-3-Clause
// Where messages (log.h) go, if not to stderr: for programs that hold this library and have a log
// of their own.
#pragma once

#include <functional>
#include <string_view>

#include "holba/base/log.h"

namespace holba {

// Gets every message, whatever the level that is set, with bytes that a terminal would obey
// escaped; from any thread, several at a time. It must not throw.
using LogSink = std::function<void(LogLevel level, std::string_view message)>;

// Empty: stderr again. To be called while no other thread logs.
void SetLogSink(LogSink sink);

}  // namespace holba
