// SPDX-License-Identifier: Apache-2.0
// The only file that knows MPI.
#include <fmt/format.h>
#include <mpi.h>
#include <poll.h>
#include <sched.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <thread>
#include <vector>

#include "comm/transport.hpp"

namespace raysplats {
namespace {

constexpr int kTag = 16;
// Messages go in pieces: MPI counts with an int, and a piece that has come tells that more will.
// They are small enough for one to come while a wait is busy, where memory is slow.
constexpr std::size_t kPiece = std::size_t{1} << 20;
// After so long without a piece a wait leaves the core to others between its looks.
constexpr auto kBusy = std::chrono::milliseconds(10);
constexpr int kPauseMs = 1;
constexpr auto kRest = std::chrono::microseconds(100);  // between looks of Wait::kResting
constexpr auto kAbort = std::chrono::seconds(2);
constexpr auto kLastWords = std::chrono::milliseconds(100);  // that an ended process may have sent

[[noreturn]] void fail(const char* what, int error) {
  char text[MPI_MAX_ERROR_STRING] = "";
  int length = 0;
  MPI_Error_string(error, text, &length);
  throw Error(ErrorCode::kRuntime,
              fmt::format("MPI has failed at {}: {}; see what mpirun says", what, text));
}

void check(const char* what, int error) {
  if (error != MPI_SUCCESS) fail(what, error);
}

// What tells processes of one machine, and of one space of process numbers there, from others.
struct Place {
  std::int64_t process = 0;
  std::uint64_t machine = 0;  // equal numbers: the same machine
  std::uint64_t space = 0;
};

class MpiTransport : public Transport {
 public:
  MpiTransport() {
    int provided = 0;
    check("MPI_Init_thread", MPI_Init_thread(nullptr, nullptr, MPI_THREAD_SERIALIZED, &provided));
    if (provided < MPI_THREAD_SERIALIZED) {
      throw Error(ErrorCode::kRuntime,
                  "This MPI lets one thread alone send messages: use one that was built with "
                  "support of threads");
    }
    MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
    MPI_Comm machine;
    check("MPI_Comm_split_type", MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, rank_,
                                                     MPI_INFO_NULL, &machine));
    MPI_Comm_rank(machine, &local_rank_);
    std::uint64_t leader = static_cast<std::uint64_t>(rank_);
    check("MPI_Bcast", MPI_Bcast(&leader, 1, MPI_UINT64_T, 0, machine));
    MPI_Comm_free(&machine);
    watch(leader);
  }
  ~MpiTransport() override {
    for (const pollfd& process : processes_) ::close(process.fd);
    MPI_Finalize();
  }
  MpiTransport(const MpiTransport&) = delete;
  MpiTransport& operator=(const MpiTransport&) = delete;

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  int local_rank() const override { return local_rank_; }

  void exchange(std::span<const Outgoing> out, std::span<const Incoming> in, Wait how) override {
    std::vector<MPI_Request> requests;
    const auto pieces = [&](std::size_t bytes, const auto& send) {
      for (std::size_t at = 0; at < bytes; at += kPiece) {
        requests.push_back(MPI_REQUEST_NULL);
        send(at, static_cast<int>(std::min(kPiece, bytes - at)), requests.back());
      }
    };
    for (const Incoming& message : in) {
      pieces(message.bytes.size(), [&](std::size_t at, int count, MPI_Request& request) {
        check("MPI_Irecv", MPI_Irecv(message.bytes.data() + at, count, MPI_BYTE, message.from, kTag,
                                     MPI_COMM_WORLD, &request));
      });
    }
    for (const Outgoing& message : out) {
      pieces(message.bytes.size(), [&](std::size_t at, int count, MPI_Request& request) {
        check("MPI_Isend", MPI_Isend(message.bytes.data() + at, count, MPI_BYTE, message.to, kTag,
                                     MPI_COMM_WORLD, &request));
      });
    }
    wait(requests, how);
  }
  void cancel() override { cancelled_ = true; }

  // A launcher that is ending the ranks already may leave MPI_Abort waiting.
  [[noreturn]] void abort(int code) override {
    std::thread([code] {
      std::this_thread::sleep_for(kAbort);
      std::_Exit(code);
    }).detach();
    MPI_Abort(MPI_COMM_WORLD, code);
    std::_Exit(code);
  }

 private:
  // Opens the processes of the other ranks on this machine, so that the end of one is seen. Those
  // of other machines, and all where the system does not do that, are left to the launcher.
  void watch(std::uint64_t machine) {
    Place here{::getpid(), machine, 0};
    struct stat space {};
    if (::stat("/proc/self/ns/pid", &space) == 0) here.space = space.st_ino;
    std::vector<Place> places(static_cast<std::size_t>(size_));
    check("MPI_Allgather", MPI_Allgather(&here, sizeof(Place), MPI_BYTE, places.data(),
                                         sizeof(Place), MPI_BYTE, MPI_COMM_WORLD));
    for (int other = 0; other < size_; ++other) {
      const Place& place = places[static_cast<std::size_t>(other)];
      if (other == rank_ || place.machine != here.machine || place.space != here.space) continue;
      // glibc has a function of that name since 2.36 only.
      const auto descriptor =
          static_cast<int>(::syscall(SYS_pidfd_open, static_cast<pid_t>(place.process), 0));
      if (descriptor < 0) continue;
      processes_.push_back({descriptor, POLLIN, 0});
      ranks_.push_back(other);
    }
  }

  void wait(std::vector<MPI_Request>& requests, Wait how) {
    using Clock = std::chrono::steady_clock;
    std::vector<int> which(requests.size());
    Clock::time_point news = Clock::now();
    std::optional<Clock::time_point> ended;
    for (;;) {
      int done = 0;
      check("MPI_Testsome", MPI_Testsome(static_cast<int>(requests.size()), requests.data(), &done,
                                         which.data(), MPI_STATUSES_IGNORE));
      if (done == MPI_UNDEFINED) return;  // nothing is open
      const Clock::time_point now = Clock::now();
      if (done > 0) news = now;
      if (cancelled_) throw Error(ErrorCode::kRuntime, "This rank has failed: see what it says");
      const bool rests = how == Wait::kResting;
      if (!rests && now - news < kBusy) {
        ::sched_yield();
        continue;
      }
      if (rests) std::this_thread::sleep_for(kRest);
      // A pause for others' sake, which the end of a process cuts short.
      if (::poll(processes_.data(), processes_.size(), rests ? 0 : kPauseMs) <= 0) continue;
      if (!ended) ended = now;
      if (now - *ended > kLastWords) throw_lost();
      ::usleep(1000);
    }
  }

  [[noreturn]] void throw_lost() const {
    std::size_t i = 0;
    while (i + 1 < processes_.size() && processes_[i].revents == 0) ++i;
    throw RankLost(fmt::format("Rank {} of the {} that share this work has ended before its time",
                               ranks_[i], size_),
                   ranks_[i]);
  }

  int rank_ = 0, size_ = 1, local_rank_ = 0;
  std::atomic<bool> cancelled_ = false;
  std::vector<pollfd> processes_;  // of ranks_
  std::vector<int> ranks_;
};

}  // namespace
}  // namespace raysplats

extern "C" const char* raysplats_mpi_version() { return RAYSPLATS_VERSION; }
extern "C" raysplats::Transport* raysplats_mpi_transport() { return new raysplats::MpiTransport; }
