// SPDX-License-Identifier: Apache-2.0
#include "io/model/broken_gaussians.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdint>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/gaussians/gaussian_selection.hpp"
#include "util/shell_word.hpp"

namespace raysplats::io {

void BrokenGaussians::add(std::size_t gaussian, const std::string& name) {
  if (numbers_.empty() || gaussian < *numbers_.begin()) first_name_ = name;
  numbers_.insert(gaussian);
}

void BrokenGaussians::settle(Gaussians& model, const std::filesystem::path& path, bool drop) const {
  if (numbers_.empty()) return;
  const std::string told = fmt::format(
      "{}: {} of {} Gaussians have a number that is not finite, '{}' of Gaussian {} the first",
      path.string(), numbers_.size(), model.size(), first_name_, *numbers_.begin());
  if (!drop) {
    throw DataError(
        fmt::format("{}: leave them out by raysplats convert {} NEW.ply --drop-nonfinite", told,
                    shell_word(path.string())));
  }
  std::vector<std::uint32_t> kept;
  auto next = numbers_.begin();
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (next != numbers_.end() && *next == i) {
      ++next;
    } else {
      kept.push_back(static_cast<std::uint32_t>(i));
    }
  }
  if (kept.empty())
    throw DataError(fmt::format("{}: no whole one is left, so export the model anew", told));
  model = gathered(model, kept);
  spdlog::warn("{}: they are left out", told);
}

}  // namespace raysplats::io
