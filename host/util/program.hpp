// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raysplats {

/// A program of somebody else, found in PATH. Throws UsageError that names the Debian package to
/// install when it is not there.
std::filesystem::path find_program(const std::string& name, const std::string& package);

/// Runs a program without a shell and waits for it. What it says (both streams) is appended to
/// `log`, and `line` hears every line. `stop` is asked several times a second and ends the program
/// by returning true. Throws Error(kInterrupted) then, and Error with the last lines and the name
/// of the log when the program fails.
void run_program(const std::filesystem::path& program,
                 const std::vector<std::string>& arguments,
                 const std::filesystem::path& log,
                 const std::function<void(std::string_view)>& line,
                 const std::function<bool()>& stop);

/// A program that reads what it is given: started without a shell, with one end of a channel in
/// place of its standard input.
class ProgramInput {
 public:
  /// Throws Error when the program cannot be started.
  ProgramInput(const std::filesystem::path& program, const std::vector<std::string>& arguments);
  /// Ends the program if finish() has not been called.
  ~ProgramInput();
  ProgramInput(const ProgramInput&) = delete;
  ProgramInput& operator=(const ProgramInput&) = delete;

  /// Blocks until the program has room. Throws Error with the last it said when it has ended.
  void write(std::span<const std::byte> bytes);
  /// What it writes to its end of the channel, up to the end of a line. Throws Error with the last
  /// it said when it has ended.
  std::string read_line();
  /// Ends its input and waits for it. Throws Error with the last it said when it fails.
  void finish();

 private:
  [[noreturn]] void fail(int status);
  std::filesystem::path program_;
  int input_ = -1;
  int said_ = -1;  // a file without a name that holds both of its streams
  int child_ = -1;
};

}  // namespace raysplats
