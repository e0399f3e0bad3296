// Three or four neighbouring words of each lane (plan.h): 16 bytes at once, and eight lanes of them turned over.
#include "spirv_interp/jit/emit_range.h"

namespace pumice::jit {

static bool isStore(Op op) { return op == Op::Store || op == Op::SharedStore; }

x86::Mem Emitter::rangeOf(Value access) {
  const Inst& i = f_.insts[access];
  const auto o = f_.operands(access);
  const uint32_t constant = uint32_t(i.imm);
  if (i.op == Op::SharedLoad || i.op == Op::SharedStore) return sharedRange(constant, 4, isStore(i.op));
  return bufferRange(o[0], o[2], constant, 4, isStore(i.op));
}

//! `address` of each lane, called for 0, 4, 1, 5, 2, 6, 3, 7.
template <class Address>
void Emitter::loadWords(const Words& w, uint32_t part, Address address) {
  const auto place = [&](uint32_t k) { return k < w.count ? p_.vregs[p_.vregOf[w.member[k]]].reg[part] : int8_t(-1); };
  const auto fetch = [&](const Ymm& d, uint32_t lane) {
    a_.vmovups(d.xmm(), address(lane));
    a_.vinserti128(d, d, address(lane + 4), 1);
  };
  // Of lanes 0, 1, 4 and 5: words 0 and 1 in one register, 2 and 3 in another; results' own, if there are any.
  const auto keep = [&](uint32_t k) { return place(k) >= 0 ? place(k) : place(k + 1); };
  const int8_t low = keep(0), high = keep(2);
  fetch(t0(), 0);
  fetch(t1(), 1);
  a_.vpunpckldq(low >= 0 ? Ymm(uint32_t(low)) : t2(), t0(), t1());
  if (low < 0) a_.vmovaps(frameMem(frameRow(2)), t2());
  a_.vpunpckhdq(high >= 0 ? Ymm(uint32_t(high)) : t0(), t0(), t1());
  if (high < 0) a_.vmovaps(frameMem(frameRow(3)), t0());
  fetch(t0(), 2);
  fetch(t1(), 3);
  a_.vpunpckldq(t2(), t0(), t1());
  a_.vpunpckhdq(t0(), t0(), t1());
  const auto finishTwo = [&](uint32_t k, int8_t kept, uint32_t row, const Ymm& others) {
    // The one that takes the kept words' place comes last.
    const uint32_t last = kept >= 0 && place(k) == kept ? k : k + 1;
    for (const uint32_t m : {2 * k + 1 - last, last}) {
      if (m >= w.count) continue;
      if (kept < 0) a_.vmovaps(t1(), frameMem(frameRow(row)));
      const Ymm from = kept < 0 ? t1() : Ymm(uint32_t(kept)), d = place(m) >= 0 ? Ymm(uint32_t(place(m))) : t1();
      if (m == k) a_.vpunpcklqdq(d, from, others);
      else a_.vpunpckhqdq(d, from, others);
      finish(w.member[m], part, d);
    }
  };
  finishTwo(0, low, 2, t2());
  finishTwo(2, high, 3, t0());
}

//! `address`: as above.
template <class Address>
void Emitter::storeWords(const Words& w, uint32_t part, Address address) {
  const auto value = [&](uint32_t k) { return f_.operands(w.member[k]).back(); };
  // Words 0 and 1, then 2 and 3: lanes 0, 1, 4, 5 in t1, the others in t0.
  const auto two = [&](uint32_t k) {
    const Source a = settled(value(k), part, t0());
    const Ymm x = a.isReg ? a.reg() : (move(t0(), a), t0());
    const Source b = settled(value(k + 1), part, t2());
    const Ymm y = b.isReg ? b.reg() : (move(t2(), b), t2());
    a_.vpunpckldq(t1(), x, y);
    a_.vpunpckhdq(t0(), x, y);
  };
  two(0);
  a_.vmovaps(frameMem(frameRow(0)), t1());
  a_.vmovaps(frameMem(frameRow(1)), t0());
  two(2);
  a_.vmovaps(frameMem(frameRow(2)), t0());
  const auto put = [&](uint32_t lane) {
    a_.vmovups(address(lane), t0().xmm());
    a_.vextracti128(address(lane + 4), t0(), 1);
  };
  for (uint32_t k = 0; k < 2; k++) {
    a_.vmovaps(t2(), frameMem(frameRow(k)));
    if (k) a_.vmovaps(t1(), frameMem(frameRow(2)));
    a_.vpunpcklqdq(t0(), t2(), t1());
    put(2 * k);
    a_.vpunpckhqdq(t0(), t2(), t1());
    put(2 * k + 1);
  }
}

void Emitter::words(const Words& w) {
  const Value v = w.member[0];
  const Inst& i = f_.insts[v];
  const bool store = isStore(i.op);
  const Value offset = f_.operands(v)[offsetOperand(i.op)];
  const uint32_t mask = p_.regions[region_].mask;
  const LanePattern* q = pattern(v);
  const asmjit::Label outside = a_.newLabel(), done = a_.newLabel();
  const x86::Mem limit = rangeOf(v);
  if (store && !allActive()) {
    Ymm all = vregLoad(mask, 0, t0());
    for (uint32_t part = 1; part < p_.unroll; part++) {
      bin(x86::Inst::kIdVandps, t0(), reg(all), vregSource(mask, part));
      all = t0();
    }
    a_.vmovmskps(x86::eax, all);
    a_.cmp(x86::eax, 0xff);
    a_.jne(outside);
  }
  // One by one, from a part on or for one part alone.
  const auto slowly = [this, w, store, mask, q, offset](Source first, uint32_t part) {
    for (uint32_t k = 0; k < w.count; k++) {
      const x86::Mem limit = rangeOf(w.member[k]);
      const Ymm s = store ? loadSettled(f_.operands(w.member[k]).back(), part, t2()) : t2();
      if (q) patternOffsets(*q, first, part);
      else move(t0(), source(offset, part));
      if (store) storeLanes(t0(), s, mask, part, x86::rsi, limit);
      else loadScattered(w.member[k], t0(), part, x86::rsi, limit);
    }
  };
  if (q) {
    patternStart(*q, offset, 12, limit, outside);
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const auto address = [&](uint32_t lane) { return x86::ptr(x86::rsi, x86::rax, 0, q->bytes(part * kVectorLanes + lane)); };
      store ? storeWords(w, part, address) : loadWords(w, part, address);
    }
  } else {
    x86::Mem last = at(limit, kRangeLast);
    last.setSize(8);
    a_.cmp(last, 12);
    a_.jb(outside);
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const asmjit::Label one = a_.newLabel(), next = a_.newLabel();
      a_.vmovaps(t1(), limit);
      a_.vpsubd(t1(), t1(), pool32(12));
      const Ymm off = load(offset, part, t0());
      a_.vpminud(t1(), t1(), off);
      a_.vpcmpeqd(t1(), t1(), off);
      a_.vmovmskps(x86::ecx, t1());
      a_.cmp(x86::ecx, 0xff);
      a_.jne(one);
      spreadOffsets(off, t1());
      const auto address = [&](uint32_t lane) { return x86::ptr(x86::rsi, laneOffset(lane)); };
      store ? storeWords(w, part, address) : loadWords(w, part, address);
      a_.bind(next);
      later([this, slowly, part, one, next, v] {
        a_.bind(one);
        slowly({}, part);
        rangeOf(v);   // the next part goes on
        a_.jmp(next);
      });
    }
  }
  a_.bind(done);
  later([this, slowly, first = q ? source(offset, 0) : Source{}, outside, done] {
    a_.bind(outside);
    for (uint32_t part = 0; part < p_.unroll; part++) slowly(first, part);
    a_.jmp(done);
  });
}

}  // namespace pumice::jit
