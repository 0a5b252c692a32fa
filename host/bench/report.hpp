// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "bench/summary.hpp"

namespace raysplats {

/// What was done in one run of a row.
struct BenchWork {
  struct Items {
    std::string unit;  ///< plural, for example "rays"
    double count = 0;
  };
  std::vector<Items> items;  ///< the unit that matters first
  double bytes = 0;          ///< that have to move at least (cl/*/work.h)
  double flops = 0;          ///< arithmetic operations that are needed at least
};

/// Limits of the device, measured.
struct Ceilings {
  double copy_bytes_per_second = 0;  ///< read + write
  double fma_flops_per_second = 0;
};

struct BenchRow {
  std::string name;      ///< of bench_rows()
  std::string scene;     ///< name of the scene or of the model's file
  std::size_t size = 0;  ///< Gaussians
  std::string clock;     ///< of `seconds`: "device" (events) or "wall"
  Summary seconds;
  std::optional<double> wall;  ///< median by the host's clock, where the row is a whole operation
  BenchWork work;

  /// "name/scene/size", what filters match and files are compared by.
  std::string id() const;
};

/// Share of a device's limits that a row reaches.
struct BenchShare {
  double copy = 0;    ///< of the copy bandwidth
  double fma = 0;     ///< of the FMA rate
  std::string bound;  ///< the larger of both: "copy", "fma", "" when nothing is counted
};
BenchShare share_of(const BenchRow& row, const Ceilings& ceilings);

struct BenchReport {
  std::string version;  ///< of RaySplats
  std::string date;     ///< UTC, ISO 8601
  std::string device;
  std::string driver;
  std::string platform;
  std::uint32_t compute_units = 0;
  std::map<std::string, std::string> options;
  Ceilings ceilings;
  std::uint64_t peak_process_bytes = 0;
  std::uint64_t peak_device_bytes = 0;  ///< in buffers
  std::vector<BenchRow> rows;
  struct LeftOut {
    std::string id;  ///< of the row
    std::string reason;
    bool failed = false;  ///< by an error that was kept (BenchOptions::keep_failures)
  };
  std::vector<LeftOut> left_out;
};

/// "ids: reason" for every reason why rows were left out.
std::vector<std::string> left_out_lines(const BenchReport& report);

/// Fixed-width text, with the ceilings above and the memory below the rows.
std::string bench_table(const BenchReport& report);
std::string bench_csv(const BenchReport& report);
std::string bench_json(const BenchReport& report);

/// Reads a file that bench_json() wrote. Throws DataError when it is none or of another version.
BenchReport read_bench_report(const std::filesystem::path& path);

}  // namespace raysplats
