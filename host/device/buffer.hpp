// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"

namespace raysplats {

class Context;

/// Untyped device memory; move-only. A size over the device's largest allocation throws
/// ResourceError, access outside the memory DeviceError. It may outlive its context, but is of no
/// use then.
class RawBuffer {
 public:
  RawBuffer() = default;
  RawBuffer(Context& context, std::size_t bytes, const std::string& label);
  RawBuffer(const RawBuffer&) = delete;
  RawBuffer& operator=(const RawBuffer&) = delete;
  RawBuffer(RawBuffer&&) = default;
  RawBuffer& operator=(RawBuffer&&) = default;

  std::size_t bytes() const { return bytes_; }
  bool empty() const { return impl_ == nullptr; }
  void write(const void* source, std::size_t bytes, std::size_t offset);  ///< blocks
  /// Enqueues; `source` is kept until it is read.
  void write_later(std::shared_ptr<const void> source, std::size_t bytes);
  void read(void* target, std::size_t bytes, std::size_t offset) const;  ///< blocks
  void fill(std::uint32_t pattern, std::size_t bytes, std::size_t offset);
  void copy_from(const RawBuffer& source,
                 std::size_t bytes,
                 std::size_t source_offset,
                 std::size_t offset);

  struct Impl;
  const Impl* impl() const { return impl_.get(); }

 private:
  Impl& checked() const;
  std::size_t bytes_ = 0;
  std::shared_ptr<Impl> impl_;
};

/// `size` elements of T on the device. Sizes and offsets are in elements. A size of 0 is allowed.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer() = default;
  Buffer(Context& context, std::size_t size, const std::string& label)
      : size_(size), raw_(context, bytes_for(size, label), label) {}

  std::size_t size() const { return size_; }

  /// Makes room for at least `size` elements; the content is lost when the buffer has to grow, and
  /// where that throws the buffer is left with a size of 0 and no memory.
  void ensure(Context& context, std::size_t size, const std::string& label) {
    if (raw_.empty() || raw_.bytes() < bytes_for(size, label)) {
      size_ = 0;
      raw_ = RawBuffer();  // the old memory goes first
      *this = Buffer(context, size, label);
    }
    size_ = size;
  }
  void upload(std::span<const T> source, std::size_t offset = 0) {
    if (!source.empty()) raw_.write(source.data(), source.size_bytes(), offset * sizeof(T));
  }
  /// The same, to the first elements, without waiting for the device.
  void upload_later(const std::shared_ptr<const std::vector<T>>& source) {
    if (!source->empty()) raw_.write_later({source, source->data()}, source->size() * sizeof(T));
  }
  void download(std::span<T> target, std::size_t offset = 0) const {
    if (!target.empty()) raw_.read(target.data(), target.size_bytes(), offset * sizeof(T));
  }
  std::vector<T> download() const {
    std::vector<T> out(size_);
    download(std::span<T>(out));
    return out;
  }
  T read(std::size_t index) const {
    T value;
    raw_.read(&value, sizeof(T), index * sizeof(T));
    return value;
  }
  /// Sets every 32-bit word of all elements to zero.
  void clear() { clear(size_); }
  /// Sets `count` elements from number `first` on to zero.
  void clear(std::size_t count, std::size_t first = 0) {
    static_assert(sizeof(T) % 4 == 0);
    if (count > 0) raw_.fill(0, count * sizeof(T), first * sizeof(T));
  }
  /// Sets every 32-bit word of all elements to `word`.
  void fill(std::uint32_t word) {
    static_assert(sizeof(T) % 4 == 0);
    if (size_ > 0) raw_.fill(word, size_ * sizeof(T), 0);
  }
  void copy_from(const Buffer& source,
                 std::size_t count,
                 std::size_t source_offset = 0,
                 std::size_t offset = 0) {
    if (count > 0)
      raw_.copy_from(source.raw_, count * sizeof(T), source_offset * sizeof(T), offset * sizeof(T));
  }
  const RawBuffer& raw() const { return raw_; }

 private:
  // A device buffer cannot be empty.
  static std::size_t bytes_for(std::size_t size, const std::string& label) {
    if (size > std::numeric_limits<std::size_t>::max() / sizeof(T)) {
      throw ResourceError("The buffer '" + label +
                          "' is larger than any memory: use fewer Gaussians");
    }
    return (size > 0 ? size : 1) * sizeof(T);
  }

  std::size_t size_ = 0;
  RawBuffer raw_;
};

}  // namespace raysplats
