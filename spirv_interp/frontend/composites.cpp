// Composites are flat lists of scalars, so taking them apart and putting them together is a matter of ranges.
#include <algorithm>

#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

namespace {

using Values = std::vector<Value>;

struct Range {
  uint32_t first, count;
};

//! The scalars of a composite of type `typeId` that literal indices lead to.
Range follow(Translator& t, uint32_t typeId, std::span<const uint32_t> indices) {
  uint32_t first = 0;
  for (uint32_t index : indices) {
    const TypeInfo& type = t.type(typeId);
    typeId = t.elementType(type, index);
    first += t.flatOffset(type, index);
  }
  return {first, t.type(typeId).scalars};
}

void onConstruct(Translator& t, const Instruction& inst, uint32_t) {
  Values out;
  for (uint32_t id : inst.operands) {
    const Values& part = t.data(id);
    out.insert(out.end(), part.begin(), part.end());
    if (out.size() > kMaxValueScalars) fail("a composite is too large");
  }
  t.define(inst, std::move(out));
}

void onExtract(Translator& t, const Instruction& inst, uint32_t) {
  if (inst.count() < 1) fail("OpCompositeExtract is too short");
  const Values& from = t.data(inst.operand(0));
  Range range = follow(t, t.typeOf(inst.operand(0)), inst.operands.subspan(1));
  if (uint64_t(range.first) + range.count > from.size()) fail("OpCompositeExtract beyond the composite");
  t.define(inst, Values(from.begin() + range.first, from.begin() + range.first + range.count));
}

void onInsert(Translator& t, const Instruction& inst, uint32_t) {
  if (inst.count() < 2) fail("OpCompositeInsert is too short");
  const Values& object = t.data(inst.operand(0));
  Values out = t.data(inst.operand(1));
  Range range = follow(t, t.typeOf(inst.operand(1)), inst.operands.subspan(2));
  if (range.count != object.size() || uint64_t(range.first) + range.count > out.size())
    fail("OpCompositeInsert of the wrong size");
  std::copy(object.begin(), object.end(), out.begin() + range.first);
  t.define(inst, std::move(out));
}

void onShuffle(Translator& t, const Instruction& inst, uint32_t) {
  if (inst.count() < 2) fail("OpVectorShuffle is too short");
  Values from = t.data(inst.operand(0));
  const Values& second = t.data(inst.operand(1));
  from.insert(from.end(), second.begin(), second.end());
  Values out;
  for (uint32_t index : inst.operands.subspan(2)) {
    if (index == 0xffffffff)  // undefined
      out.push_back(t.b.zero(t.scalarInfo(inst.resultType).scalar));
    else if (index < from.size())
      out.push_back(from[index]);
    else
      fail("OpVectorShuffle takes component %u of %zu", index, from.size());
  }
  t.define(inst, std::move(out));
}

// As for an access chain's index (Translator::checkIndices).
void checkComponent(Translator& t, uint32_t indexId, size_t count) {
  if (!(t.checks & ir::kCheckBounds)) return;
  Value index = t.resize(t.scalar(indexId), Type::I32, t.type(t.typeOf(indexId)).isSigned);
  t.b.emit(Op::Check, Type::None, {t.watchedLanes(), index, t.b.i32(uint32_t(count))},
           ir::checkImm({ir::CheckKind::Index, Op::Nop, Type::None, uint32_t(ir::IndexedKind::Vector)}));
}

void onExtractDynamic(Translator& t, const Instruction& inst, uint32_t) {
  const Values& from = t.data(inst.operand(0));
  Value index = t.scalar(inst.operand(1));
  if (from.empty()) fail("OpVectorExtractDynamic of nothing");
  checkComponent(t, inst.operand(1), from.size());
  Value result = from[0];
  for (size_t i = 1; i < from.size(); i++)
    result = t.b.select(t.b.ieq(index, t.b.constant(t.b.type(index), i)), from[i], result);
  t.define(inst, {result});
}

void onInsertDynamic(Translator& t, const Instruction& inst, uint32_t) {
  Values out = t.data(inst.operand(0));
  Value component = t.scalar(inst.operand(1));
  Value index = t.scalar(inst.operand(2));
  checkComponent(t, inst.operand(2), out.size());
  for (size_t i = 0; i < out.size(); i++) {
    if (t.b.type(out[i]) != t.b.type(component)) fail("OpVectorInsertDynamic of the wrong type");
    out[i] = t.b.select(t.b.ieq(index, t.b.constant(t.b.type(index), i)), component, out[i]);
  }
  t.define(inst, std::move(out));
}

void onCopy(Translator& t, const Instruction& inst, uint32_t) {
  Val copy = t.val(inst.operand(0));
  copy.type = inst.resultType;
  if (copy.kind == Val::Data) {
    t.define(inst, std::move(copy.scalars));
    if (copy.pointer) t.inheritLayout(inst.result, inst.operand(0));
    return;
  }
  if (t.module.find(inst.result, spv::Decoration::NonUniform)) {
    if (copy.pointer) {
      Pointer p = *copy.pointer;
      p.nonUniform = true;
      copy.pointer = std::make_shared<Pointer>(p);
    }
    if (copy.opaque) {
      Opaque o = *copy.opaque;
      o.nonUniform = true;
      copy.opaque = std::make_shared<Opaque>(o);
    }
  }
  t.setVal(inst.result, std::move(copy));
}

void onUndef(Translator& t, const Instruction& inst, uint32_t) {
  if (t.type(inst.resultType).hasValue()) t.define(inst, t.zeros(inst.resultType));
}

constexpr HandlerEntry kHandlers[] = {
    {spv::Op::OpCompositeConstruct, onConstruct},
    {spv::Op::OpCompositeExtract, onExtract},
    {spv::Op::OpCompositeInsert, onInsert},
    {spv::Op::OpVectorShuffle, onShuffle},
    {spv::Op::OpVectorExtractDynamic, onExtractDynamic},
    {spv::Op::OpVectorInsertDynamic, onInsertDynamic},
    {spv::Op::OpCopyObject, onCopy},
    {spv::Op::OpCopyLogical, onCopy},
    {spv::Op::OpExpectKHR, onCopy},
    {spv::Op::OpUndef, onUndef},
};

}  // namespace

std::span<const HandlerEntry> compositeHandlers() { return kHandlers; }

}  // namespace pumice::frontend
