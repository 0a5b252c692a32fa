// SPDX-License-Identifier: Apache-2.0
#include "arrays.hpp"

#include <fmt/format.h>
#include <nanobind/stl/string.h>

#include <memory>
#include <utility>

#include "raysplats/error.hpp"

namespace raysplats::python {
namespace {

std::string dtype_name(nb::dlpack::dtype type) {
  const auto code = static_cast<nb::dlpack::dtype_code>(type.code);
  const char* kind = code == nb::dlpack::dtype_code::Float     ? "float"
                     : code == nb::dlpack::dtype_code::Int     ? "int"
                     : code == nb::dlpack::dtype_code::UInt    ? "uint"
                     : code == nb::dlpack::dtype_code::Bool    ? "bool"
                     : code == nb::dlpack::dtype_code::Complex ? "complex"
                                                               : "other numbers of ";
  return fmt::format("{}{}", kind, type.bits);
}

template <class Lengths>
std::string shape_text(const Lengths& shape) {
  std::string out;
  char letter = 'N';
  for (const auto length : shape) {
    if (!out.empty()) out += ", ";
    out += static_cast<std::ptrdiff_t>(length) == kAny ? std::string(1, letter++)
                                                       : fmt::format("{}", length);
  }
  return fmt::format("({}{})", out, shape.size() == 1 ? "," : "");
}

bool fits(const nb::ndarray<nb::ro>& array, const Shape& shape) {
  if (array.ndim() != shape.size()) return false;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    if (shape[i] != kAny && static_cast<std::size_t>(shape[i]) != array.shape(i)) return false;
  }
  return true;
}

// An axis of one element may have any stride, and so may all axes of an array without elements.
bool is_contiguous(const nb::ndarray<nb::ro>& array) {
  std::int64_t expected = 1;
  bool empty = false;
  bool ordered = true;
  for (std::size_t i = array.ndim(); i-- > 0;) {
    ordered = ordered && (array.shape(i) == 1 || array.stride(i) == expected);
    expected *= static_cast<std::int64_t>(array.shape(i));
    empty = empty || array.shape(i) == 0;
  }
  return ordered || empty;
}

[[noreturn]] void fail_not_contiguous(const char* name) {
  throw UsageError(
      fmt::format("{} is not C-contiguous: make it so, as by numpy.ascontiguousarray", name));
}

/// Throws for arrays of numpy that cannot be handed over: by a type or an order of bytes that
/// others do not know, or because rows are no whole number of elements apart, as in packed records.
void require_known_layout(const nb::object& given, const char* name, const std::string& wanted) {
  const nb::object type = nb::getattr(given, "dtype", nb::none());
  if (!nb::hasattr(type, "isnative")) return;
  const bool native = nb::cast<bool>(type.attr("isnative"));
  if (!native || !type.equal(nb::str(wanted.c_str()))) {
    throw nb::type_error(fmt::format("{} is an array of {}{}, but {} is needed: convert it, as by "
                                     "astype(numpy.{})",
                                     name, nb::cast<std::string>(nb::str(type)),
                                     native ? "" : ", whose bytes are in another order", wanted,
                                     wanted)
                             .c_str());
  }
  fail_not_contiguous(name);
}

template <class T>
Numbers<T> checked(const nb::object& given, const char* name, const Shape& shape) {
  const std::string wanted = dtype_name(nb::dtype<T>());
  nb::ndarray<nb::ro> array;
  if (!nb::try_cast(given, array, false)) {
    require_known_layout(given, name, wanted);
    const std::string type = nb::cast<std::string>(nb::str(given.type().attr("__name__")));
    throw nb::type_error(
        fmt::format("{} has to be an array of {} of the shape {}, as numpy's, not {}{}", name,
                    wanted, shape_text(shape), type,
                    type == "Tensor" ? ": call detach() on a tensor that records gradients" : "")
            .c_str());
  }
  if (array.dtype() != nb::dtype<T>()) {
    throw nb::type_error(fmt::format("{} is an array of {}, but {} is needed: convert it, as by "
                                     "astype(numpy.{})",
                                     name, dtype_name(array.dtype()), wanted, wanted)
                             .c_str());
  }
  if (array.device_type() != nb::device::cpu::value) {
    throw UsageError(fmt::format("{} lies in the memory of a device: bring it to the CPU", name));
  }
  std::vector<std::size_t> lengths(array.ndim());
  for (std::size_t i = 0; i < lengths.size(); ++i) lengths[i] = array.shape(i);
  if (!fits(array, shape)) {
    throw UsageError(fmt::format("{} has the shape {}, but {} is needed", name, shape_text(lengths),
                                 shape_text(shape)));
  }
  if (!is_contiguous(array)) fail_not_contiguous(name);
  const auto* data = static_cast<const T*>(array.data());
  const std::span<const T> values(data, array.size());
  return {values, std::move(lengths), std::move(array)};
}

}  // namespace

Numbers<float> numbers(const FloatArray& array, const char* name, const Shape& shape) {
  return checked<float>(array.value, name, shape);
}

Numbers<std::uint32_t> numbers(const IndexArray& array, const char* name, const Shape& shape) {
  return checked<std::uint32_t>(array.value, name, shape);
}

void require_own_view(nb::handle self, const char* name, nb::handle given) {
  // Where the numbers are, their type, shape and strides.
  constexpr const char* kPlace = "__array_interface__";
  const nb::object place = nb::getattr(self.attr(name), kPlace, nb::none());
  if (!place.is_none() && place.equal(nb::getattr(given, kPlace, nb::none()))) return;
  throw nb::attribute_error(
      fmt::format("{} cannot be replaced: write into it, as by {}[:] = values", name, name)
          .c_str());
}

FloatView array_of(std::vector<float> values, std::initializer_list<std::size_t> shape) {
  auto held = std::make_unique<std::vector<float>>(std::move(values));
  float* data = held->data();
  const nb::capsule owner(held.release(), [](void* vector) noexcept {
    delete static_cast<std::vector<float>*>(vector);
  });
  return FloatView(data, shape, owner);
}

}  // namespace raysplats::python
