// SPDX-License-Identifier: Apache-2.0
// Ranks that share a run hold the same model and make the same steps of it; of a step's views each
// traces its own. What the views say is added in the tree of their slots, which a rank alone uses
// as well, so that all of it is the same for every number of ranks.
#include <fmt/format.h>
#include <xxhash.h>

#include <array>
#include <cstring>
#include <string>

#include "raysplats/error.hpp"
#include "run/dataset_fingerprint.hpp"
#include "run/train_config.hpp"
#include "shared/train_layout.h"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

// What a rank says of its views in a step.
struct StepWord {
  std::uint64_t capped_rays;
  std::uint64_t reflected_rays;
  std::uint32_t mark;  // StepGuard::marked()
  std::uint32_t stop;  // whether it has been told to end the run
};

// And of one of them, where photos have exposures or poses.
struct SlotWord {
  PoseGradient pose_gradient;
  std::array<float, Exposure::kSums> exposure{};
};

}  // namespace

// The photos of this rank that come after a view, and what is known of their depths.
void Trainer::Impl::read_ahead(std::int64_t turn) {
  if (!reads_ahead) return;
  constexpr std::size_t kOthers = kReadAhead - 1;
  std::vector<std::size_t> own;
  std::vector<SizedView> sized;  // as they will be, also where the sizes change meanwhile
  const auto foresee = [&](std::size_t view, std::int64_t its_turn) {
    const int divisor = resolution_divisor(options, its_turn / options.views_per_step);
    const Camera& full = train_cameras[view];
    const Camera camera = divisor > 1 ? downscaled(full, divisor) : full;
    sized.push_back({view, camera.width, camera.height});
  };
  foresee(order.at(turn), turn);  // not yet asked for: depths come after the photo
  for (const std::size_t view : order.upcoming(kOthers * static_cast<std::size_t>(ranks.size()))) {
    const auto slot = static_cast<std::size_t>(++turn % options.views_per_step);
    if (!share.holds(slot) || own.size() == kOthers) continue;
    own.push_back(view);
    foresee(view, turn);
  }
  photo_cache.prefetch(own);
  if (!depths) return;
  depths->prefetch(sized);
}

// Adds what the views of a step say; one view needs no sum, and one rank waits for nothing. With
// several ranks false when a view of any had too little room: then all make their views again, and
// wait for the sizes.
bool Trainer::Impl::sum_views() {
  if (ranks.size() > 1) {
    sum.wait();
    StepWord sum_of_all{0, 0, 0, 0};
    for (const StepWord& word : ranks.all_gather(StepWord{
             guard.step_capped(), reflected_rays, guard.marked(), asked.stop_wished ? 1u : 0u})) {
      sum_of_all.capped_rays += word.capped_rays;
      sum_of_all.reflected_rays += word.reflected_rays;
      sum_of_all.mark |= word.mark;
      sum_of_all.stop |= word.stop;
    }
    guard.set_mark(sum_of_all.mark);
    if ((sum_of_all.mark & RS_GUARD_REPEATED) != 0) {
      guard.close(adam.refused(), gaussians.count);
      tracer.clear_overflow();
      await_sizes = true;
      ++made_again;
      return false;
    }
    guard.set_step_capped(sum_of_all.capped_rays);
    reflected_rays = sum_of_all.reflected_rays;
    asked.stop_agreed = sum_of_all.stop != 0;
    exchange_slots();
  }
  if (slots.size() > 1) sum.finish(gradients);
  return true;
}

// What a photo alone says of its exposure and its pose.
void Trainer::Impl::exchange_slots() {
  if (!exposure && !poses) return;
  std::vector<float> colors(Exposure::kSums * slots.size());
  if (exposure) exposure->sums().download(colors);
  std::string mine;
  for (std::size_t slot = share.first; slot < share.last; ++slot) {
    SlotWord word{slots[slot].pose_gradient, {}};
    std::copy_n(&colors[Exposure::kSums * slot], Exposure::kSums, word.exposure.begin());
    mine.append(reinterpret_cast<const char*>(&word), sizeof(word));
  }
  std::string all;
  for (const std::string& theirs : ranks.all_gather_texts(mine)) all += theirs;
  for (std::size_t slot = 0; slot < slots.size(); ++slot) {
    SlotWord word;
    std::memcpy(&word, &all.at(slot * sizeof(word)), sizeof(word));
    slots[slot].pose_gradient = word.pose_gradient;
    std::copy(word.exposure.begin(), word.exposure.end(), &colors[Exposure::kSums * slot]);
  }
  if (exposure) exposure->sums().upload(colors);
}

// Ranks whose data, options or models are not the same would drift apart without a word.
void Trainer::Impl::check_ranks_agree() {
  if (ranks.size() == 1) return;
  const std::string about = fingerprint + split_fingerprint(dataset) + to_toml(options);
  XXH64_hash_t hash = XXH64(about.data(), about.size(), 0);
  for_each_group(
      [&](ParameterGroup, const Buffer<float>& numbers) {
        const std::vector<float> values = numbers.download();
        hash = XXH64(values.data(), values.size() * sizeof(float), hash);
      },
      gaussians);
  const std::vector<std::uint64_t> all = ranks.all_gather(std::uint64_t{hash});
  for (std::size_t rank = 1; rank < all.size(); ++rank) {
    if (all[rank] == all[0]) continue;
    throw Error(ErrorCode::kRuntime,
                fmt::format("After iteration {} rank {} has another model than rank 0: give all "
                            "ranks the same data, options and program, and devices of one kind",
                            iteration, rank));
  }
}

// The rank of the last slot has traced it.
LastView Trainer::Impl::last_view() {
  const int last = ranks.size() - 1;
  LastView out;
  if (ranks.rank() == last) out = {loss.value(), tracer.statistics()};
  return ranks.broadcast_value(last, out);
}

}  // namespace raysplats
