// SPDX-License-Identifier: Apache-2.0
#include "shared_work.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <numeric>
#include <optional>
#include <thread>
#include <vector>

#include "comm/launcher.hpp"
#include "comm/thread_ranks.hpp"
#include "device/device_list.hpp"
#include "logging.hpp"
#include "util/interrupt.hpp"

namespace raysplats::cli {
namespace {

// What fails everywhere, such as an option, is said by rank 0, which saves what it can and ends the
// others meanwhile.
constexpr auto kLeadersTurn = std::chrono::seconds(5);
constexpr auto kSpeakersTurn = std::chrono::seconds(10);

}  // namespace

bool is_shared(const std::string& command) {
  return command == "render" || command == "eval" || command == "train";
}

Communicator join_processes(const std::string& command) {
  const Launch launch = find_launch();
  if (launch.ranks == 1) return {};
  if (!is_shared(command)) {
    throw UsageError(fmt::format(
        "'raysplats {}' works in one process, and mpirun has started {}: start it without mpirun",
        command, launch.ranks));
  }
  return Communicator(launched_transport(launch));
}

void share_work(const DeviceFlags& flags,
                const GlobalOptions& global,
                const std::function<void(Communicator&, Context&)>& work) {
  Communicator& processes = global.processes;
  if (processes.size() > 1) {
    const std::vector<DeviceInfo> devices = flags.device.empty()
                                                ? devices_like(select_device(flags.device))
                                                : select_devices(flags.device);
    const auto place = static_cast<std::size_t>(processes.local_rank());
    const std::unique_ptr<Context> context =
        open_context(flags, devices.at(place % devices.size()));
    work(processes, *context);
    processes.barrier();
    return;
  }
  const std::vector<DeviceInfo> devices = select_devices(flags.device);
  std::vector<std::unique_ptr<Context>> contexts;
  for (const DeviceInfo& device : devices) {
    const LogSilence silence(!contexts.empty());
    contexts.push_back(open_context(flags, device));
  }
  std::optional<InterruptGuard> interrupt;  // that those of the threads do not outlive
  if (devices.size() > 1) interrupt.emplace();
  run_thread_ranks(static_cast<int>(devices.size()), [&](Communicator& ranks) {
    const LogSilence silence(!ranks.leads());
    work(ranks, *contexts[static_cast<std::size_t>(ranks.rank())]);
  });
}

FrameOptions share_of(Communicator& ranks, FrameOptions options, std::size_t frames) {
  if (frames < static_cast<std::size_t>(ranks.size())) {
    options.bands = &ranks;
    return options;
  }
  options.offset = static_cast<std::size_t>(ranks.rank());
  options.stride = static_cast<std::size_t>(ranks.size());
  return options;
}

std::uint64_t sum_over(Communicator& ranks, std::uint64_t mine) {
  const std::vector<std::uint64_t> all = ranks.all_gather(mine);
  return std::accumulate(all.begin(), all.end(), std::uint64_t{0});
}

double most_of(Communicator& ranks, double mine) {
  return std::ranges::max(ranks.all_gather(mine));
}

std::string traffic_of(const Communicator& ranks,
                       const Communicator::Traffic& before,
                       std::int64_t things,
                       const std::string& name) {
  if (ranks.size() == 1 || things < 1) return "";
  const Communicator::Traffic& now = ranks.traffic();
  const auto each = static_cast<double>(things);
  return fmt::format(
      "rank {} of {}, for each {}: {:.0f} bytes out, {:.0f} bytes in, {:.1f} messages out, {:.3f} "
      "ms among ranks and {:.3f} ms beside other work\n",
      ranks.rank(), ranks.size(), name, static_cast<double>(now.sent - before.sent) / each,
      static_cast<double>(now.received - before.received) / each,
      static_cast<double>(now.messages - before.messages) / each,
      1e3 * (now.seconds - before.seconds) / each, 1e3 * (now.hidden - before.hidden) / each);
}

int fail_together(Communicator& processes, const Error& error) {
  // Processes that have not joined yet all fail alike.
  if (processes.size() == 1 && find_launch().rank > 0) return error.exit_code();
  const auto* const lost = dynamic_cast<const RankLost*>(&error);
  const int speaker = lost != nullptr && lost->rank == 0 ? 1 : 0;
  if (processes.size() > 1 && processes.rank() != speaker)
    std::this_thread::sleep_for(lost != nullptr ? kSpeakersTurn : kLeadersTurn);
  // What cannot be said is no reason to end otherwise than with the code.
  std::fputs(fmt::format("raysplats: {}\n", error.what()).c_str(), stderr);
  if (processes.size() > 1) processes.abort(error.code());
  return error.exit_code();
}

}  // namespace raysplats::cli
