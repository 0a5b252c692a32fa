// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include "device/argument_type.hpp"
#include "device/buffer.hpp"

namespace raysplats {

/// Arguments that come together, in the order of a pack that kernels declare once (RS_..._ARGUMENTS
/// in cl/). Made by argument_pack(); refers to its buffers.
template <class... Arguments>
struct ArgumentPack {
  std::tuple<Arguments...> arguments;
};

template <class T>
struct PackedArgument {
  using type = T;
};
template <class T>
struct PackedArgument<Buffer<T>> {
  using type = const Buffer<T>&;
};

/// Buffers must outlive the pack; values are copied into it.
template <class... Arguments>
ArgumentPack<typename PackedArgument<Arguments>::type...> argument_pack(
    const Arguments&... arguments) {
  return {{arguments...}};
}

/// A count as kernels take it. Not checked: the device's largest allocation bounds how many records
/// a buffer holds.
inline std::uint32_t u32(std::size_t count) { return static_cast<std::uint32_t>(count); }

/// Work-group local memory as a kernel argument.
struct LocalMemory {
  std::size_t bytes;
};

/// A buffer of records whose words a kernel reads as T.
template <class T>
struct BufferAs {
  const RawBuffer& raw;
};

/// Sizes of a launch; unused dimensions are 1. `local` of all zeros lets the driver choose. Global
/// ids begin at `offset`.
struct Range {
  std::array<std::size_t, 3> global{1, 1, 1};
  std::array<std::size_t, 3> local{0, 0, 0};
  std::array<std::size_t, 3> offset{0, 0, 0};

  /// One dimension of at least `count` work-items in groups of `group` (rounded up: kernels check
  /// their id).
  static Range linear(std::size_t count, std::size_t group) {
    const std::size_t groups = (count + group - 1) / group;
    return Range{{groups * group, 1, 1}, {group, 1, 1}, {}};
  }
  /// Two dimensions, rounded up likewise.
  static Range plane(std::size_t width,
                     std::size_t height,
                     std::size_t group_width,
                     std::size_t group_height) {
    const auto up = [](std::size_t n, std::size_t g) { return (n + g - 1) / g * g; };
    return Range{
        {up(width, group_width), up(height, group_height), 1}, {group_width, group_height, 1}, {}};
  }
};

/// A compiled kernel bound to the queue of its context.
class Kernel {
 public:
  Kernel() = default;

  /// Sets the arguments in order and enqueues. Arguments are Buffer<T>, LocalMemory, trivially
  /// copyable values of exactly the kernel's parameter size, or packs of these. A global size of 0
  /// enqueues nothing.
  template <class... Arguments>
  void launch(const Range& range, const Arguments&... arguments) {
    begin((count_of<Arguments>::value + ... + 0u));
    unsigned index = 0;
    (set(index, arguments), ...);
    enqueue(range);
  }

  /// False for a default-constructed kernel.
  explicit operator bool() const { return impl_ != nullptr; }
  const std::string& name() const;
  std::size_t max_work_group_size() const;
  std::size_t argument_count() const;
  /// Number of subgroups of a work-group of `items` in a row, once the compiler has chosen their
  /// size; 0 where the device does not tell.
  std::size_t subgroups(std::size_t items) const;

  struct Impl;
  explicit Kernel(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

 private:
  template <class T>
  struct count_of : std::integral_constant<unsigned, 1> {};
  template <class... T>
  struct count_of<ArgumentPack<T...>> : std::integral_constant<unsigned, sizeof...(T)> {};

  template <class... T>
  void set(unsigned& index, const ArgumentPack<T...>& pack) {
    std::apply([&](const auto&... arguments) { (set(index, arguments), ...); }, pack.arguments);
  }
  template <class T>
  void set(unsigned& index, const Buffer<T>& buffer) {
    set_buffer(index++, buffer.raw(), ArgumentType::of<T>(ArgumentPlace::kBuffer));
  }
  template <class T>
  void set(unsigned& index, const BufferAs<T>& buffer) {
    set_buffer(index++, buffer.raw, ArgumentType::of<T>(ArgumentPlace::kBuffer));
  }
  void set(unsigned& index, const LocalMemory& memory) { set_local(index++, memory.bytes); }
  template <class T>
  void set(unsigned& index, const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
    set_value(index++, &value, ArgumentType::of<T>(ArgumentPlace::kValue));
  }
  void begin(std::size_t argument_count);
  void set_buffer(unsigned index, const RawBuffer& buffer, const ArgumentType& type);
  void set_local(unsigned index, std::size_t bytes);
  void set_value(unsigned index, const void* value, const ArgumentType& type);
  void set_bytes(unsigned index, const void* value, std::size_t bytes);
  void check(unsigned index, const ArgumentType& type);
  void enqueue(const Range& range);

  std::shared_ptr<Impl> impl_;
};

}  // namespace raysplats
