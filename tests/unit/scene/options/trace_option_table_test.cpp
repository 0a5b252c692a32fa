// SPDX-License-Identifier: Apache-2.0
#include "scene/options/trace_option_table.hpp"

#include <doctest/doctest.h>

#include <set>
#include <string>

#include "raysplats/error.hpp"
#include "unit/text.hpp"

using namespace raysplats;

namespace {

std::string refusal(const char* name, const std::vector<std::string>& values) {
  TraceSettings settings;
  const std::string message = test::message_of<UsageError>([&] { settings.set(name, values); });
  CHECK(settings.has(name) == message.empty());
  return message;
}

}  // namespace

TEST_CASE("what is given of tracing goes over what was there, and nothing else does") {
  TraceOptions base;
  base.max_hits = 33;
  base.hit_order = HitOrder::kPeak;
  base.depth = true;
  base.background = {0.1f, 0.2f, 0.3f};
  TraceSettings settings;
  CHECK(settings.over(base).max_hits == 33);
  settings.set("quantile", {"8.5"});
  settings.set("memory-budget", {"64"});
  settings.set("background", {"1, 0.5,0"});
  settings.set("traversal", {"bvh"});
  settings.set("traversal", {"tiles"});
  base.sky = {{0.1f, 0.2f, 0.3f}};  // a colour that is given takes its place
  CHECK(settings.over(base).sky.empty());
  CHECK(TraceSettings().over(base).sky == base.sky);
  CHECK(settings.has("quantile"));
  CHECK_FALSE(settings.has("max-hits"));
  const TraceOptions got = settings.over(base);
  CHECK(got.quantile == 8.5f);
  CHECK(got.memory_budget == std::size_t{64} << 20);
  CHECK(got.background == std::array<float, 3>{1.0f, 0.5f, 0.0f});
  CHECK(got.traversal == Traversal::kTiles);
  CHECK(got.max_hits == 33);
  CHECK(got.hit_order == HitOrder::kPeak);
  CHECK(got.depth);
  settings.set("background", {"0.5"});
  CHECK(settings.over(base).background == std::array<float, 3>{0.5f, 0.5f, 0.5f});
}

TEST_CASE("options of tracing refuse in one sentence what they do not accept") {
  CHECK(refusal("quantile", {"0"}) ==
        "The option 'quantile' needs a number from 0.01 to 100, not '0'");
  CHECK(refusal("max-hits", {"1.5"}).find("a whole number from 1 to 1000000") != std::string::npos);
  CHECK(refusal("max-hits", {"1", "2"}).find("one value") != std::string::npos);
  CHECK(refusal("near", {"nan"}).find("at least 0") != std::string::npos);
  CHECK(refusal("hit-order", {"peek"}).find("entry or peak") != std::string::npos);
  CHECK(refusal("adaptive-radius", {"1"}).find("true or false") != std::string::npos);
  CHECK(refusal("background", {"1,1"}).find("three numbers") != std::string::npos);
  CHECK(refusal("background", {"1,1,1.5"}).find("three numbers") != std::string::npos);
  CHECK(refusal("memory-budget", {"-1"}).find("from 0 to") != std::string::npos);
  CHECK(refusal("min-transmitance", {"0"}).find("no option") != std::string::npos);
  // A sensible wish: never stop early.
  CHECK(refusal("min-transmittance", {"0"}).empty());
}

TEST_CASE("every option of tracing is written so that it is read back as it was") {
  TraceOptions options;
  const std::vector<OptionRow> rows = trace_option_rows(options);
  std::set<std::string> names;
  for (const OptionRow& row : rows) {
    CAPTURE(row.name);
    CHECK(names.insert(row.name).second);
    CHECK_FALSE(row.help.empty());
    std::string text = row.text();
    std::erase(text, '"');
    row.set({text});
    std::string again = row.text();
    std::erase(again, '"');
    CHECK(again == text);
  }
  CHECK(find_row(rows, "nothing") == nullptr);
  const TraceOptions defaults;
  CHECK(options.quantile == defaults.quantile);
  CHECK(options.min_transmittance == defaults.min_transmittance);
  CHECK(options.memory_budget == defaults.memory_budget);
}

TEST_CASE("packets have widths that their shape allows") {
  const auto accepts = [](PacketShape shape, int width) {
    TraceOptions options;
    options.packet_shape = shape;
    options.packet_width = width;
    try {
      check_packet_width(options);
    } catch (const UsageError&) {
      return false;
    }
    return true;
  };
  for (const PacketShape shape :
       {PacketShape::kAuto, PacketShape::kVector, PacketShape::kGroup, PacketShape::kSubgroup}) {
    CAPTURE(packet_shape_name(shape));
    CHECK(accepts(shape, 0));
    CHECK(accepts(shape, 8));
    CHECK(accepts(shape, 16));
    CHECK_FALSE(accepts(shape, 3));
    CHECK_FALSE(accepts(shape, 128));
    CHECK(accepts(shape, 4) == (shape == PacketShape::kAuto || shape == PacketShape::kVector));
    CHECK(accepts(shape, 32) == (shape != PacketShape::kVector));
  }
}
