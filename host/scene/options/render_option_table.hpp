// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/scene.hpp"
#include "scene/options/given_options.hpp"
#include "scene/options/option_table.hpp"

namespace raysplats {

/// The brightest of lights, emission and surroundings.
constexpr double kMaxColor = 1e6;

/// How PathTracer draws, bound to `settings`: the same in [render] of scene files, on the command
/// line and as programs set it.
std::vector<OptionRow> render_option_rows(RenderSettings& settings);
/// [render.shadows].
std::vector<OptionRow> shadow_option_rows(ShadowSettings& settings);

/// Throws UsageError for a value that its row would refuse, as programs may set it.
void check_render_settings(RenderSettings settings);

/// Settings that a user gave, to go over those of a scene.
using GivenRenderSettings = GivenOptions<RenderSettings, render_option_rows>;

}  // namespace raysplats
