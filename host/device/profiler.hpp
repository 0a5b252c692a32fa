// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace raysplats {

/// Device time per kernel, summed from events.
class Profiler {
 public:
  struct Row {
    std::string kernel;
    std::uint64_t calls = 0;
    double total_ms = 0;
    double mean_ms = 0;
    double share = 0;  ///< of the sum of all rows
  };

  void add(const std::string& kernel, std::uint64_t nanoseconds);
  void reset() { entries_.clear(); }
  /// Longest total first.
  std::vector<Row> rows() const;
  /// The rows as an aligned text table with a header.
  std::string table() const;

 private:
  struct Entry {
    std::uint64_t calls = 0;
    std::uint64_t nanoseconds = 0;
  };
  std::map<std::string, Entry> entries_;
};

}  // namespace raysplats
