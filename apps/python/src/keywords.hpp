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
inline void set_all(nb::handle self, const char* what, const nb::dict& values) {
  for (const auto& [key, value] : values) {
    if (!nb::hasattr(self, key)) {
      throw UsageError(fmt::format("{} has no attribute '{}'", what, nb::cast<std::string>(key)));
    }
    nb::setattr(self, key, value);
  }
}

/// The attributes that can be set, by name.
inline nb::dict settable(nb::handle self) {
  nb::dict out;
  for (const nb::handle name : nb::module_::import_("builtins").attr("dir")(self.type())) {
    const nb::object attribute = self.type().attr(name);
    if (PyObject_TypeCheck(attribute.ptr(), &PyProperty_Type) &&
        !attribute.attr("fset").is_none()) {
      out[name] = self.attr(name);
    }
  }
  return out;
}

/// An __init__ of a record whose keywords are its attributes, which are all that it has: copies and
/// pickles are made of them.
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
  type.def("__getstate__", [](nb::handle_t<Record> self) { return settable(self); })
      .def(
          "__setstate__",
          [name](nb::handle_t<Record> self, const nb::dict& state) {
            new (nb::inst_ptr<Record>(self)) Record{};
            nb::inst_mark_ready(self);
            set_all(self, name, state);
          },
          nb::arg("state"));
}

}  // namespace raysplats::python
