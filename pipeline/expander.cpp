#include "pipeline/expander.h"

#include <algorithm>

#include "pipeline/ideas.h"
#include "pipeline/saved_routines.h"

namespace pumice::pipeline {

using ir::Op;
using ir::Type;
using ir::Value;

Value toType(ir::Builder& b, Type want, Value v) {
  const Type have = b.type(v);
  if (have == want) return v;
  if (want == Type::Mask) return b.ine(b.bitcast(ir::intOf(have), v), b.zero(ir::intOf(have)));
  if (have == Type::Mask) return toType(b, want, b.select(v, b.i32(1), b.i32(0)));
  if (ir::isFloat(have) && ir::isFloat(want)) return b.convert(Op::FToF, want, v);
  if (ir::typeBytes(have) == ir::typeBytes(want)) return b.bitcast(want, v);
  if (ir::isFloat(want)) return b.bitcast(want, toType(b, ir::intOf(want), v));
  if (ir::isFloat(have)) return toType(b, want, b.bitcast(ir::intOf(have), v));
  return b.convert(ir::typeBytes(want) > ir::typeBytes(have) ? Op::ZExt : Op::Trunc, want, v);
}

Value keepDouble(ir::Builder& b, Type want, Value v) {
  if (b.type(v) == want) return v;
  b.setInstFlags(ir::kInstKeep);
  if (b.type(v) != Type::F64 && want != Type::F64) v = b.convert(Op::FToF, Type::F64, v);
  v = b.convert(Op::FToF, want, v);
  b.setInstFlags(0);
  return v;
}

Value StageExpander::shaderInput(ir::Builder& b, Type type, uint32_t, uint32_t, std::span<const Value>) { return b.zero(type); }
void StageExpander::shaderOutput(ir::Builder&, uint32_t, uint32_t, Value, std::span<const Value>) {}

StageExpander::Buffer StageExpander::descriptor(ir::Builder& b, uint32_t resource, Value element) {
  const frontend::Resource& r = shader_.resources[resource];
  const Binding* binding = layout_.find(r.set, r.binding);
  if (!binding || !binding->count) return {b.i64(0), b.i64(0)};
  const uint32_t table = ir::kTableSet0 + r.set;
  const bool dynamic = binding->type == VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER_DYNAMIC || binding->type == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER_DYNAMIC;
  const uint32_t firstDynamic = dynamic && r.set < layout_.dynamicBase.size() ? layout_.dynamicBase[r.set] + binding->dynamicIndex : 0;
  const size_t dynamicField = offsetof(DrawConstants, dynamicOffsets) + 4 * size_t(firstDynamic);

  uint64_t index = 0;
  Value base, size, moved = 0;
  if (!element || b.isConstant(element, &index)) {
    if (index >= binding->count) return {b.i64(0), b.i64(0)};
    const uint32_t at = binding->offset + uint32_t(index) * binding->stride;
    base = b.tableLoad(Type::I64, table, at + offsetof(texture::BufferDescriptor, base));
    size = b.tableLoad(Type::I64, table, at + offsetof(texture::BufferDescriptor, size));
    if (dynamic && firstDynamic + index < kMaxDynamicOffsets) moved = b.uniform(Type::I32, uint32_t(dynamicField + 4 * index));
  } else {
    const Value inside = b.ult(element, b.i32(binding->count));
    const Value clamped = b.umin(element, b.i32(binding->count - 1));
    const Value offset = b.imul(clamped, b.i32(binding->stride));
    base = b.tableLoad(Type::I64, table, binding->offset + offsetof(texture::BufferDescriptor, base), offset);
    size = b.tableLoad(Type::I64, table, binding->offset + offsetof(texture::BufferDescriptor, size), offset);
    size = b.select(inside, size, b.i64(0));
    if (dynamic) moved = b.tableLoad(Type::I32, ir::kTableDraw, uint32_t(dynamicField), b.imul(clamped, b.i32(4)));
  }
  if (moved) base = b.iadd(base, b.convert(Op::ZExt, Type::I64, moved));
  return {base, size};
}

std::vector<ImageState> StageExpander::states(ir::Builder& b, uint32_t resource, Value element) const {
  uint64_t index = 0;
  std::optional<uint32_t> use;
  if (!element || b.isConstant(element, &index)) use = uses_.find(resource, uint32_t(index));
  if (!use) use = uses_.find(resource, ImageUses::kIndexed);   // an index that has become constant only here, too
  std::vector<ImageState> found;
  for (const ImageState& s : images_)
    if (use && s.use == *use) found.push_back(s);
  if (found.empty()) found.emplace_back();
  return found;
}

namespace {

//! Where the array element of a descriptor lies: a constant offset and a dynamic one.
template <typename Ref>
void locate(ir::Builder& b, Ref& ref, const Binding& binding, Value element, uint32_t within) {
  uint64_t index = 0;
  ref.constOffset = binding.offset + within;
  if (!element || b.isConstant(element, &index)) {
    ref.constOffset += uint32_t(std::min<uint64_t>(index, binding.count - 1)) * binding.stride;
    ref.dynamicOffset = 0;
  } else {
    ref.dynamicOffset = b.imul(b.umin(element, b.i32(binding.count - 1)), b.i32(binding.stride));
  }
}

}  // namespace

texture::ImageRef StageExpander::imageRef(ir::Builder& b, uint32_t resource, Value element, const ImageState& state) {
  texture::ImageRef ref;
  const frontend::Resource& r = shader_.resources[resource];
  const Binding* binding = layout_.find(r.set, r.binding);
  if (!binding || !binding->count) return ref;
  ref.table = ir::kTableSet0 + r.set;
  locate(b, ref, *binding, element, 0);
  ref.key = state.view;
  return ref;
}

texture::SamplerRef StageExpander::samplerRef(ir::Builder& b, uint32_t resource, Value element, const ImageState& state) {
  texture::SamplerRef ref;
  const frontend::Resource& r = shader_.resources[resource];
  const Binding* binding = layout_.find(r.set, r.binding);
  if (!binding || !binding->count) return ref;
  ref.table = ir::kTableSet0 + r.set;
  locate(b, ref, *binding, element,
         binding->type == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER ? offsetof(texture::CombinedDescriptor, sampler) : 0);
  ref.key = state.sampler;
  return ref;
}

namespace {

//! Lanes whose descriptor has these bytes `at` its start.
Value sameBytes(ir::Builder& b, uint32_t table, uint32_t constOffset, Value dynamicOffset, const void* bytes, size_t size) {
  Value same = 0;
  for (size_t at = 0; at < size; at += 4) {
    uint32_t word;
    std::memcpy(&word, static_cast<const std::byte*>(bytes) + at, 4);
    const Value m = b.ieq(b.tableLoad(Type::I32, table, constOffset + uint32_t(at), dynamicOffset), b.i32(word));
    same = same ? b.maskAnd(same, m) : m;
  }
  return same;
}

}  // namespace

Value StageExpander::inState(ir::Builder& b, uint32_t resource, Value element, const texture::ViewKey& key) {
  const texture::ImageRef ref = imageRef(b, resource, element, {});
  const Binding* binding = layout_.find(shader_.resources[resource].set, shader_.resources[resource].binding);
  if (!binding) return b.mask(true);
  if (binding->type == VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER || binding->type == VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER) {
    const uint32_t format = key.format ? uint32_t(texture::allFormats()[key.format - 1].format) : 0;
    return sameBytes(b, ref.table, ref.constOffset + offsetof(texture::BufferDescriptor, format), ref.dynamicOffset, &format, sizeof format);
  }
  return sameBytes(b, ref.table, ref.constOffset + offsetof(texture::ImageDescriptor, key), ref.dynamicOffset, &key, sizeof key);
}

Value StageExpander::inState(ir::Builder& b, uint32_t resource, Value element, const texture::SamplerKey& key) {
  const texture::SamplerRef ref = samplerRef(b, resource, element, {});
  return sameBytes(b, ref.table, ref.constOffset + offsetof(texture::SamplerDescriptor, key), ref.dynamicOffset, &key, sizeof key);
}

void StageExpander::addUsualSamplers(std::vector<Element>& groups) {
  constexpr VkSamplerAddressMode kAddresses[] = {VK_SAMPLER_ADDRESS_MODE_REPEAT, VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT,
                                                 VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE, VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_BORDER};
  const size_t given = groups.size();
  for (size_t n = 0; n < given; ++n) {
    if (!groups[n].sampler.sampler.present) continue;
    for (const VkSamplerAddressMode address : kAddresses)
      for (uint8_t linear = 0; linear < 2; ++linear)
        for (uint8_t mipmap = 0; mipmap < 2; ++mipmap) {
          Element e = groups[n];
          texture::SamplerKey& k = e.sampler.sampler;
          k.addressU = k.addressV = k.addressW = uint8_t(address);
          k.magFilter = k.minFilter = linear;
          k.mipmapMode = mipmap;
          if (std::find(groups.begin(), groups.end(), e) == groups.end()) groups.push_back(e);
        }
  }
}

std::vector<Value> StageExpander::image(ir::Builder& b, const ir::ImageOpInfo& op, std::span<const Value> given) {
  const std::vector<Value> operands(given.begin(), given.end());   // the span may point into the function that grows
  const bool sampled = op.kind == ir::ImageKind::Sample || op.kind == ir::ImageKind::Gather || op.kind == ir::ImageKind::QueryLod;
  const bool writes = op.kind == ir::ImageKind::Write || op.kind == ir::ImageKind::Atomic;
  const Value imageElement = operands[0], samplerElement = sampled ? operands[1] : 0;

  // The states that may be meant: each is code of its own.
  std::vector<Element> groups;
  const auto put = [&](const ImageState& image, const ImageState& sampler) {
    Element e;
    e.image.view = image.view;
    e.sampler.sampler = sampler.sampler;
    if (std::find(groups.begin(), groups.end(), e) == groups.end()) groups.push_back(e);
  };
  const std::vector<ImageState> images = states(b, op.imageResource, imageElement);
  std::vector<ImageState> samplers;
  if (sampled && op.samplerResource == op.imageResource) {
    for (const ImageState& i : images) put(i, i);
  } else {
    samplers = sampled ? states(b, op.samplerResource, samplerElement) : std::vector<ImageState>(1);
    for (const ImageState& i : images)
      for (const ImageState& s : samplers) put(i, sampled ? s : ImageState{});
  }

  const size_t known = groups.size();
  if (sampled && disabledIdeas() & bit(Idea::SpecialisedSampling)) addUsualSamplers(groups);
  const bool chosen = groups.size() > known;   // by what the descriptors say when the routine runs

  const auto expand = [&](const Element& g) {
    const char* why = nullptr;
    texture::SamplerRef sampler;
    if (sampled) sampler = samplerRef(b, op.samplerResource, samplerElement, g.sampler);
    std::vector<Value> r = texture::expandImage(b, op, operands, imageRef(b, op.imageResource, imageElement, g.image), sampler, &why);
    if (why && &g < groups.data() + known) fail(why);
    return r;
  };

  const Value off = writes ? suppressed(b) : Value(0);
  if (groups.size() == 1 && !off) {
    std::vector<Value> r = expand(groups[0]);
    if (r.empty() && !error_.empty() && op.kind != ir::ImageKind::Write) r.assign(4, b.zero(op.texelType));
    return r;
  }

  // Several kinds: each runs for the lanes that mean it.
  std::vector<Value> vars;
  if (op.kind != ir::ImageKind::Write)
    for (int c = 0; c < 4; ++c) vars.push_back(0);
  struct Pending { Value mask; const Element* group; };
  std::vector<Pending> pending;
  for (const Element& g : groups) {
    Value mask = b.mask(true);
    if (images.size() > 1) mask = b.maskAnd(mask, inState(b, op.imageResource, imageElement, g.image.view));
    if (sampled && (chosen || samplers.size() > 1 || (samplers.empty() && images.size() > 1)))
      mask = b.maskAnd(mask, inState(b, op.samplerResource, samplerElement, g.sampler.sampler));
    if (off) mask = b.maskAnd(mask, b.maskNot(off));
    pending.push_back({mask, &g});
  }
  // The types of the results are known once the first kind is expanded; a query has fewer than four.
  const Type resultType = op.kind == ir::ImageKind::QuerySize || op.kind == ir::ImageKind::QueryLevels || op.kind == ir::ImageKind::QuerySamples
                              ? Type::I32
                              : op.kind == ir::ImageKind::QueryLod ? Type::F32 : op.texelType;
  for (Value& v : vars) {
    v = b.var(resultType);
    b.set(v, b.zero(resultType));
  }
  for (const Pending& p : pending) {
    b.beginIf(p.mask);
    const std::vector<Value> r = expand(*p.group);
    for (size_t c = 0; c < r.size() && c < vars.size(); ++c) b.set(vars[c], toType(b, resultType, r[c]));
    b.endIf();
  }
  std::vector<Value> results;
  for (Value v : vars) results.push_back(b.get(v));
  return results;
}

base::Status finishRoutine(ir::Function& f) {
  if (std::string why = ir::verify(f); !why.empty()) return base::errorf("%s: made invalid IR: %s", f.name.c_str(), why.c_str());
  ir::optimise(f);
  countLinked();
  return {};
}

ir::Function guardEffects(const ir::Function& source) {
  ir::Function f;
  f.name = source.name;
  f.imageOps = source.imageOps;
  f.sharedBytes = source.sharedBytes;
  std::vector<Value> renamed(source.insts.size(), 0);
  const auto append = [&](ir::Inst i, std::span<const Value> operands) {
    i.firstOperand = uint32_t(f.operandPool.size());
    i.operandCount = uint32_t(operands.size());
    f.operandPool.insert(f.operandPool.end(), operands.begin(), operands.end());
    f.insts.push_back(i);
    return Value(f.insts.size() - 1);
  };
  const auto plain = [&](Op op, Type type, std::initializer_list<Value> operands) {
    ir::Inst i;
    i.op = op;
    i.type = type;
    return append(i, {operands.begin(), operands.size()});
  };
  for (Value v = 1; v < source.insts.size(); ++v) {
    const ir::Inst& i = source.insts[v];
    std::vector<Value> operands;
    for (Value o : source.operands(i)) operands.push_back(renamed[o]);
    if (i.op != Op::Store && i.op != Op::Atomic && i.op != Op::AtomicCas) {
      renamed[v] = append(i, operands);
      continue;
    }
    const Value result = i.type == Type::None ? 0 : plain(Op::Var, i.type, {});
    plain(Op::If, Type::None, {plain(Op::MaskNot, Type::Mask, {plain(Op::HelperMask, Type::Mask, {})})});
    const Value done = append(i, operands);
    if (result) plain(Op::VarSet, Type::None, {result, done});
    plain(Op::EndIf, Type::None, {});
    if (result) renamed[v] = plain(Op::VarGet, i.type, {result});
  }
  return f;
}

}  // namespace pumice::pipeline
