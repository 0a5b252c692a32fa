// SPDX-License-Identifier: Apache-2.0
// A file of a training run's folder, for the page about the run. The first byte chooses which.
#include <array>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "fuzz/fuzz_target.hpp"
#include "report/run_report.hpp"

namespace raysplats::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::array<const char*, 6> kFiles{"metrics.json", "eval/iteration_1/metrics.json",
                                            "metrics.csv",  "config.toml",
                                            "cameras.json", "exposures.json"};

void parse(std::span<const std::uint8_t> input) {
  const fs::path run = scratch().path() / "run";
  fs::remove_all(run);
  fs::create_directories(run / "eval/iteration_1");
  constexpr std::string_view kSound = R"({"evaluations":[{"iteration":1}]})";
  scratch().write("run/metrics.json",
                  {reinterpret_cast<const std::uint8_t*>(kSound.data()), kSound.size()});
  const std::string chosen = kFiles.at(take_choice(input, kFiles.size()));
  scratch().write("run/" + chosen, input);
  const std::string page = run_report(run);
  if (page.find("<script") != std::string::npos) std::abort();
  runs_report({run, run});
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
