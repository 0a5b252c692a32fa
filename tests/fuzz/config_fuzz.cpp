// SPDX-License-Identifier: Apache-2.0
// A training configuration; what is understood has to survive being written and read again.
#include <cstdlib>
#include <string>

#include "fuzz/fuzz_target.hpp"
#include "run/train_config.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  TrainOptions options;
  read_train_config(scratch().write("train.toml", input), options);
  const std::string text = to_toml(options);
  TrainOptions again;
  read_train_config(
      scratch().write("again.toml",
                      {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}),
      again);
  if (to_toml(again) != text) std::abort();
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
