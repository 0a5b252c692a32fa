// SPDX-License-Identifier: Apache-2.0
#include "program.hpp"

#include <doctest/doctest.h>
#include <fcntl.h>
#include <linux/capability.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <system_error>
#include <utility>

#include "build_paths.hpp"

namespace fs = std::filesystem;

RunningProgram::RunningProgram(const std::vector<std::string>& arguments,
                               const Surroundings& surroundings) {
  const std::string out = surroundings.out_file.empty() ? folder_ / "out" : surroundings.out_file;
  const std::string err = surroundings.err_file.empty() ? folder_ / "err" : surroundings.err_file;
  std::vector<std::string> words = surroundings.launcher;
  words.emplace_back(raysplats::test::program_file());
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  if (surroundings.terminal) {
    terminal_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (terminal_ < 0 || ::grantpt(terminal_) != 0 || ::unlockpt(terminal_) != 0)
      throw std::system_error(errno, std::generic_category(), "posix_openpt");
    const winsize size{24, 80, 0, 0};
    ::ioctl(terminal_, TIOCSWINSZ, &size);
  }
  process_ = ::fork();
  if (process_ < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (process_ > 0) {
    if (surroundings.full_once) {
      attend_ = [this, full = surroundings.full_once, most = surroundings.file_size_limit] {
        if (!full()) return;
        const rlimit limit{most, most};
        ::prlimit(process_, RLIMIT_FSIZE, &limit, nullptr);
        attend_ = {};
      };
    }
    return;
  }
  const int out_file = ::open(out.c_str(), O_WRONLY | O_CREAT, 0600);
  const int err_file = surroundings.terminal ? ::open(::ptsname(terminal_), O_WRONLY | O_NOCTTY)
                                             : ::open(err.c_str(), O_WRONLY | O_CREAT, 0600);
  if (::dup2(out_file, STDOUT_FILENO) < 0 || ::dup2(err_file, STDERR_FILENO) < 0) ::_exit(125);
  // The files' own numbers are free again, as they are in a program that a shell starts.
  ::close(out_file);
  ::close(err_file);
  if (surroundings.closed_out) ::close(STDOUT_FILENO);
  if (surroundings.closed_err) ::close(STDERR_FILENO);
  // Whatever the tests themselves are run by.
  std::signal(SIGHUP, surroundings.nohup ? SIG_IGN : SIG_DFL);
  std::signal(SIGPIPE, SIG_DFL);
  if (!surroundings.folder.empty() && ::chdir(surroundings.folder.c_str()) != 0) ::_exit(126);
  for (const auto& [name, value] : surroundings.environment)
    ::setenv(name.c_str(), value.c_str(), 1);
  if (surroundings.file_size_limit != RLIM_INFINITY && !surroundings.full_once) {
    const rlimit limit{surroundings.file_size_limit, surroundings.file_size_limit};
    if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) ::_exit(126);
  }
  if (surroundings.memory_limit != RLIM_INFINITY) {
    const rlimit limit{surroundings.memory_limit, surroundings.memory_limit};
    if (::setrlimit(RLIMIT_AS, &limit) != 0) ::_exit(126);
  }
  if (surroundings.permissions_count && ::geteuid() == 0 &&
      (::prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0) != 0 ||
       ::prctl(PR_CAPBSET_DROP, CAP_DAC_READ_SEARCH, 0, 0, 0) != 0)) {
    ::_exit(126);
  }
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

RunningProgram::~RunningProgram() {
  if (terminal_ >= 0) ::close(terminal_);
  if (ended_) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
}

void RunningProgram::hang_up() {
  read_terminal();
  ::close(std::exchange(terminal_, -1));
}

void RunningProgram::read_terminal() const {
  char part[4096];
  for (;;) {
    const ssize_t count = ::read(terminal_, part, sizeof(part));
    if (count <= 0) return;
    screen_.append(part, static_cast<std::size_t>(count));
  }
}

std::string RunningProgram::errors() const {
  if (terminal_ < 0) return read_file(folder_ / "err");
  read_terminal();
  return screen_;
}

bool RunningProgram::runs() {
  if (!ended_) ended_ = ::waitpid(process_, &status_, WNOHANG) == process_;
  return !ended_;
}

Outcome RunningProgram::wait() {
  // A terminal that nobody reads takes no more.
  while ((terminal_ >= 0 || attend_) && runs()) {
    if (terminal_ >= 0) read_terminal();
    if (attend_) attend_();
    ::usleep(1000);
  }
  if (!ended_ && ::waitpid(process_, &status_, 0) != process_)
    throw std::system_error(errno, std::generic_category(), "waitpid");
  ended_ = true;
  Outcome outcome;
  outcome.code = WIFEXITED(status_) ? WEXITSTATUS(status_) : 128 + WTERMSIG(status_);
  outcome.signal = WIFSIGNALED(status_) ? WTERMSIG(status_) : 0;
  outcome.out = read_file(folder_ / "out");
  outcome.err = errors();
  return outcome;
}

Outcome raysplats_program(const std::vector<std::string>& arguments,
                          const Surroundings& surroundings) {
  return RunningProgram(arguments, surroundings).wait();
}

Outcome succeed(const Words& arguments) {
  Outcome outcome = raysplats_program(arguments);
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  return outcome;
}

TemporaryFolder::TemporaryFolder() {
  std::string name = (fs::temp_directory_path() / "raysplats_cli_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr)
    throw std::system_error(errno, std::generic_category(), "mkdtemp");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

void write_file(const fs::path& path, const std::string& content) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << content;
}

std::string read_file(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

std::size_t entries(const fs::path& path) {
  std::error_code error;
  const fs::recursive_directory_iterator all(path, error);
  return error ? 0 : static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

std::string ply_file(std::size_t count, std::int64_t declared) {
  std::ostringstream out;
  out << "ply\nformat binary_little_endian 1.0\nelement vertex "
      << (declared >= 0 ? declared : static_cast<std::int64_t>(count)) << "\n";
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
    out << "property float " << name << "\n";
  }
  out << "end_header\n";
  for (std::size_t i = 0; i < count; ++i) {
    const float x = 0.5f * static_cast<float>(i);
    const float values[14] = {x, 0, 0, 1, 0, -1, 4, -1.5f, -1.5f, -1.5f, 1, 0, 0, 0};
    out.write(reinterpret_cast<const char*>(values), sizeof(values));
  }
  return out.str();
}

void write_npy(const std::filesystem::path& path,
               const std::string& order,
               const std::string& shape,
               const std::vector<float>& numbers) {
  const std::string header =
      "{'descr': '<f4', 'fortran_order': " + order + ", 'shape': " + shape + ", }\n";
  std::ofstream stream(path, std::ios::binary);
  stream << std::string("\x93NUMPY\x01\x00", 8) << static_cast<char>(header.size()) << '\0'
         << header;
  stream.write(reinterpret_cast<const char*>(numbers.data()),
               static_cast<std::streamsize>(numbers.size() * sizeof(float)));
}

bool one_sentence(const Outcome& outcome) {
  return outcome.err.starts_with("raysplats: ") && outcome.err.size() > 12 &&
         outcome.err.back() == '\n' &&
         std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1;
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

void check_refusal(const Outcome& outcome, int code, const std::string& part) {
  INFO(outcome.err);
  CHECK(outcome.code == code);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.err, part));
}

void check_refused(const std::vector<std::string>& arguments, int code, const std::string& part) {
  const Outcome outcome = raysplats_program(arguments);
  check_refusal(outcome, code, part);
  CHECK(outcome.out.empty());
}
