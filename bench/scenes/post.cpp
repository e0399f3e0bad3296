// Post-processing of a full screen: what is bright, blurred both ways at half size, added and tone mapped.
#include "bench/scenes/passes.h"
#include "bench/scenes/resources.h"

namespace pumice::bench {
namespace {

Options fullHd(const Options& options) {
  Options sized = options;
  if (options.width == Options().width && options.height == Options().height) sized.width = 1920, sized.height = 1080;
  return sized;
}

struct Post : DrawScene {
  static constexpr VkFormat kHdr = VK_FORMAT_R16G16B16A16_SFLOAT;
  struct Step {
    Target* target;
    Pipeline pipeline;
    cts::DescriptorSet set;
    uint32_t width, height;
  };
  Target scene, bright, blurred;
  std::vector<Step> steps;
  Buffer unused;

  Post(Device& d, const Options& given)
      : DrawScene(d, fullHd(given)),
        scene(makeTarget(canvas, canvas.size().x, canvas.size().y, kHdr)),
        bright(makeTarget(canvas, canvas.size().x / 2, canvas.size().y / 2, kHdr)),
        blurred(makeTarget(canvas, canvas.size().x / 2, canvas.size().y / 2, kHdr)) {
    unused = canvas.buffer(64, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    SamplerSpec clamped;
    clamped.address = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    VkSampler sampler = makeSampler(canvas, clamped);
    VkImageView picture = canvas.view(mippedTexture(canvas, 1024, patternTexel, false));
    auto add = [&](Target* target, std::vector<VkImageView> inputs, const std::string& body) {
      std::vector<cts::Binding> bindings;
      for (VkImageView input : inputs) bindings.push_back(sampledImage(input, sampler));
      Step step{target, {}, canvas.descriptors(bindings), canvas.size().x, canvas.size().y};
      if (target) step.width = target->image.spec.extent.width, step.height = target->image.spec.extent.height;
      PipelineSpec spec;
      spec.vertex = kFullScreenVertex;
      spec.bindings = {{0, 4, VK_VERTEX_INPUT_RATE_VERTEX}};
      spec.sets = {step.set.layout};
      spec.fragment = "#version 450\nlayout(location = 0) in vec2 place;\nlayout(location = 0) out vec4 colour;\n";
      for (size_t i = 0; i < inputs.size(); ++i)
        spec.fragment += "layout(set = 0, binding = " + std::to_string(i) + ") uniform sampler2D image" + std::to_string(i) + ";\n";
      spec.fragment += body;
      if (target)
        spec.adjust = [target](cts::PipelineStates& states) { states.renderPass = target->pass; };
      step.pipeline = pipeline(spec);
      steps.push_back(step);
    };
    auto blur = [](const char* direction) {
      return std::string("void main() {\n  vec2 d = vec2(") + direction + R"() / vec2(textureSize(image0, 0));
  const float weights[5] = float[](0.227, 0.195, 0.122, 0.054, 0.016);
  vec4 sum = texture(image0, place) * weights[0];
  for (int i = 1; i < 5; ++i) sum += (texture(image0, place + d * float(i)) + texture(image0, place - d * float(i))) * weights[i];
  colour = sum;
}
)";
    };
    add(&scene, {picture}, "void main() { vec4 c = texture(image0, place); colour = c * c * 4.0; }\n");
    add(&bright, {scene.view},
        "void main() { vec4 c = texture(image0, place); colour = max(c - 1.0, 0.0); }\n");
    add(&blurred, {bright.view}, blur("1.0, 0.0"));
    add(&bright, {blurred.view}, blur("0.0, 1.0"));
    add(nullptr, {scene.view, bright.view}, R"(
void main() {
  vec3 c = texture(image0, place).rgb + texture(image1, place).rgb;
  c = clamp(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14), 0.0, 1.0);
  colour = vec4(pow(c, vec3(1.0 / 2.2)), 1.0);
}
)");
  }
  void drawStep(VkCommandBuffer commands, const Step& step) {
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, step.pipeline.handle);
    VkDeviceSize offset = 0;
    vkCmdBindVertexBuffers(commands, 0, 1, &unused.handle, &offset);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, step.pipeline.layout, 0, 1, &step.set.handle, 0,
                            nullptr);
    vkCmdDraw(commands, 3, 1, 0, 0);
  }
  void before(VkCommandBuffer commands) override {
    for (const Step& step : steps) {
      if (!step.target) continue;
      beginPass(commands, step.target->pass, step.target->framebuffer, step.width, step.height, {clearColour(0, 0, 0, 0)});
      drawStep(commands, step);
      vkCmdEndRenderPass(commands);
    }
  }
  void draw(VkCommandBuffer commands) override { drawStep(commands, steps.back()); }
};

}  // namespace

void addPostScenes(SceneTable& table) {
  table.push_back({"post_processing", "1920x1080: bright, blur both ways, tone map", makeScene<Post>});
}

}  // namespace pumice::bench
