// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "prepare/colmap_plan.hpp"
#include "prepare/prepare.hpp"
#include "prepare/work_folder.hpp"

/// What COLMAP does for a data set, as a plan says, one step after the other; each is done only
/// where it is due.
namespace raysplats {

/// Tells how long the steps that are due will take.
void tell_time(const ColmapPlan& plan, const WorkFolder& work);
/// Tells which photos are compared, where nobody has said it and the number of photos decides.
void tell_matching(const PrepareOptions& options, const ColmapPlan& plan, const WorkFolder& work);

void find_features(const PrepareOptions& options, const ColmapPlan& plan, WorkFolder& work);
void match_photos(const ColmapPlan& plan, WorkFolder& work);
/// Throws DataError where no pose is found.
void place_photos(const ColmapPlan& plan, WorkFolder& work);

}  // namespace raysplats
