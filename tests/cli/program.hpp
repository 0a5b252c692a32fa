// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/resource.h>
#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

using Words = std::vector<std::string>;

inline Words operator+(Words first, const Words& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// What the program left behind.
struct Outcome {
  int code = -1;    ///< exit code; 128 + signal when a signal ended it
  std::string out;  ///< standard output
  std::string err;  ///< standard error
  int signal = 0;   ///< that ended it; 0 when it ended by itself
};

struct Surroundings {
  std::vector<std::pair<std::string, std::string>> environment;  ///< added to the test's own
  rlim_t file_size_limit = RLIM_INFINITY;  ///< bytes; beyond it writes fail, as on a full disk
  /// Says from when on that limit holds, asked while the program runs; from its start without. A
  /// driver writes files of its own when kernels are built.
  std::function<bool()> full_once = {};
  rlim_t memory_limit = RLIM_INFINITY;  ///< bytes of address space, as by ulimit -v
  bool permissions_count = false;  ///< even for root: what may not be read or written cannot be
  std::string out_file = {};       ///< where standard output goes, such as /dev/full
  std::string err_file = {};       ///< where standard error goes
  bool terminal = false;           ///< standard error is one, 80 columns wide
  bool closed_out = false;         ///< as by >&-
  bool closed_err = false;
  bool nohup = false;                      ///< SIGHUP is ignored
  std::string folder = {};                 ///< to run in; the test's own when empty
  std::vector<std::string> launcher = {};  ///< what starts the program, such as mpirun -n 2
};

/// Runs `raysplats` with `arguments` and waits for it.
Outcome raysplats_program(const std::vector<std::string>& arguments,
                          const Surroundings& surroundings = {});

/// Runs it and requires that it ends with 0.
Outcome succeed(const Words& arguments);

/// An empty folder that is removed with everything in it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::filesystem::path path() const { return path_; }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

/// A run of `raysplats` that goes on while the test does something else; killed when it is still
/// there at the end.
class RunningProgram {
 public:
  explicit RunningProgram(const std::vector<std::string>& arguments,
                          const Surroundings& surroundings = {});
  ~RunningProgram();
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  pid_t process() const { return process_; }
  /// Closes its terminal, without a signal.
  void hang_up();
  /// What it has written to standard error so far.
  std::string errors() const;
  /// Whether it has not ended yet.
  bool runs();
  Outcome wait();

 private:
  TemporaryFolder folder_;
  void read_terminal() const;

  std::function<void()> attend_;  // once in a while, until it has nothing left to do
  pid_t process_ = -1;
  int terminal_ = -1;           // the near end of the program's terminal
  mutable std::string screen_;  // what came out of it so far
  int status_ = 0;
  bool ended_ = false;
};

void write_file(const std::filesystem::path& path, const std::string& content);
std::string read_file(const std::filesystem::path& path);
/// A .npy file of 32-bit floats; `order` is "True" or "False", `shape` as in Python.
void write_npy(const std::filesystem::path& path,
               const std::string& order,
               const std::string& shape,
               const std::vector<float>& numbers);
/// Number of files and folders below `path`, 0 when it does not exist.
std::size_t entries(const std::filesystem::path& path);

/// A binary 3DGS PLY of SH degree 0 with a few opaque balls; `declared` overrides the count in the
/// header.
std::string ply_file(std::size_t count, std::int64_t declared = -1);

/// True when the outcome is one sentence on standard error, prefixed by the program's name.
bool one_sentence(const Outcome& outcome);

bool contains(const std::string& text, const std::string& part);

/// Checks that the program ended with `code` and one sentence that has `part`.
void check_refusal(const Outcome& outcome, int code, const std::string& part);
/// Runs it with `arguments` and checks that, and that it printed no results.
void check_refused(const std::vector<std::string>& arguments, int code, const std::string& part);
