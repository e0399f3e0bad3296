// Footprints of bytes with their addresses (FilterLevel, FilterLevels). Eight lanes that all lie inside the level, where texels x and x + 1
// are side by side and neither wraps nor is clamped, need no more than the offset of one texel; others are out of line.
#include "spirv_interp/jit/emit_filter.h"

namespace pumice::jit {

//! For all parts: the last offset of a pair of texels, or -1 if texels must be looked at one by one.
void Emitter::filterLevelsLimit(const x86::Mem& limit) {
  const asmjit::Label small = a_.newLabel();
  a_.vmovaps(x86::ymm0, limit);
  a_.vpaddd(x86::ymm0, x86::ymm0, pool32(uint32_t(-4)));
  a_.mov(x86::eax, at(limit, kRangeLast, 4));
  a_.sub(x86::eax, 4);
  a_.cmp(x86::eax, 0x7fffffec);   // no difference of what is within bounds wraps
  a_.jbe(small);
  a_.vpcmpeqd(x86::ymm0, x86::ymm0, x86::ymm0);
  a_.bind(small);
  a_.vmovaps(frameMem(footprintScratch_ + kFilterInside), x86::ymm0);
}

void Emitter::filterLevelsPart(const FootprintPart& f, bool two, uint32_t mode, uint32_t part, bool addresses) {
  const auto ymm = [](uint32_t n) { return x86::ymm(n); };
  // fetchAtBorder() knows these, up to `pitch`. The first level's components wait in ymm12 .. ymm15.
  const Ymm floor[2] = {ymm(0), ymm(1)}, extent[2] = {ymm(2), ymm(3)}, weight[2] = {ymm(8), ymm(9)}, offset = ymm(10), pitch = ymm(11);
  const Ymm outside = ymm(4), t = ymm(5), index[2] = {ymm(6), ymm(7)};
  const auto take = [this, f](const Ymm& to, uint32_t k) {
    if (f.shared[k]) a_.vpermilps(to, f.operand[k], f.lanes);
    else a_.vmovaps(to, f.operand[k]);
  };
  const auto axes = [=, this](uint32_t words) {
    a_.vmovaps(t, pool32(0xbf000000));   // -0.5
    for (uint32_t k = 0; k < 2; k++) {
      take(extent[k], words + kWidth + k);
      a_.vcvtdq2ps(weight[k], extent[k]);
      a_.vfmadd132ps(weight[k], t, f.operand[kPlaceX + k]);
      a_.vroundps(floor[k], weight[k], 9);
      a_.vsubps(weight[k], weight[k], floor[k]);
      a_.vcvttps2dq(index[k], floor[k]);
    }
    take(pitch, words + kPitch);
    take(offset, words + kOffset);
  };
  const auto found = [&](uint32_t level, uint32_t k) { return frameMem(footprintScratch_ + kFilterFound, ((level * kMaxUnroll) + part) * kFoundWords + k); };
  if (addresses) {
    for (uint32_t level = 0; level < (two ? 2 : 1); level++) {
      axes(kFirstLevel + level * kLevelWords);
      // By sign: an index below 0 or above the extent - 2, an offset too large.
      a_.vpsubd(outside, extent[0], index[0]);
      a_.vpsubd(t, extent[1], index[1]);
      a_.vpminsd(outside, outside, t);
      a_.vpaddd(outside, outside, pool32(uint32_t(-2)));
      a_.vpor(outside, outside, index[0]);
      a_.vpor(outside, outside, index[1]);
      a_.vpmulld(index[1], index[1], pitch);
      a_.vpslld(index[0], index[0], 2);
      a_.vpaddd(index[1], index[1], offset);
      a_.vpaddd(index[0], index[0], index[1]);
      a_.vpaddd(index[1], index[0], pitch);
      a_.vmovaps(found(level, 0), index[0]);
      a_.vmovaps(found(level, 1), index[1]);
      a_.vpmaxud(t, index[0], index[1]);
      a_.vmovaps(index[0], frameMem(footprintScratch_ + kFilterInside));
      a_.vpor(outside, outside, t);
      a_.vpsubd(index[0], index[0], t);
      a_.vpor(outside, outside, index[0]);
      a_.vmovaps(found(level, 2), outside);
      a_.vmovaps(found(level, 3), weight[0]);
      a_.vmovaps(found(level, 4), weight[1]);
    }
    return;
  }
  const asmjit::Label end = a_.newLabel();
  a_.mov(x86::rsi, at(f.limit, kRangeBase, 8));
  for (uint32_t level = 0; level < (two ? 2 : 1); level++) {
    if (level) {
      // The other level only where it has a share.
      const asmjit::Label none = a_.newLabel();
      take(t, kLevelWeight);
      a_.vptest(t, t);
      a_.jz(none);
      later([this, f, none, end] {
        a_.bind(none);
        for (uint32_t c = 0; c < 4; c++)
          if (f.wanted >> c & 1) a_.vmovaps(f.result[c], x86::ymm(12 + c));
        a_.jmp(end);
      });
    }
    const asmjit::Label border = a_.newLabel(), join = a_.newLabel();
    a_.vmovaps(outside, found(level, 2));
    a_.vtestps(outside, outside);
    a_.jnz(border);
    if (!(fetchesAtBorder_ >> mode & 1)) fetchAtBorder_[mode] = a_.newLabel();
    fetchesAtBorder_ |= 1u << mode;
    useTexelFetch();
    later([=, this, limit = f.limit] {
      a_.bind(border);
      axes(kFirstLevel + level * kLevelWords);
      a_.lea(x86::rdi, limit);
      a_.call(fetchAtBorder_[mode]);
      a_.jmp(join);
    });
    loadTexelPairs(found(level, 0), found(level, 1));
    a_.vmovaps(weight[0], found(level, 3));
    a_.vmovaps(weight[1], found(level, 4));
    a_.bind(join);
    if (level) take(ymm(10), kLevelWeight);
    const auto lerp = [&](const Ymm& a, const Ymm& c, const Ymm& w) {   // into c
      a_.vsubps(c, c, a);
      a_.vfmadd213ps(c, w, a);
    };
    for (uint32_t c = 0; c < 4; c++) {
      if (!(f.wanted >> c & 1)) continue;
      const Ymm result = two && !level ? ymm(12 + c) : ymm(7);
      for (uint32_t k = 0; k < 4; k++) {
        const Ymm texel = k == 3 ? result : ymm(4 + k);
        if (c == 3) a_.vpsrld(texel, ymm(k), 24);
        else a_.vpand(texel, ymm(k), pool32(0xffu << 8 * c));
        a_.vcvtdq2ps(texel, texel);
      }
      lerp(ymm(4), ymm(5), weight[0]);
      lerp(ymm(6), result, weight[0]);
      lerp(ymm(5), result, weight[1]);
      if (level) lerp(ymm(12 + c), result, ymm(10));
      if (level || !two) a_.vmovaps(f.result[c], result);
    }
  }
  a_.bind(end);
}

//! Texels of a part whose footprints leave the level or the image, to ymm0 .. ymm3. In registers as filterLevelsPart() has them; keeps
//! ymm8, ymm9 and from ymm12 on.
void Emitter::fetchAtBorder(uint32_t mode) {
  const auto ymm = [](uint32_t n) { return x86::ymm(n); };
  const Ymm t = ymm(4), offset = ymm(10), pitch = ymm(11);
  const auto indices = [&](const Ymm& floor, const Ymm& extent, bool clamp, const Ymm& first, const Ymm& second) {
    if (clamp) {
      a_.vmaxps(floor, floor, pool32(0xbf800000));   // -1; also of NaN
      a_.vcvtdq2ps(t, extent);
      a_.vsubps(t, t, pool32(0x3f800000));
      a_.vminps(floor, floor, t);
      a_.vcvttps2dq(first, floor);
      a_.vpaddd(second, first, pool32(1));
      a_.vpmaxsd(first, first, pool32(0));
      a_.vpaddd(t, extent, pool32(uint32_t(-1)));
      a_.vpminsd(second, second, t);
      return;
    }
    // As ftos: too large ones become the largest, NaN becomes 0.
    a_.vcvttps2dq(first, floor);
    a_.vcmpps(t, floor, pool32(0x4f000000), 29);
    a_.vpxor(first, first, t);
    a_.vcmpps(t, floor, floor, 7);
    a_.vpand(first, first, t);
    a_.vpaddd(second, first, pool32(1));
    a_.vpsubd(t, second, extent);
    a_.vpminud(second, second, t);
    a_.vpaddd(t, extent, pool32(uint32_t(-1)));
    a_.vpminud(first, first, t);
  };
  a_.align(asmjit::AlignMode::kCode, 16);
  a_.bind(fetchAtBorder_[mode]);
  const Ymm column[2] = {ymm(6), ymm(7)}, row[2] = {ymm(0), ymm(2)};
  indices(ymm(0), ymm(2), mode & 1, column[0], column[1]);
  indices(ymm(1), ymm(3), mode & 2, row[0], row[1]);
  for (uint32_t k = 0; k < 2; k++) {
    a_.vpslld(column[k], column[k], 2);
    a_.vpmulld(row[k], row[k], pitch);
    a_.vpaddd(row[k], row[k], offset);
  }
  for (uint32_t k = 0; k < 4; k++) {
    a_.vpaddd(t, row[k / 2], column[k % 2]);
    a_.vmovaps(frameMem(footprintScratch_ + kFilterCorners, k), t);
  }
  a_.jmp(fetchTexels_);
}

}  // namespace pumice::jit
