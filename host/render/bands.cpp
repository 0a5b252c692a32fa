// SPDX-License-Identifier: Apache-2.0
#include "render/bands.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace raysplats {

void collect_rows(Communicator& ranks, const std::array<int, 2>& rows, Image& image) {
  if (ranks.size() == 1) return;
  const auto of_rows = [&image](const std::array<int, 2>& r) {
    const auto row =
        static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.channels);
    return std::as_writable_bytes(std::span(image.data)
                                      .subspan(row * static_cast<std::size_t>(r[0]),
                                               row * static_cast<std::size_t>(r[1] - r[0])));
  };
  const std::vector<std::array<int, 2>> all = ranks.all_gather(rows);
  std::vector<Outgoing> out;
  std::vector<Incoming> in;
  if (!ranks.leads()) out.push_back({0, of_rows(rows)});
  for (int rank = 1; ranks.leads() && rank < ranks.size(); ++rank)
    in.push_back({rank, of_rows(all[static_cast<std::size_t>(rank)])});
  ranks.exchange(out, in);
}

}  // namespace raysplats
