// The two devices that all tests of this program share.
#pragma once

#include "cts_subset/harness/vulkan_context.h"

#include <gtest/gtest.h>

#include <memory>

namespace pumice::cts {

struct World {
  std::unique_ptr<VulkanInstance> instance;
  std::unique_ptr<Device> tested;  // null when the driver does not load
  std::unique_ptr<Device> peer;    // null when lavapipe is not installed
  std::string problem;             // why `tested` is null
};

// Made on first use, gone before main() returns.
World& world();
void endWorld();

// Says once that there was nothing to compare with. The program then ends as skipped instead of passed.
void missPeer(const std::string& why);
bool peerMissed();

}  // namespace pumice::cts

// A missing Pumice is always a failure.
#define PUMICE_NEED_TESTED()                                                  \
  do {                                                                        \
    if (!pumice::cts::world().tested) FAIL() << pumice::cts::world().problem; \
  } while (false)

// What another driver or program is missing for skips the test, or fails it under PUMICE_REQUIRE_PEERS=1.
#define PUMICE_MISS_PEER(why)                                                              \
  do {                                                                                     \
    const std::string text = (why);                                                        \
    if (pumice::cts::peersRequired()) FAIL() << text << ", and PUMICE_REQUIRE_PEERS is set"; \
    pumice::cts::missPeer(text);                                                           \
    GTEST_SKIP() << text;                                                                  \
  } while (false)

#define PUMICE_NEED_PEER()                                                                                       \
  do {                                                                                                           \
    if (!pumice::cts::world().peer)                                                                              \
      PUMICE_MISS_PEER("lavapipe is not installed (package mesa-vulkan-drivers): nothing to compare with");      \
  } while (false)
