// What large arenas share: pieces of huge pages, which go from one to another when they are reset.
#pragma once

#include <cstddef>

namespace pumice::base {

//! Gives back to the system what no arena uses. Otherwise up to 48 MiB stay for what comes next.
void trimArenaSlices();
//! Bytes taken from the system for slices, in use or not.
size_t arenaSlicesFootprint();

}  // namespace pumice::base
