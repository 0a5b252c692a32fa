// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "comm/communicator.hpp"
#include "options.hpp"
#include "render/frame_writer.hpp"

namespace raysplats::cli {

/// Whether several processes, or several devices, share the work of a command.
bool is_shared(const std::string& command);

/// Joins the processes that mpirun has started for `command`. Throws UsageError for a command that
/// is none of those, and what launched_transport() throws.
Communicator join_processes(const std::string& command);

/// Runs `work` for every rank of a shared command: for this process with the device of its place on
/// the machine, or for every device of --device in a thread each. Only the rank that leads prints
/// and logs.
void share_work(const DeviceFlags& flags,
                const GlobalOptions& global,
                const std::function<void(Communicator&, Context&)>& work);

/// The same options for what a rank draws of `frames` frames: some of them, or where there
/// are fewer than ranks, its rows of all.
FrameOptions share_of(Communicator& ranks, FrameOptions options, std::size_t frames);

/// All ranks: the sum and the largest of a number of each.
std::uint64_t sum_over(Communicator& ranks, std::uint64_t mine);
double most_of(Communicator& ranks, double mine);

/// For --profile: what this rank has sent, received and waited for since `before`, for each of
/// `things`, such as "step". Empty for one rank.
std::string traffic_of(const Communicator& ranks,
                       const Communicator::Traffic& before,
                       std::int64_t things,
                       const std::string& name);

/// Ends this process and the others of its work with one sentence, said by one of them; returns the
/// exit status where it is alone.
int fail_together(Communicator& processes, const Error& error);

}  // namespace raysplats::cli
