// SPDX-License-Identifier: Apache-2.0
#include "util/program.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fstream>
#include <thread>
#include <utility>

#include "raysplats/error.hpp"

extern char** environ;

namespace raysplats {
namespace {

constexpr int kPollMilliseconds = 200;
constexpr std::chrono::milliseconds kGrace{1000};  // for a program that is to end
constexpr std::chrono::milliseconds kGlance{10};
constexpr std::size_t kLastLines = 3;
constexpr std::size_t kLongestLine = 4096;

Error failure(const std::string& message) { return Error(ErrorCode::kRuntime, message); }

/// Both ends of a pipe, closed when it goes.
struct Pipe {
  int ends[2] = {-1, -1};
  Pipe() {
    if (::pipe2(ends, O_CLOEXEC) != 0)
      throw failure(fmt::format("A pipe cannot be made: {}", std::strerror(errno)));
  }
  ~Pipe() {
    for (const int end : ends) {
      if (end >= 0) ::close(end);
    }
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  void close_writing() {
    ::close(ends[1]);
    ends[1] = -1;
  }
};

/// The child, with both of its streams in `output`, reading `input`, or nothing where that is -1.
/// With `apart` the terminal's Ctrl-C is for this process alone, which ends the child when it has
/// to.
pid_t start(const std::filesystem::path& program,
            const std::vector<std::string>& arguments,
            int input,
            int output,
            bool apart) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (input < 0) {
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  } else {
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  }
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, STDERR_FILENO);
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  if (apart) {
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    posix_spawnattr_setpgroup(&attributes, 0);
  }
  pid_t child = -1;
  const int error =
      ::posix_spawn(&child, program.c_str(), &actions, &attributes, pointers.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0)
    throw failure(fmt::format("{} cannot be started: {}", program.string(), std::strerror(error)));
  return child;
}

/// Bytes become lines; those that programs write over (\r) count too.
class Lines {
 public:
  explicit Lines(std::function<void(std::string_view)> hear) : hear_(std::move(hear)) {}

  void add(std::string_view bytes) {
    for (const char c : bytes) {
      if (c == '\n' || c == '\r' || line_.size() == kLongestLine) end();
      if (c != '\n' && c != '\r') line_ += c;
    }
  }
  void end() {
    if (line_.empty()) return;
    if (hear_) hear_(line_);
    last_.push_back(line_);
    if (last_.size() > kLastLines) last_.pop_front();
    line_.clear();
  }
  std::string last() const { return fmt::format("{}", fmt::join(last_, " | ")); }

 private:
  std::function<void(std::string_view)> hear_;
  std::string line_;
  std::deque<std::string> last_;
};

int wait_for(pid_t child) {
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

/// Ends the child, by force where it does not go by itself.
void end(pid_t child) {
  ::kill(child, SIGTERM);
  const auto last = std::chrono::steady_clock::now() + kGrace;
  while (std::chrono::steady_clock::now() < last) {
    if (::waitpid(child, nullptr, WNOHANG) == child) return;
    std::this_thread::sleep_for(kGlance);
  }
  ::kill(child, SIGKILL);
  wait_for(child);
}

std::string ending(int status) {
  return WIFSIGNALED(status) ? fmt::format("was ended by signal {}", WTERMSIG(status))
                             : fmt::format("ended with exit code {}", WEXITSTATUS(status));
}

}  // namespace

std::filesystem::path find_program(const std::string& name, const std::string& package) {
  const char* value = std::getenv("PATH");
  std::string_view rest = value == nullptr ? "" : value;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(':'), rest.size());
    std::filesystem::path path = std::filesystem::path(rest.substr(0, end)) / name;
    rest.remove_prefix(std::min(end + 1, rest.size()));
    std::error_code error;
    // A relative folder of PATH would be another one after every change of directory.
    if (path.is_absolute() && std::filesystem::is_regular_file(path, error) &&
        ::access(path.c_str(), X_OK) == 0) {
      return path;
    }
  }
  throw UsageError(
      fmt::format("The program {} is not in PATH: install it, on Debian with 'apt-get install {}'",
                  name, package));
}

void run_program(const std::filesystem::path& program,
                 const std::vector<std::string>& arguments,
                 const std::filesystem::path& log,
                 const std::function<void(std::string_view)>& line,
                 const std::function<bool()>& stop) {
  std::ofstream file(log, std::ios::app | std::ios::binary);
  file << fmt::format("\n$ {} {}\n", program.string(), fmt::join(arguments, " "));
  Pipe pipe;
  const pid_t child = start(program, arguments, -1, pipe.ends[1], false);
  pipe.close_writing();
  Lines lines(line);
  bool stopped = false;
  for (bool open = true; open;) {
    pollfd wanted{pipe.ends[0], POLLIN, 0};
    const int ready = ::poll(&wanted, 1, kPollMilliseconds);
    if (!stopped && stop && stop()) {
      stopped = true;
      ::kill(child, SIGTERM);
    }
    if (ready <= 0) continue;
    char buffer[4096];
    const ssize_t count = ::read(pipe.ends[0], buffer, sizeof(buffer));
    if (count < 0 && errno == EINTR) continue;
    open = count > 0;
    if (!open) break;
    const std::string_view bytes(buffer, static_cast<std::size_t>(count));
    file << bytes;
    lines.add(bytes);
  }
  lines.end();
  const int status = wait_for(child);
  if (stopped) {
    throw Error(ErrorCode::kInterrupted,
                fmt::format("Interrupted in {}: the same command goes on from here",
                            program.filename().string()));
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
  throw failure(fmt::format("{} {}: {} (all it said is in {})", program.filename().string(),
                            ending(status), lines.last(), log.string()));
}

ProgramInput::ProgramInput(const std::filesystem::path& program,
                           const std::vector<std::string>& arguments)
    : program_(program) {
  // Writing to a socket whose reader is gone is an error, to a pipe a signal.
  int ends[2] = {-1, -1};
  said_ = ::memfd_create("raysplats-program", MFD_CLOEXEC);
  if (said_ < 0 || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw failure(
        fmt::format("A channel to {} cannot be made: {}", program.string(), std::strerror(errno)));
  input_ = ends[1];
  try {
    child_ = start(program, arguments, ends[0], said_, true);
  } catch (...) {
    ::close(ends[0]);
    ::close(input_);
    ::close(said_);
    throw;
  }
  ::close(ends[0]);
}

ProgramInput::~ProgramInput() {
  // One that waits for more, as ffmpeg does whatever signal it gets, has to see the end first.
  if (input_ >= 0) ::close(input_);
  if (child_ > 0) end(child_);
  if (said_ >= 0) ::close(said_);
}

void ProgramInput::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::send(input_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      ::close(std::exchange(input_, -1));  // it may wait for more
      fail(wait_for(std::exchange(child_, -1)));
    }
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

std::string ProgramInput::read_line() {
  std::string line;
  while (true) {
    char byte = 0;
    const ssize_t count = ::recv(input_, &byte, 1, 0);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      ::close(std::exchange(input_, -1));
      fail(wait_for(std::exchange(child_, -1)));
    }
    if (byte == '\n') return line;
    line += byte;
  }
}

void ProgramInput::finish() {
  ::close(std::exchange(input_, -1));
  const int status = wait_for(std::exchange(child_, -1));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) fail(status);
}

void ProgramInput::fail(int status) {
  std::string text(kLongestLine, '\0');
  const off_t size = ::lseek(said_, 0, SEEK_END);
  const off_t from = std::max<off_t>(0, size - static_cast<off_t>(text.size()));
  const ssize_t count = ::pread(said_, text.data(), text.size(), from);
  Lines lines({});
  lines.add(
      std::string_view(text).substr(0, static_cast<std::size_t>(std::max<ssize_t>(count, 0))));
  lines.end();
  throw failure(
      fmt::format("{} {}: {}", program_.filename().string(), ending(status), lines.last()));
}

}  // namespace raysplats
