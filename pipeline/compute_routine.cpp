// Compute shaders: built-ins from the rows of ids that dispatch() fills.
#include <cstdio>

#include "pipeline/builders.h"
#include "spirv_interp/ir/waits.h"

namespace pumice::pipeline {

using ir::Op;
using ir::Type;
using ir::Value;

namespace {

constexpr uint32_t kSlotLocalId = 0, kSlotGroupId = 3;

class ComputeExpander : public StageExpander {
 public:
  ComputeExpander(const ComputePipeline& p, const ComputeKey& key) : StageExpander(*p.shader, *p.layout, p.images, key.images) {}

  Value builtin(ir::Builder& b, Type type, uint32_t builtIn, uint32_t c) override {
    const auto& size = shader_.localSize;
    const auto local = [&](uint32_t i) { return b.input(Type::I32, kSlotLocalId + i); };
    const auto group = [&](uint32_t i) { return b.input(Type::I32, kSlotGroupId + i); };
    Value v = 0;
    switch (builtIn) {
      case kLocalInvocationId: v = local(c); break;
      case kWorkgroupId: v = group(c); break;
      case kGlobalInvocationId: v = b.iadd(b.imul(group(c), b.i32(size[c])), local(c)); break;
      case kLocalInvocationIndex:
        v = b.iadd(b.iadd(b.imul(local(2), b.i32(size[0] * size[1])), b.imul(local(1), b.i32(size[0]))), local(0));
        break;
      case kWorkgroupSize: v = b.i32(size[c]); break;
      case kNumWorkgroups: v = drawField(b, Type::I32, offsetof(DrawConstants, groupCount), c); break;
      case kDeviceIndex: v = b.i32(0); break;
      default: fail(base::errorf("built-in %u is not supported", builtIn).message); v = b.i32(0);
    }
    return toType(b, type, v);
  }
};

std::string invocationText(const interp::ExecContext& context, uint32_t lane) {
  unsigned id[6];
  for (int i = 0; i < 6; ++i) id[i] = static_cast<const uint32_t*>(context.inputs[i])[lane];
  char text[120];
  std::snprintf(text, sizeof text, "invocation (%u, %u, %u) of work group (%u, %u, %u)", id[0], id[1], id[2], id[3], id[4], id[5]);
  return text;
}

}  // namespace

static uint64_t groupSize(const frontend::Shader& shader) { return uint64_t(shader.localSize[0]) * shader.localSize[1] * shader.localSize[2]; }

//! dispatch() gives rows whole multiples of 32 invocations of a work group where its size is one, beginning at such places.
static void promiseGroups(ir::Function& f, const frontend::Shader& shader) {
  if (groupSize(shader) % ir::kSubgroupLanes) return;
  for (int i = 0; i < 3; ++i) f.groupSize[i] = uint16_t(shader.localSize[i]);
}

static base::Result<std::shared_ptr<ComputeRoutine>> compile(const ComputePipeline& pipeline, const ComputeKey& key, const ir::Function& f, base::ThreadPool* workers) {
  const frontend::Shader& shader = *pipeline.shader;
  auto code = compileRoutine(f, key.numerics, {"compute shader \"" + shader.function.name + "\"", invocationText}, false, workers);
  if (!code) return std::move(code).error();
  auto routine = std::make_shared<ComputeRoutine>();
  routine->code = std::move(code).value();
  routine->localSize = shader.localSize;
  routine->sharedBytes = key.numerics == ir::Numerics::Oracle ? ir::oracleSharedBytes(shader.function.sharedBytes) : shader.function.sharedBytes;
  routine->groupsApart = routine->sharedBytes || shader.usesBarrier;
  uint32_t loops = 0;   // around the instruction
  const std::vector<uint8_t> taken = ir::takenValues(f);
  for (ir::Value v = 1; v < f.insts.size(); ++v) {
    const ir::Inst& i = f.insts[v];
    routine->groupsApart |= (i.op >= Op::QuadDdx && i.op <= Op::SubgroupReduce) || i.op == Op::LaneId;
    if (i.op == Op::Loop) ++loops;
    if (i.op == Op::EndLoop) --loops;
    if (loops) routine->waits |= ir::looksAtDeviceMemory(i) && (taken[v] || !ir::isAtomic(i.op));
  }
  routine->groupsApart |= routine->waits;
  return routine;
}

std::shared_ptr<ComputeRoutine> restoreComputeRoutine(const ComputePipeline& pipeline, const ComputeKey& key, base::ThreadPool* workers) {
  if (!pipeline.saved) return nullptr;
  Surroundings s;
  s.sets = uint32_t(pipeline.layout->sets.size());
  s.inputs.assign(6, Type::I32);
  s.workGroup = true;
  auto saved = pipeline.saved->find(savedKey(key), s);
  if (!saved || groupSize(*pipeline.shader) > kMaxGroupInvocations) return nullptr;
  saved->function.sharedBytes = pipeline.shader->function.sharedBytes;
  promiseGroups(saved->function, *pipeline.shader);
  auto made = compile(pipeline, key, saved->function, workers);
  if (!made) return nullptr;
  countRestored();
  return std::move(made).value();
}

base::Result<std::shared_ptr<ComputeRoutine>> buildComputeRoutine(const ComputePipeline& pipeline, const ComputeKey& key, base::ThreadPool* workers) {
  if (auto restored = restoreComputeRoutine(pipeline, key, workers)) return restored;
  const frontend::Shader& shader = *pipeline.shader;
  const uint64_t invocations = groupSize(shader);
  ir::Function f;
  f.name = "compute routine";
  f.sharedBytes = shader.function.sharedBytes;
  ir::Builder b(f);
  ComputeExpander expander(pipeline, key);
  ir::inlineShader(b, shader.function, expander);
  if (!expander.error().empty()) return base::Error{expander.error()};
  if (invocations == 0 || invocations > kMaxGroupInvocations)
    return base::errorf("work groups have 1 to %u invocations (this one: %llu)", kMaxGroupInvocations, static_cast<unsigned long long>(invocations));
  PUMICE_TRY(finishRoutine(f));
  if (pipeline.saved) pipeline.saved->insert(savedKey(key), f, 0);
  promiseGroups(f, shader);
  return compile(pipeline, key, f, workers);
}

}  // namespace pumice::pipeline
