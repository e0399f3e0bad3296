#include "spirv_interp/frontend/shader_bytes.h"

#include "spirv_interp/ir/bytes.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::frontend {
namespace {

// A new field of these belongs into fields() below, and changes the version. (One that fits into padding is not noticed.)
static_assert(sizeof(InterfaceVariable) == 40 && sizeof(Resource) == 32 && sizeof(Shader) == 272);

using ir::list, ir::text;

template <typename A>
void fields(A& a, InterfaceVariable& v) {
  a.value(v.location), a.value(v.component), a.value(v.index), a.value(v.locations), a.value(v.components), a.value(v.type);
  a.value(v.isSigned), a.value(v.builtIn), a.value(v.interpolation), a.value(v.sampling), a.value(v.usedComponents);
}

template <typename A>
void fields(A& a, Resource& r) {
  a.value(r.set), a.value(r.binding), a.value(r.kind), a.value(r.arraySize), a.value(r.readOnly), a.value(r.dynamicIndex);
  a.value(r.inputAttachmentIndex), a.value(r.usedConstantElements);
}

template <typename A>
void fields(A& a, Shader& s) {
  a.value(s.stage);
  ir::fields(a, s.function);
  list(a, s.inputs, 32, [&](InterfaceVariable& v) { fields(a, v); });
  list(a, s.outputs, 32, [&](InterfaceVariable& v) { fields(a, v); });
  list(a, s.inputBuiltIns, 4, [&](uint32_t& b) { a.value(b); });
  list(a, s.resources, 27, [&](Resource& r) { fields(a, r); });
  a.value(s.localSize);
  for (bool* flag : {&s.usesDerivatives, &s.mayDiscard, &s.writesMemory, &s.earlyFragmentTests, &s.writesDepth, &s.usesSampleRate, &s.usesBarrier}) a.value(*flag);
  list(a, s.sources, 1, [&](std::string& t) { text(a, t); });
}

// --- what is read

constexpr uint64_t kMostLocalBytes = 1 << 20, kMostSharedBytes = 1 << 20;

bool sound(const InterfaceVariable& v) {
  return v.location < (v.builtIn ? 10000u : 256u) && v.component < 4 && v.index < 2 && v.locations >= 1 && v.locations <= 64 && v.components >= 1 && v.components <= 64 &&
         v.type > ir::Type::None && v.type <= ir::Type::F64 && v.interpolation <= Interpolation::Flat && v.sampling <= SampleLocation::Sample;
}

}  // namespace

bool namesOnlyWhatIsThere(const Shader& s) {
  if (s.stage > Stage::Compute) return false;
  for (const auto* list : {&s.inputs, &s.outputs})
    for (const InterfaceVariable& v : *list)
      if (!sound(v)) return false;
  for (const Resource& r : s.resources)
    if (r.kind > ResourceKind::InputAttachment || r.set >= ir::kMaxDescriptorSets) return false;
  uint64_t invocations = 1;
  for (uint32_t n : s.localSize) {
    if (n < 1 || n > 1024) return false;
    invocations *= n;
  }
  if (invocations > 1024 || s.function.sharedBytes > kMostSharedBytes) return false;
  const ir::Function& f = s.function;
  const auto resource = [&](uint64_t n) { return n < s.resources.size(); };
  const auto variable = [](const std::vector<InterfaceVariable>& list, const ir::Inst& i) {
    const uint64_t number = i.imm >> 32, component = i.imm & 0xffffffff;
    return number < list.size() && component < 64 && (list[number].usedComponents >> component & 1);
  };
  uint64_t local = 0;
  for (const ir::Inst& i : f.insts) switch (i.op) {
      // What stands for a routine's own surroundings has no place in a shader.
      case ir::Op::Input: case ir::Op::UniformInput: case ir::Op::Output: case ir::Op::QuadLoad: case ir::Op::TileLoad: case ir::Op::TileStore:
      case ir::Op::Check: return false;
      case ir::Op::ShaderInput:
        if (!variable(s.inputs, i)) return false;
        break;
      case ir::Op::ShaderOutput:
        if (!variable(s.outputs, i)) return false;
        break;
      case ir::Op::Descriptor:
        if (!resource(i.imm)) return false;
        break;
      case ir::Op::ImageOp:
        if (!resource(f.imageOps[i.imm].imageResource) || !resource(f.imageOps[i.imm].samplerResource)) return false;
        break;
      case ir::Op::LocalAlloc:
        if ((local += i.imm) > kMostLocalBytes) return false;
        break;
      default: break;
    }
  return true;
}

std::vector<std::byte> toBytes(const Shader& shader) {
  ir::ByteWriter w;
  w.value(kShaderBytesVersion);
  fields(w, const_cast<Shader&>(shader));   // a writer only reads it
  return std::move(w.bytes);
}

std::shared_ptr<const Shader> fromBytes(std::span<const std::byte> bytes) {
  ir::ByteReader r(bytes);
  uint32_t version = 0;
  r.value(version);
  if (!r.ok || version != kShaderBytesVersion) return nullptr;
  auto shader = std::make_shared<Shader>();
  fields(r, *shader);
  if (!r.ok || !r.rest.empty() || !ir::verify(shader->function).empty() || !namesOnlyWhatIsThere(*shader)) return nullptr;
  ir::computeRates(shader->function);
  return shader;
}

}  // namespace pumice::frontend
