// SPDX-License-Identifier: BSD-3-Clause
#include "holba/base/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <string>
#include <utility>

#include "holba/base/log_sink.h"
#include "holba/base/printable.h"
#include "holba/base/progress.h"

namespace holba {
namespace {

spdlog::level::level_enum ToSpdlog(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarning:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
    case LogLevel::kOff:
      return spdlog::level::off;
  }
  return spdlog::level::info;
}

spdlog::logger& Logger() {
  static const std::shared_ptr<spdlog::logger> logger = [] {
    auto created = std::make_shared<spdlog::logger>(
        "holba", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
    created->set_pattern("%^%l%$ %v");
    return created;
  }();
  return *logger;
}

LogSink& Sink() {
  static LogSink sink;
  return sink;
}

}  // namespace

void SetLogSink(LogSink sink) { Sink() = std::move(sink); }

void SetLogLevel(LogLevel level) { Logger().set_level(ToSpdlog(level)); }

void LogMessage(LogLevel level, std::string_view message) {
  const std::string printable = Printable(message);
  if (Sink()) return Sink()(level, printable);
  if (!Logger().should_log(ToSpdlog(level))) return;
  ClearProgressLine();
  Logger().log(ToSpdlog(level), spdlog::string_view_t(printable.data(), printable.size()));
}

}  // namespace holba
