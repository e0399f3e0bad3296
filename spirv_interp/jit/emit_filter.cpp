// Footprints of four texels of four halves (FilterHalves), texel by texel: two lanes' texels are one vector of floats, so that nothing has
// to be taken apart before it is filtered; the sums of four pairs of lanes become components by one transposition.
//
// The first of a footprint's components computes all of them, with all vector registers: what lives in them waits in the frame.
#include <algorithm>

#include "spirv_interp/jit/emit_range.h"

namespace pumice::jit {
namespace {

namespace I = x86::Inst;
enum Operand { kRow0, kRow1, kColumn0, kColumn1, kWeightX, kWeightY, kOperands };

// Scratch in the frame: operands that stand in registers, the offsets of the corners, texels in place of those out of bounds.
constexpr uint32_t kCorners = kOperands * kMaxUnroll * kVectorBytes;
constexpr uint32_t kTexels = kCorners + 4 * kVectorBytes;
constexpr uint32_t kScratchBytes = kTexels + 32 * 8;

x86::Mem at(x86::Mem m, int32_t offset, uint32_t size) {
  m.addOffset(offset);
  m.setSize(size);
  return m;
}

}  // namespace

bool Emitter::filterHalves(Value v) {
  if (preamble_) return false;
  const auto o = f_.operands(v);
  const auto holds = [&](uint32_t region) {
    for (uint32_t r = region_; r != kNone; r = p_.regions[r].parent)
      if (r == region) return true;
    return false;
  };
  uint32_t place = 0;
  for (size_t k = footprints_.size(), last = k > 16 ? k - 16 : 0; !place && k-- > last;) {
    const Footprint& known = footprints_[k];
    const auto other = f_.operands(known.first);
    if (std::equal(o.begin(), o.end(), other.begin()) && holds(known.region)) place = known.place;
  }
  if (!place) {
    if (!footprintScratch_) {
      footprintScratch_ = out_->frameBytes;
      out_->frameBytes += kScratchBytes;
    }
    place = out_->frameBytes;
    out_->frameBytes += 4 * p_.unroll * kVectorBytes;
    footprints_.push_back({v, region_, place});
    emitFootprint(v, place);
  }
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm d = target(v, part);
    a_.vmovaps(d, frameMem(place, uint32_t(f_.insts[v].imm) * p_.unroll + part));
    finish(v, part, d);
  }
  return true;
}

void Emitter::emitFootprint(Value v, uint32_t results) {
  const auto o = f_.operands(v);
  const x86::Mem limit = bankMem(rangeSlot(o[0], o[1], 0, 0, 8, false));
  x86::Mem operands[kMaxUnroll][kOperands];
  for (uint32_t part = 0; part < p_.unroll; part++)
    for (uint32_t k = 0; k < kOperands; k++) {
      const Source s = source(o[2 + k], part);
      operands[part][k] = s.isReg ? frameMem(footprintScratch_, k * kMaxUnroll + part) : s.mem();
      if (s.isReg) a_.vmovaps(operands[part][k], s.reg());
    }
  uint32_t live = 0;
  for (const Vreg& r : p_.vregs) {
    if (r.unused || r.start > v || r.end < v) continue;
    for (uint32_t part = 0; part < p_.parts(r); part++)
      if (r.reg[part] >= 0) live |= 1u << r.reg[part];
  }
  for (uint32_t r = 0; r < kMaxRegisters; r++)
    if (live >> r & 1) a_.vmovaps(frameMem(kFrameSave, r), x86::ymm(r));
  for (uint32_t part = 0; part < p_.unroll; part++) emitFootprintPart(operands[part], limit, results, part);
  for (uint32_t r = 0; r < kMaxRegisters; r++)
    if (live >> r & 1) a_.vmovaps(x86::ymm(r), frameMem(kFrameSave, r));
}

void Emitter::emitFootprintPart(const x86::Mem (&operand)[6], const x86::Mem& limit, uint32_t results, uint32_t part) {
  const auto ymm = [](uint32_t n) { return x86::ymm(n); };
  const Ymm sum[4] = {ymm(0), ymm(1), ymm(2), ymm(3)}, weightX = ymm(12), weightY = ymm(13), ones = ymm(14);

  // 2x4 pixels whose columns depend on x alone and whose rows depend on y alone, as in pictures that are drawn over the whole screen? Then
  // 12 offsets say where 32 texels are.
  const asmjit::Label general = a_.newLabel(), inside = a_.newLabel(), join = a_.newLabel();
  for (uint32_t k = 0; k < 4; k++) a_.vmovaps(ymm(k), operand[k]);
  for (uint32_t k = 0; k < 4; k++) a_.vpaddd(ymm(4 + k), ymm(k / 2), ymm(2 + k % 2));
  a_.vpmaxud(ymm(8), ymm(4), ymm(5));
  a_.vpmaxud(ymm(9), ymm(6), ymm(7));
  a_.vpmaxud(ymm(8), ymm(8), ymm(9));
  a_.vpmaxud(ymm(8), ymm(8), limit);
  a_.vpxor(ymm(8), ymm(8), limit);   // not 0: a corner is out of bounds
  a_.vpor(ymm(9), ymm(0), ymm(1));
  a_.vpor(ymm(10), ymm(2), ymm(3));
  a_.vpor(ymm(9), ymm(9), ymm(10));
  a_.vpand(ymm(9), ymm(9), pool32(0x80000000u));   // sums of others do not wrap
  for (uint32_t k = 0; k < 4; k++) {
    if (k < 2) {
      a_.vpermq(ymm(10), ymm(k), 0x44);
      a_.vpshufd(ymm(10), ymm(10), 0xa0);
    } else {
      a_.vpshufd(ymm(10), ymm(k), 0x44);
    }
    a_.vpxor(ymm(10), ymm(10), ymm(k));
    a_.vpor(ymm(9), ymm(9), ymm(10));
  }
  a_.vmovaps(weightX, operand[kWeightX]);
  a_.vmovaps(weightY, operand[kWeightY]);
  a_.vmovaps(ones, pool32(0x3f800000));

  // Lanes k and k + 4 of all components.
  const auto filter = [&](uint32_t k, const auto& texel) {
    const Ymm x = ymm(4), restX = ymm(5), y = ymm(6), restY = ymm(7);
    a_.vpermilps(x, weightX, 0x55 * k);
    a_.vsubps(restX, ones, x);
    a_.vpermilps(y, weightY, 0x55 * k);
    a_.vsubps(restY, ones, y);
    for (uint32_t corner = 0; corner < 4; corner++) {
      const Ymm t = ymm(8 + corner);
      a_.vmovq(t.xmm(), texel(corner, k));
      a_.vmovhps(t.xmm(), t.xmm(), texel(corner, k + 4));
      a_.vcvtph2ps(t, t.xmm());
    }
    for (uint32_t row = 0; row < 2; row++) {
      a_.vmulps(ymm(8 + 2 * row), ymm(8 + 2 * row), restX);
      a_.vfmadd231ps(ymm(8 + 2 * row), ymm(9 + 2 * row), x);
    }
    a_.vmulps(sum[k], ymm(8), restY);
    a_.vfmadd231ps(sum[k], ymm(10), y);
  };

  a_.vpor(ymm(9), ymm(9), ymm(8));
  a_.vptest(ymm(9), ymm(9));
  a_.jnz(general);
  static constexpr x86::Gp kColumns[2][4] = {{x86::rax, x86::rcx, x86::rdx, x86::rdi}, {x86::r8, x86::r9, x86::r10, x86::r11}};
  static constexpr x86::Gp kRows[2] = {x86::rsi, x86::r15};
  for (uint32_t c = 0; c < 2; c++)
    for (uint32_t k = 0; k < 4; k++) a_.mov(kColumns[c][k].r32(), at(operand[kColumn0 + c], int32_t(4 * (k + (k & 2))), 4));
  for (uint32_t half = 0; half < 2; half++) {
    for (uint32_t r = 0; r < 2; r++) {
      a_.mov(kRows[r].r32(), at(operand[kRow0 + r], int32_t(8 * half), 4));
      a_.add(kRows[r], at(limit, kRangeBase, 8));
    }
    for (uint32_t k = 0; k < 2; k++)
      filter(2 * half + k, [&](uint32_t corner, uint32_t lane) { return x86::qword_ptr(kRows[corner >> 1], kColumns[corner & 1][(lane & 1) + lane / 4 * 2]); });
  }
  a_.jmp(join);

  a_.bind(general);
  for (uint32_t k = 0; k < 4; k++) a_.vmovaps(frameMem(footprintScratch_ + kCorners, k), ymm(4 + k));
  a_.mov(x86::rsi, at(limit, kRangeBase, 8));
  a_.vptest(ymm(8), ymm(8));
  a_.jz(inside);
  {
    const asmjit::Label again = a_.newLabel(), outside = a_.newLabel();
    const x86::Mem corner = x86::dword_ptr(frame_, x86::rcx, 2, int32_t(footprintScratch_ + kCorners));
    a_.xor_(x86::ecx, x86::ecx);
    a_.bind(again);
    a_.mov(x86::eax, corner);
    a_.xor_(x86::edx, x86::edx);
    a_.cmp(x86::rax, at(limit, kRangeLast, 8));
    a_.ja(outside);
    a_.mov(x86::rdx, x86::qword_ptr(x86::rsi, x86::rax));
    a_.bind(outside);
    a_.mov(x86::qword_ptr(frame_, x86::rcx, 3, int32_t(footprintScratch_ + kTexels)), x86::rdx);
    a_.lea(x86::eax, x86::ptr(x86::rcx, x86::rcx, 0));
    a_.shl(x86::eax, 2);
    a_.mov(corner, x86::eax);
    a_.inc(x86::ecx);
    a_.cmp(x86::ecx, 32);
    a_.jb(again);
    a_.lea(x86::rsi, x86::ptr(frame_, int32_t(footprintScratch_ + kTexels)));
  }
  a_.bind(inside);
  for (uint32_t k = 0; k < 4; k++)
    filter(k, [&](uint32_t corner, uint32_t lane) {
      const x86::Gp offset = kColumns[corner & 1][lane / 4];
      a_.mov(offset.r32(), at(frameMem(footprintScratch_ + kCorners, corner), int32_t(4 * lane), 4));
      return x86::qword_ptr(x86::rsi, offset);
    });
  a_.bind(join);

  // Per half of the registers: four texels to four components.
  a_.vunpcklps(ymm(4), sum[0], sum[1]);
  a_.vunpckhps(ymm(5), sum[0], sum[1]);
  a_.vunpcklps(ymm(6), sum[2], sum[3]);
  a_.vunpckhps(ymm(7), sum[2], sum[3]);
  const auto result = [&](uint32_t component) { return frameMem(results, component * p_.unroll + part); };
  a_.vunpcklpd(ymm(8), ymm(4), ymm(6));
  a_.vmovaps(result(0), ymm(8));
  a_.vunpckhpd(ymm(9), ymm(4), ymm(6));
  a_.vmovaps(result(1), ymm(9));
  a_.vunpcklpd(ymm(10), ymm(5), ymm(7));
  a_.vmovaps(result(2), ymm(10));
  a_.vunpckhpd(ymm(11), ymm(5), ymm(7));
  a_.vmovaps(result(3), ymm(11));
}

}  // namespace pumice::jit
