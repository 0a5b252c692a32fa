// SPDX-License-Identifier: Apache-2.0
#include "run/former_metrics.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

namespace raysplats {
namespace {

using Json = nlohmann::json;

// What is not the last step's to say.
constexpr std::array<const char*, 5> kOfNow{"complete", "iterations", "most_gaussians",
                                            "model_hash", "evaluation_seconds"};

std::string text(const Json& of, const char* key) {
  const auto found = of.find(key);
  return found != of.end() && found->is_string() ? found->get<std::string>() : "";
}

std::uint64_t whole(const Json& of, const char* key) {
  const auto found = of.find(key);
  if (found == of.end() || !found->is_number_integer()) return 0;
  const bool negative = !found->is_number_unsigned() && found->get<std::int64_t>() < 0;
  return negative ? 0 : found->get<std::uint64_t>();
}

// The objects of a list that have a name.
std::vector<Json> named(const Json& of, const char* key) {
  std::vector<Json> out;
  const auto list = of.find(key);
  if (list == of.end() || !list->is_array()) return out;
  for (const Json& each : *list) {
    if (each.is_object() && !text(each, "name").empty()) out.push_back(each);
  }
  return out;
}

std::vector<std::string> texts(const Json& of, const char* key) {
  std::vector<std::string> out;
  const auto list = of.find(key);
  if (list == of.end() || !list->is_array()) return out;
  for (const Json& each : *list) {
    if (each.is_string()) out.push_back(each.get<std::string>());
  }
  return out;
}

// The commands that the run had, the one that started it first.
Json commands_of(const Json& of) {
  Json out = texts(of, "commands");
  if (out.empty()) out.push_back(of.at("command"));
  return out;
}

struct Kernel {
  std::uint64_t calls = 0;
  double ms = 0;
};

// The kernels of both, longest first.
Json all_kernels(const Json& now, const Json& former) {
  std::map<std::string, Kernel> sums;
  double total = 0;
  for (const Json* part : {&now, &former}) {
    for (const Json& each : named(*part, "kernels")) {
      const double ms = former_number(each, "ms");
      Kernel& sum = sums[text(each, "name")];
      sum.calls += whole(each, "calls");
      sum.ms += ms;
      total += ms;
    }
  }
  std::vector<std::pair<std::string, Kernel>> rows(sums.begin(), sums.end());
  std::ranges::stable_sort(rows, std::ranges::greater(),
                           [](const auto& row) { return row.second.ms; });
  Json out = Json::array();
  for (const auto& [name, kernel] : rows) {
    out.push_back({{"name", name},
                   {"calls", kernel.calls},
                   {"ms", kernel.ms},
                   {"share", total > 0 ? kernel.ms / total : 0.0}});
  }
  return out;
}

}  // namespace

double former_number(const Json& former, const char* key) {
  const auto found = former.find(key);
  return found != former.end() && found->is_number() ? found->get<double>() : 0.0;
}

std::vector<std::string> former_warnings(const Json& former) {
  return texts(former, "photo_warnings");
}

std::map<std::string, Json> former_photos(const Json& former) {
  std::map<std::string, Json> out;
  for (Json& photo : named(former, "photos")) {
    std::string name = text(photo, "name");
    out.emplace(std::move(name), std::move(photo));
  }
  return out;
}

Json continued_metrics(Json now, const Json& former, bool stepped) {
  if (!former.is_object()) return now;
  if (!stepped && former.contains("iteration") &&
      former_number(former, "iteration") == former_number(now, "iteration")) {
    Json out = former;
    for (const char* key : kOfNow) out[key] = now.at(key);
    return out;
  }
  if (const std::string command = text(former, "command"); !command.empty()) {
    now["commands"] = commands_of(former);
    if (const std::string last = text(now, "command"); !last.empty())
      now["commands"].push_back(last);
    now["command"] = command;
  }
  now["kernel_build_seconds"] =
      former_number(now, "kernel_build_seconds") + former_number(former, "kernel_build_seconds");
  now["peak_device_bytes"] =
      std::max(whole(now, "peak_device_bytes"), whole(former, "peak_device_bytes"));
  if (text(former, "device") == text(now, "device")) {
    now["timed_steps"] = whole(now, "timed_steps") + whole(former, "timed_steps");
    now["kernels"] = all_kernels(now, former);
  }
  return now;
}

}  // namespace raysplats
