// Vulkan objects with a common life: everything made by a Workspace goes when it goes.
#pragma once

#include "cts_subset/harness/shader.h"
#include "cts_subset/harness/vulkan_context.h"

#include <cstring>
#include <functional>
#include <string>
#include <vector>

namespace pumice::cts {

struct Buffer {
  VkBuffer handle = VK_NULL_HANDLE;
  VkDeviceSize size = 0;
  std::byte* mapped = nullptr;  // host-visible, coherent, mapped for its whole life
};

struct ImageSpec {
  VkFormat format = VK_FORMAT_R8G8B8A8_UNORM;
  VkExtent3D extent{1, 1, 1};
  VkImageUsageFlags usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  uint32_t mips = 1;
  uint32_t layers = 1;
  VkSampleCountFlagBits samples = VK_SAMPLE_COUNT_1_BIT;
  VkImageType type = VK_IMAGE_TYPE_2D;
  VkImageTiling tiling = VK_IMAGE_TILING_OPTIMAL;
  VkImageCreateFlags flags = 0;
};

struct Image {
  VkImage handle = VK_NULL_HANDLE;
  ImageSpec spec;
  VkImageAspectFlags aspects = VK_IMAGE_ASPECT_COLOR_BIT;
  VkDeviceMemory memory = VK_NULL_HANDLE;
};

VkImageAspectFlags aspectsOf(VkFormat format);

struct Pipeline {
  VkPipeline handle = VK_NULL_HANDLE;
  VkPipelineLayout layout = VK_NULL_HANDLE;
};

struct Binding {
  VkDescriptorType type;
  VkDescriptorBufferInfo buffer{};
  VkDescriptorImageInfo image{};
  VkBufferView texels = VK_NULL_HANDLE;
};

struct DescriptorSet {
  VkDescriptorSetLayout layout = VK_NULL_HANDLE;
  VkDescriptorSet handle = VK_NULL_HANDLE;
};

// Objects that one structure describes: vkCreateX takes a VkXCreateInfo.
#define PUMICE_PLAIN_OBJECTS(X)                                                                                       \
  X(Buffer) X(BufferView) X(CommandPool) X(DescriptorPool) X(DescriptorSetLayout) X(DescriptorUpdateTemplate) X(Event) \
  X(Fence) X(Framebuffer) X(Image) X(ImageView) X(PipelineLayout) X(PrivateDataSlot) X(QueryPool) X(RenderPass)        \
  X(Sampler) X(Semaphore) X(ShaderModule)

class Workspace {
 public:
  explicit Workspace(Device& d) : device(d) {}
  ~Workspace();
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;

  Device& device;

  Buffer buffer(VkDeviceSize size, VkBufferUsageFlags usage, const void* data = nullptr);
  template <class T>
  Buffer bufferOf(const std::vector<T>& data, VkBufferUsageFlags usage) {
    return buffer(data.size() * sizeof(T), usage, data.data());
  }
  Image image(const ImageSpec& spec);
  VkImageView view(const Image& image, VkImageAspectFlags aspects = 0);
  VkSampler sampler(VkFilter filter, VkSamplerAddressMode mode);
  VkShaderModule shader(VkShaderStageFlagBits stage, const std::string& glsl,
                        ShaderTarget target = ShaderTarget::kVulkan10);
  VkShaderModule shader(const std::vector<uint32_t>& words);
  Pipeline compute(const std::string& glsl, const std::vector<VkDescriptorSetLayout>& sets);
  // Bindings 0, 1, ... of one set, visible to vertex, fragment and compute shaders.
  DescriptorSet descriptors(const std::vector<Binding>& bindings);
  // An RGBA8 image ready to be sampled.
  Image texture(uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba,
                VkFormat format = VK_FORMAT_R8G8B8A8_UNORM);

  // The object that `info` describes; it goes with the workspace. Throws like check().
#define PUMICE_MAKE(Object) Vk##Object make(const Vk##Object##CreateInfo& info);
  PUMICE_PLAIN_OBJECTS(PUMICE_MAKE)
#undef PUMICE_MAKE
  VkRenderPass make(const VkRenderPassCreateInfo2& info);
  VkDeviceMemory make(const VkMemoryAllocateInfo& info);
  VkPipeline make(const VkComputePipelineCreateInfo& info);
  VkPipeline make(const VkGraphicsPipelineCreateInfo& info);

  VkFramebuffer framebufferOf(VkRenderPass pass, const std::vector<VkImageView>& views, VkExtent2D extent, uint32_t layers = 1);

  // Destroys `undo`'s object with the workspace, in reverse order of making.
  void onDestroy(std::function<void()> undo) { undoList.push_back(std::move(undo)); }

 private:
  std::vector<std::function<void()>> undoList;
};

// A barrier over the whole image that waits for everything before it.
void transition(VkCommandBuffer commands, const Image& image, VkImageLayout from, VkImageLayout to);
// Makes all earlier writes visible to all later commands and to the host.
void fullBarrier(VkCommandBuffer commands);

}  // namespace pumice::cts
