// cts_subset: every test drives Vulkan through the ordinary loader.
#include "cts_subset/tests/world.h"

#include <iostream>
#include <set>

namespace pumice::cts {
namespace {

std::unique_ptr<World> theWorld;
std::set<std::string> missed;

// In validated runs every message of the layer fails the test that caused it.
class ValidationListener : public testing::EmptyTestEventListener {
  void OnTestEnd(const testing::TestInfo&) override {
    if (!theWorld || !theWorld->instance) return;
    for (const std::string& message : theWorld->instance->takeMessages())
      ADD_FAILURE() << "validation: " << message;
  }
};

}  // namespace

World& world() {
  if (theWorld) return *theWorld;
  theWorld = std::make_unique<World>();
  World& w = *theWorld;
  try {
    w.instance = std::make_unique<VulkanInstance>(validationRequested());
    VkPhysicalDevice physical = w.instance->find(testedDeviceName());
    if (physical) {
      w.tested = std::make_unique<Device>(physical);
    } else {
      w.problem = "no device whose name starts with '" + testedDeviceName() + "' (manifest " +
                  pumiceManifest() + "); there are:";
      for (const std::string& name : w.instance->deviceNames()) w.problem += " " + name;
    }
    if (VkPhysicalDevice peer = w.instance->find(kLavapipeName)) w.peer = std::make_unique<Device>(peer);
  } catch (const std::exception& error) {
    w.problem = error.what();
  }
  return w;
}

void missPeer(const std::string& why) {
  if (missed.insert(why).second) std::cerr << why << "\n";
}
bool peerMissed() { return !missed.empty(); }

void endWorld() {
  if (!theWorld) return;
  theWorld->tested.reset();
  theWorld->peer.reset();
  theWorld->instance.reset();
  theWorld.reset();
}

}  // namespace pumice::cts

// ctest counts this exit status as skipped (SKIP_RETURN_CODE).
static constexpr int kSkipped = 77;

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  testing::FLAGS_gtest_death_test_style = "threadsafe";  // drivers have threads
  pumice::cts::selectDrivers();
  if (pumice::cts::validationRequested() && !pumice::cts::VulkanInstance::validationAvailable()) {
    std::cerr << "VK_LAYER_KHRONOS_validation is not installed (package "
                 "vulkan-validationlayers): nothing is validated\n";
    return pumice::cts::peersRequired() ? 1 : kSkipped;
  }
  if (pumice::cts::validationRequested())
    testing::UnitTest::GetInstance()->listeners().Append(new pumice::cts::ValidationListener);
  int status = RUN_ALL_TESTS();
  pumice::cts::endWorld();
  return status == 0 && pumice::cts::peerMissed() ? kSkipped : status;
}
