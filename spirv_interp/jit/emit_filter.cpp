// Footprints of four texels (FilterHalves, FilterBytes, FilterLevel, FilterLevels). The first component of a footprint makes all of them (Plan::footprint), with all
// vector registers: what lives in them and is still needed waits in the frame.
//
// Halves are filtered texel by texel: two lanes' texels are one vector of floats, so that nothing has to be taken apart before it is
// filtered; the sums of four pairs of lanes become components by one transposition.
#include "spirv_interp/jit/emit_filter.h"

namespace pumice::jit {
namespace {

//! x << shift with an x that is no sum: in images made of blocks, where x is spread over the offset, neighbours in a row are not side
//! by side.
bool isShifted(const Function& f, Value column, uint64_t shift) {
  if (f.insts[column].op != Op::Shl) return false;
  const auto o = f.operands(column);
  return f.insts[o[1]].op == Op::Const && f.insts[o[1]].imm == shift && f.insts[o[0]].op != Op::IAdd;
}

}  // namespace

bool Emitter::filter(Value v) {
  if (preamble_) return false;
  if (p_.footprint[v] != v) return true;   // made with the first
  const Op op = f_.insts[v].op;
  const auto o = f_.operands(v);
  const bool bytes = op != Op::FilterHalves, levels = ir::filtersLevels(op);
  const auto componentOf = [&](Value c) { return uint32_t(f_.insts[c].imm & 3); };
  if (!footprintScratch_) {
    footprintScratch_ = out_->frameBytes;
    out_->frameBytes += kFilterScratchBytes;
  }
  const x86::Mem limit = bankMem(rangeSlot(o[0], o[1], 0, 0, bytes ? 4 : 8, false));
  FootprintPart parts[kMaxUnroll];
  for (uint32_t part = 0; part < p_.unroll; part++) {
    parts[part].limit = limit;
    parts[part].neighbours = !levels && isShifted(f_, o[2 + kColumn0], bytes ? 2 : 3);
    parts[part].lanes = uint8_t(0x55 * (part * 4 / p_.unroll));
    for (uint32_t k = 0; k + 2 < o.size(); k++) {
      const Source s = source(o[2 + k], part);
      const bool shared = parts[part].shared[k] = p_.shared[o[2 + k]];
      parts[part].operand[k] = s.isReg ? frameMem(footprintScratch_, k * kMaxUnroll + (shared ? 0 : part)) : s.mem();
      if (s.isReg && !(shared && part)) a_.vmovaps(parts[part].operand[k], s.reg());
    }
  }
  // Components go where they will be read, or into registers afterwards.
  Value last = v;
  for (Value c = v; c < f_.insts.size(); c++) {
    if (!p_.a.needed[c] || p_.a.uniform[c]) continue;
    if (p_.footprint[c] != v) break;
    last = c;
    const uint32_t component = componentOf(c);
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const Source s = source(c, part);
      x86::Mem& result = parts[part].result[component];
      if (parts[part].wanted >> component & 1) continue;
      parts[part].wanted |= 1u << component;
      result = s.isReg ? frameMem(footprintScratch_ + kFilterResults, component * kMaxUnroll + part) : s.mem();
    }
  }
  uint32_t live = 0;
  for (const Vreg& r : p_.vregs) {
    if (r.unused || r.start >= v || r.end <= last) continue;
    for (uint32_t part = 0; part < p_.parts(r); part++)
      if (r.reg[part] >= 0) live |= 1u << r.reg[part];
  }
  for (uint32_t r = 0; r < 16; r++)
    if (live >> r & 1) a_.vmovaps(frameMem(kFrameSave, r), x86::ymm(r));
  if (levels) {
    filterLevelsLimit(limit);
    for (const bool addresses : {true, false})
      for (uint32_t part = 0; part < p_.unroll; part++) filterLevelsPart(parts[part], op == Op::FilterLevels, uint32_t(f_.insts[v].imm >> 2), part, addresses);
  } else {
    if (bytes) filterBytesMasks();
    for (uint32_t part = 0; part < p_.unroll; part++) bytes ? filterBytesPart(parts[part]) : filterHalvesPart(parts[part]);
  }
  for (uint32_t r = 0; r < 16; r++)
    if (live >> r & 1) a_.vmovaps(x86::ymm(r), frameMem(kFrameSave, r));
  for (Value c = v; c <= last; c++) {
    if (!p_.a.needed[c] || p_.a.uniform[c]) continue;
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const x86::Mem& from = parts[part].result[componentOf(c)];
      const Source s = source(c, part);
      if (s.isReg) {
        a_.vmovaps(s.reg(), from);
      } else if (s.offset != from.offsetLo32() || s.id != from.baseId()) {   // the same component twice
        a_.vmovaps(t0(), from);
        a_.store(s, t0());
      }
    }
  }
  return true;
}

void Emitter::filterHalvesPart(const FootprintPart& f) {
  const auto ymm = [](uint32_t n) { return x86::ymm(n); };
  const Ymm sum[4] = {ymm(0), ymm(1), ymm(2), ymm(3)}, weightX = ymm(12), weightY = ymm(13), ones = ymm(14);

  // 2x4 pixels whose columns depend on x alone and whose rows depend on y alone, as in pictures that are drawn over the whole screen? Then
  // 12 offsets say where 32 texels are.
  const asmjit::Label general = a_.newLabel(), inside = a_.newLabel(), join = a_.newLabel();
  for (uint32_t k = 0; k < 4; k++) a_.vmovaps(ymm(k), f.operand[k]);
  a_.vpmaxud(ymm(8), ymm(0), ymm(1));
  a_.vpmaxud(ymm(10), ymm(2), ymm(3));
  a_.vpor(ymm(9), ymm(8), ymm(10));
  a_.vpand(ymm(9), ymm(9), pool32(0x80000000u));   // sums of others do not wrap: the greatest row and column make the greatest corner
  a_.vpaddd(ymm(8), ymm(8), ymm(10));
  a_.vpmaxud(ymm(8), ymm(8), f.limit);
  a_.vpxor(ymm(8), ymm(8), f.limit);   // not 0: a corner is out of bounds
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
  a_.vmovaps(weightX, f.operand[kWeightX]);
  a_.vmovaps(weightY, f.operand[kWeightY]);
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
    for (uint32_t k = 0; k < 4; k++) a_.mov(kColumns[c][k].r32(), at(f.operand[kColumn0 + c], int32_t(4 * (k + (k & 2))), 4));
  for (uint32_t half = 0; half < 2; half++) {
    for (uint32_t r = 0; r < 2; r++) {
      a_.mov(kRows[r].r32(), at(f.operand[kRow0 + r], int32_t(8 * half), 4));
      a_.add(kRows[r], at(f.limit, kRangeBase, 8));
    }
    for (uint32_t k = 0; k < 2; k++)
      filter(2 * half + k, [&](uint32_t corner, uint32_t lane) { return x86::qword_ptr(kRows[corner >> 1], kColumns[corner & 1][(lane & 1) + lane / 4 * 2]); });
  }
  a_.jmp(join);

  a_.bind(general);
  for (uint32_t k = 0; k < 4; k++) {
    a_.vpaddd(ymm(4 + k), ymm(k / 2), ymm(2 + k % 2));
    a_.vmovaps(frameMem(footprintScratch_ + kFilterCorners, k), ymm(4 + k));
    if (k) a_.vpmaxud(ymm(8), k == 1 ? ymm(4) : ymm(8), ymm(4 + k));
  }
  a_.vpmaxud(ymm(8), ymm(8), f.limit);
  a_.vpxor(ymm(8), ymm(8), f.limit);
  a_.mov(x86::rsi, at(f.limit, kRangeBase, 8));
  a_.vptest(ymm(8), ymm(8));
  a_.jz(inside);
  {
    const asmjit::Label again = a_.newLabel(), outside = a_.newLabel();
    const x86::Mem corner = x86::dword_ptr(frame_, x86::rcx, 2, int32_t(footprintScratch_ + kFilterCorners));
    a_.xor_(x86::ecx, x86::ecx);
    a_.bind(again);
    a_.mov(x86::eax, corner);
    a_.xor_(x86::edx, x86::edx);
    a_.cmp(x86::rax, at(f.limit, kRangeLast, 8));
    a_.ja(outside);
    a_.mov(x86::rdx, x86::qword_ptr(x86::rsi, x86::rax));
    a_.bind(outside);
    a_.mov(x86::qword_ptr(frame_, x86::rcx, 3, int32_t(footprintScratch_ + kFilterTexels)), x86::rdx);
    a_.lea(x86::eax, x86::ptr(x86::rcx, x86::rcx, 0));
    a_.shl(x86::eax, 2);
    a_.mov(corner, x86::eax);
    a_.inc(x86::ecx);
    a_.cmp(x86::ecx, 32);
    a_.jb(again);
    a_.lea(x86::rsi, x86::ptr(frame_, int32_t(footprintScratch_ + kFilterTexels)));
  }
  a_.bind(inside);
  for (uint32_t k = 0; k < 4; k++)
    filter(k, [&](uint32_t corner, uint32_t lane) {
      const x86::Gp offset = kColumns[corner & 1][lane / 4];
      a_.mov(offset.r32(), at(frameMem(footprintScratch_ + kFilterCorners, corner), int32_t(4 * lane), 4));
      return x86::qword_ptr(x86::rsi, offset);
    });
  a_.bind(join);

  // Per half of the registers: four texels to four components.
  a_.vunpcklps(ymm(4), sum[0], sum[1]);
  a_.vunpckhps(ymm(5), sum[0], sum[1]);
  a_.vunpcklps(ymm(6), sum[2], sum[3]);
  a_.vunpckhps(ymm(7), sum[2], sum[3]);
  for (uint32_t c = 0; c < 4; c++) {
    if (!(f.wanted >> c & 1)) continue;
    const Ymm low = ymm(4 + c / 2), high = ymm(6 + c / 2);
    if (c & 1) a_.vunpckhpd(ymm(8 + c), low, high);
    else a_.vunpcklpd(ymm(8 + c), low, high);
    a_.vmovaps(f.result[c], ymm(8 + c));
  }
}

}  // namespace pumice::jit
