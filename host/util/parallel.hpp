// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

namespace raysplats {

/// Calls work(i) for every i below `count` once, on all cores. Where it throws, some of the others
/// are left out, and what it threw for the least i is thrown when all cores have ended.
template <class Work>
void in_parallel(std::size_t count, const Work& work) {
  const std::size_t threads =
      std::min<std::size_t>(std::max(1u, std::thread::hardware_concurrency()), count);
  using Failure = std::pair<std::size_t, std::exception_ptr>;
  std::vector<Failure> failures(threads, {count, nullptr});
  {
    std::vector<std::jthread> workers;
    for (std::size_t t = 0; t < threads; ++t) {
      workers.emplace_back([&, t] {
        std::size_t i = t;
        try {
          for (; i < count; i += threads) work(i);
        } catch (...) {
          failures[t] = {i, std::current_exception()};
        }
      });
    }
  }
  const auto first = std::ranges::min_element(failures, {}, &Failure::first);
  if (first != failures.end() && first->second) std::rethrow_exception(first->second);
}

/// Calls work(begin, end) for chunks of that many that make up 0 to `count`, on all cores; the last
/// one may be shorter.
template <class Work>
void in_chunks(std::size_t count, std::size_t chunk, const Work& work) {
  in_parallel((count + chunk - 1) / chunk,
              [&](std::size_t i) { work(i * chunk, std::min(count, (i + 1) * chunk)); });
}

}  // namespace raysplats
