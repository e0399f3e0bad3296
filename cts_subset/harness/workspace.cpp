#include "cts_subset/harness/workspace.h"

namespace pumice::cts {

VkImageAspectFlags aspectsOf(VkFormat format) {
  switch (format) {
    case VK_FORMAT_D16_UNORM:
    case VK_FORMAT_X8_D24_UNORM_PACK32:
    case VK_FORMAT_D32_SFLOAT:
      return VK_IMAGE_ASPECT_DEPTH_BIT;
    case VK_FORMAT_S8_UINT:
      return VK_IMAGE_ASPECT_STENCIL_BIT;
    case VK_FORMAT_D16_UNORM_S8_UINT:
    case VK_FORMAT_D24_UNORM_S8_UINT:
    case VK_FORMAT_D32_SFLOAT_S8_UINT:
      return VK_IMAGE_ASPECT_DEPTH_BIT | VK_IMAGE_ASPECT_STENCIL_BIT;
    default:
      return VK_IMAGE_ASPECT_COLOR_BIT;
  }
}

namespace {

template <class Handle, class Info>
Handle made(Workspace& work, VkResult(VKAPI_PTR* create)(VkDevice, const Info*, const VkAllocationCallbacks*, Handle*),
            void(VKAPI_PTR* destroy)(VkDevice, Handle, const VkAllocationCallbacks*), const Info& info, const char* what) {
  VkDevice d = work.device.handle;
  Handle object = VK_NULL_HANDLE;
  check(create(d, &info, nullptr, &object), what);
  work.onDestroy([=] { destroy(d, object, nullptr); });
  return object;
}

}  // namespace

#define PUMICE_MAKE(Object)                                                                      \
  Vk##Object Workspace::make(const Vk##Object##CreateInfo& info) {                               \
    return made<Vk##Object>(*this, vkCreate##Object, vkDestroy##Object, info, "vkCreate" #Object); \
  }
PUMICE_PLAIN_OBJECTS(PUMICE_MAKE)
#undef PUMICE_MAKE

VkRenderPass Workspace::make(const VkRenderPassCreateInfo2& info) {
  return made<VkRenderPass>(*this, vkCreateRenderPass2, vkDestroyRenderPass, info, "vkCreateRenderPass2");
}

VkDeviceMemory Workspace::make(const VkMemoryAllocateInfo& info) {
  return made<VkDeviceMemory>(*this, vkAllocateMemory, vkFreeMemory, info, "vkAllocateMemory");
}

VkPipeline Workspace::make(const VkComputePipelineCreateInfo& info) {
  VkPipeline pipeline = VK_NULL_HANDLE;
  check(vkCreateComputePipelines(device.handle, device.pipelineCache, 1, &info, nullptr, &pipeline), "vkCreateComputePipelines");
  onDestroy([d = device.handle, pipeline] { vkDestroyPipeline(d, pipeline, nullptr); });
  return pipeline;
}

VkPipeline Workspace::make(const VkGraphicsPipelineCreateInfo& info) {
  VkPipeline pipeline = VK_NULL_HANDLE;
  check(vkCreateGraphicsPipelines(device.handle, device.pipelineCache, 1, &info, nullptr, &pipeline), "vkCreateGraphicsPipelines");
  onDestroy([d = device.handle, pipeline] { vkDestroyPipeline(d, pipeline, nullptr); });
  return pipeline;
}

VkFramebuffer Workspace::framebufferOf(VkRenderPass pass, const std::vector<VkImageView>& views, VkExtent2D extent, uint32_t layers) {
  return make(VkFramebufferCreateInfo{VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO, nullptr, 0, pass, uint32_t(views.size()), views.data(),
                                      extent.width, extent.height, layers});
}

Workspace::~Workspace() {
  device.waitIdle();
  for (auto undo = undoList.rbegin(); undo != undoList.rend(); ++undo) (*undo)();
}

Buffer Workspace::buffer(VkDeviceSize size, VkBufferUsageFlags usage, const void* data) {
  VkDevice d = device.handle;
  Buffer made;
  made.size = size;
  VkBufferCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO;
  info.size = size;
  info.usage = usage;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  made.handle = make(info);

  VkMemoryRequirements needs{};
  vkGetBufferMemoryRequirements(d, made.handle, &needs);
  VkMemoryAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  allocate.allocationSize = needs.size;
  allocate.memoryTypeIndex = device.memoryType(
      needs.memoryTypeBits, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT);
  VkDeviceMemory memory = make(allocate);
  check(vkBindBufferMemory(d, made.handle, memory, 0), "vkBindBufferMemory");
  void* mapped = nullptr;
  check(vkMapMemory(d, memory, 0, VK_WHOLE_SIZE, 0, &mapped), "vkMapMemory");
  made.mapped = static_cast<std::byte*>(mapped);
  if (data) std::memcpy(mapped, data, size);
  return made;
}

Image Workspace::image(const ImageSpec& spec) {
  VkDevice d = device.handle;
  Image made;
  made.spec = spec;
  made.aspects = aspectsOf(spec.format);
  VkImageCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO;
  info.flags = spec.flags;
  info.imageType = spec.type;
  info.format = spec.format;
  info.extent = spec.extent;
  info.mipLevels = spec.mips;
  info.arrayLayers = spec.layers;
  info.samples = spec.samples;
  info.tiling = spec.tiling;
  info.usage = spec.usage;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  info.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  made.handle = make(info);

  VkMemoryRequirements needs{};
  vkGetImageMemoryRequirements(d, made.handle, &needs);
  VkMemoryAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO;
  allocate.allocationSize = needs.size;
  allocate.memoryTypeIndex = device.memoryType(needs.memoryTypeBits, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
  made.memory = make(allocate);
  check(vkBindImageMemory(d, made.handle, made.memory, 0), "vkBindImageMemory");
  return made;
}

VkImageView Workspace::view(const Image& image, VkImageAspectFlags aspects) {
  VkImageViewCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO;
  info.image = image.handle;
  info.viewType = image.spec.type == VK_IMAGE_TYPE_3D ? VK_IMAGE_VIEW_TYPE_3D
                  : image.spec.type == VK_IMAGE_TYPE_1D
                      ? VK_IMAGE_VIEW_TYPE_1D
                      : (image.spec.layers > 1 ? VK_IMAGE_VIEW_TYPE_2D_ARRAY : VK_IMAGE_VIEW_TYPE_2D);
  info.format = image.spec.format;
  info.subresourceRange = {aspects ? aspects : image.aspects, 0, image.spec.mips, 0, image.spec.layers};
  return make(info);
}

VkSampler Workspace::sampler(VkFilter filter, VkSamplerAddressMode mode) {
  VkSamplerCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO;
  info.magFilter = info.minFilter = filter;
  info.mipmapMode = VK_SAMPLER_MIPMAP_MODE_NEAREST;
  info.addressModeU = info.addressModeV = info.addressModeW = mode;
  info.maxAnisotropy = 1;
  info.borderColor = VK_BORDER_COLOR_FLOAT_OPAQUE_WHITE;
  return make(info);
}

VkShaderModule Workspace::shader(VkShaderStageFlagBits stage, const std::string& glsl, ShaderTarget target) {
  return shader(compileGlsl(stage, glsl, target));
}

VkShaderModule Workspace::shader(const std::vector<uint32_t>& words) {
  VkShaderModuleCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
  info.codeSize = words.size() * sizeof(uint32_t);
  info.pCode = words.data();
  return make(info);
}

DescriptorSet Workspace::descriptors(const std::vector<Binding>& bindings) {
  VkDevice d = device.handle;
  DescriptorSet made;
  std::vector<VkDescriptorSetLayoutBinding> layout;
  std::vector<VkDescriptorPoolSize> sizes;
  for (uint32_t i = 0; i < bindings.size(); ++i) {
    VkShaderStageFlags stages = VK_SHADER_STAGE_FRAGMENT_BIT;
    if (bindings[i].type != VK_DESCRIPTOR_TYPE_INPUT_ATTACHMENT) stages |= VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_COMPUTE_BIT;
    layout.push_back(
        {i, bindings[i].type, 1, stages, nullptr});
    sizes.push_back({bindings[i].type, 1});
  }
  VkDescriptorSetLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO;
  layoutInfo.bindingCount = uint32_t(layout.size());
  layoutInfo.pBindings = layout.data();
  made.layout = make(layoutInfo);

  VkDescriptorPoolCreateInfo poolInfo{};
  poolInfo.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO;
  poolInfo.maxSets = 1;
  poolInfo.poolSizeCount = uint32_t(sizes.size());
  poolInfo.pPoolSizes = sizes.data();
  VkDescriptorPool pool = make(poolInfo);

  VkDescriptorSetAllocateInfo allocate{};
  allocate.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO;
  allocate.descriptorPool = pool;
  allocate.descriptorSetCount = 1;
  allocate.pSetLayouts = &made.layout;
  check(vkAllocateDescriptorSets(d, &allocate, &made.handle), "vkAllocateDescriptorSets");

  std::vector<VkWriteDescriptorSet> writes;
  for (uint32_t i = 0; i < bindings.size(); ++i) {
    VkWriteDescriptorSet write{};
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = made.handle;
    write.dstBinding = i;
    write.descriptorCount = 1;
    write.descriptorType = bindings[i].type;
    write.pBufferInfo = &bindings[i].buffer;
    write.pImageInfo = &bindings[i].image;
    write.pTexelBufferView = &bindings[i].texels;
    writes.push_back(write);
  }
  vkUpdateDescriptorSets(d, uint32_t(writes.size()), writes.data(), 0, nullptr);
  return made;
}

Pipeline Workspace::compute(const std::string& glsl, const std::vector<VkDescriptorSetLayout>& sets) {
  Pipeline made;
  VkPipelineLayoutCreateInfo layoutInfo{};
  layoutInfo.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
  layoutInfo.setLayoutCount = uint32_t(sets.size());
  layoutInfo.pSetLayouts = sets.data();
  made.layout = make(layoutInfo);
  VkComputePipelineCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
  info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  info.stage.module = shader(VK_SHADER_STAGE_COMPUTE_BIT, glsl);
  info.stage.pName = "main";
  info.layout = made.layout;
  made.handle = make(info);
  return made;
}

Image Workspace::texture(uint32_t width, uint32_t height, const std::vector<uint8_t>& rgba, VkFormat format) {
  ImageSpec spec;
  spec.format = format;
  spec.extent = {width, height, 1};
  spec.usage = VK_IMAGE_USAGE_TRANSFER_DST_BIT | VK_IMAGE_USAGE_SAMPLED_BIT;
  Image made = image(spec);
  Buffer staging = bufferOf(rgba, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
  device.run([&](VkCommandBuffer commands) {
    transition(commands, made, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
    VkBufferImageCopy region{};
    region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
    region.imageExtent = spec.extent;
    vkCmdCopyBufferToImage(commands, staging.handle, made.handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1,
                           &region);
    transition(commands, made, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
               VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
  });
  return made;
}

void transition(VkCommandBuffer commands, const Image& image, VkImageLayout from, VkImageLayout to) {
  VkImageMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
  barrier.oldLayout = from;
  barrier.newLayout = to;
  barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image.handle;
  barrier.subresourceRange = {image.aspects, 0, image.spec.mips, 0, image.spec.layers};
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0,
                       nullptr, 0, nullptr, 1, &barrier);
}

void fullBarrier(VkCommandBuffer commands) {
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_MEMORY_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT | VK_ACCESS_HOST_READ_BIT;
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT,
                       VK_PIPELINE_STAGE_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0,
                       nullptr, 0, nullptr);
}

}  // namespace pumice::cts
