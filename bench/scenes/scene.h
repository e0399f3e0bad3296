// A scene to measure: what is set up once, and the frame that is drawn again and again.
//
// One process renders one scene on one driver, so that the time to the first frame and the peak of memory are that
// driver's own. Everything goes through the loader, as in any application.
#pragma once

#include "cts_subset/harness/canvas.h"

#include <memory>
#include <string>
#include <vector>

namespace pumice::bench {

using cts::Buffer;
using cts::Canvas;
using cts::Device;
using cts::Image;
using cts::Picture;
using cts::Pipeline;
using cts::PipelineSpec;

struct Options {
  uint32_t width = 1280, height = 720;
  VkInstance instance = VK_NULL_HANDLE;  // for windows
  uint64_t amount = 0;  // of the scene's own measure (triangles, draws, elements); 0: its usual number
};

// What a frame needs at least, for the share of the machine's limit.
struct Work {
  double bytes = 0;  // read and written
  double flops = 0;  // a fused multiply-add counts twice
};

class Scene {
 public:
  explicit Scene(Device& device);
  virtual ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Records, submits and waits, unless a scene does otherwise.
  virtual void frame();
  // What the scene makes, to compare drivers and settings: a picture, or the bytes of a buffer as one.
  virtual Picture picture() { return {}; }
  virtual Work work() const { return {}; }

 protected:
  virtual void record(VkCommandBuffer) {}
  void submit(uint32_t buffers);

  Device& device;
  VkCommandPool pool = VK_NULL_HANDLE;
  VkCommandBuffer commands = VK_NULL_HANDLE;
  VkFence fence = VK_NULL_HANDLE;
};

// Draws into one pass on a canvas.
class DrawScene : public Scene {
 public:
  DrawScene(Device& device, const Options& options, VkFormat depth = VK_FORMAT_UNDEFINED,
            VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT);
  Picture picture() override;

 protected:
  void record(VkCommandBuffer commands) override;
  virtual void before(VkCommandBuffer) {}  // outside the pass
  virtual void draw(VkCommandBuffer commands) = 0;
  // With the shaders from the cache.
  Pipeline pipeline(const PipelineSpec& spec);

  Canvas canvas;
  bool hasDepth;
};

void beginPass(VkCommandBuffer commands, VkRenderPass pass, VkFramebuffer target, uint32_t width, uint32_t height,
               const std::vector<VkClearValue>& clears);
VkClearValue clearColour(float r, float g, float b, float a);
VkClearValue clearDepth(float depth);

// What a scene is limited by where it is done as well as can be.
enum class Limit { kNone, kFill, kLargeFill, kCopy, kArithmetic };

struct SceneEntry {
  const char* name;
  const char* what;
  std::unique_ptr<Scene> (*make)(Device&, const Options&);
  Limit limit = Limit::kNone;
  bool window = false;  // needs an X server
  bool once = false;    // only the first frame counts, as what it measures is kept by drivers
};

template <class T>
std::unique_ptr<Scene> makeScene(Device& device, const Options& options) {
  return std::make_unique<T>(device, options);
}

using SceneTable = std::vector<SceneEntry>;
const SceneTable& allScenes();
void addFillScenes(SceneTable& table);
void addTriangleScenes(SceneTable& table);
void addTexturedScenes(SceneTable& table);
void addShadingScenes(SceneTable& table);
void addLightingScenes(SceneTable& table);
void addPostScenes(SceneTable& table);
void addComputeScenes(SceneTable& table);
void addCopyScenes(SceneTable& table);
void addPresentScenes(SceneTable& table);

}  // namespace pumice::bench
