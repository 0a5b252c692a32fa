// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stdexcept>
#include <string>

namespace raysplats {

/// Kind of a failure; the value is the exit code of the command-line program.
enum class ErrorCode {
  kRuntime = 1,
  kUsage = 2,
  kData = 3,
  kDevice = 4,
  kMemory = 5,
  kInterrupted = 130,
};

/// Base of everything this library throws. what() is one sentence: what failed, on what, what to
/// do.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  ErrorCode code() const { return code_; }
  int exit_code() const { return static_cast<int>(code_); }

 private:
  ErrorCode code_;
};

/// A wrong option, configuration key or combination of arguments.
struct UsageError : Error {
  explicit UsageError(const std::string& message) : Error(ErrorCode::kUsage, message) {}
};

/// A file that is missing, malformed or cannot be written.
struct DataError : Error {
  explicit DataError(const std::string& message) : Error(ErrorCode::kData, message) {}
};

/// An OpenCL call, kernel build or device that failed.
struct DeviceError : Error {
  explicit DeviceError(const std::string& message) : Error(ErrorCode::kDevice, message) {}
};

/// Memory that the device or the host does not have.
struct ResourceError : Error {
  explicit ResourceError(const std::string& message) : Error(ErrorCode::kMemory, message) {}
};

}  // namespace raysplats
