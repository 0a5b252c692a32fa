// SPDX-License-Identifier: Apache-2.0
#include "device/argument_type.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <optional>
#include <string_view>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// Numbers and their size as a kernel declares them; 0 bytes where the build decides the lanes (fv,
// iv of vector_lanes.h).
struct Declared {
  ArgumentNumbers numbers = ArgumentNumbers::kWords;
  std::size_t bytes = 0;
};

// Nothing for a name that no launch can set.
std::optional<Declared> declared(const std::string& name) {
  static const std::map<std::string, Declared> known{
      {"float", {ArgumentNumbers::kFloat, 4}}, {"int", {ArgumentNumbers::kInt, 4}},
      {"uint", {ArgumentNumbers::kUint, 4}},   {"unsigned int", {ArgumentNumbers::kUint, 4}},
      {"fv", {ArgumentNumbers::kFloat, 0}},    {"iv", {ArgumentNumbers::kInt, 0}},
      {"uchar", {ArgumentNumbers::kWords, 1}}, {"ulong", {ArgumentNumbers::kWords, 8}}};
  if (name.compare(0, 2, "Rs") == 0) return Declared{ArgumentNumbers::kRecord, 0};
  const std::size_t digits = std::min(name.find_first_of("0123456789"), name.size());
  const auto found = known.find(name.substr(0, digits));
  if (found == known.end()) return std::nullopt;
  Declared out = found->second;
  if (digits < name.size()) out.bytes *= std::strtoul(name.c_str() + digits, nullptr, 10);
  return out;
}

const char* place_name(ArgumentPlace place) {
  return place == ArgumentPlace::kValue    ? "a value"
         : place == ArgumentPlace::kBuffer ? "a buffer"
                                           : "local memory";
}

}  // namespace

std::string ArgumentType::mismatch(const std::string& type_name,
                                   ArgumentPlace declared_place) const {
  if (place != declared_place) {
    return fmt::format("is {} in the kernel and {} in the launch", place_name(declared_place),
                       place_name(place));
  }
  if (place == ArgumentPlace::kLocal) return "";
  std::string name = type_name.substr(0, type_name.find('*'));
  if (name.compare(0, 7, "struct ") == 0) name = name.substr(7);
  const std::optional<Declared> kernel = declared(name);
  if (!kernel) return fmt::format("has the type {}, which no launch can set", type_name);
  if (numbers == ArgumentNumbers::kRecord || kernel->numbers == ArgumentNumbers::kRecord) {
    if (name == record) return "";
    return fmt::format("is {} in the kernel and {} in the launch", name,
                       *record != 0 ? record : "another type");
  }
  const bool value = place == ArgumentPlace::kValue;
  if (numbers == ArgumentNumbers::kWords) {
    if (kernel->bytes == bytes) return "";
    return fmt::format("has {} bytes in the kernel and {} in the launch", kernel->bytes, bytes);
  }
  if (numbers != kernel->numbers) {
    return fmt::format("is {} in the kernel and has other numbers in the launch", name);
  }
  if (value && kernel->bytes != bytes) {
    return fmt::format("has {} bytes in the kernel and {} in the launch", kernel->bytes, bytes);
  }
  return "";
}

bool arguments_are_checked() {
  const char* text = std::getenv("RAYSPLATS_CHECK_ARGUMENTS");
  if (text == nullptr || std::string_view(text).empty() || std::string_view(text) == "0") {
    return false;
  }
  if (std::string_view(text) != "1") {
    throw UsageError(fmt::format("RAYSPLATS_CHECK_ARGUMENTS is '{}': it must be 0 or 1", text));
  }
  return true;
}

}  // namespace raysplats
