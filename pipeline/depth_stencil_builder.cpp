// Depth bounds, stencil and depth tests (Vulkan spec, "Fragment Operations"). Depths are compared as they are stored:
// integers for unsigned normalised formats, after the same rounding that a write does; so EQUAL after a pre-pass holds.
#include "pipeline/builders.h"

namespace pumice::pipeline {

using ir::Op;
using ir::Type;
using ir::Value;

namespace {

Value both(ir::Builder& b, Value x, Value y) { return !x ? y : !y ? x : b.maskAnd(x, y); }

Value compareMask(ir::Builder& b, VkCompareOp op, Value x, Value y) {
  const bool f = ir::isFloat(b.type(x));
  struct Flags {
    ir::Builder& b;
    ~Flags() { b.setInstFlags(0); }
  } flags{b};
  if (f) b.setInstFlags(ir::kInstDeclared);   // what is stored is what is compared
  switch (op) {
    case VK_COMPARE_OP_NEVER: return b.mask(false);
    case VK_COMPARE_OP_LESS: return f ? b.flt(x, y) : b.ult(x, y);
    case VK_COMPARE_OP_EQUAL: return f ? b.feq(x, y) : b.ieq(x, y);
    case VK_COMPARE_OP_LESS_OR_EQUAL: return f ? b.fle(x, y) : b.ule(x, y);
    case VK_COMPARE_OP_GREATER: return f ? b.flt(y, x) : b.ult(y, x);
    case VK_COMPARE_OP_NOT_EQUAL: return f ? b.fne(x, y) : b.ine(x, y);
    case VK_COMPARE_OP_GREATER_OR_EQUAL: return f ? b.fle(y, x) : b.ule(y, x);
    default: return b.mask(true);
  }
}

Value stencilResult(ir::Builder& b, VkStencilOp op, Value stored, Value reference) {
  const Value one = b.i32(1), max = b.i32(255);
  switch (op) {
    case VK_STENCIL_OP_ZERO: return b.i32(0);
    case VK_STENCIL_OP_REPLACE: return b.and_(reference, max);
    case VK_STENCIL_OP_INCREMENT_AND_CLAMP: return b.umin(b.iadd(stored, one), max);
    case VK_STENCIL_OP_DECREMENT_AND_CLAMP: return b.isub(b.umax(stored, one), one);
    case VK_STENCIL_OP_INVERT: return b.xor_(stored, max);
    case VK_STENCIL_OP_INCREMENT_AND_WRAP: return b.and_(b.iadd(stored, one), max);
    case VK_STENCIL_OP_DECREMENT_AND_WRAP: return b.and_(b.isub(stored, one), max);
    default: return stored;
  }
}

//! The two faces' choice, one if they agree.
template <typename F>
Value perFace(ir::Builder& b, Value front, F&& make) {
  const Value f = make(0u), k = make(1u);
  return f == k ? f : b.select(front, f, k);
}

struct DepthPlane {
  const texture::FormatInfo* format = nullptr;
  uint32_t plane = 0;
  bool isFloat() const { return format->rgba[0].numeric == texture::Numeric::Sfloat; }
  uint32_t mask() const { return format->rgba[0].bits >= 32 ? ~0u : (1u << format->rgba[0].bits) - 1; }

  //! In the form that depths are compared in.
  Value load(ir::Builder& b) const {
    if (isFloat()) return b.tileLoad(Type::F32, plane, format->elementBytes, 0);
    if (format->elementBytes == 2) return b.convert(Op::ZExt, Type::I32, b.tileLoad(Type::I16, plane, 2, 0));
    return b.and_(b.tileLoad(Type::I32, plane, format->elementBytes, 0), b.i32(mask()));
  }
  Value stored(ir::Builder& b, Value depth) const {
    const Value packed = texture::packDepth(b, *format, depth);
    if (isFloat()) return b.bitcast(Type::F32, packed);
    return b.and_(toType(b, Type::I32, packed), b.i32(mask()));
  }
  void store(ir::Builder& b, Value v) const {
    if (!isFloat() && format->elementBytes == 2) v = b.convert(Op::Trunc, Type::I16, v);
    b.tileStore(plane, format->elementBytes, 0, v);
  }
};

}  // namespace

bool testsSamples(const GraphicsState& s) {
  const texture::FormatInfo* f = texture::formatInfo(s.depthStencilFormat);
  if (!f) return false;
  return (f->hasDepth() && (s.depthTest || s.depthBoundsTest)) || (f->hasStencil() && s.stencilTest);
}

Value testSample(ir::Builder& b, const GraphicsState& s, uint32_t sample, Value live, Value depth, Value stencilReference) {
  const texture::FormatInfo* format = texture::formatInfo(s.depthStencilFormat);
  if (!format || !testsSamples(s)) return live;
  const DepthPlane plane{format, depthPlane(sample, s.samples)};
  const bool testDepth = format->hasDepth() && s.depthTest;
  const bool testBounds = format->hasDepth() && s.depthBoundsTest;
  const bool testStencil = format->hasStencil() && s.stencilTest;

  Value old = 0, fresh = 0;
  if (testBounds || (testDepth && s.depthCompare != VK_COMPARE_OP_ALWAYS && s.depthCompare != VK_COMPARE_OP_NEVER)) old = plane.load(b);
  if (testDepth) fresh = plane.stored(b, depth);

  if (testBounds) {
    const Value value = plane.isFloat() ? old : texture::unpackDepth(b, *format, old);
    const Value low = drawField(b, Type::F32, offsetof(DrawConstants, depthBounds), 0);
    const Value high = drawField(b, Type::F32, offsetof(DrawConstants, depthBounds), 1);
    live = both(b, live, b.maskAnd(b.fle(low, value), b.fle(value, high)));
  }

  Value depthPass = 0;
  if (testDepth && s.depthCompare != VK_COMPARE_OP_ALWAYS)
    depthPass = s.depthCompare == VK_COMPARE_OP_NEVER ? b.mask(false) : compareMask(b, s.depthCompare, fresh, old);

  Value pass = both(b, live, depthPass);
  if (testStencil) {
    const uint32_t stencil = stencilPlane(sample, s.samples);
    const Value front = b.ine(b.quadLoad(Type::I32, offsetof(raster::RecordHeader, frontFacing)), b.i32(0));
    const auto field = [&](size_t offset) {
      return b.select(front, drawField(b, Type::I32, offset, 0), drawField(b, Type::I32, offset, 1));
    };
    const Value reference = stencilReference ? stencilReference : field(offsetof(DrawConstants, stencilReference));
    const Value compareBits = field(offsetof(DrawConstants, stencilCompareMask));
    const Value writeBits = field(offsetof(DrawConstants, stencilWriteMask));
    const Value stored = b.convert(Op::ZExt, Type::I32, b.tileLoad(Type::I8, stencil, 1, 0));
    const VkStencilOpState* faces[2] = {&s.stencilFront, &s.stencilBack};
    const Value x = b.and_(b.and_(reference, compareBits), b.i32(255)), y = b.and_(stored, compareBits);
    const Value stencilPass = perFace(b, front, [&](uint32_t i) { return compareMask(b, faces[i]->compareOp, x, y); });
    const auto result = [&](auto op) {
      return perFace(b, front, [&](uint32_t i) { return stencilResult(b, faces[i]->*op, stored, reference); });
    };
    Value passed = result(&VkStencilOpState::passOp);
    if (depthPass) passed = b.select(depthPass, passed, result(&VkStencilOpState::depthFailOp));
    Value next = b.select(stencilPass, passed, result(&VkStencilOpState::failOp));
    next = b.or_(b.and_(next, writeBits), b.and_(stored, b.not_(writeBits)));
    if (live) b.beginIf(live);
    b.tileStore(stencil, 1, 0, b.convert(Op::Trunc, Type::I8, next));
    if (live) b.endIf();
    pass = both(b, pass, stencilPass);
  }

  if (testDepth && s.depthWrite) {
    if (pass) b.beginIf(pass);
    plane.store(b, fresh);
    if (pass) b.endIf();
  }
  return pass;
}

}  // namespace pumice::pipeline
