// Scenes of filling: nothing, a clear, one triangle, layers over layers.
#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

struct EmptySubmit : Scene {
  EmptySubmit(Device& device, const Options&) : Scene(device) {}
  void frame() override { submit(0); }
};

struct Clear : DrawScene {
  Clear(Device& device, const Options& options) : DrawScene(device, options) {}
  void draw(VkCommandBuffer) override {}
  Work work() const override { return {double(canvas.size().x) * canvas.size().y * 4, 0}; }
};

struct FullScreenTriangle : DrawScene {
  Pipeline shaded;
  Buffer vertices;
  FullScreenTriangle(Device& device, const Options& options) : DrawScene(device, options) {
    PipelineSpec spec;
    useSmallVertices(spec);
    shaded = pipeline(spec);
    const std::vector<SmallVertex> three{
        {-1, -1, 0.5f, 0xff0000ff}, {3, -1, 0.5f, 0xff00ff00}, {-1, 3, 0.5f, 0xffff0000}};
    vertices = canvas.bufferOf(three, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void draw(VkCommandBuffer commands) override {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &vertices.handle, &offset);
    vkCmdDraw(commands, 3, 1, 0, 0);
  }
};

enum class Order { kFrontToBack, kBackToFront, kBlended };

// Layers of two triangles each over the whole screen, one draw each.
template <Order order, VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT>
struct Layers : DrawScene {
  Pipeline shaded;
  Buffer vertices;
  uint32_t layers;
  Layers(Device& device, const Options& options)
      : DrawScene(device, options, order == Order::kBlended ? VK_FORMAT_UNDEFINED : VK_FORMAT_D32_SFLOAT, samples),
        layers(options.amount ? uint32_t(options.amount) : 50) {
    PipelineSpec spec;
    useSmallVertices(spec);
    if (order == Order::kBlended) {
      VkPipelineColorBlendAttachmentState over{};
      over.blendEnable = VK_TRUE;
      over.srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
      over.dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
      over.srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
      over.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
      spec.blend = over;
    } else {
      spec.depthTest = spec.depthWrite = true;
    }
    shaded = pipeline(spec);
    std::vector<SmallVertex> corners;
    Random random(7);
    for (uint32_t layer = 0; layer < layers; ++layer) {
      float step = (float(layer) + 1) / float(layers + 1);
      float z = order == Order::kBackToFront ? 1 - step : step;
      auto corner = [&](float x, float y) {
        corners.push_back({x, y, z, (random.word() & 0xffffff) | (order == Order::kBlended ? 0x30000000u : 0xff000000u)});
      };
      corner(-1, -1), corner(1, -1), corner(-1, 1), corner(-1, 1), corner(1, -1), corner(1, 1);
    }
    vertices = canvas.bufferOf(corners, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  }
  void draw(VkCommandBuffer commands) override {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shaded.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &vertices.handle, &offset);
    for (uint32_t layer = 0; layer < layers; ++layer) vkCmdDraw(commands, 6, 1, layer * 6, 0);
  }
};

}  // namespace

void addFillScenes(SceneTable& table) {
  table.push_back({"empty_submit", "a submission of nothing, and its fence", makeScene<EmptySubmit>});
  table.push_back({"clear", "a pass that only clears", makeScene<Clear>, Limit::kFill});
  table.push_back({"full_screen_triangle", "one triangle over the screen, interpolated colour", makeScene<FullScreenTriangle>});
  table.push_back({"layers_front_to_back", "50 opaque layers, nearest first", makeScene<Layers<Order::kFrontToBack>>});
  table.push_back({"layers_back_to_front", "50 opaque layers, nearest last", makeScene<Layers<Order::kBackToFront>>});
  table.push_back({"layers_blended", "50 layers, each blended over the ones before", makeScene<Layers<Order::kBlended>>});
  table.push_back({"layers_blended_msaa4", "the same at 4 samples", makeScene<Layers<Order::kBlended, VK_SAMPLE_COUNT_4_BIT>>});
}

}  // namespace pumice::bench
