// Image instructions become `image` operations, which the linker expands for the formats and samplers at hand.
#include "spirv_interp/frontend/translator.h"

namespace pumice::frontend {

namespace {

using Values = std::vector<Value>;
using ir::ImageKind;

ir::ImageDim dimOf(const Instruction& image) {
  switch (spv::Dim(image.operand(1))) {
    case spv::Dim::Dim1D: return ir::ImageDim::D1;
    case spv::Dim::Dim2D: return ir::ImageDim::D2;
    case spv::Dim::Dim3D: return ir::ImageDim::D3;
    case spv::Dim::Cube: return ir::ImageDim::Cube;
    case spv::Dim::Rect: return ir::ImageDim::Rect;
    case spv::Dim::Buffer: return ir::ImageDim::Buffer;
    case spv::Dim::SubpassData: return ir::ImageDim::SubpassData;
    default: fail("image dimension %u is not supported", image.operand(1));
  }
}

//! What an image instruction is being made of.
struct Request {
  ir::ImageOpInfo info;
  Values operands;   //!< image element, sampler element, coordinates
  bool nonUniform = false;
};

void describe(Translator& t, Request& r, const Opaque& o, ImageKind kind) {
  if (!o.imageType) fail("an image instruction without an image");
  const TypeInfo& type = t.type(o.imageType);
  if (type.kind != TypeInfo::Image) fail("an image instruction without an image");
  const Instruction& image = *type.image;
  r.info.kind = kind;
  r.info.dim = dimOf(image);
  r.info.arrayed = image.operand(3) != 0;
  r.info.multisampled = image.operand(4) != 0;
  r.info.storageFormat = image.operand(6);
  r.info.imageResource = o.image;
  r.info.samplerResource = o.sampler == ~0u ? 0 : o.sampler;
  const TypeInfo& texel = t.type(image.operand(0));
  r.info.texelType = texel.scalar == Type::None ? Type::F32 : texel.scalar;
  r.info.texelSigned = texel.isSigned;
  r.nonUniform = o.nonUniform;
  r.operands = {o.imageElement, o.samplerElement ? o.samplerElement : t.b.i32(0)};
}

//! Storage cube images are addressed by (x, y, layer and face), like arrays of 2D images.
void cubeAsArray(Request& r) {
  if (r.info.dim != ir::ImageDim::Cube) return;
  r.info.dim = ir::ImageDim::D2;
  r.info.arrayed = true;
}

void addCoordinates(Request& r, const Values& coordinate, Value divisor, Translator& t) {
  unsigned count = ir::imageDimensions(r.info.dim) + (r.info.arrayed ? 1 : 0);
  if (coordinate.size() < count) fail("%zu image coordinates where %u are needed", coordinate.size(), count);
  for (unsigned i = 0; i < count; i++)
    r.operands.push_back(divisor ? t.b.fdiv(coordinate[i], divisor) : coordinate[i]);
}

//! The optional operands of an image instruction in the order of ir.h. `at` is where the mask stands.
void addOperands(Translator& t, Request& r, const Instruction& inst, size_t at, Value dref, Value gatherComponent) {
  using M = spv::ImageOperandsMask;
  uint32_t mask = inst.operand(at);
  size_t next = at + 1;
  auto take = [&](M bit) -> uint32_t { return mask & uint32_t(bit) ? inst.operand(next++) : 0; };
  uint32_t bias = take(M::Bias), lod = take(M::Lod);
  uint32_t gradX = take(M::Grad);
  uint32_t gradY = gradX ? inst.operand(next++) : 0;
  uint32_t constOffset = take(M::ConstOffset), offset = take(M::Offset), offsets = take(M::ConstOffsets);
  uint32_t sample = take(M::Sample), minLod = take(M::MinLod);
  if (mask & uint32_t(M::Offsets)) fail("the image operand Offsets is not supported");
  if (constOffset) offset = constOffset;

  unsigned dimensions = ir::imageDimensions(r.info.dim);
  auto add = [&](uint32_t flag, const Values& values, size_t count) {
    if (values.size() < count) fail("an image operand has too few components");
    r.info.operands |= uint16_t(flag);
    r.operands.insert(r.operands.end(), values.begin(), values.begin() + ptrdiff_t(count));
  };
  auto integers = [&](const Values& values) {
    Values out;
    for (Value v : values) out.push_back(t.toI32(v));
    return out;
  };
  if (dref) add(ir::kImageDref, {dref}, 1);
  if (bias) add(ir::kImageBias, t.data(bias), 1);
  if (lod) add(ir::kImageLod, t.data(lod), 1);
  if (gradX) {
    add(ir::kImageGrad, t.data(gradX), dimensions);
    add(ir::kImageGrad, t.data(gradY), dimensions);
  }
  // Offsets of cube images do not exist.
  if (offset) add(ir::kImageOffset, integers(t.data(offset)), dimensions);
  if (sample) add(ir::kImageSample, integers(t.data(sample)), 1);
  if (minLod) add(ir::kImageMinLod, t.data(minLod), 1);
  if (gatherComponent) add(ir::kImageGatherComponent, {gatherComponent}, 1);
  if (offsets) add(ir::kImageOffsets, integers(t.data(offsets)), 8);
}

Value finish(Translator& t, Request& r) {
  if (t.shader.function.imageOps.size() > kMaxInstructions) fail("the shader is too large");
  uint64_t index = t.shader.function.imageOps.size();
  t.shader.function.imageOps.push_back(r.info);
  if (r.nonUniform) t.b.setInstFlags(ir::kInstNonUniform);
  Value tuple = t.b.emit(Op::ImageOp, Type::Tuple, r.operands, index);
  t.b.setInstFlags(0);
  return tuple;
}

Values components(Translator& t, Value tuple, Type type, uint32_t count) {
  Values out;
  for (uint32_t i = 0; i < count; i++) out.push_back(t.b.emit(Op::TupleGet, type, {tuple}, i));
  return out;
}

//! Defines the result from the components of the tuple, adapted to the instruction's type.
void defineTexel(Translator& t, const Instruction& inst, const Request& r, Value tuple) {
  const TypeInfo& type = t.type(inst.resultType);
  Values out = components(t, tuple, r.info.texelType, type.scalars);
  for (Value& v : out)
    if (t.b.type(v) != t.scalarInfo(inst.resultType).scalar) fail("an image result of an unsupported type");
  t.define(inst, std::move(out));
}

constexpr uint32_t kDref = 1, kProj = 2, kImplicit = 4;

void onSample(Translator& t, const Instruction& inst, uint32_t aux) {
  Request r;
  describe(t, r, t.opaque(inst.operand(0)), ImageKind::Sample);
  const Values& coordinate = t.data(inst.operand(1));
  Value divisor = 0;
  if (aux & kProj) {
    unsigned at = ir::imageDimensions(r.info.dim);
    if (coordinate.size() <= at) fail("a projective coordinate without divisor");
    divisor = coordinate[at];
    r.info.operands |= ir::kImageProj;
  }
  addCoordinates(r, coordinate, divisor, t);
  Value dref = aux & kDref ? t.scalar(inst.operand(2)) : 0;
  if (dref && divisor) dref = t.b.fdiv(dref, divisor);
  // Only fragment shaders have implicit derivatives; elsewhere the level is 0 plus bias.
  r.info.implicitLod = (aux & kImplicit) && t.stage == Stage::Fragment;
  addOperands(t, r, inst, aux & kDref ? 3 : 2, dref, 0);
  defineTexel(t, inst, r, finish(t, r));
}

void onFetch(Translator& t, const Instruction& inst, uint32_t) {
  Request r;
  describe(t, r, t.opaque(inst.operand(0)), ImageKind::Fetch);
  Values coordinate;
  for (Value v : t.data(inst.operand(1))) coordinate.push_back(t.toI32(v));
  addCoordinates(r, coordinate, 0, t);
  addOperands(t, r, inst, 2, 0, 0);
  defineTexel(t, inst, r, finish(t, r));
}

void onGather(Translator& t, const Instruction& inst, uint32_t aux) {
  Request r;
  describe(t, r, t.opaque(inst.operand(0)), ImageKind::Gather);
  addCoordinates(r, t.data(inst.operand(1)), 0, t);
  Value third = t.scalar(inst.operand(2));
  addOperands(t, r, inst, 3, aux & kDref ? third : 0, aux & kDref ? 0 : t.toI32(third));
  defineTexel(t, inst, r, finish(t, r));
}

void markImageWritten(Translator& t, const Request& r) { t.shader.resources[r.info.imageResource].readOnly = false; }

void onRead(Translator& t, const Instruction& inst, uint32_t) {
  Request r;
  describe(t, r, t.opaque(inst.operand(0)), ImageKind::Read);
  cubeAsArray(r);
  Values coordinate;
  for (Value v : t.data(inst.operand(1))) coordinate.push_back(t.toI32(v));
  addCoordinates(r, coordinate, 0, t);
  addOperands(t, r, inst, 2, 0, 0);
  defineTexel(t, inst, r, finish(t, r));
}

void onWrite(Translator& t, const Instruction& inst, uint32_t) {
  Request r;
  describe(t, r, t.opaque(inst.operand(0)), ImageKind::Write);
  cubeAsArray(r);
  Values coordinate;
  for (Value v : t.data(inst.operand(1))) coordinate.push_back(t.toI32(v));
  addCoordinates(r, coordinate, 0, t);
  addOperands(t, r, inst, 3, 0, 0);
  Values texel = t.data(inst.operand(2));
  if (texel.empty() || texel.size() > 4) fail("OpImageWrite of %zu components", texel.size());
  while (texel.size() < 4) texel.push_back(t.b.zero(t.b.type(texel[0])));
  r.info.texelType = t.b.type(texel[0]);
  r.operands.insert(r.operands.end(), texel.begin(), texel.end());
  markImageWritten(t, r);
  finish(t, r);
}

void onQuery(Translator& t, const Instruction& inst, uint32_t aux) {
  Request r;
  describe(t, r, t.opaque(inst.operand(0)), ImageKind(aux));
  Type result = Type::I32;
  if (inst.op == spv::Op::OpImageQuerySizeLod) {
    r.info.operands |= ir::kImageLod;
    r.operands.push_back(t.toI32(t.scalar(inst.operand(1))));
  } else if (inst.op == spv::Op::OpImageQueryLod) {
    const Values& coordinate = t.data(inst.operand(1));
    bool arrayed = r.info.arrayed;
    r.info.arrayed = false;  // the coordinate has no layer
    addCoordinates(r, coordinate, 0, t);
    r.info.arrayed = arrayed;
    if (arrayed) r.operands.push_back(t.b.zero(t.b.type(coordinate[0])));
    r.info.implicitLod = true;
    result = Type::F32;
  }
  Values out = components(t, finish(t, r), result, t.type(inst.resultType).scalars);
  for (Value& v : out)
    if (result == Type::I32) v = t.resize(v, t.scalarInfo(inst.resultType).scalar, true);
  t.define(inst, std::move(out));
}

void onSampledImage(Translator& t, const Instruction& inst, uint32_t) {
  Opaque image = t.opaque(inst.operand(0));
  const Opaque& sampler = t.opaque(inst.operand(1));
  image.sampler = sampler.sampler;
  image.samplerElement = sampler.samplerElement;
  image.nonUniform |= sampler.nonUniform || t.module.find(inst.result, spv::Decoration::NonUniform);
  t.defineOpaque(inst, image);
}

void onImage(Translator& t, const Instruction& inst, uint32_t) {
  Opaque image = t.opaque(inst.operand(0));
  image.sampler = ~0u;
  image.samplerElement = 0;
  t.defineOpaque(inst, image);
}

void onTexelPointer(Translator& t, const Instruction& inst, uint32_t) {
  Pointer p = t.pointer(inst.operand(0));
  p.texelImage = inst.operand(0);
  p.texelCoordinate = inst.operand(1);
  p.texelSample = inst.operand(2);
  t.definePointer(inst, p);
}

constexpr uint32_t aux(ImageKind kind) { return uint32_t(kind); }

constexpr HandlerEntry kHandlers[] = {
    {spv::Op::OpSampledImage, onSampledImage},
    {spv::Op::OpImage, onImage},
    {spv::Op::OpImageTexelPointer, onTexelPointer},
    {spv::Op::OpImageSampleImplicitLod, onSample, kImplicit},
    {spv::Op::OpImageSampleExplicitLod, onSample, 0},
    {spv::Op::OpImageSampleDrefImplicitLod, onSample, kImplicit | kDref},
    {spv::Op::OpImageSampleDrefExplicitLod, onSample, kDref},
    {spv::Op::OpImageSampleProjImplicitLod, onSample, kImplicit | kProj},
    {spv::Op::OpImageSampleProjExplicitLod, onSample, kProj},
    {spv::Op::OpImageSampleProjDrefImplicitLod, onSample, kImplicit | kProj | kDref},
    {spv::Op::OpImageSampleProjDrefExplicitLod, onSample, kProj | kDref},
    {spv::Op::OpImageFetch, onFetch},
    {spv::Op::OpImageGather, onGather, 0},
    {spv::Op::OpImageDrefGather, onGather, kDref},
    {spv::Op::OpImageRead, onRead},
    {spv::Op::OpImageWrite, onWrite},
    {spv::Op::OpImageQuerySizeLod, onQuery, aux(ImageKind::QuerySize)},
    {spv::Op::OpImageQuerySize, onQuery, aux(ImageKind::QuerySize)},
    {spv::Op::OpImageQueryLod, onQuery, aux(ImageKind::QueryLod)},
    {spv::Op::OpImageQueryLevels, onQuery, aux(ImageKind::QueryLevels)},
    {spv::Op::OpImageQuerySamples, onQuery, aux(ImageKind::QuerySamples)},
};

}  // namespace

std::span<const HandlerEntry> imageHandlers() { return kHandlers; }

Value imageAtomic(Translator& t, const Pointer& p, Type type, ir::AtomicOp op, Value value, Value comparator) {
  if (p.home != Home::Opaque || p.resourceArray || t.type(p.type).kind != TypeInfo::Image)
    fail("OpImageTexelPointer into something other than an image");
  Opaque o;
  o.imageType = p.type;
  o.image = t.resourceOf(*p.variable);
  t.useElement(o.image, p.element);
  o.imageElement = p.element ? p.element : t.b.i32(0);
  o.nonUniform = p.nonUniform;
  Request r;
  describe(t, r, o, ImageKind::Atomic);
  cubeAsArray(r);
  r.info.texelType = type;
  r.info.atomic = op;
  r.info.compareExchange = comparator != 0;
  Values coordinate;
  for (Value v : t.data(p.texelCoordinate)) coordinate.push_back(t.toI32(v));
  addCoordinates(r, coordinate, 0, t);
  if (r.info.multisampled) {
    r.info.operands |= ir::kImageSample;
    r.operands.push_back(t.toI32(t.scalar(p.texelSample)));
  }
  r.operands.push_back(value);
  if (comparator) r.operands.push_back(comparator);
  if (op != ir::AtomicOp::Load) markImageWritten(t, r);
  return components(t, finish(t, r), type, 1)[0];
}

}  // namespace pumice::frontend
