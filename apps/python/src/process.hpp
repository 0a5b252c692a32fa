// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

#include <memory>
#include <type_traits>
#include <utility>

namespace raysplats::python {

/// Marks this process as the one that uses OpenCL. Throws UsageError when its parent already does:
/// a driver's threads and queues do not outlive a fork.
void require_own_process();
/// Whether this process came by a fork out of the one that uses OpenCL.
bool is_forked();

/// An object with OpenCL behind it. It may be used by the process that made it alone, and a child
/// by fork leaves it alone when it goes: the driver would wait for threads that are not there.
/// Made and taken down without the interpreter's lock, because both may wait for threads that want
/// it.
template <class T>
class Held {
 public:
  template <class... Arguments>
  requires std::is_constructible_v<T, Arguments...>
  explicit Held(Arguments&&... arguments) {
    require_own_process();
    const nanobind::gil_scoped_release release;
    object_ = std::make_unique<T>(std::forward<Arguments>(arguments)...);
  }
  ~Held() {
    if (is_forked()) {
      static_cast<void>(object_.release());
      return;
    }
    const nanobind::gil_scoped_release release;
    object_.reset();
  }
  Held(const Held&) = delete;
  Held& operator=(const Held&) = delete;

  T& operator*() const {
    require_own_process();
    return *object_;
  }
  T* operator->() const { return &**this; }

 private:
  std::unique_ptr<T> object_;
};

}  // namespace raysplats::python
