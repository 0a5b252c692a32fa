// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "shared/records.h"

namespace raysplats {

enum class ArgumentPlace { kValue, kBuffer, kLocal };
enum class ArgumentNumbers {
  kFloat,
  kInt,
  kUint,
  kRecord,  ///< of cl/shared/records.h, by name
  kWords,   ///< a structure of the host that kernels take as a vector of as many bytes
};

/// What a launch sets for an argument, in words that what a kernel declares can be compared with.
struct ArgumentType {
  ArgumentPlace place = ArgumentPlace::kLocal;
  ArgumentNumbers numbers = ArgumentNumbers::kWords;
  const char* record = "";  ///< of kRecord
  std::size_t bytes = 0;    ///< of a value, or of an element of a buffer

  bool operator==(const ArgumentType&) const = default;

  template <class T>
  static constexpr ArgumentType of(ArgumentPlace place);

  /// Why an argument declared as `type_name` (of CL_KERNEL_ARG_TYPE_NAME) in `place` cannot take
  /// this; "" when it can. Elements of buffers of plain numbers may be grouped in any way.
  std::string mismatch(const std::string& type_name, ArgumentPlace place) const;
};

/// Whether launches compare their arguments with what kernels declare, once per kernel and
/// argument: when RAYSPLATS_CHECK_ARGUMENTS=1. Throws UsageError when it is neither 0 nor 1.
bool arguments_are_checked();

namespace detail {

template <class T>
struct ArgumentNumbersOf {
  static constexpr ArgumentNumbers numbers = ArgumentNumbers::kWords;
  static constexpr const char* record = "";
};
template <>
struct ArgumentNumbersOf<float> {
  static constexpr ArgumentNumbers numbers = ArgumentNumbers::kFloat;
  static constexpr const char* record = "";
};
template <>
struct ArgumentNumbersOf<std::int32_t> {
  static constexpr ArgumentNumbers numbers = ArgumentNumbers::kInt;
  static constexpr const char* record = "";
};
template <>
struct ArgumentNumbersOf<std::uint32_t> {
  static constexpr ArgumentNumbers numbers = ArgumentNumbers::kUint;
  static constexpr const char* record = "";
};
template <class T, std::size_t n>
struct ArgumentNumbersOf<std::array<T, n>> : ArgumentNumbersOf<T> {};

#define RS_ARGUMENT_RECORD(type)                                         \
  template <>                                                            \
  struct ArgumentNumbersOf<type> {                                       \
    static constexpr ArgumentNumbers numbers = ArgumentNumbers::kRecord; \
    static constexpr const char* record = #type;                         \
  };
#define RS_ARGUMENT_FIELD(type, field)
RS_RECORDS(RS_ARGUMENT_RECORD, RS_ARGUMENT_FIELD)
#undef RS_ARGUMENT_RECORD
#undef RS_ARGUMENT_FIELD

}  // namespace detail

template <class T>
constexpr ArgumentType ArgumentType::of(ArgumentPlace place) {
  return {place, detail::ArgumentNumbersOf<T>::numbers, detail::ArgumentNumbersOf<T>::record,
          sizeof(T)};
}

}  // namespace raysplats
