// expandImage(): fetches, reads, writes, atomics and queries; samples go to sample.cpp.
#include <cstddef>

#include "texture/block.h"
#include "texture/sample.h"

namespace pumice::texture {

using ir::Builder;
using ir::ImageDim;
using ir::ImageKind;
using ir::Op;
using ir::Type;
using ir::Value;

Value ImageBuild::extent(unsigned i, Value level) const {
  constexpr size_t kField[] = {offsetof(ImageDescriptor, width), offsetof(ImageDescriptor, height), offsetof(ImageDescriptor, depth)};
  // More is never there: who knows it need not watch for overflows.
  Value first = b.umin(fields.i32(kField[i]), b.i32(0xffff));
  if (i < 2 && shift[i]) first = b.lshr(b.iadd(first, b.i32((1u << shift[i]) - 1)), b.i32(shift[i]));
  return level ? b.umax(b.lshr(first, level), b.i32(1)) : first;
}

Value texelOffset(ImageBuild& s, const SliceAddress& slice, const Value (&at)[3]) {
  Builder& b = s.b;
  const FormatInfo& f = s.format;
  auto element = [&](Value i) { return f.isCompressed() ? b.lshr(i, b.i32(2)) : i; };
  return elementOffset(b, slice, isTiled(s.image.key), f.elementBytes, element(at[0]), s.dimensions > 1 ? element(at[1]) : 0);
}

Texel loadTexelAt(ImageBuild& s, const SliceAddress& slice, const Value (&at)[3], bool constant, bool scale) {
  Builder& b = s.b;
  Value offset = texelOffset(s, slice, at);
  if (!s.format.isCompressed()) return loadTexel(b, s.format, slice.base, offset, slice.size, constant);
  return loadBlockTexel(b, s.format, slice.base, offset, slice.size, constant, b.and_(at[0], b.i32(3)), b.and_(at[1], b.i32(3)), scale);
}

Texel swizzle(Builder& b, const ViewKey& key, bool integer, const Texel& t) {
  Texel out = t;
  for (int i = 0; i < 4; ++i) {
    uint8_t s = key.swizzle[i];
    if (s == VK_COMPONENT_SWIZZLE_ZERO) out[i] = integer ? b.i32(0) : b.f32(0.0f);
    if (s == VK_COMPONENT_SWIZZLE_ONE) out[i] = integer ? b.i32(1) : b.f32(1.0f);
    if (s >= VK_COMPONENT_SWIZZLE_R && s <= VK_COMPONENT_SWIZZLE_A) out[i] = t[s - VK_COMPONENT_SWIZZLE_R];
  }
  return out;
}

namespace {

bool isSample(ImageKind k) { return k == ImageKind::Sample || k == ImageKind::Gather || k == ImageKind::QueryLod; }

// False if there are fewer operands than the operation's flags ask for.
bool parseOperands(const ir::ImageOpInfo& op, std::span<const Value> operands, ImageOperandValues& in) {
  size_t at = 2;  // the image's and the sampler's array elements are in the references
  bool ok = true;
  auto take = [&]() -> Value {
    if (at >= operands.size()) ok = false;
    return ok ? operands[at++] : 0;
  };
  const unsigned dimensions = imageDimensions(op.dim);
  const bool query = op.kind == ImageKind::QuerySize || op.kind == ImageKind::QueryLevels || op.kind == ImageKind::QuerySamples;
  if (!query) {
    for (unsigned i = 0; i < dimensions; ++i) in.coordinate[i] = take();
    if (op.arrayed) in.layer = take();
  }
  if (op.operands & ir::kImageDref) in.dref = take();
  if (op.operands & ir::kImageBias) in.bias = take();
  if (op.operands & ir::kImageLod) in.lod = take();
  if (op.operands & ir::kImageGrad) {
    for (unsigned i = 0; i < dimensions; ++i) in.ddx[i] = take();
    for (unsigned i = 0; i < dimensions; ++i) in.ddy[i] = take();
  }
  if (op.operands & ir::kImageOffset) {
    for (unsigned i = 0; i < dimensions; ++i) in.offset[i] = take();
  }
  if (op.operands & ir::kImageSample) in.sample = take();
  if (op.operands & ir::kImageMinLod) in.minLod = take();
  if (op.operands & ir::kImageGatherComponent) in.gatherComponent = take();
  if (op.operands & ir::kImageOffsets) {
    for (auto& o : in.offsets) {
      o[0] = take();
      o[1] = take();
    }
  }
  if (ok) in.data = operands.subspan(at);
  return ok;
}

// Components in the type the shader wants.
std::vector<Value> finish(Builder& b, const ir::ImageOpInfo& op, const Texel& t) {
  std::vector<Value> out;
  for (Value v : t) {
    if (op.texelType != b.type(v)) {
      if (op.texelType == Type::F16 && b.type(v) == Type::F32) {
        v = b.convert(Op::FToF, Type::F16, v);
      } else if (typeBytes(op.texelType) == 4) {
        v = b.bitcast(op.texelType, v);  // a view of another numeric type: undefined values, but values
      } else if (isInt(op.texelType)) {
        v = b.convert(typeBytes(op.texelType) > 4 ? (op.texelSigned ? Op::SExt : Op::ZExt) : Op::Trunc, op.texelType, b.bitcast(Type::I32, v));
      } else {
        v = b.convert(Op::FToF, op.texelType, b.bitcast(Type::F32, v));
      }
    }
    out.push_back(v);
  }
  return out;
}

Texel incoming(Builder& b, const FormatInfo& f, std::span<const Value> data) {
  Texel t{};
  for (size_t i = 0; i < 4; ++i) {
    Value v = i < data.size() ? data[i] : 0;
    Type want = f.isInteger() ? Type::I32 : Type::F32;
    if (!v) v = b.zero(want);
    if (b.type(v) == Type::F16) v = b.convert(Op::FToF, Type::F32, v);
    if (b.type(v) == Type::I64) v = b.convert(Op::Trunc, Type::I32, v);
    if (typeBytes(b.type(v)) < 4) v = b.convert(Op::ZExt, Type::I32, v);
    t[i] = b.bitcast(want, v);
  }
  return t;
}

// The element that integer coordinates name; out of bounds where they are outside the image.
struct Element {
  Value base, offset, size;
  Value inBlock[2] = {};  // of compressed images: the texel in the element
};

Element bufferElement(ImageBuild& s) {
  Builder& b = s.b;
  Value x = s.in.coordinate[0];
  Value inside = b.ult(x, s.fields.i32(offsetof(BufferDescriptor, elements)));
  // maxTexelBufferElements keeps buffers below 4 GiB.
  Value offset = b.select(inside, b.imul(x, b.i32(s.format.elementBytes)), b.i32(kOutside));
  return {s.fields.i64(offsetof(BufferDescriptor, base)), offset, s.fields.i64(offsetof(BufferDescriptor, size))};
}

Element imageElement(ImageBuild& s) {
  Builder& b = s.b;
  Value level = s.in.lod;
  if (s.image.key.singleLevel && level && b.isConstant(level)) {
    uint64_t bits = 0;
    b.isConstant(level, &bits);
    if (bits == 0) level = 0;
  }
  Value inside = 0;
  auto require = [&](Value m) { inside = inside ? b.maskAnd(inside, m) : m; };
  if (level) require(b.ult(level, s.fields.i32(offsetof(ImageDescriptor, levelCount))));
  // Storage images address a cube's faces as layers: the third coordinate.
  Value layer = s.in.layer;
  Value coordinate[3] = {s.in.coordinate[0], s.in.coordinate[1], s.in.coordinate[2]};
  unsigned dimensions = s.dimensions;
  if (s.isCube()) layer = coordinate[2];
  for (unsigned i = 0; i < dimensions; ++i) {
    if (s.in.offset[i]) coordinate[i] = b.iadd(coordinate[i], s.in.offset[i]);
    require(b.ult(coordinate[i], s.extent(i, level)));
  }
  if (layer) require(b.ult(layer, s.fields.i32(offsetof(ImageDescriptor, layerCount))));
  if (s.in.sample) require(b.ult(s.in.sample, s.fields.i32(offsetof(ImageDescriptor, samples))));
  SliceAddress slice = sliceAddress(s.fields, level, layer, dimensions > 2 ? coordinate[2] : 0, s.in.sample);
  Element e = {slice.base, texelOffset(s, slice, coordinate), slice.size};
  if (isCompact(s.image.key)) e.offset = b.select(inside, e.offset, b.i32(kOutside));
  else e.size = b.select(inside, e.size, b.i64(0));
  for (unsigned i = 0; i < 2 && s.format.isCompressed(); ++i) e.inBlock[i] = b.and_(coordinate[i], b.i32(3));
  return e;
}

Texel loadElement(ImageBuild& s, const Element& e, bool constant) {
  if (s.format.isCompressed()) return loadBlockTexel(s.b, s.format, e.base, e.offset, e.size, constant, e.inBlock[0], e.inBlock[1]);
  return loadTexel(s.b, s.format, e.base, e.offset, e.size, constant);
}

std::vector<Value> querySize(ImageBuild& s) {
  Builder& b = s.b;
  if (s.op.dim == ImageDim::Buffer) return {s.fields.i32(offsetof(BufferDescriptor, elements))};
  std::vector<Value> out;
  for (unsigned i = 0; i < s.dimensions; ++i) out.push_back(s.extent(i, s.in.lod));
  if (s.op.arrayed) {
    Value layers = s.fields.i32(offsetof(ImageDescriptor, layerCount));
    out.push_back(s.isCube() ? b.udiv(layers, b.i32(6)) : layers);
  }
  return out;
}

std::vector<Value> expandNull(Builder& b, const ir::ImageOpInfo& op) {
  switch (op.kind) {
    case ImageKind::Write: return {};
    case ImageKind::Atomic: return {b.zero(op.texelType)};
    case ImageKind::QueryLod: return {b.f32(0.0f), b.f32(0.0f)};
    case ImageKind::QuerySize:
    case ImageKind::QueryLevels:
    case ImageKind::QuerySamples: return std::vector<Value>(4, b.i32(0));
    default: return std::vector<Value>(4, b.zero(op.texelType));
  }
}

}  // namespace

std::vector<Value> expandImage(Builder& b, const ir::ImageOpInfo& op, std::span<const Value> operands, const ImageRef& image,
                               const SamplerRef& sampler, const char** error) {
  const char* ignored = nullptr;
  if (!error) error = &ignored;
  *error = nullptr;
  if (image.key.format == 0) return expandNull(b, op);
  if (image.key.format > allFormats().size()) {
    *error = "image view of an unknown format";
    return {};
  }
  const FormatInfo& format = planeFormat(allFormats()[image.key.format - 1], image.key.aspect);
  ImageBuild s{b, op, image, sampler, {b, image}, format, op.dim == ImageDim::Cube ? 2u : imageDimensions(op.dim), {}};
  if (!parseOperands(op, operands, s.in)) {
    *error = "image instruction with too few operands";
    return {};
  }
  if (format.isCompressed() && (op.kind == ImageKind::Write || op.kind == ImageKind::Atomic || s.dimensions < 2)) {
    *error = "block-compressed images are two- or three-dimensional and cannot be written by shaders";
    return {};
  }
  const bool query = op.kind == ImageKind::QuerySize || op.kind == ImageKind::QueryLevels || op.kind == ImageKind::QuerySamples;
  if (format.isMultiPlanar() && op.kind != ImageKind::Sample && !query) {
    *error = "views of all planes of a multi-planar image can only be sampled";
    return {};
  }
  if (isSample(op.kind) && op.dim == ImageDim::Buffer) {
    *error = "texel buffers cannot be sampled";
    return {};
  }

  auto element = [&] { return op.dim == ImageDim::Buffer ? bufferElement(s) : imageElement(s); };
  switch (op.kind) {
    case ImageKind::Sample: {
      Texel t = format.isMultiPlanar() ? samplePlanes(s, error) : sampleImage(s, error);
      if (*error) return {};
      t = swizzle(b, image.key, s.integer(), t);
      if (sampler.key.conversion && !s.integer()) t = convertYcbcr(b, format, conversionOf(sampler.key.conversion), t);
      return finish(b, op, t);
    }
    case ImageKind::Gather: {
      Texel t = gatherImage(s, error);
      return *error ? std::vector<Value>{} : finish(b, op, t);
    }
    case ImageKind::QueryLod: return queryLod(s);
    case ImageKind::Fetch: {
      Element e = element();
      // Images that are only sampled do not change during a draw; attachments do.
      const bool constant = op.dim != ImageDim::SubpassData;
      return finish(b, op, swizzle(b, image.key, s.integer(), loadElement(s, e, constant)));
    }
    case ImageKind::Read: {
      Element e = element();
      return finish(b, op, swizzle(b, image.key, s.integer(), loadElement(s, e, false)));
    }
    case ImageKind::Write: {
      Element e = element();
      storeTexel(b, format, e.base, e.offset, e.size, incoming(b, format, s.in.data));
      return {};
    }
    case ImageKind::Atomic: {
      if (format.elementBytes != 4 || s.in.data.empty() || (op.compareExchange && s.in.data.size() < 2)) {
        *error = "image atomics work on 32-bit formats";
        return {};
      }
      Element e = element();
      const Type type = b.type(s.in.data[0]);
      if (op.compareExchange) return {b.emit(Op::AtomicCas, type, {e.base, e.offset, e.size, s.in.data[0], s.in.data[1]})};
      // What only moves floats moves bits.
      const Type inMemory = ir::isFloat(type) && op.atomic != ir::AtomicOp::FAdd ? ir::intOf(type) : type;
      Value old = b.emit(Op::Atomic, inMemory, {e.base, e.offset, e.size, b.bitcast(inMemory, s.in.data[0])}, uint64_t(op.atomic) << 32);
      return {b.bitcast(type, old)};
    }
    case ImageKind::QuerySize: return querySize(s);
    case ImageKind::QueryLevels: return {s.fields.i32(offsetof(ImageDescriptor, levelCount))};
    case ImageKind::QuerySamples: return {s.fields.i32(offsetof(ImageDescriptor, samples))};
  }
  *error = "unknown image instruction";
  return {};
}

}  // namespace pumice::texture
