#include "spirv_interp/frontend/support.h"

#include <algorithm>
#include <iterator>

#include <spirv/unified1/GLSL.std.450.h>

namespace pumice::frontend {

namespace {

using C = spv::Capability;
using M = spv::ExecutionMode;
using O = spv::Op;

constexpr NumberName kCapabilityNames[] = {
#define PUMICE_SPIRV_CAPABILITY(number, name) {number, #name},
#include "spirv_interp/frontend/grammar.inc"
#undef PUMICE_SPIRV_CAPABILITY
};
constexpr NumberName kModeNames[] = {
#define PUMICE_SPIRV_MODE(number, name) {number, #name},
#include "spirv_interp/frontend/grammar.inc"
#undef PUMICE_SPIRV_MODE
};
constexpr NumberName kGlslNames[] = {
#define PUMICE_GLSL_450(number, name) {number, #name},
#include "spirv_interp/frontend/grammar.inc"
#undef PUMICE_GLSL_450
};
struct OpcodeCapability {
  uint32_t opcode, capability;
};
constexpr OpcodeCapability kOpcodeCapabilities[] = {
#define PUMICE_SPIRV_OP_CAPABILITY(opcode, capability) {opcode, capability},
#include "spirv_interp/frontend/grammar.inc"
#undef PUMICE_SPIRV_OP_CAPABILITY
};

constexpr C kSupported[] = {
    C::Matrix, C::Shader, C::Float16, C::Float64, C::Int64, C::Int16, C::Int8, C::Int64Atomics,
    // For reading built-ins in other stages; the stages themselves are refused by name.
    C::Geometry, C::Tessellation,
    C::ImageGatherExtended, C::StorageImageMultisample, C::UniformBufferArrayDynamicIndexing,
    C::SampledImageArrayDynamicIndexing, C::StorageBufferArrayDynamicIndexing, C::StorageImageArrayDynamicIndexing,
    C::ClipDistance, C::CullDistance, C::ImageCubeArray, C::SampleRateShading, C::SampledRect, C::InputAttachment,
    C::MinLod, C::Sampled1D, C::Image1D, C::SampledCubeArray, C::SampledBuffer, C::ImageBuffer, C::ImageMSArray,
    C::StorageImageExtendedFormats, C::ImageQuery, C::DerivativeControl, C::InterpolationFunction,
    C::StorageImageReadWithoutFormat, C::StorageImageWriteWithoutFormat, C::MultiViewport, C::DrawParameters,
    C::StorageBuffer16BitAccess, C::UniformAndStorageBuffer16BitAccess, C::StoragePushConstant16,
    C::StorageInputOutput16, C::DeviceGroup, C::MultiView, C::StorageBuffer8BitAccess,
    C::UniformAndStorageBuffer8BitAccess, C::StoragePushConstant8, C::StencilExportEXT, C::ShaderViewportIndexLayerEXT,
    C::ShaderViewportIndex, C::ShaderLayer, C::ShaderNonUniform, C::RuntimeDescriptorArray,
    C::InputAttachmentArrayDynamicIndexing, C::UniformTexelBufferArrayDynamicIndexing,
    C::StorageTexelBufferArrayDynamicIndexing, C::UniformBufferArrayNonUniformIndexing,
    C::SampledImageArrayNonUniformIndexing, C::StorageBufferArrayNonUniformIndexing,
    C::StorageImageArrayNonUniformIndexing, C::InputAttachmentArrayNonUniformIndexing,
    C::UniformTexelBufferArrayNonUniformIndexing, C::StorageTexelBufferArrayNonUniformIndexing,
    C::VulkanMemoryModel, C::VulkanMemoryModelDeviceScope, C::PhysicalStorageBufferAddresses,
    C::VariablePointersStorageBuffer, C::VariablePointers,
    C::DemoteToHelperInvocation, C::ExpectAssumeKHR, C::AtomicFloat32AddEXT, C::AtomicFloat64AddEXT,
    C::AtomicFloat32MinMaxEXT, C::AtomicFloat64MinMaxEXT, C::DotProduct,
    C::DotProductInputAll, C::DotProductInput4x8Bit, C::DotProductInput4x8BitPacked,
    C::GroupNonUniform, C::GroupNonUniformVote, C::GroupNonUniformArithmetic, C::GroupNonUniformBallot,
    C::GroupNonUniformShuffle, C::GroupNonUniformShuffleRelative, C::GroupNonUniformClustered, C::GroupNonUniformQuad,
    C::GroupNonUniformRotateKHR, C::ShaderClockKHR,
    C::SubgroupBallotKHR, C::SubgroupVoteKHR,
    // What lane IR does anyway; the execution modes say for which widths.
    C::DenormPreserve, C::SignedZeroInfNanPreserve, C::RoundingModeRTE,
};

constexpr const char* kOpenCl = "belongs to OpenCL, not to Vulkan";
constexpr const char* kNotVulkan = "is in no version of Vulkan";
constexpr const char* kRay = "needs ray tracing, which this driver does not have";
constexpr const char* kMesh = "needs mesh shaders, which this driver does not have";
constexpr const char* kGeometry = "needs geometry shaders, which are not supported yet";
constexpr const char* kTessellation = "needs tessellation shaders, which are not supported yet";
constexpr const char* kVendor = "is an extension of one vendor that this driver does not have";
constexpr const char* kExtension = "is an extension that this driver does not have";
constexpr const char* kSparse = "needs sparse residency, which this driver does not have";
constexpr const char* kRates = "needs fragment shading rates, which this driver does not have";

struct RejectedCapability {
  C capability;
  const char* reason;
};
constexpr RejectedCapability kRejected[] = {
    {C::Addresses, kOpenCl}, {C::Linkage, "is for modules to be linked, which Vulkan has not"}, {C::Kernel, kOpenCl},
    {C::Vector16, kOpenCl}, {C::Float16Buffer, kOpenCl}, {C::ImageBasic, kOpenCl}, {C::ImageReadWrite, kOpenCl},
    {C::ImageMipmap, kOpenCl}, {C::Pipes, kOpenCl}, {C::Groups, kOpenCl}, {C::DeviceEnqueue, kOpenCl},
    {C::LiteralSampler, kOpenCl}, {C::AtomicStorage, kNotVulkan}, {C::TessellationPointSize, kTessellation},
    {C::GeometryPointSize, kGeometry}, {C::ImageRect, kNotVulkan}, {C::GenericPointer, kOpenCl},
    {C::SparseResidency, kSparse}, {C::TransformFeedback, kExtension}, {C::GeometryStreams, kGeometry},
    {C::SubgroupDispatch, kOpenCl}, {C::NamedBarrier, kOpenCl}, {C::PipeStorage, kOpenCl},
    {C::UniformDecoration, kOpenCl}, {C::CoreBuiltinsARM, kVendor}, {C::FragmentShadingRateKHR, kRates},
    {C::WorkgroupMemoryExplicitLayoutKHR, kExtension}, {C::WorkgroupMemoryExplicitLayout8BitAccessKHR, kExtension},
    {C::WorkgroupMemoryExplicitLayout16BitAccessKHR, kExtension}, {C::AtomicStorageOps, kNotVulkan},
    {C::SampleMaskPostDepthCoverage, kExtension},
    {C::DenormFlushToZero, "cannot be had: denormal numbers are always kept"},
    {C::RoundingModeRTZ, "cannot be had: rounding is always to nearest even"},
    {C::RayQueryProvisionalKHR, kRay}, {C::RayQueryKHR, kRay}, {C::RayTraversalPrimitiveCullingKHR, kRay},
    {C::RayTracingKHR, kRay}, {C::Float16ImageAMD, kVendor}, {C::ImageGatherBiasLodAMD, kVendor},
    {C::FragmentMaskAMD, kVendor}, {C::ImageReadWriteLodAMD, kVendor}, {C::Int64ImageEXT, kExtension},
    {C::SampleMaskOverrideCoverageNV, kVendor},
    {C::GeometryShaderPassthroughNV, kGeometry}, {C::ShaderViewportMaskNV, kVendor}, {C::ShaderStereoViewNV, kVendor},
    {C::PerViewAttributesNV, kVendor}, {C::FragmentFullyCoveredEXT, kExtension}, {C::MeshShadingNV, kMesh},
    {C::ImageFootprintNV, kVendor}, {C::MeshShadingEXT, kMesh}, {C::FragmentBarycentricKHR, kExtension},
    {C::ComputeDerivativeGroupQuadsNV, kVendor}, {C::FragmentDensityEXT, kRates},
    {C::GroupNonUniformPartitionedNV, kVendor}, {C::RayTracingNV, kRay}, {C::RayTracingMotionBlurNV, kRay},
    {C::ComputeDerivativeGroupLinearNV, kVendor}, {C::RayTracingProvisionalKHR, kRay}, {C::CooperativeMatrixNV, kVendor},
    {C::FragmentShaderSampleInterlockEXT, kExtension}, {C::FragmentShaderShadingRateInterlockEXT, kExtension},
    {C::ShaderSMBuiltinsNV, kVendor}, {C::FragmentShaderPixelInterlockEXT, kExtension},
    {C::RayTracingOpacityMicromapEXT, kRay}, {C::ShaderInvocationReorderNV, kRay}, {C::BindlessTextureNV, kVendor},
    {C::SubgroupShuffleINTEL, kOpenCl}, {C::SubgroupBufferBlockIOINTEL, kOpenCl}, {C::SubgroupImageBlockIOINTEL, kOpenCl},
    {C::SubgroupImageMediaBlockIOINTEL, kOpenCl}, {C::RoundToInfinityINTEL, kOpenCl}, {C::FloatingPointModeINTEL, kOpenCl},
    {C::IntegerFunctions2INTEL, kVendor}, {C::FunctionPointersINTEL, kOpenCl}, {C::IndirectReferencesINTEL, kOpenCl},
    {C::AsmINTEL, kOpenCl}, {C::AtomicFloat16MinMaxEXT, "needs atomics of 16 bits, which Vulkan's core has not"},
    {C::VectorComputeINTEL, kOpenCl}, {C::VectorAnyINTEL, kOpenCl}, {C::SubgroupAvcMotionEstimationINTEL, kOpenCl},
    {C::SubgroupAvcMotionEstimationIntraINTEL, kOpenCl}, {C::SubgroupAvcMotionEstimationChromaINTEL, kOpenCl},
    {C::VariableLengthArrayINTEL, kOpenCl}, {C::FunctionFloatControlINTEL, kOpenCl}, {C::FPGAMemoryAttributesINTEL, kOpenCl},
    {C::FPFastMathModeINTEL, kOpenCl}, {C::ArbitraryPrecisionIntegersINTEL, kOpenCl},
    {C::ArbitraryPrecisionFloatingPointINTEL, kOpenCl}, {C::UnstructuredLoopControlsINTEL, kOpenCl},
    {C::FPGALoopControlsINTEL, kOpenCl}, {C::KernelAttributesINTEL, kOpenCl}, {C::FPGAKernelAttributesINTEL, kOpenCl},
    {C::FPGAMemoryAccessesINTEL, kOpenCl}, {C::FPGAClusterAttributesINTEL, kOpenCl}, {C::LoopFuseINTEL, kOpenCl},
    {C::FPGADSPControlINTEL, kOpenCl}, {C::MemoryAccessAliasingINTEL, kOpenCl},
    {C::FPGAInvocationPipeliningAttributesINTEL, kOpenCl}, {C::FPGABufferLocationINTEL, kOpenCl},
    {C::ArbitraryPrecisionFixedPointINTEL, kOpenCl}, {C::USMStorageClassesINTEL, kOpenCl},
    {C::RuntimeAlignedAttributeINTEL, kOpenCl}, {C::IOPipesINTEL, kOpenCl}, {C::BlockingPipesINTEL, kOpenCl},
    {C::FPGARegINTEL, kOpenCl}, {C::RayCullMaskKHR, kRay}, {C::BitInstructions, kOpenCl},
    {C::LongConstantCompositeINTEL, kOpenCl}, {C::OptNoneINTEL, kOpenCl},
    {C::AtomicFloat16AddEXT, "needs atomics of 16 bits, which Vulkan's core has not"}, {C::DebugInfoModuleINTEL, kOpenCl},
    {C::SplitBarrierINTEL, kOpenCl}, {C::GroupUniformArithmeticKHR, kOpenCl},
};

struct RejectedOpcode {
  O op;
  const char* reason;
};
constexpr RejectedOpcode kRejectedOpcodes[] = {
    {O::OpEmitVertex, kGeometry},
    {O::OpEndPrimitive, kGeometry},
};

struct RejectedGlsl {
  uint32_t number;
  const char* reason;
};
constexpr RejectedGlsl kRejectedGlsl[] = {
    {GLSLstd450IMix, "was taken out of the instruction set; OpSelect is meant"},
};

// Execution modes that shaders may state. Float controls name widths: those for which they hold.
enum Widths : uint32_t { kNoWidth = 0, k16 = 1, k32 = 2, k64 = 4 };
struct AcceptedMode {
  M mode;
  uint32_t widths = kNoWidth;
};
constexpr AcceptedMode kModes[] = {
    {M::OriginUpperLeft},    {M::EarlyFragmentTests},  {M::DepthReplacing},
    {M::DepthGreater},       {M::DepthLess},           {M::DepthUnchanged},
    {M::LocalSize},          {M::LocalSizeId},         {M::SubgroupUniformControlFlowKHR},
    {M::StencilRefReplacingEXT},
    {M::DenormPreserve, k16 | k32 | k64},
    {M::SignedZeroInfNanPreserve, k16 | k32 | k64},
    {M::RoundingModeRTE, k16 | k32 | k64},
};

const char* nameOf(std::span<const NumberName> table, uint32_t number) {
  auto at = std::find_if(table.begin(), table.end(), [&](const NumberName& n) { return n.number == number; });
  return at == table.end() ? nullptr : at->name;
}

}  // namespace

std::span<const NumberName> allCapabilities() { return kCapabilityNames; }
std::span<const NumberName> allExecutionModes() { return kModeNames; }
std::span<const NumberName> allGlsl450() { return kGlslNames; }

std::vector<uint32_t> capabilitiesOf(spv::Op op) {
  std::vector<uint32_t> out;
  for (const OpcodeCapability& entry : kOpcodeCapabilities)
    if (entry.opcode == uint32_t(op)) out.push_back(entry.capability);
  return out;
}

bool supportsCapability(uint32_t capability) {
  return std::find(std::begin(kSupported), std::end(kSupported), C(capability)) != std::end(kSupported);
}

const char* whyNotCapability(uint32_t capability) {
  for (const RejectedCapability& entry : kRejected)
    if (entry.capability == C(capability)) return entry.reason;
  return nullptr;
}

const char* whyNotOpcode(spv::Op op) {
  for (const RejectedOpcode& entry : kRejectedOpcodes)
    if (entry.op == op) return entry.reason;
  for (uint32_t capability : capabilitiesOf(op))
    if (supportsCapability(capability)) return nullptr;
  for (uint32_t capability : capabilitiesOf(op))
    if (const char* reason = whyNotCapability(capability)) return reason;
  return nullptr;
}

const char* whyNotGlsl450(uint32_t instruction) {
  for (const RejectedGlsl& entry : kRejectedGlsl)
    if (entry.number == instruction) return entry.reason;
  return nullptr;
}

const char* whyNotExecutionMode(uint32_t mode, uint32_t operand) {
  for (const AcceptedMode& entry : kModes) {
    if (entry.mode != M(mode)) continue;
    if (entry.widths == kNoWidth) return nullptr;
    uint32_t width = operand == 16 ? k16 : operand == 32 ? k32 : operand == 64 ? k64 : kNoWidth;
    return entry.widths & width ? nullptr : "is not promised for numbers of this width";
  }
  return "is not one that vertex, fragment and compute shaders can have here";
}

std::string executionModeName(uint32_t mode) {
  const char* name = nameOf(kModeNames, mode);
  return name ? name : "execution mode " + std::to_string(mode);
}

std::string capabilityName(uint32_t capability) {
  const char* name = nameOf(kCapabilityNames, capability);
  return name ? name : "capability " + std::to_string(capability);
}

}  // namespace pumice::frontend
