// SPDX-License-Identifier: Apache-2.0
// A message of the viewer's page, and the headers of a request.
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "fuzz/fuzz_target.hpp"
#include "view/access.hpp"
#include "view/view_request.hpp"

namespace raysplats::fuzz {
namespace {

void parse(std::span<const std::uint8_t> input) {
  const std::string_view text(reinterpret_cast<const char*>(input.data()), input.size());
  // Nobody knows this token; whatever is sent, the answer is no.
  const view::Access access("0123456789abcdef0123456789abcdef", {"127.0.0.1"}, 1);
  const std::size_t half = text.size() / 2;
  for (const view::Credentials& sent :
       {view::Credentials{"127.0.0.1:1", "", text, text},
        view::Credentials{"127.0.0.1:1", text.substr(0, half), text.substr(half), text}}) {
    const bool known = text.find("0123456789abcdef0123456789abcdef") != std::string_view::npos;
    if (!known && access.judge(sent) != view::Verdict::kForbidden) std::abort();
  }
  constexpr int kMostSide = 1000;
  const view::Message message = view::parse_message(text, kMostSide);
  if (const auto* request = std::get_if<view::ViewRequest>(&message)) {
    const Camera& camera = request->camera;
    const bool sound = camera.width >= 1 && camera.height >= 1 && camera.width <= kMostSide &&
                       camera.height <= kMostSide && camera.fx > 0 && std::isfinite(camera.fx) &&
                       std::isfinite(camera.translation.x + camera.rotation[0][0]);
    if (!sound) std::abort();
  }
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
