// SPDX-License-Identifier: Apache-2.0
#include "comm/thread_ranks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

namespace raysplats {
namespace {

// What the ranks of one run share. A message is a view of the sender's memory, who waits until it
// is copied.
struct Group {
  struct Message {
    std::span<const std::byte> bytes;
    std::size_t* open;  // messages of the sender that nobody has copied
  };

  explicit Group(int ranks)
      : size(ranks),
        boxes(static_cast<std::size_t>(ranks * ranks)),
        copying(static_cast<std::size_t>(ranks)) {}

  std::deque<Message>& box(int from, int to) {
    return boxes[static_cast<std::size_t>(from) * static_cast<std::size_t>(size) +
                 static_cast<std::size_t>(to)];
  }
  void fail(int rank) {
    const std::lock_guard lock(mutex);
    if (!failed) failed = rank;
    changed.notify_all();
  }

  int size;
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<std::deque<Message>> boxes;
  std::vector<int> copying;   // messages of each rank that others read at this moment
  std::optional<int> failed;  // the first rank that did
};

class ThreadTransport : public Transport {
 public:
  ThreadTransport(Group& group, int rank) : group_(group), rank_(rank) {}
  int rank() const override { return rank_; }
  int size() const override { return group_.size; }
  int local_rank() const override { return rank_; }

  void exchange(std::span<const Outgoing> out,
                std::span<const Incoming> in,
                Wait /*wait*/) override {
    std::unique_lock lock(group_.mutex);
    std::size_t open = out.size();
    const Withdrawal withdrawal{*this, lock};
    for (const Outgoing& message : out)
      group_.box(rank_, message.to).push_back({message.bytes, &open});
    group_.changed.notify_all();
    for (const Incoming& wanted : in) {
      std::deque<Group::Message>& box = group_.box(wanted.from, rank_);
      wait(lock, [&] { return !box.empty(); });
      const Group::Message message = box.front();
      if (message.bytes.size() != wanted.bytes.size()) {
        throw Error(ErrorCode::kRuntime,
                    fmt::format("Rank {} expects {} bytes of rank {}, which sends {}", rank_,
                                wanted.bytes.size(), wanted.from, message.bytes.size()));
      }
      box.pop_front();
      int& copying = group_.copying[static_cast<std::size_t>(wanted.from)];
      ++copying;
      lock.unlock();
      if (!wanted.bytes.empty())
        std::memcpy(wanted.bytes.data(), message.bytes.data(), wanted.bytes.size());
      lock.lock();
      --copying;
      --*message.open;
      group_.changed.notify_all();
    }
    wait(lock, [&] { return open == 0; });
  }

  void cancel() override { group_.fail(rank_); }

  [[noreturn]] void abort(int /*code*/) override {
    group_.fail(rank_);
    throw lost(rank_);
  }

 private:
  static RankLost lost(int rank) {
    return {fmt::format("The work of device {} of the list has failed", rank), rank};
  }

  // However an exchange ends, nobody looks at this rank's memory afterwards.
  struct Withdrawal {
    ~Withdrawal() {
      Group& group = transport.group_;
      const int rank = transport.rank_;
      for (int other = 0; other < group.size; ++other) group.box(rank, other).clear();
      group.changed.wait(lock, [&] { return group.copying[static_cast<std::size_t>(rank)] == 0; });
    }
    ThreadTransport& transport;
    std::unique_lock<std::mutex>& lock;
  };

  template <class Condition>
  void wait(std::unique_lock<std::mutex>& lock, const Condition& condition) {
    group_.changed.wait(lock, [&] { return condition() || group_.failed; });
    if (!condition()) throw lost(*group_.failed);
  }

  Group& group_;
  int rank_;
};

}  // namespace

void run_thread_ranks(int ranks, const std::function<void(Communicator&)>& work) {
  if (ranks == 1) {
    Communicator alone;
    work(alone);
    return;
  }
  Group group(ranks);
  std::vector<std::exception_ptr> errors(static_cast<std::size_t>(ranks));
  const auto run = [&](int rank) {
    try {
      Communicator communicator(std::make_shared<ThreadTransport>(group, rank));
      work(communicator);
    } catch (...) {
      errors[static_cast<std::size_t>(rank)] = std::current_exception();
      group.fail(rank);
    }
  };
  std::vector<std::thread> threads;
  for (int rank = 1; rank < ranks; ++rank) threads.emplace_back(run, rank);
  run(0);
  for (std::thread& thread : threads) thread.join();
  if (group.failed) std::rethrow_exception(errors[static_cast<std::size_t>(*group.failed)]);
}

}  // namespace raysplats
