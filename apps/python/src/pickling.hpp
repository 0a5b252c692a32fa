// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/tuple.h>

#include <new>
#include <tuple>

namespace raysplats::python {

namespace nb = nanobind;

/// Lets a record be pickled and copied by members, which are all that it has.
template <class Record, class... Members>
void def_pickling(nb::class_<Record>& type, Members Record::*... members) {
  type.def("__getstate__",
           [members...](const Record& self) { return std::tuple<Members...>(self.*members...); })
      .def(
          "__setstate__",
          [members...](Record& self, const std::tuple<Members...>& state) {
            new (&self) Record{};
            std::tie(self.*members...) = state;
          },
          nb::arg("state"));
}

}  // namespace raysplats::python
