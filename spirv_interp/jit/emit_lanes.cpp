// The caller's rows, quads and subgroups.
#include <algorithm>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

namespace I = x86::Inst;

bool Emitter::lanes(Value v) {
  if (preamble_) return false;
  const Inst& i = f_.insts[v];
  const auto o = f_.operands(v);
  const auto each = [&](auto f) {
    for (uint32_t part = 0; part < partsOf(i.type); part++) {
      const Ymm d = target(v, part);
      f(d, part);
      finish(v, part, d);
    }
    return true;
  };
  const auto eaxToAll = [&] {
    return each([&](Ymm d, uint32_t) {
      a_.vmovd(d.xmm(), x86::eax);
      a_.vpbroadcastd(d, d.xmm());
    });
  };
  const uint32_t all = p_.regions[region_].mask;
  const bool wide = ir::typeBytes(i.type) == 8;
  switch (i.op) {
    case Op::Input: input(v); return true;
    case Op::Output: output(v); return true;
    case Op::LaneId: laneId(v); return true;
    case Op::QuadLoad: quadLoad(v); return true;
    case Op::QuadDdx:
    case Op::QuadDdy:
      if (i.type != Type::F32 && i.type != Type::F64) return false;
      derivative(v);
      return true;
    case Op::QuadSwizzle:
      return each([&](Ymm d, uint32_t part) {
        // Of a shared value: from all quads' to one part's.
        const uint32_t lanes = p_.shared[o[0]] ? 0x55 * (part * 4 / p_.unroll) : uint32_t(i.imm & 0xff);
        a_.emit(wide ? I::kIdVpermq : I::kIdVpermilps, d, source(o[0], part), asmjit::imm(lanes));
      });
    case Op::SubgroupAny:
    case Op::SubgroupAll:
      maskBits(x86::eax, o[0]);
      if (i.op == Op::SubgroupAll) a_.not_(x86::eax);
      vregMaskBits(x86::ecx, all);
      a_.and_(x86::eax, x86::ecx);
      a_.cmp(x86::eax, 1);
      a_.sbb(x86::eax, x86::eax);   // all ones if there was none
      if (i.op == Op::SubgroupAny) a_.not_(x86::eax);
      return eaxToAll();
    case Op::SubgroupBallot:
      maskBits(x86::eax, o[0]);
      vregMaskBits(x86::ecx, all);
      a_.and_(x86::eax, x86::ecx);
      return eaxToAll();
    case Op::SubgroupShuffle:
      if (wide) return false;
      a_.mov(x86::eax, x86::dword_ptr(call_, offsetof(ChunkCall, active)));
      for (uint32_t part = 0; part < partsOf(i.type); part++) {
        maskFromBits(t1(), x86::eax, part);
        a_.emit(I::kIdVandps, t1(), t1(), source(o[0], part));
        a_.vmovaps(frameMem(frameRow(0), part), t1());
      }
      if (isUniform(o[1])) {
        a_.mov(x86::eax, scalar(o[1]));
        a_.and_(x86::eax, ir::kSubgroupLanes - 1);
        return each([&](Ymm d, uint32_t) { a_.vbroadcastss(d, x86::ptr(frame_, x86::rax, 2, int32_t(frameRow(0)))); });
      }
      for (uint32_t part = 0; part < partsOf(i.type); part++) {
        const Ymm d = target(v, part);
        a_.vpand(t0(), load(o[1], part, t0()), pool32(ir::kSubgroupLanes - 1));
        a_.vpcmpeqd(t1(), t1(), t1());
        a_.vpxor(d, d, d);
        a_.vgatherdps(d, x86::ptr(frame_, t0(), 2, int32_t(frameRow(0))), t1());
        finish(v, part, d);
      }
      return true;
    case Op::SubgroupReduce: return reduce(v);
    default: return false;
  }
}

//! Reductions of 32-bit values whose operation is one instruction that does not mind the order of its operands.
bool Emitter::reduce(Value v) {
  const Inst& i = f_.insts[v];
  const Value o = f_.operands(v)[0];
  const auto operation = ir::ReduceOp(i.imm & 0xff);
  const uint32_t steps = uint32_t(i.imm >> 16) & 0xff;
  if (ir::ScanKind(i.imm >> 8 & 0xff) != ir::ScanKind::Reduce || ir::typeBytes(i.type) != 4 || steps > 5 || p_.unroll != 4) return false;
  const InstId id = commutative(ir::reduceOperation(operation), i.type);
  if (!id) return false;
  const uint32_t mask = p_.regions[region_].mask;
  const x86::Mem identity = pool32(uint32_t(ir::reduceIdentity(operation, i.type)));
  for (uint32_t part = 0; part < 4; part++) {
    const Ymm m = vregLoad(mask, part, t1());
    a_.vmovaps(t0(), identity);
    a_.emit(I::kIdVblendvps, t0(), t0(), source(o, part), m);
    for (uint32_t step = 0; step < std::min(steps, 3u); step++) {
      if (step < 2) a_.vpermilps(t1(), t0(), step ? 0x4e : 0xb1);
      else a_.vperm2f128(t1(), t0(), t0(), 1);
      a_.emit(id, t0(), t0(), t1());
    }
    a_.vmovaps(frameMem(frameRow(0), part), t0());
  }
  for (uint32_t step = 3; step < steps; step++)
    for (uint32_t part = 0; part < 4; part++) {
      const uint32_t other = part ^ (step == 3 ? 1 : 2);
      if (part > other) continue;
      a_.vmovaps(t0(), frameMem(frameRow(0), part));
      a_.emit(id, t0(), t0(), frameMem(frameRow(0), other));
      a_.vmovaps(frameMem(frameRow(0), part), t0());
      a_.vmovaps(frameMem(frameRow(0), other), t0());
    }
  for (uint32_t part = 0; part < 4; part++) {
    const Ymm d = target(v, part);
    a_.vmovaps(d, frameMem(frameRow(0), part));
    finish(v, part, d);
  }
  return true;
}

void Emitter::input(Value v) {
  const Inst& i = f_.insts[v];
  a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, inputs)));
  a_.mov(x86::rsi, x86::ptr(x86::rsi, int32_t(uint32_t(i.imm) * 8)));
  if (p_.flat[v]) {
    const Ymm d = target(v, 0);
    a_.vpbroadcastd(d, x86::ptr(x86::rsi, lane0_, 2));
    finish(v, 0, d);
    return;
  }
  if (i.type == Type::Mask) {
    a_.mov(x86::eax, x86::ebp);
    a_.shr(x86::eax, 3);
    const x86::Mem m = x86::ptr(x86::rsi, x86::rax);
    if (p_.unroll == 4) a_.mov(x86::eax, m);
    else if (p_.unroll == 2) a_.movzx(x86::eax, x86::word_ptr(x86::rsi, x86::rax));
    else a_.movzx(x86::eax, x86::byte_ptr(x86::rsi, x86::rax));
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const Ymm d = target(v, part);
      maskFromBits(d, x86::eax, part);
      finish(v, part, d);
    }
    return;
  }
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Ymm d = target(v, part);
    switch (ir::typeBytes(i.type)) {
      case 1: a_.vpmovzxbd(d, x86::ptr(x86::rsi, lane0_, 0, int32_t(8 * part))); break;
      case 2: a_.vpmovzxwd(d, x86::ptr(x86::rsi, lane0_, 1, int32_t(16 * part))); break;
      case 4: a_.vmovups(d, x86::ptr(x86::rsi, lane0_, 2, int32_t(32 * part))); break;
      default: a_.vmovups(d, x86::ptr(x86::rsi, lane0_, 3, int32_t(32 * part)));
    }
    finish(v, part, d);
  }
}

//! Only active lanes of the caller's row change.
void Emitter::output(Value v) {
  const Inst& i = f_.insts[v];
  const Value value = f_.operands(v)[0];
  const Type t = f_.type(value);
  const uint32_t mask = p_.regions[region_].mask;
  a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, outputs)));
  a_.mov(x86::rsi, x86::ptr(x86::rsi, int32_t(i.imm * 8)));
  if (t == Type::Mask) {
    maskBits(x86::ecx, value);
    vregMaskBits(x86::edx, mask);
    a_.and_(x86::ecx, x86::edx);
    a_.not_(x86::edx);
    a_.mov(x86::eax, x86::ebp);
    a_.shr(x86::eax, 3);
    for (uint32_t part = 0; part < p_.unroll; part++) {
      a_.mov(x86::r8d, x86::edx);
      a_.mov(x86::r9d, x86::ecx);
      if (part) {
        a_.shr(x86::r8d, 8 * part);
        a_.shr(x86::r9d, 8 * part);
      }
      a_.and_(x86::byte_ptr(x86::rsi, x86::rax, 0, int32_t(part)), x86::r8b);
      a_.or_(x86::byte_ptr(x86::rsi, x86::rax, 0, int32_t(part)), x86::r9b);
    }
    return;
  }
  const uint32_t bytes = ir::typeBytes(t);
  if (bytes >= 4) {
    for (uint32_t part = 0; part < partsOf(t); part++) {
      const x86::Mem m = x86::ptr(x86::rsi, lane0_, bytes == 8 ? 3 : 2, int32_t(32 * part));
      const Ymm s = loadSettled(value, part, t0());
      const Ymm e = bytes == 8 ? wideMaskOf(vregSource(mask, part / 2), part, t1()) : vregLoad(mask, part, t1());
      if (a_.evex()) {
        a_.emit(bytes == 8 ? I::kIdVpmovq2m : I::kIdVpmovd2m, x86::k1, e);
        if (bytes == 8) a_.k(x86::k1).vmovupd(m, s);
        else a_.k(x86::k1).vmovups(m, s);
        continue;
      }
      a_.vmovups(t2(), m);
      a_.vblendvps(t2(), t2(), s, e);
      a_.vmovups(m, t2());
    }
    return;
  }
  // Small elements: active lanes one by one.
  for (uint32_t part = 0; part < partsOf(t); part++) a_.vmovaps(frameMem(frameRow(1), part), loadSettled(value, part, t0()));
  vregMaskBits(x86::ecx, mask);
  const asmjit::Label again = a_.newLabel();
  if (bytes == 2) a_.lea(x86::rsi, x86::ptr(x86::rsi, lane0_, 1));
  else a_.add(x86::rsi, lane0_);
  a_.bind(again);   // somebody is active
  a_.tzcnt(x86::edx, x86::ecx);
  a_.mov(x86::eax, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(1))));
  if (bytes == 2) a_.mov(x86::word_ptr(x86::rsi, x86::rdx, 1), x86::ax);
  else a_.mov(x86::byte_ptr(x86::rsi, x86::rdx), x86::al);
  a_.blsr(x86::ecx, x86::ecx);
  a_.jnz(again);
}

void Emitter::laneId(Value v) {
  for (uint32_t part = 0; part < p_.unroll; part++) {
    uint32_t words[8];
    for (uint32_t k = 0; k < 8; k++) words[k] = part * 8 + k;
    const Ymm d = target(v, part);
    a_.vmovd(d.xmm(), x86::ebp);
    a_.vpbroadcastd(d, d.xmm());
    a_.vpaddd(d, d, poolVector(words));
    finish(v, part, d);
  }
}

void Emitter::quadLoad(Value v) {
  const Inst& i = f_.insts[v];
  const int32_t at = int32_t(i.imm);
  const uint32_t bytes = ir::typeBytes(i.type);
  if (single_) {   // all quads have one record (ir::kOneRecord)
    if (!quadPointers_) {
      a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, quadRecords)));
      a_.mov(x86::rax, x86::ptr(x86::rsi));
    }
    const Ymm d = target(v, 0);
    a_.vbroadcastss(d, x86::ptr(quadPointers_ ? x86::r8 : x86::rax, at));
    finish(v, 0, d);
    return;
  }
  if (bytes == 4 && p_.unroll <= 2) {
    // Several fields in a row: the addresses stay in registers.
    constexpr x86::Gp kPointers[] = {x86::r8, x86::r9, x86::r10, x86::r11};
    if (!quadPointers_) {
      a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, quadRecords)));
      for (uint32_t q = 0; q < p_.unroll * 2; q++) a_.mov(kPointers[q], x86::ptr(x86::rsi, int32_t(q * 8)));
      quadPointers_ = true;
    }
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const Ymm d = target(v, part);
      a_.vbroadcastss(t0(), x86::ptr(kPointers[part * 2 + 1], at));
      a_.vbroadcastss(d, x86::ptr(kPointers[part * 2], at));
      a_.vblendps(d, d, t0(), 0xf0);
      finish(v, part, d);
    }
    return;
  }
  quadPointers_ = false;
  a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, quadRecords)));
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Ymm d = target(v, part);
    if (bytes == 8) {
      a_.mov(x86::rax, x86::ptr(x86::rsi, int32_t(part * 8)));
      a_.vbroadcastsd(d, x86::ptr(x86::rax, at));
    } else {
      a_.mov(x86::rax, x86::ptr(x86::rsi, int32_t(part * 16)));
      a_.mov(x86::rdx, x86::ptr(x86::rsi, int32_t(part * 16 + 8)));
      if (bytes == 4) {
        a_.vbroadcastss(t0(), x86::ptr(x86::rdx, at));
        a_.vbroadcastss(d, x86::ptr(x86::rax, at));
      } else {
        for (const auto& [r, ymm] : {std::pair(x86::rdx, t0()), std::pair(x86::rax, d)}) {
          if (bytes == 2) a_.movzx(x86::ecx, x86::word_ptr(r, at));
          else a_.movzx(x86::ecx, x86::byte_ptr(r, at));
          a_.vmovd(ymm.xmm(), x86::ecx);
          a_.vpbroadcastd(ymm, ymm.xmm());
        }
      }
      a_.vblendps(d, d, t0(), 0xf0);
    }
    finish(v, part, d);
  }
}

//! Coarse: the quad's first row (column) serves all four.
void Emitter::derivative(Value v) {
  const Inst& i = f_.insts[v];
  const Value o = f_.operands(v)[0];
  const bool wide = i.type == Type::F64, fine = i.imm != 0, x = i.op == Op::QuadDdx;
  //                                 to - from, 2 bits a lane
  const uint32_t to = x ? (fine ? 0b11110101u : 0b01010101u) : (fine ? 0b11101110u : 0b10101010u);
  const uint32_t from = x ? (fine ? 0b10100000u : 0u) : (fine ? 0b01000100u : 0u);
  if (p_.shared[v]) {
    // One lane of each quad, two parts side by side, or four.
    const auto gather = [&](const Ymm& d, uint32_t lane) {
      if (p_.unroll == 1) return void(a_.emit(I::kIdVpermilps, d, source(o, 0), asmjit::imm(lane)));
      a_.emit(I::kIdVshufps, d, load(o, 0, d), source(o, 1), asmjit::imm(lane));
      if (p_.unroll < 4) return;
      a_.emit(I::kIdVshufps, t2(), load(o, 2, t2()), source(o, 3), asmjit::imm(lane));
      a_.vshufps(d, d, t2(), 0x88);
    };
    gather(t0(), to);
    gather(t1(), from);
    const Ymm d = target(v, 0);
    a_.vsubps(d, t0(), t1());
    return finish(v, 0, d);
  }
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Source s = source(o, part);
    const Ymm d = target(v, part);
    const InstId id = wide ? I::kIdVpermpd : I::kIdVpermilps;
    a_.emit(id, t0(), s, asmjit::imm(to));
    a_.emit(id, t1(), s, asmjit::imm(from));
    a_.emit(wide ? I::kIdVsubpd : I::kIdVsubps, d, t0(), t1());
    finish(v, part, d);
  }
}

}  // namespace pumice::jit
