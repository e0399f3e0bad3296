// Loads and stores: buffers, tables, work-group memory, whose bounds are ranges (emit_range.cpp). Loads look at bounds alone: what an
// inactive lane reads within them does no harm.
#include <algorithm>

#include "spirv_interp/jit/emit_range.h"

namespace pumice::jit {
namespace {

namespace I = x86::Inst;
constexpr uint32_t kIota4[8] = {0, 4, 8, 12, 16, 20, 24, 28};

}  // namespace

void Emitter::broadcast(Ymm d, const x86::Gp& address, Type t) {
  switch (ir::typeBytes(t)) {
    case 8: a_.vbroadcastsd(d, x86::ptr(address)); return;
    case 4: a_.vbroadcastss(d, x86::ptr(address)); return;
    case 2: a_.movzx(x86::ecx, x86::word_ptr(address)); break;
    default: a_.movzx(x86::ecx, x86::byte_ptr(address)); break;
  }
  a_.vmovd(d.xmm(), x86::ecx);
  a_.vpbroadcastd(d, d.xmm());
}

//! In the preamble: everything is uniform.
void Emitter::uniformLoad(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  Range r;
  r.bytes = ir::typeBytes(i.type);
  r.constant = uint32_t(i.imm);
  r.slot = bankSlot(v);   // for a moment the pointer
  if (i.op == Op::UniformInput) {
    r.table = ir::kTableDraw;
  } else if (i.op == Op::TableLoad) {
    r.table = uint32_t(i.imm >> 32);
    r.offset = o[0];
  } else {
    r.base = o[0];
    r.offset = o[1];
    r.size = o[2];
  }
  if (!r.offset) {
    // A range's base is what we need.
    const asmjit::Label bad = a_.newLabel(), done = a_.newLabel();
    a_.mov(x86::rcx, x86::ptr(call_, offsetof(ChunkCall, tables)));
    a_.mov(x86::rsi, x86::ptr(x86::rcx, int32_t(r.table * sizeof(interp::Table) + offsetof(interp::Table, data))));
    a_.mov(x86::rdx, x86::ptr(x86::rcx, int32_t(r.table * sizeof(interp::Table) + offsetof(interp::Table, size))));
    a_.mov(x86::eax, r.constant);
    a_.test(x86::rsi, x86::rsi);
    a_.jz(bad);
    a_.sub(x86::rdx, r.bytes);
    a_.jb(bad);
    a_.sub(x86::rdx, x86::rax);
    a_.jb(bad);
    a_.add(x86::rsi, x86::rax);
    a_.jmp(done);
    a_.bind(bad);
    a_.mov(x86::rsi, uint64_t(reinterpret_cast<uintptr_t>(zeroBlock())));
    a_.bind(done);
  } else {
    emitRange(r);
  }
  broadcast(t2(), x86::rsi, i.type);
  finish(v, 0, t2());
}

bool Emitter::mayBeLinear(Value offset) {
  if (linear_[1] < 0) {
    // Numbers that come from floats (texel coordinates) or memory hardly ever are neighbours in order.
    for (Value v = 1; v < f_.insts.size(); v++) {
      const Op op = f_.insts[v].op;
      bool yes = isUniform(v) || (op != Op::FToS && op != Op::FToU && op != Op::Load && op != Op::LoadConst && op != Op::TableLoad &&
                                  op != Op::LocalLoad && op != Op::SharedLoad && op != Op::TileLoad && op != Op::QuadLoad && op != Op::Atomic);
      if (yes && !isUniform(v))
        for (Value o : f_.operands(v)) yes = yes && linear_[o] != 0;
      linear_[v] = yes;
    }
  }
  return linear_[offset] != 0;
}

//! The number of a structure in an array, times its size: levels of a texture, mostly the same in neighbouring lanes.
static bool isRecord(const Function& f, Value offset) {
  const auto o = f.operands(offset);
  return f.insts[offset].op == Op::IMul && (f.insts[o[0]].op == Op::Const || f.insts[o[1]].op == Op::Const);
}

//! row + x * 8 with an x that is no sum: in images made of blocks, where x is spread over the offset, neighbours in a row are not
//! side by side.
static bool isColumn(const Function& f, Value offset) {
  if (f.insts[offset].op != Op::IAdd) return false;
  for (Value o : f.operands(offset)) {
    if (f.insts[o].op != Op::Shl) continue;
    const auto column = f.operands(o);
    if (f.insts[column[1]].op == Op::Const && f.insts[column[1]].imm == 3 && f.insts[column[0]].op != Op::IAdd) return true;
  }
  return false;
}

static constexpr x86::Gp kOffsetPairs[4] = {x86::rax, x86::rcx, x86::rdx, x86::r8};

//! Plain loads of the lanes' elements, 4 or 8 bytes: two thirds of a gather's time on Zen 3, and never its microcode elsewhere. Lanes out
//! of bounds read at the limit and become zero. `part`: of a 32-bit value.
void Emitter::loadScattered(Value v, const Ymm& off, uint32_t part, const x86::Gp& base, const x86::Mem& limit) {
  a_.vpminud(t1(), off, limit);
  a_.vpcmpeqd(t0(), t1(), off);
  spreadOffsets(t1(), t2());
  if (ir::typeBytes(f_.type(v)) == 8) {
    const bool crossed = p_.crossed[v] != 0;
    for (uint32_t half = 0; half < 2; half++) {
      for (uint32_t k = 0; k < 2; k++) {
        const x86::Xmm x = (k ? t2() : t1()).xmm();
        const uint32_t lane = crossed ? 4 * k + 2 * half : 4 * half + 2 * k;
        a_.vmovq(x, x86::qword_ptr(base, laneOffset(lane)));
        a_.vmovhps(x, x, x86::qword_ptr(base, laneOffset(lane + 1)));
      }
      a_.vinserti128(t1(), t1(), t2().xmm(), 1);
      if (!crossed) wideMaskOf(reg(t0()), half, t2());
      else if (half) a_.vpunpckhdq(t2(), t0(), t0());
      else a_.vpunpckldq(t2(), t0(), t0());
      const Ymm d = target(v, part * 2 + half);
      a_.vpand(d, t1(), t2());
      finish(v, part * 2 + half, d);
    }
    return;
  }
  for (uint32_t half = 0; half < 2; half++) {
    const x86::Xmm x = (half ? t1() : t2()).xmm();   // the upper half first
    for (uint32_t k = 0; k < 4; k++) {
      const x86::Gp at = laneOffset(4 * (1 - half) + k);
      if (k == 0) a_.vmovd(x, x86::dword_ptr(base, at));
      else a_.vpinsrd(x, x, x86::dword_ptr(base, at), k);
    }
  }
  a_.vinserti128(t1(), t1(), t2().xmm(), 1);
  const Ymm d = target(v, part);
  a_.vpand(d, t1(), t0());
  finish(v, part, d);
}

//! Takes a vector of offsets apart: two lanes' in each of four registers, of which laneOffset() gives each, even lanes first.
void Emitter::spreadOffsets(const Ymm& offsets, const Ymm& scratch) {
  a_.vextracti128(scratch.xmm(), offsets, 1);
  a_.vmovq(kOffsetPairs[0], offsets.xmm());
  a_.vpextrq(kOffsetPairs[1], offsets.xmm(), 1);
  a_.vmovq(kOffsetPairs[2], scratch.xmm());
  a_.vpextrq(kOffsetPairs[3], scratch.xmm(), 1);
}

x86::Gp Emitter::laneOffset(uint32_t lane) {
  const x86::Gp pair = kOffsetPairs[lane / 2];
  if (lane & 1) {
    a_.shr(pair, 32);
    return pair;
  }
  a_.mov(x86::r9d, pair.r32());
  return x86::r9;
}

//! v and the load before it (Plan::pairFirst): where each lane's two are neighbours within bounds, one access of twice the width.
void Emitter::loadPair(Value v, const x86::Gp& base, const x86::Mem& limit) {
  const Value first = p_.pairFirst[v];
  const Value low = f_.operands(first)[1], high = f_.operands(v)[1];
  const bool wide = ir::typeBytes(f_.type(v)) == 8;
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const asmjit::Label general = a_.newLabel(), done = a_.newLabel();
    const Ymm from = load(low, part, t0());
    x86::Mem last = at(limit, kRangeLast);
    last.setSize(4);
    a_.cmp(last, -16);   // no sum within bounds wraps
    a_.ja(general);
    a_.vpaddd(t1(), from, pool32(wide ? 8 : 4));
    a_.emit(I::kIdVpxor, t2(), t1(), source(high, part));
    a_.vpmaxud(t1(), t1(), from);
    a_.vpmaxud(t1(), t1(), limit);
    a_.vpxor(t1(), t1(), limit);
    a_.vpor(t1(), t1(), t2());
    a_.vptest(t1(), t1());
    a_.jnz(general);
    spreadOffsets(from, t1());
    if (wide) {
      const bool crossed = p_.crossed[v] != 0;
      for (uint32_t half = 0; half < 2; half++) {
        for (uint32_t k = 0; k < 2; k++) {
          const uint32_t lane = crossed ? 4 * k + 2 * half : 4 * half + 2 * k;
          const x86::Mem left = x86::ptr(base, laneOffset(lane)), right = x86::ptr(base, laneOffset(lane + 1));
          if (k == 0) {
            a_.vmovups(t1().xmm(), left);
            a_.vmovups(t0().xmm(), right);
          } else {
            a_.vinserti128(t1(), t1(), left, 1);
            a_.vinserti128(t0(), t0(), right, 1);
          }
        }
        const Ymm d = target(first, part * 2 + half);
        a_.vpunpcklqdq(d, t1(), t0());
        finish(first, part * 2 + half, d);
        const Ymm e = target(v, part * 2 + half);
        a_.vpunpckhqdq(e, t1(), t0());
        finish(v, part * 2 + half, e);
      }
    } else {
      const auto two = [&](const x86::Xmm& x, uint32_t lane) {
        a_.vmovq(x, x86::qword_ptr(base, laneOffset(lane)));
        a_.vmovhps(x, x, x86::qword_ptr(base, laneOffset(lane + 1)));
      };
      two(t2().xmm(), 4);
      two(t1().xmm(), 0);
      a_.vinserti128(t1(), t1(), t2().xmm(), 1);
      two(t2().xmm(), 6);
      two(t0().xmm(), 2);
      a_.vinserti128(t0(), t0(), t2().xmm(), 1);
      const Ymm d = target(first, part);
      a_.vshufps(d, t1(), t0(), 0x88);
      finish(first, part, d);
      const Ymm e = target(v, part);
      a_.vshufps(e, t1(), t0(), 0xdd);
      finish(v, part, e);
    }
    a_.jmp(done);
    a_.bind(general);
    loadScattered(first, load(low, part, t0()), part, base, limit);
    loadScattered(v, load(high, part, t0()), part, base, limit);
    a_.bind(done);
  }
}

//! rsi: base, rdi: base + 2^31; limit: a range's vector.
void Emitter::loadRange(Value v, Value offset, const x86::Gp& base, const x86::Gp& biased, const x86::Mem& limit) {
  const Type t = f_.type(v);
  const uint32_t bytes = ir::typeBytes(t);
  if (p_.flat[offset] || isUniform(offset)) {   // then so is v, if need be: it has one part
    a_.vmovd(x86::eax, load(offset, 0, t0()).xmm());
    a_.cmp(x86::rax, at(limit, kRangeLast));
    a_.lea(x86::rax, x86::ptr(base, x86::rax));
    a_.mov(x86::rcx, uint64_t(reinterpret_cast<uintptr_t>(zeroBlock())));
    a_.cmova(x86::rax, x86::rcx);
    for (uint32_t part = 0; part < partsOf(t); part++) {
      const Ymm d = target(v, part);
      broadcast(d, x86::rax, t);
      finish(v, part, d);
    }
    return;
  }
  if (bytes == 4) {
    const bool look = mayBeLinear(offset), record = !look && isRecord(f_, offset);
    for (uint32_t part = 0; part < partsOf(t); part++) {
      const Ymm off = load(offset, part, t0());
      const Ymm d = target(v, part);
      const asmjit::Label general = a_.newLabel(), done = a_.newLabel();
      if (look) {
        const asmjit::Label differ = a_.newLabel();
        a_.vpbroadcastd(t1(), off.xmm());
        a_.vpsubd(t1(), off, t1());
        a_.vmovd(x86::eax, off.xmm());
        a_.vpxor(t2(), t1(), poolVector(kIota4));
        a_.vptest(t2(), t2());
        a_.jnz(differ);
        a_.lea(x86::rcx, x86::ptr(x86::rax, 28));
        a_.cmp(x86::rcx, at(limit, kRangeLast));
        a_.ja(general);
        a_.vmovups(d, x86::ptr(base, x86::rax));
        finish(v, part, d);
        a_.jmp(done);
        a_.bind(differ);
        a_.vptest(t1(), t1());
        a_.jnz(general);
        a_.cmp(x86::rax, at(limit, kRangeLast));
        a_.ja(general);
        a_.vbroadcastss(d, x86::ptr(base, x86::rax));
        finish(v, part, d);
        a_.jmp(done);
        a_.bind(general);
      }
      if (record) {
        a_.vpbroadcastd(t1(), off.xmm());
        a_.vpxor(t1(), t1(), off);
        a_.vptest(t1(), t1());
        a_.jnz(general);
        a_.vmovd(x86::eax, off.xmm());
        a_.cmp(x86::rax, at(limit, kRangeLast));
        a_.ja(general);
        a_.vbroadcastss(d, x86::ptr(base, x86::rax));
        finish(v, part, d);
        a_.jmp(done);
        a_.bind(general);
      }
      loadScattered(v, load(offset, part, t0()), part, base, limit);
      if (look || record) a_.bind(done);
    }
    return;
  }
  const bool wide = bytes == 8;
  if (wide) {
    // Texels of 8 bytes, in a picture that is drawn at its own size: two quads read four neighbours in each of two rows.
    static constexpr uint32_t kRowStarts[8] = {0, 0, 2, 2, 0, 0, 2, 2}, kColumns[8] = {0, 8, 0, 8, 16, 24, 16, 24};
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const Ymm off = load(offset, part, t0());
      if (!isColumn(f_, offset)) {
        loadScattered(v, load(offset, part, t0()), part, base, limit);
        continue;
      }
      const asmjit::Label general = a_.newLabel(), done = a_.newLabel();
      a_.vmovaps(t1(), poolVector(kRowStarts));
      a_.vpermd(t1(), t1(), off);
      a_.vpaddd(t1(), t1(), poolVector(kColumns));
      a_.vpxor(t1(), t1(), off);
      a_.vptest(t1(), t1());
      a_.jnz(general);
      a_.vmovd(x86::eax, off.xmm());
      a_.vpextrd(x86::ecx, off.xmm(), 2);
      for (const x86::Gp& row : {x86::rax, x86::rcx}) {
        a_.lea(x86::rdx, x86::ptr(row, 24));
        a_.cmp(x86::rdx, at(limit, kRangeLast));
        a_.ja(general);
      }
      for (uint32_t half = 0; half < 2; half++) {
        const Ymm d = target(v, part * 2 + half);
        if (p_.crossed[v]) {
          a_.vmovups(d, x86::ptr(base, half ? x86::rcx : x86::rax));
        } else {
          a_.vmovups(d.xmm(), x86::ptr(base, x86::rax, 0, int32_t(16 * half)));
          a_.vinserti128(d, d, x86::ptr(base, x86::rcx, 0, int32_t(16 * half)), 1);
        }
        finish(v, part * 2 + half, d);
      }
      a_.jmp(done);
      a_.bind(general);
      loadScattered(v, load(offset, part, t0()), part, base, limit);
      a_.bind(done);
    }
    return;
  }
  // Whole words, if all of them lie within bounds too.
  const asmjit::Label slow = a_.newLabel(), end = a_.newLabel();
  x86::Mem last = at(limit, kRangeLast);
  last.setSize(8);
  a_.cmp(last, 4 - bytes);
  a_.jb(slow);
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm off = load(offset, part, t0());
    a_.vmovaps(t1(), limit);
    a_.vpsubd(t1(), t1(), pool32(4 - bytes));
    a_.vpminud(t1(), t1(), off);
    a_.vpcmpeqd(t1(), t1(), off);
    a_.vmovmskps(x86::ecx, t1());
    a_.cmp(x86::ecx, 0xff);
    a_.jne(slow);
    a_.vpxor(t0(), off, pool32(0x80000000u));
    const Ymm d = target(v, part);
    a_.vpxor(d, d, d);
    a_.vgatherdps(d, x86::ptr(biased, t0()), t1());
    a_.vpand(d, d, pool32(bytes == 1 ? 0xff : 0xffff));
    finish(v, part, d);
  }
  a_.jmp(end);
  a_.bind(slow);
  // Lanes within bounds one by one.
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm off = load(offset, part, t0());
    a_.vmovaps(frameMem(frameRow(0), part), off);
    a_.vpminud(t1(), off, limit);
    a_.vpcmpeqd(t1(), t1(), off);
    const x86::Gp bits = part ? x86::r11d : x86::ecx;
    a_.vmovmskps(bits, t1());
    if (part) {
      a_.shl(bits, 8 * part);
      a_.or_(x86::ecx, bits);
    }
  }
  a_.vpxor(t0(), t0(), t0());
  for (uint32_t part = 0; part < partsOf(t); part++) a_.vmovaps(frameMem(frameRow(5), part), t0());
  const asmjit::Label again = a_.newLabel(), done = a_.newLabel();
  a_.test(x86::ecx, x86::ecx);
  a_.jz(done);
  a_.bind(again);
  a_.tzcnt(x86::edx, x86::ecx);
  a_.mov(x86::eax, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(0))));
  {
    if (bytes == 2) a_.movzx(x86::eax, x86::word_ptr(base, x86::rax));
    else a_.movzx(x86::eax, x86::byte_ptr(base, x86::rax));
    a_.mov(x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(5))), x86::eax);
  }
  a_.blsr(x86::ecx, x86::ecx);
  a_.jnz(again);
  a_.bind(done);
  for (uint32_t part = 0; part < partsOf(t); part++) {
    const Ymm d = target(v, part);
    a_.vmovaps(d, frameMem(frameRow(5), part));
    finish(v, part, d);
  }
  a_.bind(end);
}

void Emitter::storeRange(Value v, Value offset, Value value, const x86::Gp& base, const x86::Mem& limit) {
  const Type t = f_.type(value);
  const uint32_t bytes = ir::typeBytes(t), mask = p_.regions[region_].mask;
  (void)v;
  if (bytes == 4 && mayBeLinear(offset)) {
    // Neighbours, all active.
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const Ymm off = load(offset, part, t0());
      const asmjit::Label general = a_.newLabel(), done = a_.newLabel();
      a_.vpbroadcastd(t1(), off.xmm());
      a_.vpsubd(t1(), off, t1());
      a_.vpcmpeqd(t1(), t1(), poolVector(kIota4));
      a_.emit(I::kIdVpand, t1(), t1(), vregSource(mask, part));
      a_.vmovmskps(x86::ecx, t1());
      a_.vmovd(x86::eax, off.xmm());
      a_.vmovaps(frameMem(frameRow(0), part), off);
      const Ymm s = loadSettled(value, part, t2());
      a_.cmp(x86::ecx, 0xff);
      a_.jne(general);
      a_.lea(x86::rdx, x86::ptr(x86::rax, 28));
      a_.cmp(x86::rdx, at(limit, kRangeLast));
      a_.ja(general);
      a_.vmovups(x86::ptr(base, x86::rax), s);
      a_.jmp(done);
      a_.bind(general);
      a_.vmovaps(t0(), frameMem(frameRow(0), part));
      storeLanes(t0(), s, mask, part, base, limit);
      a_.bind(done);
    }
    return;
  }
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const Ymm off = load(offset, part, t0());
    a_.vmovaps(frameMem(frameRow(0), part), off);
    a_.vpminud(t1(), off, limit);
    a_.vpcmpeqd(t1(), t1(), off);
    a_.emit(I::kIdVpand, t1(), t1(), vregSource(mask, part));
    const x86::Gp bits = part ? x86::r11d : x86::ecx;
    a_.vmovmskps(bits, t1());
    if (part) {
      a_.shl(bits, 8 * part);
      a_.or_(x86::ecx, bits);
    }
  }
  for (uint32_t part = 0; part < partsOf(t); part++) a_.vmovaps(frameMem(frameRow(1), part), loadSettled(value, part, t0()));
  const asmjit::Label again = a_.newLabel(), done = a_.newLabel();
  a_.test(x86::ecx, x86::ecx);
  a_.jz(done);
  a_.bind(again);
  a_.tzcnt(x86::edx, x86::ecx);
  a_.mov(x86::eax, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(0))));
  if (bytes == 8) a_.mov(x86::r8, x86::ptr(frame_, x86::rdx, 3, int32_t(frameRow(1))));
  else a_.mov(x86::r8d, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(1))));
  switch (bytes) {
    case 1: a_.mov(x86::byte_ptr(base, x86::rax), x86::r8b); break;
    case 2: a_.mov(x86::word_ptr(base, x86::rax), x86::r8w); break;
    case 4: a_.mov(x86::dword_ptr(base, x86::rax), x86::r8d); break;
    default: a_.mov(x86::qword_ptr(base, x86::rax), x86::r8);
  }
  a_.blsr(x86::ecx, x86::ecx);
  a_.jnz(again);
  a_.bind(done);
}

bool Emitter::memory(Value v) {
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const uint32_t constant = uint32_t(i.imm);
  const auto useRange = [&](uint32_t slot) {
    a_.mov(x86::rsi, at(bankMem(slot), kRangeBase));
    return bankMem(slot);
  };
  switch (i.op) {
    case Op::UniformInput:
    case Op::TableLoad:
    case Op::LoadConst:
      if (preamble_) {
        uniformLoad(v);
        return true;
      }
      if (i.op == Op::UniformInput) return false;
      [[fallthrough]];
    case Op::Load: {
      const bool table = i.op == Op::TableLoad;
      const Value offset = table ? o[0] : o[1];
      const uint32_t number = table ? uint32_t(i.imm >> 32) : 0;
      if (!table && (!isUniform(o[0]) || !isUniform(o[2]))) {
        loadAddresses(v);
        return true;
      }
      const Value base = table ? 0 : o[0], size = table ? 0 : o[2];
      const uint32_t bytes = ir::typeBytes(i.type);
      if (isUniform(offset) && (table || !pattern(v))) {
        const uint32_t slot = pointerSlot(base, offset, size, number, constant, bytes);
        for (uint32_t part = 0; part < partsOf(i.type); part++) {
          a_.mov(x86::rax, bankMem(slot));
          const Ymm d = target(v, part);
          broadcast(d, x86::rax, i.type);
          finish(v, part, d);
        }
        return true;
      }
      if (f_.type(offset) != Type::I32 || (size && isUnbounded(size))) {
        loadAddresses(v);
        return true;
      }
      const x86::Mem limit = useRange(rangeSlot(base, size, number, constant, bytes, false));
      if (const LanePattern* q = table ? nullptr : pattern(v)) {
        loadPattern(v, *q, offset, limit);
        return true;
      }
      if (p_.pairFirst[v]) {
        loadPair(v, x86::rsi, limit);
        return true;
      }
      a_.mov(x86::rdi, at(limit, kRangeBiased));
      loadRange(v, offset, x86::rsi, x86::rdi, limit);
      return true;
    }
    case Op::FilterHalves:
    case Op::FilterBytes:
    case Op::FilterLevel:
    case Op::FilterLevels: return filter(v);
    case Op::Store: {
      if (preamble_ || !isUniform(o[0]) || !isUniform(o[2]) || f_.type(o[1]) != Type::I32) return false;
      const x86::Mem limit = bufferRange(o[0], o[2], constant, ir::typeBytes(f_.type(o[3])), true);
      if (const LanePattern* q = pattern(v)) storePattern(*q, o[1], o[3], limit);
      else storeRange(v, o[1], o[3], x86::rsi, limit);
      return true;
    }
    case Op::SharedLoad:
      if (preamble_) return false;
      if (const LanePattern* q = pattern(v)) loadPattern(v, *q, o[0], sharedRange(constant, 4, false));
      else loadRange(v, o[0], x86::rsi, x86::rdi, sharedRange(constant, ir::typeBytes(i.type), false));
      return true;
    case Op::SharedStore:
      if (preamble_) return false;
      if (const LanePattern* q = pattern(v)) storePattern(*q, o[0], o[1], sharedRange(constant, 4, true));
      else storeRange(v, o[0], o[1], x86::rsi, sharedRange(constant, ir::typeBytes(f_.type(o[1])), true));
      return true;
    case Op::Atomic:
    case Op::SharedAtomic: return !preamble_ && atomic(v);
    case Op::LocalLoad:
    case Op::LocalStore:
      if (preamble_) return false;
      localMemory(v);
      return true;
    case Op::TileLoad:
      if (preamble_) return false;
      tileLoad(v);
      return true;
    case Op::TileStore:
      if (preamble_) return false;
      tileStore(v);
      return true;
    default: return false;
  }
}

}  // namespace pumice::jit
