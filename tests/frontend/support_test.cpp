// The tables of what is taken and what is refused cover the grammars: nothing is forgotten, nothing is in two lists.
#include <gtest/gtest.h>

#include <algorithm>

#include <spirv/unified1/GLSL.std.450.h>

#include "spirv_interp/frontend/support.h"
#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {
namespace {

TEST(Support, EveryCapabilityIsTakenOrRefusedWithAReason) {
  EXPECT_GT(allCapabilities().size(), 150u);
  for (const NumberName& c : allCapabilities())
    EXPECT_NE(supportsCapability(c.number), whyNotCapability(c.number) != nullptr) << c.name;
}

// Those that Vulkan 1.3 has for vertex, fragment and compute shaders.
TEST(Support, TheCapabilitiesOfVulkanAreTaken) {
  using C = spv::Capability;
  for (C c : {C::Shader, C::Matrix, C::Int8, C::Int16, C::Int64, C::Float16, C::Float64, C::StorageBuffer8BitAccess,
              C::UniformAndStorageBuffer8BitAccess, C::StoragePushConstant8, C::StorageBuffer16BitAccess,
              C::UniformAndStorageBuffer16BitAccess, C::StoragePushConstant16, C::StorageInputOutput16,
              C::VariablePointers, C::VariablePointersStorageBuffer, C::PhysicalStorageBufferAddresses,
              C::GroupNonUniform, C::GroupNonUniformVote, C::GroupNonUniformArithmetic, C::GroupNonUniformBallot,
              C::GroupNonUniformShuffle, C::GroupNonUniformShuffleRelative, C::GroupNonUniformClustered,
              C::GroupNonUniformQuad, C::Int64Atomics, C::AtomicFloat32AddEXT, C::ImageQuery, C::SampledBuffer,
              C::ImageBuffer, C::StorageImageMultisample, C::InputAttachment, C::ShaderNonUniform,
              C::RuntimeDescriptorArray, C::DemoteToHelperInvocation, C::DotProduct, C::DotProductInputAll,
              C::DotProductInput4x8Bit, C::DotProductInput4x8BitPacked, C::ExpectAssumeKHR, C::VulkanMemoryModel,
              C::GroupNonUniformRotateKHR, C::ShaderClockKHR,
              C::VulkanMemoryModelDeviceScope, C::DerivativeControl, C::ImageGatherExtended,
              C::StorageImageReadWithoutFormat, C::StorageImageWriteWithoutFormat, C::ClipDistance, C::CullDistance,
              C::SampleRateShading, C::MultiView, C::DrawParameters, C::RoundingModeRTE, C::DenormPreserve,
              C::SignedZeroInfNanPreserve, C::InterpolationFunction, C::ImageCubeArray, C::ImageMSArray, C::MinLod,
              C::Sampled1D, C::Image1D, C::DeviceGroup, C::ShaderLayer, C::ShaderViewportIndex})
    EXPECT_TRUE(supportsCapability(uint32_t(c))) << capabilityName(uint32_t(c));
}

TEST(Support, EveryOpcodeIsTranslatedOrRefusedWithAReason) {
  size_t handled = 0, refused = 0;
  for (const OpcodeInfo& info : allOpcodes()) {
    spv::Op op = spv::Op(info.opcode);
    int tables = (findHandler(op) != nullptr) + handledElsewhere(op);
    const char* why = whyNotOpcode(op);
    EXPECT_LE(tables, 1) << info.name << " is in two tables";
    EXPECT_NE(tables > 0, why != nullptr) << info.name << (why ? " is translated, though it " : " is forgotten") << (why ? why : "");
    handled += tables > 0;
    refused += why != nullptr;
  }
  EXPECT_GE(handled, 270u);
  EXPECT_GT(refused, 300u);
}

TEST(Support, EveryGlsl450InstructionIsTranslatedOrRefusedWithAReason) {
  EXPECT_EQ(allGlsl450().size(), 81u);
  for (const NumberName& i : allGlsl450())
    EXPECT_NE(handlesGlsl450(i.number), whyNotGlsl450(i.number) != nullptr) << i.name;
}

TEST(Support, ExecutionModesOfOtherStagesAreRefused) {
  using M = spv::ExecutionMode;
  size_t taken = 0;
  for (const NumberName& m : allExecutionModes()) taken += !whyNotExecutionMode(m.number, 32);
  EXPECT_EQ(taken, 13u);
  EXPECT_TRUE(whyNotExecutionMode(uint32_t(M::DenormFlushToZero), 32));
  EXPECT_TRUE(whyNotExecutionMode(uint32_t(M::RoundingModeRTZ), 32));
  EXPECT_FALSE(whyNotExecutionMode(uint32_t(M::DenormPreserve), 16));
  EXPECT_FALSE(whyNotExecutionMode(uint32_t(M::SignedZeroInfNanPreserve), 64));
  EXPECT_TRUE(whyNotExecutionMode(uint32_t(M::OutputVertices), 0));
}

}  // namespace
}  // namespace pumice::frontend
