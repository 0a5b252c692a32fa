// SPDX-License-Identifier: Apache-2.0
// Steps are enqueued without waiting for the device to say how much room their views need. One that
// finds too little changes nothing, nor does any step behind it; when the host sees that, it goes
// back to that step and makes it again with the room that it needs. So parameters do not depend on
// the sizes of buffers.
#include "device/kernel_sample.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

// The host stays this far ahead at most: enough for the device never to run dry, few enough for a
// step that is made again and for a signal not to cost much.
constexpr std::size_t kMostAhead = 4;
constexpr std::int64_t kTimedEvery = 32;

}  // namespace

void Trainer::Impl::send_step() {
  collect_done(false);
  const std::int64_t begun = iteration;
  const std::int64_t optimiser_steps = adam.steps();
  const std::uint64_t rays = traced_rays;
  enqueue_step();
  await_sizes = false;
  sent.push_back({begun, optimiser_steps, rays, ReadBack(context, tracer.overflow(), 1)});
}

// A step now and then has its kernels timed, which tells of all of them and costs nothing that
// could be measured. Not the first: it finds out what the later ones know.
void Trainer::Impl::send_sampled_step() {
  if (iteration % kTimedEvery != kTimedEvery / 2) return send_step();
  const KernelSample sample(context);
  send_step();
  if (sample.alone()) ++timed_steps;
}

// Takes note of the steps that are done, of all of them with `all`. Goes back to the first one
// that had too little room.
void Trainer::Impl::collect_done(bool all) {
  while (!sent.empty()) {
    const SentStep& oldest = sent.front();
    if (!all && sent.size() <= kMostAhead && !oldest.overflow.ready()) return;
    if (oldest.overflow.words()[0] != 0) {
      rewind();
    } else {
      sent.pop_front();
    }
  }
}

// To the state that the device is in since the oldest step of `sent` found too little room.
void Trainer::Impl::rewind() {
  iteration = sent.front().iteration;
  adam.set_steps(sent.front().optimiser_steps);
  traced_rays = sent.front().traced_rays;
  pass_due = false;  // density control waits for all steps before it
  ++made_again;
  sent.clear();
  tracer.clear_overflow();
  await_sizes = true;
}

// Waits until all steps up to this iteration are done and count.
void Trainer::Impl::finish_steps() {
  const std::int64_t wanted = iteration;
  do {
    while (iteration < wanted) send_step();
    collect_done(true);
  } while (iteration < wanted);
}

// Waits for what is on its way and leaves out what would have to be made again.
void Trainer::Impl::drop_unfinished() {
  collect_done(true);
  context.finish();
}

}  // namespace raysplats
