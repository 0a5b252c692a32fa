// SPDX-License-Identifier: Apache-2.0
// std::array as a tuple of Python, in place of nanobind/stl/array.h, which makes lists: what is
// read is a copy, and an assignment to a number of it would change nothing and say nothing.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/detail/nb_array.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace nanobind::detail {

template <class T, std::size_t Size>
struct type_caster<std::array<T, Size>> : array_caster<std::array<T, Size>, T, Size> {
  using Base = array_caster<std::array<T, Size>, T, Size>;
  static constexpr auto Name = io_name("collections.abc.Sequence[", "tuple[") +
                               make_caster<T>::Name + io_name("]", ", ...]");
  template <class Source>
  static handle from_cpp(Source&& source, rv_policy policy, cleanup_list* cleanup) noexcept {
    const object list = steal(Base::from_cpp(std::forward<Source>(source), policy, cleanup));
    return list.is_valid() ? PyList_AsTuple(list.ptr()) : nullptr;
  }
};

}  // namespace nanobind::detail

namespace raysplats::python {

/// The same for lists of them.
template <class T>
nanobind::typed<nanobind::tuple, T, nanobind::ellipsis> tuple_of(const std::vector<T>& values) {
  return nanobind::tuple(nanobind::cast(values));
}

}  // namespace raysplats::python
