// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace raysplats::cli {

/// Log lines from `level` on ("debug" to "off"), or errors alone where it is `quiet`. They go to
/// standard error, so that results on standard output can be piped.
void start_logging(const std::string& level, bool quiet);

/// While one with `silent` lives, its thread logs errors only: another thread says the same.
class LogSilence {
 public:
  explicit LogSilence(bool silent);
  ~LogSilence();
  LogSilence(const LogSilence&) = delete;
  LogSilence& operator=(const LogSilence&) = delete;

  /// Whether this thread is silent.
  static bool holds();

 private:
  bool before_;
};

}  // namespace raysplats::cli
