// One dispatch over one buffer.
#pragma once

#include <functional>

#include "tests/icd/driver.h"

namespace pumice::icd::test {

//! Set 0, binding 0 is a storage buffer, the first 4096 bytes of which are zero; while `finish` runs `words` points to it. `finish`
//! is given the command buffer, still open.
void dispatch(TestDevice& device, const std::vector<uint32_t>& spirv, uint32_t groups, const std::function<void(TestDevice&, VkCommandBuffer)>& finish,
              VkDeviceSize bytes = 4096, uint32_t** words = nullptr);

}  // namespace pumice::icd::test
