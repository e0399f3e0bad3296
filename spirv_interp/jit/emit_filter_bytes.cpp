// Footprints of four texels of four bytes (FilterBytes): texels are words, one vector of eight lanes for each corner, of which each component
// is masked and made a float.
#include "spirv_interp/jit/emit_filter.h"

namespace pumice::jit {

//! For all parts.
void Emitter::filterBytesMasks() {
  for (uint32_t c = 0; c < 3; c++) a_.vmovaps(x86::ymm(13 + c), pool32(0xffu << 8 * c));
}

//! Both rows' pairs of texels, from their offsets in the frame, to ymm0 .. ymm3. rsi: base.
void Emitter::loadTexelPairs(const x86::Mem& row0, const x86::Mem& row1) {
  const auto ymm = [](uint32_t n) { return x86::ymm(n); };
  const auto corner = [&](uint32_t r) { return r ? row1 : row0; };
  for (uint32_t r = 0; r < 2; r++) {
    const auto two = [&](const x86::Xmm& x, uint32_t lane) {
      a_.mov(x86::eax, at(corner(r), int32_t(4 * lane), 4));
      a_.mov(x86::ecx, at(corner(r), int32_t(4 * lane + 4), 4));
      a_.vmovq(x, x86::qword_ptr(x86::rsi, x86::rax));
      a_.vmovhps(x, x, x86::qword_ptr(x86::rsi, x86::rcx));
    };
    const Ymm outer = ymm(4), inner = ymm(5), upper = ymm(6);   // lanes 0, 1, 4, 5 and 2, 3, 6, 7
    for (const auto& [to, lane] : {std::pair{outer, 0u}, std::pair{inner, 2u}}) {
      two(to.xmm(), lane);
      two(upper.xmm(), lane + 4);
      a_.vinserti128(to, to, upper.xmm(), 1);
    }
    a_.vshufps(ymm(2 * r), outer, inner, 0x88);
    a_.vshufps(ymm(2 * r + 1), outer, inner, 0xdd);
  }
}

void Emitter::useTexelFetch() {
  if (!fetchesTexels_) fetchTexels_ = a_.newLabel();
  fetchesTexels_ = true;
}

void Emitter::filterBytesPart(const FootprintPart& f) {
  const auto ymm = [](uint32_t n) { return x86::ymm(n); };
  const asmjit::Label general = a_.newLabel(), join = a_.newLabel();
  const Ymm row[2] = {ymm(0), ymm(1)}, column = ymm(2);
  const auto corner = [&](uint32_t k) { return frameMem(footprintScratch_ + kFilterCorners, k); };
  for (uint32_t r = 0; r < 2; r++) a_.vmovaps(row[r], f.operand[kRow0 + r]);
  a_.vmovaps(column, f.operand[kColumn0]);
  a_.mov(x86::rsi, at(f.limit, kRangeBase, 8));
  if (f.neighbours) {
    // Two texels of a row are one load of 64 bits where each lane's are side by side, and all within bounds.
    a_.cmp(at(f.limit, kRangeLast, 4), 0x7ffffff0);   // no sum of what is within bounds wraps
    a_.ja(general);
    const Ymm beside = ymm(3), differ = ymm(4), most = ymm(5), sum = ymm(6);
    a_.vpaddd(beside, column, pool32(4));
    a_.vpxor(differ, beside, f.operand[kColumn1]);
    a_.vpmaxud(most, row[0], row[1]);
    a_.vpaddd(sum, most, beside);
    a_.vpmaxud(most, most, column);
    a_.vpmaxud(sum, sum, most);
    a_.vpmaxud(sum, sum, f.limit);
    a_.vpxor(sum, sum, f.limit);
    a_.vpor(sum, sum, differ);
    a_.vptest(sum, sum);
    a_.jnz(general);
    for (uint32_t r = 0; r < 2; r++) {
      a_.vpaddd(row[r], row[r], column);
      a_.vmovaps(corner(r), row[r]);
    }
    loadTexelPairs(corner(0), corner(1));
    a_.jmp(join);
  }
  a_.bind(general);
  for (uint32_t k = 0; k < 4; k++) {
    if (k == 2) a_.vmovaps(column, f.operand[kColumn1]);
    a_.vpaddd(ymm(4), row[k & 1], column);
    a_.vmovaps(corner((k & 1) * 2 + (k >> 1)), ymm(4));
  }
  a_.lea(x86::rdi, f.limit);
  useTexelFetch();
  a_.call(fetchTexels_);
  a_.bind(join);

  const Ymm weightX = ymm(8), weightY = ymm(9);
  a_.vmovaps(weightX, f.operand[kWeightX]);
  a_.vmovaps(weightY, f.operand[kWeightY]);
  const auto lerp = [&](const Ymm& a, const Ymm& c, const Ymm& weight) {   // into c
    a_.vsubps(c, c, a);
    a_.vfmadd213ps(c, weight, a);
  };
  for (uint32_t c = 0; c < 4; c++) {
    if (!(f.wanted >> c & 1)) continue;
    for (uint32_t k = 0; k < 4; k++) {
      if (c == 3) a_.vpsrld(ymm(4 + k), ymm(k), 24);
      else a_.vpand(ymm(4 + k), ymm(k), ymm(13 + c));
      a_.vcvtdq2ps(ymm(4 + k), ymm(4 + k));
    }
    lerp(ymm(4), ymm(5), weightX);
    lerp(ymm(6), ymm(7), weightX);
    lerp(ymm(5), ymm(7), weightY);
    a_.vmovaps(f.result[c], ymm(7));
  }
}

//! Texels at the corners' offsets in the frame, to ymm0 .. ymm3; those out of bounds are 0. rsi: base, rdi: a range's vector.
void Emitter::fetchTexels() {
  a_.bind(fetchTexels_);
  const asmjit::Label again = a_.newLabel();
  const int32_t corners = int32_t(footprintScratch_ + kFilterCorners);
  const Ymm offsets = x86::ymm4, bounded = x86::ymm5;
  a_.lea(x86::rdx, x86::ptr(frame_, corners));
  a_.mov(x86::r8d, 4);
  a_.bind(again);
  a_.vmovaps(offsets, x86::ptr(x86::rdx));
  a_.vpminud(bounded, offsets, x86::ptr(x86::rdi));
  a_.vpcmpeqd(offsets, offsets, bounded);
  a_.vmovaps(x86::ptr(x86::rdx), bounded);
  for (uint32_t half = 0; half < 2; half++) {
    const x86::Xmm x = half ? x86::xmm0 : x86::xmm1;   // the upper half first
    for (uint32_t k = 0; k < 4; k++) {
      const x86::Gp offset = k & 1 ? x86::rcx : x86::rax;
      a_.mov(offset.r32(), x86::dword_ptr(x86::rdx, int32_t(16 * (1 - half) + 4 * k)));
      if (k == 0) a_.vmovd(x, x86::dword_ptr(x86::rsi, offset));
      else a_.vpinsrd(x, x, x86::dword_ptr(x86::rsi, offset), k);
    }
  }
  a_.vinserti128(x86::ymm0, x86::ymm0, x86::xmm1, 1);
  a_.vpand(x86::ymm0, x86::ymm0, offsets);
  a_.vmovaps(x86::ptr(x86::rdx), x86::ymm0);
  a_.add(x86::rdx, kVectorBytes);
  a_.dec(x86::r8d);
  a_.jnz(again);
  for (uint32_t k = 0; k < 4; k++) a_.vmovaps(x86::ymm(k), x86::ptr(frame_, corners + int32_t(k * kVectorBytes)));
  a_.ret();
}

}  // namespace pumice::jit
