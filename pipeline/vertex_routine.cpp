// Vertex fetch, vertex shader, and the rows that clipping and setup read.
#include <cstdio>
#include <map>
#include <mutex>
#include <set>

#include "base/log.h"
#include "pipeline/builders.h"
#include "spirv_interp/ir/checks.h"
#include "spirv_interp/ir/decisions.h"

namespace pumice::pipeline {

using ir::Type;
using ir::Value;

namespace {

constexpr uint32_t kSlotVertexIndex = 0, kSlotInstanceIndex = 1;

//! The scalar of a 64-bit input, as I64. Attributes of more than two components go on in the next location.
Value fetchWideAttribute(ir::Builder& b, const GraphicsState& state, const frontend::InterfaceVariable& v, uint32_t component);

class VertexExpander : public StageExpander {
 public:
  VertexExpander(const GraphicsPipeline& p, const VertexKey& key)
      : StageExpander(*p.vertex, *p.layout, p.vertexImages, key.images), pipeline_(p), wide_(key.numerics == ir::Numerics::Oracle) {}

  //! Declares a variable per row: what the shader does not write is zero.
  void declare(ir::Builder& b) {
    for (uint32_t r = 0; r < pipeline_.link.rowCount; ++r) rows_.push_back(b.var(wide_ ? Type::F64 : Type::F32));
  }
  void setWord(ir::Builder& b, uint32_t row, Value word) { b.set(rows_[row], inRow(b, word)); }
  void writeRows(ir::Builder& b) {
    for (uint32_t r = 0; r < rows_.size(); ++r) b.output(r, b.get(rows_[r]));
  }

  Value shaderInput(ir::Builder& b, Type type, uint32_t variable, uint32_t component, std::span<const Value>) override {
    if (is64Bit(type)) return toType(b, type, fetchWideAttribute(b, pipeline_.state, shader_.inputs[variable], component));
    const Place p = place(shader_.inputs[variable], component);
    const bool checked = checks_ && checked_.insert(p.location).second;   // once for all components
    const texture::Texel texel = fetchAttribute(b, pipeline_.state, p.location, checked);
    return toType(b, type, texel[p.component & 3]);
  }

  void shaderOutput(ir::Builder& b, uint32_t variable, uint32_t component, Value value, std::span<const Value>) override {
    const frontend::InterfaceVariable& v = shader_.outputs[variable];
    int32_t row = -1;
    if (v.builtIn) {
      if (v.location == kPosition) row = int32_t(component & 3);
      const StageLink& link = pipeline_.link;
      if (v.location == kPointSize) row = link.pointSizeRow;
      if (v.location == kViewportIndex) row = link.viewportRow;
      if (v.location == kLayer) row = link.layerRow;
      if (v.location == kClipDistance) row = link.clipDistanceRow + int32_t(component);
      if (v.location == kCullDistance) row = link.cullDistanceRow + int32_t(component);
    } else if (is64Bit(v.type)) {
      const Value bits = toType(b, Type::I64, value);
      for (uint32_t word = 0; word < 2; ++word)
        if (auto it = pipeline_.link.rows.find(wordPlace(v, component, word)); it != pipeline_.link.rows.end())
          b.set(rows_[it->second], inRow(b, b.convert(ir::Op::Trunc, Type::I32, word ? b.lshr(bits, b.i64(32)) : bits)));
    } else if (auto it = pipeline_.link.rows.find(place(v, component)); it != pipeline_.link.rows.end()) {
      row = int32_t(it->second);
    }
    if (row >= 0) b.set(rows_[size_t(row)], inRow(b, value));
  }

  Value builtin(ir::Builder& b, Type type, uint32_t builtIn, uint32_t) override {
    switch (builtIn) {
      case kVertexIndex: return toType(b, type, b.input(Type::I32, kSlotVertexIndex));
      case kInstanceIndex: return toType(b, type, b.input(Type::I32, kSlotInstanceIndex));
      case kBaseVertex: return toType(b, type, PUMICE_DRAW_FIELD(b, I32, vertexOffset));
      case kBaseInstance: return toType(b, type, PUMICE_DRAW_FIELD(b, I32, firstInstance));
      case kDrawIndex: return toType(b, type, PUMICE_DRAW_FIELD(b, I32, drawIndex));
      case kViewIndex: return toType(b, type, PUMICE_DRAW_FIELD(b, I32, viewIndex));
      case kDeviceIndex: return b.zero(type);
      default: fail(base::errorf("built-in %u is not supported", builtIn).message); return b.zero(type);
    }
  }

 private:
  //! A number or a word in the form that rows have.
  Value inRow(ir::Builder& b, Value v) const {
    if (!wide_) return toType(b, Type::F32, v);
    return ir::isFloat(b.type(v)) ? keepDouble(b, Type::F64, v) : b.bitcast(Type::F64, toType(b, Type::I64, v));
  }

  const GraphicsPipeline& pipeline_;
  const bool wide_;
  const bool checks_ = ir::wantedChecks() & ir::kCheckBounds;
  std::set<uint32_t> checked_;
  std::vector<Value> rows_;
};

}  // namespace

namespace {

//! Where an attribute of the current vertex lies: memory and its size (i64), and the offset in it.
struct AttributePlace {
  const texture::FormatInfo* format = nullptr;   //!< null: there is no such attribute
  Value base = 0, offset = 0, size = 0;
};

AttributePlace locateAttribute(ir::Builder& b, const GraphicsState& state, uint32_t location, bool checked = false) {
  const VkVertexInputAttributeDescription* attribute = nullptr;
  for (const auto& a : state.vertexAttributes)
    if (a.location == location) attribute = &a;
  const VkVertexInputBindingDescription* binding = nullptr;
  if (attribute)
    for (const auto& v : state.vertexBindings)
      if (v.binding == attribute->binding) binding = &v;
  const texture::FormatInfo* format = attribute ? texture::formatInfo(attribute->format) : nullptr;
  if (!binding || !format) return {};

  const size_t buffer = offsetof(VertexConstants, vertexBuffers) + sizeof(VertexBufferRef) * binding->binding;
  const Value base = b.uniform(Type::I64, uint32_t(buffer + offsetof(VertexBufferRef, base)));
  const Value size = b.uniform(Type::I64, uint32_t(buffer + offsetof(VertexBufferRef, size)));
  const bool instanced = binding->inputRate == VK_VERTEX_INPUT_RATE_INSTANCE;
  // 64 bits: an index may be anything, and index * stride must not wrap back into the buffer.
  Value number = b.input(Type::I32, instanced ? kSlotInstanceIndex : kSlotVertexIndex);
  if (instanced)
    for (const auto& d : state.divisors)
      if (d.binding == binding->binding) {
        const Value first = PUMICE_DRAW_FIELD(b, I32, firstInstance);
        number = d.divisor ? b.iadd(first, b.udiv(b.isub(number, first), b.i32(d.divisor))) : first;
      }
  const Value index = b.convert(ir::Op::ZExt, Type::I64, number);
  const Value offset = b.iadd(b.imul(index, b.i64(binding->stride)), b.i64(attribute->offset));
  if (checked) {
    const Value operands[] = {b.mask(true), offset, b.i32(format->elementBytes), size};
    b.emit(ir::Op::Check, Type::None, operands, ir::checkImm({ir::CheckKind::Vertex, ir::Op::LoadConst, Type::None, location}));
  }
  if (!state.wholeAttributes) return {format, base, offset, size};
  const Value inside = b.ule(b.iadd(offset, b.i64(format->elementBytes)), size);
  return {format, base, offset, b.select(inside, size, b.i64(0))};
}

Value fetchWideAttribute(ir::Builder& b, const GraphicsState& state, const frontend::InterfaceVariable& v, uint32_t component) {
  const Place p = wordPlace(v, component, 0);
  uint32_t element = p.component / 2;
  AttributePlace at = locateAttribute(b, state, p.location);
  if (!at.format && p.location > v.location) {
    at = locateAttribute(b, state, p.location - 1);
    element += 2;
  }
  if (!at.format || at.format->rgba[element & 3].bits != 64) return b.i64(0);
  return b.load(Type::I64, at.base, b.iadd(at.offset, b.i64(8 * (element & 3))), at.size);
}

}  // namespace

texture::Texel fetchAttribute(ir::Builder& b, const GraphicsState& state, uint32_t location, bool checked) {
  const AttributePlace at = locateAttribute(b, state, location, checked);
  if (!at.format) return {b.f32(0), b.f32(0), b.f32(0), b.f32(1)};
  return texture::loadTexel(b, *at.format, at.base, at.offset, at.size, true);
}

static std::string vertexText(const interp::ExecContext& context, uint32_t lane) {
  char text[64];
  std::snprintf(text, sizeof text, "vertex %u of instance %u", static_cast<const uint32_t*>(context.inputs[kSlotVertexIndex])[lane],
                static_cast<const uint32_t*>(context.inputs[kSlotInstanceIndex])[lane]);
  return text;
}

static base::Result<std::shared_ptr<VertexRoutine>> compile(const GraphicsPipeline& pipeline, const VertexKey& key, const ir::Function& f, base::ThreadPool* workers) {
  auto code = compileRoutine(f, key.numerics, {"vertex shader \"" + pipeline.vertex->function.name + "\"", vertexText}, false, workers);
  if (!code) return std::move(code).error();
  auto routine = std::make_shared<VertexRoutine>();
  routine->code = std::move(code).value();
  routine->rowCount = pipeline.link.rowCount;
  routine->wide = key.numerics == ir::Numerics::Oracle;
  return routine;
}

std::shared_ptr<VertexRoutine> restoreVertexRoutine(const GraphicsPipeline& pipeline, const VertexKey& key, base::ThreadPool* workers) {
  if (!pipeline.saved) return nullptr;
  Surroundings s;
  s.sets = uint32_t(pipeline.layout->sets.size());
  s.drawBytes = sizeof(VertexConstants);
  s.inputs = {Type::I32, Type::I32};   // kSlotVertexIndex, kSlotInstanceIndex
  s.outputs.assign(pipeline.link.rowCount, key.numerics == ir::Numerics::Oracle ? Type::F64 : Type::F32);
  auto saved = pipeline.saved->find(savedKey(key), s);
  if (!saved) return nullptr;
  auto made = compile(pipeline, key, saved->function, workers);
  if (!made) return nullptr;
  countRestored();
  return std::move(made).value();
}

namespace {

//! Vertex routines that pipelines have: many differ in their fragments alone, and then the vertex shader is linked once.
class Linked {
 public:
  std::shared_ptr<VertexRoutine> find(const SavedPipelineKey& key, const std::shared_ptr<const frontend::Shader>& shader) {
    std::shared_ptr<VertexRoutine> found;   // let go, should it be the last, when the lock is
    std::lock_guard lock(mutex_);
    const auto it = entries_.find(key);
    // Another shader may have come to stand where one was.
    if (it == entries_.end() || it->second.shader.owner_before(shader) || shader.owner_before(it->second.shader)) return nullptr;
    found = it->second.routine.lock();
    return found;
  }
  //! Gives the routine as pipelines are to hold it. The latest of several with one key is known.
  std::shared_ptr<VertexRoutine> insert(const SavedPipelineKey& key, const std::shared_ptr<const frontend::Shader>& shader, std::shared_ptr<VertexRoutine> made) {
    std::shared_ptr<VertexRoutine> shared(made.get(), [this, key, made](VertexRoutine* r) {
      std::lock_guard lock(mutex_);
      if (const auto it = entries_.find(key); it != entries_.end() && it->second.which == r) entries_.erase(it);
    });
    std::lock_guard lock(mutex_);
    entries_.insert_or_assign(key, Entry{made.get(), shader, shared});
    return shared;
  }
  //! Never destroyed (routine_code.cpp); without routines it holds nothing.
  static Linked& all() {
    union Forever {
      Linked linked;
      Forever() : linked() {}
      ~Forever() {}
    };
    static Forever forever;
    return forever.linked;
  }

 private:
  struct Entry {
    const VertexRoutine* which;
    std::weak_ptr<const frontend::Shader> shader;
    std::weak_ptr<VertexRoutine> routine;
  };
  std::mutex mutex_;
  std::map<SavedPipelineKey, Entry> entries_;
};

}  // namespace

static base::Result<std::shared_ptr<VertexRoutine>> linkVertexRoutine(const GraphicsPipeline& pipeline, const VertexKey& key, base::ThreadPool* workers);

base::Result<std::shared_ptr<VertexRoutine>> buildVertexRoutine(const GraphicsPipeline& pipeline, const VertexKey& key, base::ThreadPool* workers) {
  if (auto restored = restoreVertexRoutine(pipeline, key, workers)) return restored;
  if (pipeline.saved) return linkVertexRoutine(pipeline, key, workers);   // which leaves its IR there
  const SavedPipelineKey part = vertexPartKey(pipeline, key);
  if (auto known = Linked::all().find(part, pipeline.vertex)) return known;
  auto made = linkVertexRoutine(pipeline, key, workers);
  if (!made) return made;
  return Linked::all().insert(part, pipeline.vertex, std::move(made).value());
}

static base::Result<std::shared_ptr<VertexRoutine>> linkVertexRoutine(const GraphicsPipeline& pipeline, const VertexKey& key, base::ThreadPool* workers) {
  ir::Function f;
  f.name = "vertex routine";
  ir::Builder b(f);
  VertexExpander expander(pipeline, key);
  expander.declare(b);
  Value decisions = 0;
  if (pipeline.link.decisionRow >= 0) {
    decisions = b.var(Type::I32);
    b.set(decisions, ir::mixDecision(b, b.input(Type::I32, kSlotVertexIndex), b.input(Type::I32, kSlotInstanceIndex)));
  }
  const Value first = Value(f.insts.size());
  ir::inlineShader(b, pipeline.vertex->function, expander);
  const Value end = Value(f.insts.size());
  if (decisions) expander.setWord(b, uint32_t(pipeline.link.decisionRow), b.get(decisions));
  expander.writeRows(b);
  if (!expander.error().empty()) return base::Error{expander.error()};
  if (decisions) ir::recordDecisions(f, first, end, decisions);
  PUMICE_TRY(finishRoutine(f));
  if (pipeline.saved) pipeline.saved->insert(savedKey(key), f, 0);
  return compile(pipeline, key, f, workers);
}

}  // namespace pumice::pipeline
