// SPIR-V to shader IR: one entry point, specialised, fully inlined and scalarised, with abstract operations
// (ShaderInput, ShaderOutput, Builtin, Descriptor, ImageOp) for what depends on the pipeline.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "spirv_interp/ir/ir.h"

namespace pumice::base {
class ThreadPool;
}

namespace pumice::frontend {

using base::Result;

enum class Stage : uint8_t { Vertex, TessControl, TessEval, Geometry, Fragment, Compute };

enum class Interpolation : uint8_t { Perspective, Linear, Flat };
enum class SampleLocation : uint8_t { Center, Centroid, Sample };

//! One input or output variable (or block member) with a Location. Component c of array/matrix element e is
//! numbered e*4 + c: element e lies at `location + e`. (64-bit scalars: c is 0 or 1, two to a location.) In a
//! built-in, components are numbered through from 0 (element i of ClipDistance is component i).
struct InterfaceVariable {
  uint32_t location = 0;
  uint32_t component = 0;          //!< first component (Component decoration)
  uint32_t index = 0;              //!< dual-source index
  uint32_t locations = 1;          //!< how many consecutive locations
  uint32_t components = 1;         //!< scalars per location
  ir::Type type = ir::Type::F32;
  bool isSigned = false;
  bool builtIn = false;            //!< then `location` is the spv::BuiltIn, written through ShaderOutput
  Interpolation interpolation = Interpolation::Perspective;
  SampleLocation sampling = SampleLocation::Center;
  uint64_t usedComponents = 0;     //!< bit e*4+c: statically read or written
};

enum class ResourceKind : uint8_t {
  UniformBuffer, StorageBuffer, SampledImage, Sampler, CombinedImageSampler, StorageImage,
  UniformTexelBuffer, StorageTexelBuffer, InputAttachment
};
struct Resource {
  uint32_t set = 0, binding = 0;
  ResourceKind kind = ResourceKind::UniformBuffer;
  uint32_t arraySize = 1;          //!< 0 = run-time array
  bool readOnly = false;           //!< NonWritable or never written
  bool dynamicIndex = false;       //!< indexed by something not constant
  uint32_t inputAttachmentIndex = 0;
  uint64_t usedConstantElements = 0;  //!< bit per array element used with a constant index (<64)
};

//! Work-group memory must be zero when a group starts: variables may have a zero initializer.
struct Shader {
  Stage stage = Stage::Vertex;
  ir::Function function;           //!< optimised shader IR
  std::vector<InterfaceVariable> inputs;   //!< index = `variable` of ShaderInput
  std::vector<InterfaceVariable> outputs;  //!< built-ins that are written are here too (builtIn = true)
  std::vector<uint32_t> inputBuiltIns;     //!< spv::BuiltIn values read by Builtin operations
  std::vector<Resource> resources; //!< index = resource of Descriptor / ImageOpInfo
  std::array<uint32_t, 3> localSize{1, 1, 1};
  bool usesDerivatives = false;    //!< derivatives, implicit level of detail or quad operations: helper lanes needed
  bool mayDiscard = false;
  bool writesMemory = false;
  bool earlyFragmentTests = false;
  bool writesDepth = false;        //!< DepthReplacing
  bool usesSampleRate = false;     //!< SampleId, SamplePosition or a sample-interpolated input is in the interface
  bool usesBarrier = false;
  std::vector<std::string> sources;
};

struct SpecializationConstant {
  uint32_t id;
  std::vector<std::byte> data;
  bool operator==(const SpecializationConstant&) const = default;
};

//! Parsed module, shared by the pipelines made from it. SPIRV-Tools' validator takes longer than everything else that a
//! pipeline needs, so it may run beside the translator, which survives any words (it is fuzzed).
class Module;
enum class Validate : uint8_t {
  First,   //!< an invalid module gives an error with the validator's text
  Beside,  //!< on a worker; validity() waits for it, or does it when no worker has begun
};
base::Result<std::shared_ptr<const Module>> parseModule(std::span<const uint32_t> words, Validate validate = Validate::First,
                                                        base::ThreadPool* workers = nullptr);
//! What the validator has against a module that was parsed with Validate::Beside. While a worker is at it, other tasks are done.
base::Status validity(const Module& module, base::ThreadPool* workers = nullptr);

//! Errors name what is invalid or not supported (opcode, capability) and where.
base::Result<std::shared_ptr<const Shader>> translate(const Module& module, Stage stage, std::string_view entryPoint,
                                               std::span<const SpecializationConstant> specialization);
//! Calls of translate() since the process started.
uint64_t translations();

}  // namespace pumice::frontend
