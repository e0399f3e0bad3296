#include "icd/properties.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "icd/descriptors.h"
#include "icd/external.h"
#include "pipeline/layout.h"
#include "spirv_interp/frontend/support.h"
#include "spirv_interp/ir/ir.h"
#include "texture/format.h"

namespace pumice::icd {
namespace {

// Many, where the implementation has no bound of its own.
constexpr uint32_t kMany = 1 << 20;

void initVulkan11(VkPhysicalDeviceVulkan11Properties& p, uint64_t heapBytes) {
  driverUuid(p.deviceUUID);
  driverUuid(p.driverUUID);
  p.deviceLUIDValid = VK_FALSE;
  p.subgroupSize = ir::kSubgroupLanes;
  p.subgroupSupportedStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT | VK_SHADER_STAGE_COMPUTE_BIT;
  p.subgroupSupportedOperations = VK_SUBGROUP_FEATURE_BASIC_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT | VK_SUBGROUP_FEATURE_ARITHMETIC_BIT |
                                  VK_SUBGROUP_FEATURE_BALLOT_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_BIT | VK_SUBGROUP_FEATURE_SHUFFLE_RELATIVE_BIT |
                                  VK_SUBGROUP_FEATURE_CLUSTERED_BIT | VK_SUBGROUP_FEATURE_QUAD_BIT | VK_SUBGROUP_FEATURE_ROTATE_BIT_KHR |
                                  VK_SUBGROUP_FEATURE_ROTATE_CLUSTERED_BIT_KHR;
  p.subgroupQuadOperationsInAllStages = VK_TRUE;
  p.pointClippingBehavior = VK_POINT_CLIPPING_BEHAVIOR_ALL_CLIP_PLANES;
  p.maxMultiviewViewCount = 6;
  p.maxMultiviewInstanceIndex = 0x7fffffff;
  p.protectedNoFault = VK_FALSE;
  p.maxPerSetDescriptors = kMany;
  p.maxMemoryAllocationSize = heapBytes;
}

// What shaders may ask of denormals, signed zeros and rounding is what the frontend accepts.
VkBool32 floatMode(spv::Capability capability, spv::ExecutionMode mode, uint32_t width) {
  return frontend::supportsCapability(uint32_t(capability)) && !frontend::whyNotExecutionMode(uint32_t(mode), width);
}

void initFloatControls(VkPhysicalDeviceVulkan12Properties& p) {
  using C = spv::Capability;
  using M = spv::ExecutionMode;
  p.denormBehaviorIndependence = VK_SHADER_FLOAT_CONTROLS_INDEPENDENCE_ALL;
  p.roundingModeIndependence = VK_SHADER_FLOAT_CONTROLS_INDEPENDENCE_ALL;
#define PUMICE_FLOAT_MODE(member, mode)                                     \
  p.shader##member##Float16 = floatMode(C::mode, M::mode, 16);              \
  p.shader##member##Float32 = floatMode(C::mode, M::mode, 32);              \
  p.shader##member##Float64 = floatMode(C::mode, M::mode, 64);
  PUMICE_FLOAT_MODE(SignedZeroInfNanPreserve, SignedZeroInfNanPreserve)
  PUMICE_FLOAT_MODE(DenormPreserve, DenormPreserve)
  PUMICE_FLOAT_MODE(DenormFlushToZero, DenormFlushToZero)
  PUMICE_FLOAT_MODE(RoundingModeRTE, RoundingModeRTE)
  PUMICE_FLOAT_MODE(RoundingModeRTZ, RoundingModeRTZ)
#undef PUMICE_FLOAT_MODE
}

void initVulkan12(VkPhysicalDeviceVulkan12Properties& p, const VkPhysicalDeviceLimits& l) {
  // None of the registered drivers. Another's number would be a lie, and bring that one's workarounds; applications take the
  // default branch for one they do not know.
  p.driverID = VkDriverId(0);
  std::snprintf(p.driverName, sizeof p.driverName, "Pumice");
  std::snprintf(p.driverInfo, sizeof p.driverInfo, "Pumice " PUMICE_VERSION);
  p.conformanceVersion = {};    // not submitted
  initFloatControls(p);
  p.maxUpdateAfterBindDescriptorsInAllPools = kMany;
  p.shaderUniformBufferArrayNonUniformIndexingNative = VK_TRUE;
  p.shaderStorageBufferArrayNonUniformIndexingNative = VK_TRUE;
  p.robustBufferAccessUpdateAfterBind = VK_TRUE;
  p.maxPerStageDescriptorUpdateAfterBindSamplers = l.maxPerStageDescriptorSamplers;
  p.maxPerStageDescriptorUpdateAfterBindUniformBuffers = l.maxPerStageDescriptorUniformBuffers;
  p.maxPerStageDescriptorUpdateAfterBindStorageBuffers = l.maxPerStageDescriptorStorageBuffers;
  p.maxPerStageDescriptorUpdateAfterBindSampledImages = l.maxPerStageDescriptorSampledImages;
  p.maxPerStageDescriptorUpdateAfterBindStorageImages = l.maxPerStageDescriptorStorageImages;
  p.maxPerStageDescriptorUpdateAfterBindInputAttachments = l.maxPerStageDescriptorInputAttachments;
  p.maxPerStageUpdateAfterBindResources = l.maxPerStageResources;
  p.maxDescriptorSetUpdateAfterBindSamplers = l.maxDescriptorSetSamplers;
  p.maxDescriptorSetUpdateAfterBindUniformBuffers = l.maxDescriptorSetUniformBuffers;
  p.maxDescriptorSetUpdateAfterBindUniformBuffersDynamic = l.maxDescriptorSetUniformBuffersDynamic;
  p.maxDescriptorSetUpdateAfterBindStorageBuffers = l.maxDescriptorSetStorageBuffers;
  p.maxDescriptorSetUpdateAfterBindStorageBuffersDynamic = l.maxDescriptorSetStorageBuffersDynamic;
  p.maxDescriptorSetUpdateAfterBindSampledImages = l.maxDescriptorSetSampledImages;
  p.maxDescriptorSetUpdateAfterBindStorageImages = l.maxDescriptorSetStorageImages;
  p.maxDescriptorSetUpdateAfterBindInputAttachments = l.maxDescriptorSetInputAttachments;
  p.supportedDepthResolveModes = VK_RESOLVE_MODE_SAMPLE_ZERO_BIT | VK_RESOLVE_MODE_AVERAGE_BIT | VK_RESOLVE_MODE_MIN_BIT | VK_RESOLVE_MODE_MAX_BIT;
  p.supportedStencilResolveModes = VK_RESOLVE_MODE_SAMPLE_ZERO_BIT | VK_RESOLVE_MODE_MIN_BIT | VK_RESOLVE_MODE_MAX_BIT;
  p.independentResolveNone = p.independentResolve = VK_TRUE;
  p.filterMinmaxSingleComponentFormats = p.filterMinmaxImageComponentMapping = VK_TRUE;
  p.maxTimelineSemaphoreValueDifference = ~0ull;
  p.supportedDepthResolveModes = VK_RESOLVE_MODE_SAMPLE_ZERO_BIT | VK_RESOLVE_MODE_AVERAGE_BIT | VK_RESOLVE_MODE_MIN_BIT | VK_RESOLVE_MODE_MAX_BIT;
  p.supportedStencilResolveModes = VK_RESOLVE_MODE_SAMPLE_ZERO_BIT | VK_RESOLVE_MODE_MIN_BIT | VK_RESOLVE_MODE_MAX_BIT;
  p.independentResolveNone = p.independentResolve = VK_TRUE;
  p.framebufferIntegerColorSampleCounts = texture::sampleCounts(*texture::formatInfo(VK_FORMAT_R8G8B8A8_UINT));
}

void initVulkan13(VkPhysicalDeviceVulkan13Properties& p, const VkPhysicalDeviceLimits& l, uint64_t heapBytes) {
  p.minSubgroupSize = p.maxSubgroupSize = ir::kSubgroupLanes;
  p.maxComputeWorkgroupSubgroups = pipeline::kMaxGroupInvocations / ir::kSubgroupLanes;
  p.requiredSubgroupSizeStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT | VK_SHADER_STAGE_COMPUTE_BIT;
  // Bytes of a block and of all of a stage or a set; only host memory bounds them.
  p.maxInlineUniformBlockSize = kMaxInlineBlockBytes;
  p.maxPerStageDescriptorInlineUniformBlocks = p.maxPerStageDescriptorUpdateAfterBindInlineUniformBlocks = kMany;
  p.maxDescriptorSetInlineUniformBlocks = p.maxDescriptorSetUpdateAfterBindInlineUniformBlocks = kMany;
  p.maxInlineUniformTotalSize = kMany;
  p.storageTexelBufferOffsetAlignmentBytes = p.uniformTexelBufferOffsetAlignmentBytes = l.minTexelBufferOffsetAlignment;
  p.storageTexelBufferOffsetSingleTexelAlignment = p.uniformTexelBufferOffsetSingleTexelAlignment = VK_TRUE;
  p.maxBufferSize = std::min(heapBytes, uint64_t(1) << 47);
}

}  // namespace

void driverUuid(uint8_t out[VK_UUID_SIZE]) {
  std::memset(out, 0, VK_UUID_SIZE);
  std::memcpy(out, "pumice-" PUMICE_VERSION, std::min<size_t>(VK_UUID_SIZE, sizeof("pumice-" PUMICE_VERSION) - 1));
}

void initProperties(ExtendedProperties& p, const VkPhysicalDeviceLimits& limits, uint64_t heapBytes) {
  initVulkan11(p.v11, heapBytes);
  initVulkan12(p.v12, limits);
  initVulkan13(p.v13, limits, heapBytes);
}

void fillProperties(const ExtendedProperties& all, void* chain) {
  for (auto* s = static_cast<VkBaseOutStructure*>(chain); s; s = s->pNext) switch (uint32_t(s->sType)) {   // a number: newer ones are not enumerators
#define PUMICE_PROPERTY_MEMBER(aggregate, from, to)                \
  static_assert(sizeof(p.to) == sizeof(all.aggregate.from));       \
  std::memcpy(&p.to, &all.aggregate.from, sizeof(p.to));
#define PUMICE_PROPERTY_STRUCT(type, Struct, members) \
  case type: {                                        \
    auto& p = *reinterpret_cast<Struct*>(s);          \
    members break;                                    \
  }
#include "property_structs.inc"
#undef PUMICE_PROPERTY_STRUCT
#undef PUMICE_PROPERTY_MEMBER
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PUSH_DESCRIPTOR_PROPERTIES_KHR:
        reinterpret_cast<VkPhysicalDevicePushDescriptorPropertiesKHR*>(s)->maxPushDescriptors = 256;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_CUSTOM_BORDER_COLOR_PROPERTIES_EXT:
        reinterpret_cast<VkPhysicalDeviceCustomBorderColorPropertiesEXT*>(s)->maxCustomBorderColorSamplers = kMany;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ROBUSTNESS_2_PROPERTIES_EXT: {
        // Every scalar is bounded by itself, to the byte.
        auto& p = *reinterpret_cast<VkPhysicalDeviceRobustness2PropertiesEXT*>(s);
        p.robustStorageBufferAccessSizeAlignment = p.robustUniformBufferAccessSizeAlignment = 1;
        break;
      }
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MULTI_DRAW_PROPERTIES_EXT:
        reinterpret_cast<VkPhysicalDeviceMultiDrawPropertiesEXT*>(s)->maxMultiDrawCount = kMany;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VERTEX_ATTRIBUTE_DIVISOR_PROPERTIES_EXT:
        reinterpret_cast<VkPhysicalDeviceVertexAttributeDivisorPropertiesEXT*>(s)->maxVertexAttribDivisor = ~0u;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VERTEX_ATTRIBUTE_DIVISOR_PROPERTIES_KHR: {
        auto& p = *reinterpret_cast<VkPhysicalDeviceVertexAttributeDivisorPropertiesKHR*>(s);
        p.maxVertexAttribDivisor = ~0u;
        p.supportsNonZeroFirstInstance = VK_TRUE;
        break;
      }
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROVOKING_VERTEX_PROPERTIES_EXT:
        reinterpret_cast<VkPhysicalDeviceProvokingVertexPropertiesEXT*>(s)->provokingVertexModePerPipeline = VK_TRUE;
        reinterpret_cast<VkPhysicalDeviceProvokingVertexPropertiesEXT*>(s)->transformFeedbackPreservesTriangleFanProvokingVertex = VK_FALSE;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_LINE_RASTERIZATION_PROPERTIES_EXT:
        reinterpret_cast<VkPhysicalDeviceLineRasterizationPropertiesEXT*>(s)->lineSubPixelPrecisionBits = 8;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_MEMORY_HOST_PROPERTIES_EXT:
        reinterpret_cast<VkPhysicalDeviceExternalMemoryHostPropertiesEXT*>(s)->minImportedHostPointerAlignment = kHostPointerAlignment;
        break;
      case VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_ROBUSTNESS_PROPERTIES_EXT: {
        // Bounds are always looked at; only vertex attributes know two ways.
        auto& p = *reinterpret_cast<VkPhysicalDevicePipelineRobustnessPropertiesEXT*>(s);
        p.defaultRobustnessStorageBuffers = p.defaultRobustnessUniformBuffers = VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_ROBUST_BUFFER_ACCESS_2_EXT;
        p.defaultRobustnessVertexInputs = VK_PIPELINE_ROBUSTNESS_BUFFER_BEHAVIOR_ROBUST_BUFFER_ACCESS_EXT;
        p.defaultRobustnessImages = VK_PIPELINE_ROBUSTNESS_IMAGE_BEHAVIOR_ROBUST_IMAGE_ACCESS_2_EXT;
        break;
      }
      default: break;
    }
}

}  // namespace pumice::icd
