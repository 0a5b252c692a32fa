// SPDX-License-Identifier: Apache-2.0
// Seconds of a frame by the C++ API: frame_times MODEL WIDTH HEIGHT reads "forward" or "backward"
// (both passes) from each line of its input and answers with the seconds that it took, so that
// scripts/bench/python_overhead.py can take turns with it.
#include <chrono>
#include <cstdio>
#include <iostream>
#include <string>

#include "raysplats/context.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/tracer.hpp"

int main(int argc, char** argv) {
  using namespace raysplats;
  if (argc != 4) {
    std::fputs("usage: frame_times MODEL WIDTH HEIGHT\n", stderr);
    return 2;
  }
  try {
    const int width = std::stoi(argv[2]), height = std::stoi(argv[3]);
    Context context(select_device(""));
    const Model model(context, read_ply(argv[1]));
    Tracer tracer(context);
    const Camera camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, width, height, 1.0 * width);
    Image ones(width, height, 4);
    ones.data.assign(ones.data.size(), 1.0f);
    for (std::string pass; std::getline(std::cin, pass);) {
      const bool both = pass == "backward";
      const auto begin = std::chrono::steady_clock::now();
      const Image picture = tracer.render(model, camera, both);
      if (both) tracer.backward(model, ones);
      const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
      std::cout << seconds.count() << std::endl;
    }
    return 0;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.exit_code();
  }
}
