// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <string>

#include "raysplats/error.hpp"

namespace raysplats::python {

namespace nb = nanobind;

/// Sets attributes, whose setters check types and names; `what` is the type in messages.
inline void set_all(nb::handle self, const char* what, const nb::kwargs& values) {
  for (const auto& [key, value] : values) {
    if (!nb::hasattr(self, key)) {
      throw UsageError(fmt::format("{} has no attribute '{}'", what, nb::cast<std::string>(key)));
    }
    nb::setattr(self, key, value);
  }
}

/// An __init__ of a record whose keywords are its attributes.
template <class Record>
void def_keywords(nb::class_<Record>& type, const char* name) {
  type.def(
      "__init__",
      [name](nb::handle_t<Record> self, const nb::kwargs& values) {
        new (nb::inst_ptr<Record>(self)) Record{};
        nb::inst_mark_ready(self);
        set_all(self, name, values);
      },
      nb::sig("def __init__(self, **attributes: object) -> None"));
}

}  // namespace raysplats::python
