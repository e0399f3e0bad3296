// Control flow and masks. E is two words, so all of this is nearly free.
#include <algorithm>
#include <chrono>
#include <cstring>

#include "spirv_interp/interpreter/bytecode.h"

namespace pumice::interp {
namespace {

using ir::Op, ir::Type;

inline void assign(uint64_t* dst, const uint64_t* src) {
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = src[w];
}
inline const Code* skipIfNone(const RunState& s, const Code* c, int64_t distance) {
  return s.none() ? c + distance : c + 1;
}

//! src: condition, saved E, lanes of the other side. imm: to else or endif
const Code* beginIf(RunState& s, const Code* c) {
  const uint64_t* m = s.mask(c->src[0]);
  uint64_t* saved = s.mask(c->src[1]);
  uint64_t* other = s.mask(c->src[2]);
  for (unsigned w = 0; w < kMaskWords; w++) {
    const uint64_t e = s.exec[w], condition = m[w];
    saved[w] = e;
    other[w] = e & ~condition;
    s.exec[w] = e & condition;
  }
  return skipIfNone(s, c, int64_t(c->imm));
}
//! src: lanes of the other side. imm: to endif
const Code* beginElse(RunState& s, const Code* c) {
  assign(s.exec, s.mask(c->src[0]));
  return skipIfNone(s, c, int64_t(c->imm));
}
//! src: saved E. imm: to the end of the region around (endif and endblock alike)
const Code* endConstruct(RunState& s, const Code* c) {
  assign(s.exec, s.mask(c->src[0]));
  return skipIfNone(s, c, int64_t(c->imm));
}
//! src: saved E (loop and block alike)
const Code* beginConstruct(RunState& s, const Code* c) {
  assign(s.mask(c->src[0]), s.exec);
  return c + 1;
}
inline const Code* suspend(RunState& s, const Code* next) {
  s.next = next;
  return nullptr;
}
//! src: saved E, distance to the end of the region around. imm: back to the loop's first instruction
const Code* endLoop(RunState& s, const Code* c) {
  if (!s.none()) {
    const Code* again = c + int64_t(c->imm);
    return --s.turns ? again : suspend(s, again);
  }
  assign(s.exec, s.mask(c->src[0]));
  return skipIfNone(s, c, int32_t(c->src[1]));
}
//! The active lanes will not come back to the construct whose saved E is src.
const Code* leave(RunState& s, const Code* c) {
  uint64_t* saved = s.mask(c->src[0]);
  for (unsigned w = 0; w < kMaskWords; w++) saved[w] &= ~s.exec[w];
  return c + 1;
}
//! imm: to the end of the innermost region
const Code* breakOut(RunState& s, const Code* c) {
  for (unsigned w = 0; w < kMaskWords; w++) s.exec[w] = 0;
  return c + int64_t(c->imm);
}
const Code* barrier(RunState& s, const Code* c) {
  s.atBarrier = true;
  return suspend(s, c + 1);
}
const Code* end(RunState& s, const Code*) { return suspend(s, nullptr); }

template <class F>
inline const Code* maskBinary(RunState& s, const Code* c, F f) {
  uint64_t* dst = s.mask(c->dst);
  const uint64_t* a = s.mask(c->src[0]);
  const uint64_t* b = s.mask(c->src[1]);
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = f(a[w], b[w]);
  return c + 1;
}
const Code* maskAnd(RunState& s, const Code* c) { return maskBinary(s, c, [](uint64_t a, uint64_t b) { return a & b; }); }
const Code* maskOr(RunState& s, const Code* c) { return maskBinary(s, c, [](uint64_t a, uint64_t b) { return a | b; }); }
const Code* maskXor(RunState& s, const Code* c) { return maskBinary(s, c, [](uint64_t a, uint64_t b) { return a ^ b; }); }
const Code* maskNot(RunState& s, const Code* c) {
  uint64_t* dst = s.mask(c->dst);
  const uint64_t* a = s.mask(c->src[0]);
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = ~a[w];
  return c + 1;
}
const Code* maskSelect(RunState& s, const Code* c) {
  uint64_t* dst = s.mask(c->dst);
  const uint64_t *m = s.mask(c->src[0]), *a = s.mask(c->src[1]), *b = s.mask(c->src[2]);
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = (a[w] & m[w]) | (b[w] & ~m[w]);
  return c + 1;
}
const Code* maskSplat(RunState& s, const Code* c) {
  uint64_t* dst = s.mask(c->dst);
  const uint64_t all = 0 - (s.uniform<uint64_t>(c->src[0]) & 1);
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = all;
  return c + 1;
}
const Code* maskCopy(RunState& s, const Code* c) {
  assign(s.mask(c->dst), s.mask(c->src[0]));
  return c + 1;
}
const Code* maskZero(RunState& s, const Code* c) {
  for (unsigned w = 0; w < kMaskWords; w++) s.mask(c->dst)[w] = 0;
  return c + 1;
}
const Code* maskSet(RunState& s, const Code* c) {
  uint64_t* dst = s.mask(c->dst);
  const uint64_t* a = s.mask(c->src[0]);
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = (a[w] & s.exec[w]) | (dst[w] & ~s.exec[w]);
  return c + 1;
}
const Code* maskInput(RunState& s, const Code* c) {
  std::memcpy(s.mask(c->dst), s.context->inputs[c->imm], kMaskBytes);
  return c + 1;
}
const Code* maskOutput(RunState& s, const Code* c) {
  uint64_t* dst = static_cast<uint64_t*>(s.context->outputs[c->imm]);
  const uint64_t* a = s.mask(c->src[0]);
  for (unsigned w = 0; w < kMaskWords; w++) dst[w] = (a[w] & s.exec[w]) | (dst[w] & ~s.exec[w]);
  return c + 1;
}
const Code* maskToBank(RunState& s, const Code* c) {
  s.bankOut[c->imm] = s.mask(c->src[0])[0] & 1;
  return c + 1;
}
const Code* maskSwizzle(RunState& s, const Code* c) {
  constexpr uint64_t kFirst = 0x1111111111111111u;   // the first lane of each quad
  uint64_t* dst = s.mask(c->dst);
  const uint64_t* a = s.mask(c->src[0]);
  for (unsigned w = 0; w < kMaskWords; w++) {
    const uint64_t v = a[w];
    uint64_t out = 0;
    for (unsigned i = 0; i < 4; i++) out |= (v >> (c->imm >> 2 * i & 3) & kFirst) << i;
    dst[w] = out;
  }
  return c + 1;
}
const Code* execMask(RunState& s, const Code* c) {
  assign(s.mask(c->dst), s.exec);
  return c + 1;
}

const Code* clock(RunState& s, const Code* c) {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  std::fill_n(s.row<uint64_t>(c->dst), s.rounded, uint64_t(std::chrono::nanoseconds(now).count()));
  return c + 1;
}

}  // namespace

void addControlKernels(KernelTable& t) {
  t.at(Control::If) = beginIf;
  t.at(Control::Else) = beginElse;
  t.at(Control::EndIf) = endConstruct;
  t.at(Control::Loop) = beginConstruct;
  t.at(Control::EndLoop) = endLoop;
  t.at(Control::Block) = beginConstruct;
  t.at(Control::EndBlock) = endConstruct;
  t.at(Control::Leave) = leave;
  t.at(Control::Break) = breakOut;
  t.at(Control::Barrier) = barrier;
  t.at(Control::End) = end;
  t.at(Op::MaskAnd, Type::Mask) = maskAnd;
  t.at(Op::MaskOr, Type::Mask) = maskOr;
  t.at(Op::MaskXor, Type::Mask) = maskXor;
  t.at(Op::MaskNot, Type::Mask) = maskNot;
  t.at(Op::Select, Type::Mask) = maskSelect;
  t.at(Op::Input, Type::Mask) = maskInput;
  t.at(Op::QuadSwizzle, Type::Mask) = maskSwizzle;
  t.at(Op::ExecMask, Type::Mask) = execMask;
  t.at(Op::Clock, Type::I64) = clock;
  t.at(Internal::Splat, Type::Mask) = maskSplat;
  t.at(Internal::Copy, Type::Mask) = maskCopy;
  t.at(Internal::Zero, Type::Mask) = maskZero;
  t.at(Internal::SetMasked, Type::Mask) = maskSet;
  t.at(Internal::OutputRow, Type::Mask) = maskOutput;
  t.at(Internal::ToBank, Type::Mask) = maskToBank;
}

}  // namespace pumice::interp
