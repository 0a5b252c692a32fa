// SPDX-License-Identifier: Apache-2.0
#include "logging.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <utility>

namespace raysplats::cli {
namespace {

thread_local bool silent_thread = false;

class LogSink : public spdlog::sinks::stderr_color_sink_mt {
 public:
  void log(const spdlog::details::log_msg& message) override {
    if (!silent_thread || message.level >= spdlog::level::err)
      spdlog::sinks::stderr_color_sink_mt::log(message);
  }
};

}  // namespace

LogSilence::LogSilence(bool silent) : before_(std::exchange(silent_thread, silent)) {}
LogSilence::~LogSilence() { silent_thread = before_; }
bool LogSilence::holds() { return silent_thread; }

void start_logging(const std::string& level, bool quiet) {
  auto logger = std::make_shared<spdlog::logger>("raysplats", std::make_shared<LogSink>());
  logger->set_pattern("[%H:%M:%S] %^%l%$: %v");
  logger->set_level(quiet ? spdlog::level::err : spdlog::level::from_str(level));
  spdlog::set_default_logger(logger);
}

}  // namespace raysplats::cli
