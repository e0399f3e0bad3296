// Render passes: subpasses with input attachments, feedback within a subpass, layers and slices as attachments, partial render areas.
#include <cmath>

#include "cts_subset/harness/scene.h"

namespace pumice::cts {
namespace {

constexpr uint32_t kSize = 256;

VkAttachmentDescription attachment(VkFormat format, VkAttachmentLoadOp load, VkAttachmentStoreOp store, VkImageLayout before, VkImageLayout after,
                                   VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT) {
  VkAttachmentDescription a{};
  a.format = format;
  a.samples = samples;
  a.loadOp = load;
  a.storeOp = store;
  a.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  a.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  a.initialLayout = before;
  a.finalLayout = after;
  return a;
}

struct SubpassSpec {
  std::vector<VkAttachmentReference> colours, inputs;
  std::optional<VkAttachmentReference> depth;
};

VkRenderPass renderPass(Workspace& work, const std::vector<VkAttachmentDescription>& attachments, const std::vector<SubpassSpec>& specs,
                        bool selfDependency = false) {
  std::vector<VkSubpassDescription> subpasses;
  for (const SubpassSpec& s : specs) {
    VkSubpassDescription d{};
    d.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
    d.colorAttachmentCount = uint32_t(s.colours.size());
    d.pColorAttachments = s.colours.data();
    d.inputAttachmentCount = uint32_t(s.inputs.size());
    d.pInputAttachments = s.inputs.data();
    d.pDepthStencilAttachment = s.depth ? &*s.depth : nullptr;
    subpasses.push_back(d);
  }
  std::vector<VkSubpassDependency> dependencies;
  auto depend = [&](uint32_t from, uint32_t to, VkPipelineStageFlags before, VkPipelineStageFlags after, VkAccessFlags source, VkAccessFlags target) {
    dependencies.push_back({from, to, before, after, source, target, from == VK_SUBPASS_EXTERNAL || to == VK_SUBPASS_EXTERNAL ? VkDependencyFlags(0) : VkDependencyFlags(VK_DEPENDENCY_BY_REGION_BIT)});
  };
  const VkAccessFlags kAll = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  depend(VK_SUBPASS_EXTERNAL, 0, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT, kAll, kAll);
  for (uint32_t i = 0; i + 1 < subpasses.size(); ++i)
    depend(i, i + 1, VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT,
           VK_ACCESS_INPUT_ATTACHMENT_READ_BIT);
  if (selfDependency)
    depend(0, 0, VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT,
           VK_ACCESS_INPUT_ATTACHMENT_READ_BIT);
  depend(uint32_t(subpasses.size()) - 1, VK_SUBPASS_EXTERNAL, VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, kAll, kAll);
  VkRenderPassCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO;
  info.attachmentCount = uint32_t(attachments.size());
  info.pAttachments = attachments.data();
  info.subpassCount = uint32_t(subpasses.size());
  info.pSubpasses = subpasses.data();
  info.dependencyCount = uint32_t(dependencies.size());
  info.pDependencies = dependencies.data();
  return work.make(info);
}

void begin(VkCommandBuffer commands, VkRenderPass pass, VkFramebuffer target, const VkRect2D& area, const std::vector<VkClearValue>& clears) {
  VkRenderPassBeginInfo info{};
  info.sType = VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO;
  info.renderPass = pass;
  info.framebuffer = target;
  info.renderArea = area;
  info.clearValueCount = uint32_t(clears.size());
  info.pClearValues = clears.data();
  vkCmdBeginRenderPass(commands, &info, VK_SUBPASS_CONTENTS_INLINE);
  setViewport(commands, 0, 0, float(kSize), float(kSize));
  setScissor(commands, area.offset.x, area.offset.y, area.extent.width, area.extent.height);
}

// A piece of an RGBA8 image in TRANSFER_SRC layout.
struct Readback {
  Buffer buffer;
  VkBufferImageCopy region{};
  Readback(Workspace& work, uint32_t width, uint32_t height, uint32_t layer = 0, uint32_t slice = 0)
      : buffer(work.buffer(VkDeviceSize(width) * height * 4, VK_BUFFER_USAGE_TRANSFER_DST_BIT)) {
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, layer, 1};
    region.imageOffset.z = int32_t(slice);
    region.imageExtent = {width, height, 1};
  }
  void record(VkCommandBuffer commands, const Image& image) {
    vkCmdCopyImageToBuffer(commands, image.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, buffer.handle, 1, &region);
  }
  Picture picture() const {
    Picture p(region.imageExtent.width, region.imageExtent.height);
    std::memcpy(p.rgba.data(), buffer.mapped, p.rgba.size());
    return p;
  }
};

std::vector<Vertex> everything(float z = 0.5f, glm::vec4 attribute = {}) {
  return {{{-1, -1, z, 1}, attribute}, {{3, -1, z, 1}, attribute}, {{-1, 3, z, 1}, attribute}};
}

std::vector<VkPipelineColorBlendAttachmentState> unblended(size_t count) {
  VkPipelineColorBlendAttachmentState state{};
  state.colorWriteMask = 0xf;
  return std::vector<VkPipelineColorBlendAttachmentState>(count, state);
}

const char* const kGeometry = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 albedo;
layout(location = 1) out vec4 normal;
layout(location = 2) out vec4 position;
layout(location = 3) out uvec4 material;
void main() {
  vec2 local = passed.xy;
  float height = sqrt(max(1 - dot(local, local), 0));
  albedo = vec4(passed.z, 0.75, 1 - passed.z, 1);
  normal = vec4(local, height, 0);
  position = vec4(gl_FragCoord.xy, height * 20, 1);
  material = uvec4(uint(passed.w + 0.5), 7, 255, 1);
}
)";

// Geometry into four attachments and depth, then light from what they hold at each pixel.
Picture renderDeferred(Device& device, Variant variant, VkSampleCountFlagBits samples) {
  Canvas canvas(device, kSize, kSize);
  const bool many = samples != VK_SAMPLE_COUNT_1_BIT;
  const VkFormat kFormats[] = {VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R16G16B16A16_SFLOAT, VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_R8G8B8A8_UINT};
  std::vector<VkAttachmentDescription> attachments;
  std::vector<VkImageView> views;
  std::vector<Binding> bindings;
  SubpassSpec geometry, light;
  for (uint32_t i = 0; i < 4; ++i) {
    ImageSpec spec;
    spec.format = kFormats[i];
    spec.extent = {kSize, kSize, 1};
    spec.samples = samples;
    spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSIENT_ATTACHMENT_BIT;
    views.push_back(canvas.view(canvas.image(spec)));
    attachments.push_back(attachment(kFormats[i], VK_ATTACHMENT_LOAD_OP_CLEAR, VK_ATTACHMENT_STORE_OP_DONT_CARE, VK_IMAGE_LAYOUT_UNDEFINED,
                                     VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, samples));
    geometry.colours.push_back({i, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL});
    light.inputs.push_back({i, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL});
    Binding b{VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT};
    b.image = {VK_NULL_HANDLE, views.back(), VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
    bindings.push_back(b);
  }
  ImageSpec depthSpec;
  depthSpec.format = VK_FORMAT_D32_SFLOAT;
  depthSpec.extent = {kSize, kSize, 1};
  depthSpec.samples = samples;
  depthSpec.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT;
  views.push_back(canvas.view(canvas.image(depthSpec)));
  attachments.push_back(attachment(VK_FORMAT_D32_SFLOAT, VK_ATTACHMENT_LOAD_OP_CLEAR, VK_ATTACHMENT_STORE_OP_DONT_CARE, VK_IMAGE_LAYOUT_UNDEFINED,
                                   VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL, samples));
  geometry.depth = VkAttachmentReference{4, VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
  views.push_back(canvas.view(canvas.colourImage()));
  attachments.push_back(attachment(Canvas::kColourFormat, VK_ATTACHMENT_LOAD_OP_DONT_CARE, VK_ATTACHMENT_STORE_OP_STORE, VK_IMAGE_LAYOUT_UNDEFINED,
                                   VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL));
  light.colours.push_back({5, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL});
  VkRenderPass pass = renderPass(canvas, attachments, {geometry, light});
  VkFramebuffer target = canvas.framebufferOf(pass, views, {kSize, kSize});

  auto blend = unblended(4);
  PipelineSpec first;
  first.fragment = kGeometry;
  first.depthTest = first.depthWrite = true;
  first.adjust = [&](PipelineStates& s) {
    s.renderPass = pass;
    s.multisample.rasterizationSamples = samples;
    s.blend.attachmentCount = 4;
    s.blend.pAttachments = blend.data();
  };
  Pipeline fill = canvas.pipeline(first);
  DescriptorSet set = canvas.descriptors(bindings);
  PipelineSpec second;
  second.sets = {set.layout};
  const std::string ms = many ? "MS" : "", at = many ? ", i" : "";
  second.fragment = "#version 450\n"
                    "layout(input_attachment_index = 0, set = 0, binding = 0) uniform subpassInput" + ms + " albedos;\n"
                    "layout(input_attachment_index = 1, set = 0, binding = 1) uniform subpassInput" + ms + " normals;\n"
                    "layout(input_attachment_index = 2, set = 0, binding = 2) uniform subpassInput" + ms + " positions;\n"
                    "layout(input_attachment_index = 3, set = 0, binding = 3) uniform usubpassInput" + ms + " materials;\n"
                    "layout(location = 0) out vec4 colour;\n"
                    "void main() {\n"
                    "  vec3 sum = vec3(0);\n"
                    "  for (int i = 0; i < " + std::to_string(int(samples)) + "; ++i) {\n"
                    "    vec3 n = subpassLoad(normals" + at + ").xyz, p = subpassLoad(positions" + at + ").xyz;\n"
                    "    vec3 a = subpassLoad(albedos" + at + ").rgb;\n"
                    "    float shine = float(subpassLoad(materials" + at + ").r) / 16.0;\n"
                    "    for (int l = 0; l < 3; ++l) {\n"
                    "      vec3 light = vec3(40.0 + 90.0 * float(l), 200.0 - 80.0 * float(l), " + (variant == Variant::kBroken ? "80.0" : "60.0") + ");\n"
                    "      vec3 d = light - p;\n"
                    "      float cosine = max(dot(n, normalize(d)), 0.0);\n"
                    "      sum += a * cosine * 2000.0 / dot(d, d) * (1.0 + shine * cosine);\n"
                    "    }\n"
                    "  }\n"
                    "  colour = vec4(sum / " + std::to_string(int(samples)) + ".0, 1);\n"
                    "}\n";
  second.adjust = [&](PipelineStates& s) {
    s.renderPass = pass;
    s.subpass = 1;
  };
  Pipeline shade = canvas.pipeline(second);

  // Nine discs made of quads whose attributes are local coordinates; their depths overlap.
  std::vector<Vertex> discs;
  for (int i = 0; i < 9; ++i) {
    double x = 50.25 + i % 3 * 74, y = 52.125 + i / 3 * 72, r = 46;
    float z = 0.2f + 0.05f * float(i * 4 % 9);
    glm::vec2 previous(1, 0);
    for (int k = 1; k <= 24; ++k) {
      double angle = 6.283185307179586 * k / 24;
      glm::vec2 next(std::cos(angle), std::sin(angle));
      for (glm::vec2 p : {glm::vec2(0), previous, next})
        discs.push_back({atPixel(canvas.size(), std::round((x + r * p.x) * 256) / 256, std::round((y + r * p.y) * 256) / 256, z), {p, float(i) / 9, float(i)}});
      previous = next;
    }
  }
  Readback read(canvas, kSize, kSize);
  device.run([&](VkCommandBuffer commands) {
    std::vector<VkClearValue> clears(5);
    clears[4].depthStencil = {1, 0};
    begin(commands, pass, target, {{0, 0}, {kSize, kSize}}, clears);
    canvas.drawVertices(commands, fill, discs);
    vkCmdNextSubpass(commands, VK_SUBPASS_CONTENTS_INLINE);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, shade.layout, 0, 1, &set.handle, 0, nullptr);
    canvas.drawVertices(commands, shade, everything());
    vkCmdEndRenderPass(commands);
    read.record(commands, canvas.colourImage());
    fullBarrier(commands);
  });
  return read.picture();
}

// Each draw reads what the ones before it left in the attachment: blending by hand.
Picture renderFeedback(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  ImageSpec spec;
  spec.extent = {kSize, kSize, 1};
  spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_INPUT_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  Image image = canvas.image(spec);
  VkImageView view = canvas.view(image);
  SubpassSpec subpass;
  subpass.colours = subpass.inputs = {{0, VK_IMAGE_LAYOUT_GENERAL}};
  VkRenderPass pass = renderPass(canvas, {attachment(spec.format, VK_ATTACHMENT_LOAD_OP_CLEAR, VK_ATTACHMENT_STORE_OP_STORE, VK_IMAGE_LAYOUT_UNDEFINED,
                                                     VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)}, {subpass}, true);
  VkFramebuffer target = canvas.framebufferOf(pass, {view}, {kSize, kSize});
  Binding binding{VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT};
  binding.image = {VK_NULL_HANDLE, view, VK_IMAGE_LAYOUT_GENERAL};
  DescriptorSet set = canvas.descriptors({binding});
  PipelineSpec blend;
  blend.sets = {set.layout};
  blend.fragment = R"(#version 450
layout(input_attachment_index = 0, set = 0, binding = 0) uniform subpassInput before;
layout(location = 0) in vec4 passed;
layout(location = 0) out vec4 colour;
void main() { vec4 old = subpassLoad(before); colour = vec4(abs(old.rgb - passed.rgb), 1); }
)";
  blend.adjust = [&](PipelineStates& s) { s.renderPass = pass; };
  Pipeline pipeline = canvas.pipeline(blend);
  Readback read(canvas, kSize, kSize);
  device.run([&](VkCommandBuffer commands) {
    std::vector<VkClearValue> clears(1);
    clears[0].color = {{0.2f, 0.4f, 0.6f, 1}};
    begin(commands, pass, target, {{0, 0}, {kSize, kSize}}, clears);
    vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.layout, 0, 1, &set.handle, 0, nullptr);
    for (int i = 0; i < 7; ++i) {
      VkMemoryBarrier barrier{};
      barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
      barrier.srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
      barrier.dstAccessMask = VK_ACCESS_INPUT_ATTACHMENT_READ_BIT;
      vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT, VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT, VK_DEPENDENCY_BY_REGION_BIT, 1,
                           &barrier, 0, nullptr, 0, nullptr);
      double x = 10.25 + i * 22, y = 14.125 + i * 9;
      glm::vec4 colour(float(40 + i * 30) / 255, float(200 - i * 20) / 255, float((i * 77) % 255) / 255, 1);
      if (variant == Variant::kBroken && i == 3) colour.g = 0;
      canvas.drawVertices(commands, pipeline, {{atPixel(canvas.size(), x, y), colour}, {atPixel(canvas.size(), x + 120, y + 30), colour}, {atPixel(canvas.size(), x + 20, y + 150), colour}});
    }
    vkCmdEndRenderPass(commands);
    read.record(commands, image);
    fullBarrier(commands);
  });
  return read.picture();
}

// Four layers of an array, or slices of a 3D image, drawn by one instanced draw through gl_Layer; shown as quarters.
Picture renderLayers(Device& device, Variant variant, bool slices) {
  Canvas canvas(device, kSize, kSize);
  constexpr uint32_t kHalf = kSize / 2;
  ImageSpec spec;
  spec.extent = {kHalf, kHalf, slices ? 4u : 1u};
  spec.layers = slices ? 1 : 4;
  spec.type = slices ? VK_IMAGE_TYPE_3D : VK_IMAGE_TYPE_2D;
  spec.flags = slices ? VK_IMAGE_CREATE_2D_ARRAY_COMPATIBLE_BIT : 0;
  spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  Image image = canvas.image(spec);
  VkImageViewCreateInfo viewInfo{};
  viewInfo.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  viewInfo.image = image.handle;
  viewInfo.viewType = VK_IMAGE_VIEW_TYPE_2D_ARRAY;
  viewInfo.format = spec.format;
  viewInfo.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 4};
  VkImageView view = canvas.make(viewInfo);
  SubpassSpec subpass;
  subpass.colours = {{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL}};
  VkRenderPass pass = renderPass(canvas, {attachment(spec.format, VK_ATTACHMENT_LOAD_OP_CLEAR, VK_ATTACHMENT_STORE_OP_STORE, VK_IMAGE_LAYOUT_UNDEFINED,
                                                     VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)}, {subpass});
  VkFramebuffer target = canvas.framebufferOf(pass, {view}, {kHalf, kHalf}, 4);
  PipelineSpec draw;
  draw.vertex = std::string(R"(#version 450
#extension GL_ARB_shader_viewport_layer_array : require
layout(location = 0) in vec4 position;
layout(location = 1) in vec4 given;
layout(location = 0) out vec4 passed;
layout(location = 1) flat out int layer;
void main() {
  layer = gl_InstanceIndex;
  gl_Position = position * vec4(1, 1 - 0.2 * float(gl_InstanceIndex), 1, 1);
  passed = given;
  gl_Layer = )") + (variant == Variant::kBroken ? "gl_InstanceIndex ^ 1" : "gl_InstanceIndex") + ";\n}\n";
  draw.fragment = R"(#version 450
layout(location = 0) in vec4 passed;
layout(location = 1) flat in int layer;
layout(location = 0) out vec4 colour;
void main() { colour = vec4(passed.rg, float(layer) / 3, 1); }
)";
  draw.adjust = [&](PipelineStates& s) { s.renderPass = pass; };
  Pipeline pipeline = canvas.pipeline(draw);
  std::vector<Readback> reads;
  for (uint32_t l = 0; l < 4; ++l) reads.emplace_back(canvas, kHalf, kHalf, slices ? 0 : l, slices ? l : 0);
  device.run([&](VkCommandBuffer commands) {
    std::vector<VkClearValue> clears(1);
    clears[0].color = {{0, 0, 0.2f, 1}};
    begin(commands, pass, target, {{0, 0}, {kHalf, kHalf}}, clears);
    setViewport(commands, 0, 0, float(kHalf), float(kHalf));
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.handle);
    canvas.bindVertices(commands, {{{-0.9f, -0.875f, 0.5f, 1}, {1, 0, 0, 1}}, {{0.75f, -0.5f, 0.5f, 1}, {0, 1, 0, 1}}, {{-0.25f, 0.9375f, 0.5f, 1}, {1, 1, 0, 1}}});
    vkCmdDraw(commands, 3, 4, 0, 0);
    // A clear in the middle of the pass: layers 1 and 2 only.
    VkClearAttachment clear{VK_IMAGE_ASPECT_COLOR_BIT, 0, {}};
    clear.clearValue.color = {{1, 1, 1, 1}};
    VkClearRect rect{{{100, 90}, {20, 30}}, 1, 2};
    vkCmdClearAttachments(commands, 1, &clear, 1, &rect);
    vkCmdEndRenderPass(commands);
    for (Readback& r : reads) r.record(commands, image);
    fullBarrier(commands);
  });
  Picture whole(kSize, kSize);
  for (uint32_t l = 0; l < 4; ++l) {
    Picture part = reads[l].picture();
    for (uint32_t y = 0; y < kHalf; ++y) std::memcpy(whole.at(l % 2 * kHalf, y + l / 2 * kHalf), part.at(0, y), kHalf * 4);
  }
  return whole;
}

// A 1D image as attachment: one row of pixels, loaded in a second pass that draws on a part of it.
Picture renderOneDimension(Device& device, Variant variant) {
  Canvas canvas(device, kSize, 1);
  ImageSpec spec;
  spec.type = VK_IMAGE_TYPE_1D;
  spec.extent = {kSize, 1, 1};
  spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  Image image = canvas.image(spec);
  VkImageView view = canvas.view(image);
  SubpassSpec subpass;
  subpass.colours = {{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL}};
  VkRenderPass fresh = renderPass(canvas, {attachment(spec.format, VK_ATTACHMENT_LOAD_OP_CLEAR, VK_ATTACHMENT_STORE_OP_STORE, VK_IMAGE_LAYOUT_UNDEFINED,
                                                      VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL)}, {subpass});
  VkRenderPass again = renderPass(canvas, {attachment(spec.format, VK_ATTACHMENT_LOAD_OP_LOAD, VK_ATTACHMENT_STORE_OP_STORE, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
                                                      VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL)}, {subpass});
  VkFramebuffer target = canvas.framebufferOf(fresh, {view}, {kSize, 1});
  PipelineSpec draw;
  draw.adjust = [&](PipelineStates& s) { s.renderPass = fresh; };
  Pipeline pipeline = canvas.pipeline(draw);
  Readback read(canvas, kSize, 1);
  device.run([&](VkCommandBuffer commands) {
    std::vector<VkClearValue> clears(1);
    clears[0].color = {{0, 0, 1, 1}};
    begin(commands, fresh, target, {{0, 0}, {kSize, 1}}, clears);
    setViewport(commands, 16, 0, 64, 1);
    canvas.drawVertices(commands, pipeline, everything(0.5f, {1, 0, 0, 1}));
    vkCmdEndRenderPass(commands);
    begin(commands, again, target, {{40, 0}, {150, 1}}, {});
    setViewport(commands, 64, 0, variant == Variant::kBroken ? 65.f : 64.f, 1);
    canvas.drawVertices(commands, pipeline, everything(0.5f, {0, 1, 0.5f, 1}));
    vkCmdEndRenderPass(commands);
    read.record(commands, image);
    fullBarrier(commands);
  });
  return read.picture();
}

// Clears, draws and loads within a render area; outside everything stays.
Picture renderArea(Device& device, Variant variant) {
  Canvas canvas(device, kSize, kSize);
  ImageSpec spec;
  spec.extent = {kSize, kSize, 1};
  spec.usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  Image image = canvas.image(spec);
  VkImageView view = canvas.view(image);
  SubpassSpec subpass;
  subpass.colours = {{0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL}};
  const VkImageLayout kBetween = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL;
  auto pass = [&](VkAttachmentLoadOp load, VkImageLayout before, VkImageLayout after) {
    return renderPass(canvas, {attachment(spec.format, load, VK_ATTACHMENT_STORE_OP_STORE, before, after)}, {subpass});
  };
  VkRenderPass clear = pass(VK_ATTACHMENT_LOAD_OP_CLEAR, VK_IMAGE_LAYOUT_UNDEFINED, kBetween);
  VkRenderPass clearAgain = pass(VK_ATTACHMENT_LOAD_OP_CLEAR, kBetween, kBetween);
  VkRenderPass load = pass(VK_ATTACHMENT_LOAD_OP_LOAD, kBetween, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
  VkFramebuffer target = canvas.framebufferOf(clear, {view}, {kSize, kSize});
  PipelineSpec draw;
  draw.adjust = [&](PipelineStates& s) { s.renderPass = clear; };
  Pipeline pipeline = canvas.pipeline(draw);
  Readback read(canvas, kSize, kSize);
  device.run([&](VkCommandBuffer commands) {
    std::vector<VkClearValue> clears(1);
    clears[0].color = {{0.1f, 0.1f, 0.3f, 1}};
    begin(commands, clear, target, {{0, 0}, {kSize, kSize}}, clears);
    vkCmdEndRenderPass(commands);
    clears[0].color = {{0.5f, 0.1f, 0.1f, 1}};
    begin(commands, clearAgain, target, {{13, 70}, {101, 62u + (variant == Variant::kBroken)}}, clears);
    canvas.drawVertices(commands, pipeline, {{{-1, -1, 0.5f, 1}, {1, 1, 0, 1}}, {{0.5f, 0, 0.5f, 1}, {0, 1, 0, 1}}, {{-1, 1, 0.5f, 1}, {0, 1, 1, 1}}});
    vkCmdEndRenderPass(commands);
    begin(commands, load, target, {{90, 3}, {151, 250}}, {});
    canvas.drawVertices(commands, pipeline, {{{-1, -0.25f, 0.5f, 1}, {1, 0, 1, 1}}, {{1, 0, 0.5f, 1}, {1, 1, 1, 1}}, {{-1, 0.25f, 0.5f, 1}, {0, 0, 1, 1}}});
    vkCmdEndRenderPass(commands);
    read.record(commands, image);
    fullBarrier(commands);
  });
  return read.picture();
}

}  // namespace

void addPassScenes(SceneList& scenes) {
  auto add = [&](const char* name, const char* broken, std::function<Picture(Device&, Variant)> render) -> Scene& {
    Scene scene;
    scene.name = name;
    scene.broken = broken;
    scene.render = std::move(render);
    scenes.push_back(scene);
    return scenes.back();
  };
  auto rough = [] {
    Expectation e;
    e.colourTolerance = 2;   // attachments of 16 bits, then a division
    return e;
  };
  add("deferred_shading", "lights at another height", [](Device& d, Variant v) { return renderDeferred(d, v, VK_SAMPLE_COUNT_1_BIT); }).expectation = rough;
  Scene& many = add("deferred_shading_samples", "lights at another height", [](Device& d, Variant v) { return renderDeferred(d, v, VK_SAMPLE_COUNT_4_BIT); });
  many.expectation = rough;
  many.supported = [](const Device& d) {
    const VkPhysicalDeviceLimits& l = d.properties.limits;
    return (l.framebufferColorSampleCounts & l.framebufferDepthSampleCounts & l.sampledImageColorSampleCounts & VK_SAMPLE_COUNT_4_BIT) != 0;
  };
  add("feedback_in_a_subpass", "one draw in another colour", renderFeedback);
  auto layers = [](const Device& d) { return d.has(VK_EXT_SHADER_VIEWPORT_INDEX_LAYER_EXTENSION_NAME); };
  add("layers", "layers exchanged", [](Device& d, Variant v) { return renderLayers(d, v, false); }).supported = layers;
  add("slices_as_layers", "layers exchanged", [](Device& d, Variant v) { return renderLayers(d, v, true); }).supported = layers;
  add("one_dimension", "a pixel too far", renderOneDimension).supported = [](const Device& d) {
    VkImageFormatProperties p;
    return vkGetPhysicalDeviceImageFormatProperties(d.physical, Canvas::kColourFormat, VK_IMAGE_TYPE_1D, VK_IMAGE_TILING_OPTIMAL,
                                                    VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT, 0, &p) == VK_SUCCESS;
  };
  add("render_area", "a row too many", renderArea);
}

}  // namespace pumice::cts
