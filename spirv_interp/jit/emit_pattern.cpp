// Accesses whose lanes' offsets are known but for the first one's (lane_patterns.h): one comparison says whether a chunk's lanes lie within
// bounds, and what they want are whole vectors, one element for all, or single elements at known places.
#include <algorithm>

#include "spirv_interp/jit/emit_range.h"

namespace pumice::jit {

namespace I = x86::Inst;

//! rax: the first lane's byte offset, if all lanes lie within bounds, and `more` bytes behind each. Uses rcx.
void Emitter::patternStart(const LanePattern& q, Value first, uint32_t more, const x86::Mem& limit, const asmjit::Label& outside) {
  const Source s = source(first, 0);
  if (s.isReg) {
    a_.vmovd(x86::eax, s.reg().xmm());
  } else {
    x86::Mem m = s.mem();
    m.setSize(4);
    a_.mov(x86::eax, m);
  }
  // What lies within bounds has not been clamped, nor have sums wrapped.
  if (q.shift) a_.shl(x86::rax, q.shift);
  const int32_t furthest = *std::max_element(q.delta, q.delta + p_.unroll * kVectorLanes) << q.shift;
  a_.lea(x86::rcx, x86::ptr(x86::rax, furthest + int32_t(more)));
  a_.cmp(x86::rcx, at(limit, kRangeLast));
  a_.ja(outside);
}

//! t0: the lanes' offsets.
void Emitter::patternOffsets(const LanePattern& q, Source first, uint32_t part) {
  uint32_t words[kVectorLanes];
  std::copy_n(q.delta + part * kVectorLanes, kVectorLanes, words);
  move(t0(), first);
  a_.vpaddd(t0(), t0(), poolVector(words));
  if (!q.clamped) return;
  a_.vpminud(t0(), t0(), pool32(0xffffffffu >> q.shift));
  a_.vpslld(t0(), t0(), q.shift);
}

namespace {
enum class Shape { Neighbours, Equal, Other };
Shape shapeOf(const LanePattern& q, uint32_t part) {
  bool neighbours = true, equal = true;
  for (uint32_t l = 1; l < kVectorLanes; l++) {
    const int32_t step = q.bytes(part * kVectorLanes + l) - q.bytes(part * kVectorLanes + l - 1);
    neighbours &= step == 4;
    equal &= step == 0;
  }
  return neighbours ? Shape::Neighbours : equal ? Shape::Equal : Shape::Other;
}
}  // namespace

//! rsi: base.
void Emitter::loadPattern(Value v, const LanePattern& q, Value first, const x86::Mem& limit) {
  const asmjit::Label outside = a_.newLabel(), done = a_.newLabel();
  patternStart(q, first, 0, limit, outside);
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm d = target(v, part);
    const auto element = [&](uint32_t lane) { return x86::dword_ptr(x86::rsi, x86::rax, 0, q.bytes(part * kVectorLanes + lane)); };
    switch (shapeOf(q, part)) {
      case Shape::Neighbours: a_.vmovups(d, x86::ptr(x86::rsi, x86::rax, 0, q.bytes(part * kVectorLanes))); break;
      case Shape::Equal: a_.vbroadcastss(d, element(0)); break;
      case Shape::Other:
        for (uint32_t half = 0; half < 2; half++) {
          const x86::Xmm x = (half ? t0() : t1()).xmm();
          a_.vmovd(x, element(half * 4));
          for (uint32_t k = 1; k < 4; k++) a_.vpinsrd(x, x, element(half * 4 + k), k);
        }
        a_.vinserti128(d, t1(), t0().xmm(), 1);
        break;
    }
    finish(v, part, d);
  }
  a_.bind(done);
  later([this, v, &q, from = source(first, 0), limit, outside, done] {
    a_.bind(outside);
    for (uint32_t part = 0; part < p_.unroll; part++) {
      patternOffsets(q, from, part);
      loadScattered(v, t0(), part, x86::rsi, limit);
    }
    a_.jmp(done);
  });
}

//! One by one, those that are active and within bounds. Uses t1, rax, rcx, rdx, r8 and the frame's rows 0 and 1.
void Emitter::storeLanes(const Ymm& offsets, const Ymm& values, uint32_t mask, uint32_t part, const x86::Gp& base, const x86::Mem& limit) {
  const asmjit::Label again = a_.newLabel(), done = a_.newLabel();
  a_.vmovaps(frameMem(frameRow(0), part), offsets);
  a_.vmovaps(frameMem(frameRow(1), part), values);
  a_.vpminud(t1(), offsets, limit);
  a_.vpcmpeqd(t1(), t1(), offsets);
  a_.emit(I::kIdVpand, t1(), t1(), vregSource(mask, part));
  a_.vmovmskps(x86::ecx, t1());
  a_.test(x86::ecx, x86::ecx);
  a_.jz(done);
  a_.bind(again);
  a_.tzcnt(x86::edx, x86::ecx);
  a_.mov(x86::eax, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(0) + part * kVectorBytes)));
  a_.mov(x86::r8d, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(1) + part * kVectorBytes)));
  a_.mov(x86::ptr(base, x86::rax), x86::r8d);
  a_.blsr(x86::ecx, x86::ecx);
  a_.jnz(again);
  a_.bind(done);
}

//! rsi: base.
void Emitter::storePattern(const LanePattern& q, Value first, Value value, const x86::Mem& limit) {
  const uint32_t mask = p_.regions[region_].mask;
  const asmjit::Label outside = a_.newLabel(), done = a_.newLabel();
  if (!allActive()) {
    Ymm all = vregLoad(mask, 0, t0());
    for (uint32_t part = 1; part < p_.unroll; part++) {
      bin(I::kIdVandps, t0(), reg(all), vregSource(mask, part));
      all = t0();
    }
    a_.vmovmskps(x86::eax, all);
    a_.cmp(x86::eax, 0xff);
    a_.jne(outside);
  }
  patternStart(q, first, 0, limit, outside);
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm s = loadSettled(value, part, t2());
    if (shapeOf(q, part) == Shape::Neighbours) {
      a_.vmovups(x86::ptr(x86::rsi, x86::rax, 0, q.bytes(part * kVectorLanes)), s);
      continue;
    }
    // In the order of lanes: where two write to one place the last one's stays.
    a_.vextracti128(t0().xmm(), s, 1);
    for (uint32_t l = 0; l < kVectorLanes; l++) {
      const x86::Mem element = x86::dword_ptr(x86::rsi, x86::rax, 0, q.bytes(part * kVectorLanes + l));
      const x86::Xmm x = (l < 4 ? s : t0()).xmm();
      if (l % 4 == 0) a_.vmovd(element, x);
      else a_.vpextrd(element, x, l % 4);
    }
  }
  a_.bind(done);
  later([this, value, mask, &q, from = source(first, 0), limit, outside, done] {
    a_.bind(outside);
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const Ymm s = loadSettled(value, part, t2());
      patternOffsets(q, from, part);
      storeLanes(t0(), s, mask, part, x86::rsi, limit);
    }
    a_.jmp(done);
  });
}

}  // namespace pumice::jit
