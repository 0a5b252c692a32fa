// SPDX-License-Identifier: Apache-2.0
// Types of raysplats/error.hpp as Python exceptions with the same sentences.
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>

#include "bindings.hpp"
#include "raysplats/error.hpp"

namespace raysplats::python {
namespace {

namespace nb = nanobind;

/// Exception types live as long as the process.
struct Types {
  PyObject* error = nullptr;
  PyObject* usage = nullptr;
  PyObject* data = nullptr;
  PyObject* device = nullptr;
  PyObject* resource = nullptr;
};
Types types;

PyObject* add(nb::module_& module, const char* name, const char* text, const nb::object& bases) {
  const std::string full = std::string("raysplats.") + name;
  PyObject* type = PyErr_NewExceptionWithDoc(full.c_str(), text, bases.ptr(), nullptr);
  if (type == nullptr) throw nb::python_error();
  module.attr(name) = nb::borrow(type);
  return type;
}

PyObject* type_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage:
      return types.usage;
    case ErrorCode::kData:
      return types.data;
    case ErrorCode::kDevice:
      return types.device;
    case ErrorCode::kMemory:
      return types.resource;
    case ErrorCode::kInterrupted:
      return PyExc_KeyboardInterrupt;
    case ErrorCode::kRuntime:
      break;
  }
  return types.error;
}

/// Raises an exception whose text may hold the bytes of a damaged file or of a name that is no
/// UTF-8.
void set_exception(PyObject* type, const char* text) {
  PyObject* message =
      PyUnicode_DecodeUTF8(text, static_cast<Py_ssize_t>(std::strlen(text)), "backslashreplace");
  if (message == nullptr) return;  // that there is no memory is raised already
  PyErr_SetObject(type, message);
  Py_DECREF(message);
}

constexpr const char* kNoMemory =
    "The host has no memory left: use fewer Gaussians or smaller pictures";

void translate(const std::exception_ptr& thrown, void*) {
  try {
    std::rethrow_exception(thrown);
  } catch (const Error& error) {
    set_exception(type_of(error.code()), error.what());
  } catch (const std::bad_alloc&) {
    PyErr_SetString(types.resource, kNoMemory);
  } catch (const std::length_error&) {  // of containers that no memory could hold
    PyErr_SetString(types.resource, kNoMemory);
  }
}

}  // namespace

void bind_errors(nb::module_& module) {
  const auto kind = [](PyObject* type) { return nb::borrow(type); };
  types.error = add(module, "Error", "Whatever raysplats raises; one sentence.",
                    nb::make_tuple(kind(PyExc_RuntimeError)));
  const nb::object base = kind(types.error);
  types.usage = add(module, "UsageError", "Arguments that make no sense.",
                    nb::make_tuple(base, kind(PyExc_ValueError)));
  types.data = add(module, "DataError", "A file or numbers that are missing or malformed.",
                   nb::make_tuple(base, kind(PyExc_ValueError)));
  types.device = add(module, "DeviceError", "An OpenCL call, a kernel or a device that failed.",
                     nb::make_tuple(base));
  types.resource = add(module, "ResourceError", "Memory that the device or the host does not have.",
                       nb::make_tuple(base, kind(PyExc_MemoryError)));
  nb::register_exception_translator(&translate);
}

}  // namespace raysplats::python
