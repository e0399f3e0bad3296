// A compute shader in SPIR-V assembly, made of the parts in which tests differ. Includes nothing: clients of the API use it too.
#pragma once

#include <string>
#include <vector>

namespace pumice::test {

//! There are always %void, %fn (void()), %bool, %uint, %int, %uint3, %n0 .. %n9 (of %uint), %glsl (GLSL.std.450), %gid
//! (GlobalInvocationId), %ptr (to an element in a storage buffer).
struct ComputeModule {
  unsigned lanes = 64;                    //!< of a work group
  std::string head = {};                  //!< capabilities besides Shader, extensions
  std::string modes = {};                 //!< execution modes besides the size
  std::vector<std::string> buffers = {};  //!< names: variables at set 0, bindings 0, 1, ..., each a run-time array of elements
  bool namesBuffers = true;               //!< in the entry point's interface, as SPIR-V 1.4 and later wants it
  std::string interface = {};             //!< what stands there besides
  std::string element = "%uint";          //!< of the buffers
  std::string elementType = {};           //!< its declaration, if it is another
  unsigned elementBytes = 4;
  std::string decorations = {};
  std::string types = {};                 //!< types, constants and variables besides
  std::string body = {};                  //!< of %main after its label, up to the return
  std::string functions = {};
};

//! The start of a body: %i is the invocation's number.
inline const char* const kInvocation = "%ids = OpLoad %uint3 %gid\n%i = OpCompositeExtract %uint %ids 0\n";

inline std::string textOf(const ComputeModule& m) {
  std::string names, bindings, variables, constants;
  for (size_t k = 0; k < m.buffers.size(); k++) {
    const std::string& name = m.buffers[k];
    if (m.namesBuffers) names += " " + name;
    bindings += "OpDecorate " + name + " DescriptorSet 0\nOpDecorate " + name + " Binding " + std::to_string(k) + "\n";
    variables += name + " = OpVariable %ptr_elements StorageBuffer\n";
  }
  for (int k = 0; k < 10; k++) constants += "%n" + std::to_string(k) + " = OpConstant %uint " + std::to_string(k) + "\n";
  return "OpCapability Shader\n" + m.head + R"(
%glsl = OpExtInstImport "GLSL.std.450"
OpMemoryModel Logical GLSL450
OpEntryPoint GLCompute %main "main" %gid)" + names + " " + m.interface + R"(
OpExecutionMode %main LocalSize )" + std::to_string(m.lanes) + " 1 1\n" + m.modes + R"(
OpDecorate %gid BuiltIn GlobalInvocationId
OpDecorate %element_list ArrayStride )" + std::to_string(m.elementBytes) + R"(
OpDecorate %elements Block
OpMemberDecorate %elements 0 Offset 0
)" + bindings + m.decorations + R"(
%void = OpTypeVoid
%fn = OpTypeFunction %void
%bool = OpTypeBool
%uint = OpTypeInt 32 0
%int = OpTypeInt 32 1
%uint3 = OpTypeVector %uint 3
)" + constants + m.elementType + R"(
%element_list = OpTypeRuntimeArray )" + m.element + R"(
%elements = OpTypeStruct %element_list
%ptr_elements = OpTypePointer StorageBuffer %elements
%ptr = OpTypePointer StorageBuffer )" + m.element + R"(
%ptr_gid = OpTypePointer Input %uint3
%gid = OpVariable %ptr_gid Input
)" + variables + m.types + R"(
%main = OpFunction %void None %fn
%entry = OpLabel
)" + m.body + R"(
OpReturn
OpFunctionEnd
)" + m.functions;
}

}  // namespace pumice::test
