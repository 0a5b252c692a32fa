// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

namespace raysplats::python {

namespace nb = nanobind;

/// What a caller gave for an array of float32 or uint32; nothing is checked or converted yet.
struct FloatArray {
  nb::object value;
};
struct IndexArray {
  nb::object value;
};

/// Arrays that are handed out: views of an object's own memory, which keep the object alive.
using FloatView = nb::ndarray<nb::numpy, float>;
using DoubleView = nb::ndarray<nb::numpy, double>;
using IndexView = nb::ndarray<nb::numpy, std::uint32_t>;

/// Any length in a Shape.
constexpr std::ptrdiff_t kAny = -1;
using Shape = std::vector<std::ptrdiff_t>;

/// The numbers of an array, where they are, for as long as this lives.
template <class T>
struct Numbers {
  std::span<const T> values;
  std::vector<std::size_t> shape;
  nb::ndarray<nb::ro> keeper;

  std::vector<T> copy() const { return {values.begin(), values.end()}; }
};

/// Throws TypeError for what is no array of that type, UsageError for one that lies elsewhere than
/// in the host's memory, is not C-contiguous or has another shape; never copies. `name` is the
/// argument's in messages.
Numbers<float> numbers(const FloatArray& array, const char* name, const Shape& shape);
Numbers<std::uint32_t> numbers(const IndexArray& array, const char* name, const Shape& shape);

/// A view of what `owner` holds; strides count elements, none means C order.
template <class T>
nb::ndarray<nb::numpy, T> view(nb::handle owner,
                               T* data,
                               std::initializer_list<std::size_t> shape,
                               std::initializer_list<std::int64_t> strides = {}) {
  return nb::ndarray<nb::numpy, T>(data, shape, owner, strides);
}

/// Throws AttributeError unless `given` is the array that `self` has as `name`.
void require_own_view(nb::handle self, const char* name, nb::handle given);

/// The setter of a view: `thing.name += 1` writes into it and then sets what is there already.
inline auto set_view(const char* name) {
  return [name](nb::handle self, nb::handle given) { require_own_view(self, name, given); };
}

/// An array that owns `values`.
FloatView array_of(std::vector<float> values, std::initializer_list<std::size_t> shape);

}  // namespace raysplats::python

namespace nanobind::detail {

// Both take whatever is given, so that numbers() can say in one sentence what is wrong with it.

template <>
struct type_caster<raysplats::python::FloatArray> {
  NB_TYPE_CASTER(raysplats::python::FloatArray, const_name("numpy.typing.NDArray[numpy.float32]"))
  bool from_python(handle source, std::uint32_t, cleanup_list*) noexcept {
    value.value = borrow(source);
    return true;
  }
  static handle from_cpp(const raysplats::python::FloatArray& source,
                         rv_policy,
                         cleanup_list*) noexcept {
    return source.value.inc_ref();
  }
};

template <>
struct type_caster<raysplats::python::IndexArray> {
  NB_TYPE_CASTER(raysplats::python::IndexArray, const_name("numpy.typing.NDArray[numpy.uint32]"))
  bool from_python(handle source, std::uint32_t, cleanup_list*) noexcept {
    value.value = borrow(source);
    return true;
  }
  static handle from_cpp(const raysplats::python::IndexArray& source,
                         rv_policy,
                         cleanup_list*) noexcept {
    return source.value.inc_ref();
  }
};

}  // namespace nanobind::detail
