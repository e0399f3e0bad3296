// Control flow over masks: every region's active lanes are a Vreg of masks, a side that no lane runs is jumped over.
#include <algorithm>

#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

//! Zero flag: no lane is active.
void Emitter::testMask(uint32_t id) {
  Ymm m = vregLoad(id, 0, t0());
  for (uint32_t part = 1; part < p_.unroll; part++) {
    bin(x86::Inst::kIdVorps, t0(), reg(m), vregSource(id, part));
    m = t0();
  }
  a_.vptest(m, m);
}
void Emitter::none(uint32_t id, const asmjit::Label& to) {
  testMask(id);
  a_.jz(to);
}
void Emitter::any(uint32_t id, const asmjit::Label& to) {
  testMask(id);
  a_.jnz(to);
}

//! Goes on here later.
void Emitter::suspend(Value at, interp::Progress why) {
  resumes_.push_back(a_.newLabel());
  const uint32_t live = liveRegisters(at);
  for (uint32_t r = 0; r < kMaxRegisters; r++)
    if (live >> r & 1) a_.vmovaps(frameMem(kFrameSave, r), x86::ymm(r));
  a_.mov(x86::dword_ptr(frame_, kFrameResume), uint32_t(resumes_.size()));
  if (out_->groups) {   // all waiting is for barriers
    a_.inc(x86::dword_ptr(call_, offsetof(ChunkCall, waiting)));
    a_.jmp(step_);
  } else {
    a_.mov(x86::eax, uint32_t(why));
    a_.jmp(exit_);
  }
  a_.bind(resumes_.back());
  for (uint32_t r = 0; r < kMaxRegisters; r++)
    if (live >> r & 1) a_.vmovaps(x86::ymm(r), frameMem(kFrameSave, r));
}

//! Where a region goes on when its last lane has left. A then side ends where its else begins, which looks at the lanes of
//! its own side.
const asmjit::Label& Emitter::endOf(uint32_t id) const {
  const Region& r = p_.regions[id];
  const bool hasElse = r.op == Op::If && f_.insts[r.end].op == Op::Else;
  return hasElse && !r.uniform ? labels_[id].start : labels_[id].end;
}

//! Everybody leaves: straight behind the construct.
const asmjit::Label& Emitter::leftBy(Value brk, uint32_t r) const {
  for (uint64_t left = f_.insts[brk].imm + 1;; r = p_.regions[r].parent)
    if ((p_.regions[r].op == Op::Loop || p_.regions[r].op == Op::Block) && --left == 0) break;
  return p_.regions[r].op == Op::Loop ? labels_[r].out : labels_[r].end;
}

void Emitter::enterLoop(uint32_t id) {
  hotMarks_.push_back(hotBefore_.size());
  auto h = std::lower_bound(p_.hot.begin(), p_.hot.end(), id, [](const Hot& a, uint32_t region) { return a.region < region; });
  for (; h != p_.hot.end() && h->region == id; ++h) {
    const int8_t r = p_.vregs[h->vreg].reg[0];
    if (r < 0) continue;
    move(x86::ymm(uint32_t(r)), source(h->value, 0));
    hotBefore_.push_back({h->value, hot_[h->value]});
    hot_[h->value] = r;
  }
}
void Emitter::leaveLoop() {
  for (; hotBefore_.size() > hotMarks_.back(); hotBefore_.pop_back()) hot_[hotBefore_.back().first] = hotBefore_.back().second;
  hotMarks_.pop_back();
}

void Emitter::control(Value v) {
  const Inst& i = f_.insts[v];
  const uint32_t id = p_.regionOf[v];
  const auto copyMask = [&](uint32_t to, uint32_t from) {
    for (uint32_t part = 0; part < p_.unroll; part++) {
      const Ymm d = vregTarget(to, part);
      move(d, vregSource(from, part));
      vregFinish(to, part, d);
    }
  };
  switch (i.op) {
    case Op::If: {
      const Region& r = p_.regions[id];
      const uint32_t outer = p_.regions[region_].mask;
      const Value condition = f_.operands(v)[0];
      labels_[id].start = a_.newLabel();   // of the else, or the end
      labels_[id].end = a_.newLabel();
      if (r.uniform) {
        if (r.own) copyMask(r.mask, outer);
        const Source bits = source(condition, 0);
        if (bits.isReg) {
          a_.vmovd(x86::eax, bits.reg().xmm());
          a_.test(x86::eax, x86::eax);
        } else {
          x86::Mem m = bits.mem();
          m.setSize(4);
          a_.cmp(m, 0);
        }
        const Value next = v + 1;
        if (next < f_.insts.size() && f_.insts[next].op == Op::Break && p_.flat[next] && f_.insts[r.end].op == Op::EndIf) {
          a_.jnz(leftBy(next, id));
          doneAlready_ = next;
        } else {
          a_.jz(labels_[id].start);
        }
      } else {
        if (r.condition != kNone && r.condition != p_.vregOf[condition]) copyMask(r.condition, p_.vregOf[condition]);
        for (uint32_t part = 0; part < p_.unroll; part++) {
          const Ymm d = vregTarget(r.mask, part);
          bin(x86::Inst::kIdVandps, d, source(condition, part), vregSource(outer, part), true);
          vregFinish(r.mask, part, d);
        }
        none(r.mask, labels_[id].start);
      }
      region_ = id;
      return;
    }
    case Op::Else: {
      const uint32_t then = region_;
      const Region& r = p_.regions[id];
      region_ = r.parent;
      const uint32_t outer = p_.regions[region_].mask;
      labels_[id] = labels_[then];
      if (r.uniform) {
        a_.jmp(labels_[id].end);
        a_.bind(labels_[then].start);
        if (r.own) copyMask(r.mask, outer);
      } else {
        a_.bind(labels_[then].start);
        const uint32_t condition = p_.regions[then].condition;
        for (uint32_t part = 0; part < p_.unroll; part++) {
          const Ymm d = vregTarget(r.mask, part);
          bin(x86::Inst::kIdVandnps, d, vregSource(condition, part), vregSource(outer, part));
          vregFinish(r.mask, part, d);
        }
        none(r.mask, labels_[id].end);
      }
      region_ = id;
      return;
    }
    case Op::Loop:
    case Op::Block: {
      const Region& r = p_.regions[id];
      if (r.own) copyMask(r.mask, p_.regions[region_].mask);
      labels_[id].start = a_.newLabel();
      labels_[id].end = a_.newLabel();
      if (i.op == Op::Loop) {
        enterLoop(id);
        labels_[id].out = a_.newLabel();
        a_.align(asmjit::AlignMode::kCode, 16);
        a_.bind(labels_[id].start);
      }
      region_ = id;
      return;
    }
    case Op::EndIf:
    case Op::EndBlock:
    case Op::EndLoop: {
      const Region& r = p_.regions[id];
      if (r.op == Op::If) a_.bind(labels_[id].start);
      a_.bind(labels_[id].end);
      if (i.op == Op::EndLoop) {
        leaveLoop();
        const asmjit::Label finished = a_.newLabel();
        if (r.own) none(r.mask, finished);
        a_.dec(x86::dword_ptr(call_, offsetof(ChunkCall, turns)));
        a_.jnz(labels_[id].start);
        if (p_.mayWait) {
          suspend(v, interp::Progress::Yielded);
          a_.jmp(labels_[id].start);
        } else {
          a_.mov(x86::dword_ptr(call_, offsetof(ChunkCall, turns)), kTurns);
          a_.mov(x86::rax, x86::ptr(call_, offsetof(ChunkCall, stop)));
          a_.test(x86::rax, x86::rax);
          a_.jz(labels_[id].start);
          a_.cmp(x86::byte_ptr(x86::rax), 0);
          a_.jz(labels_[id].start);
          a_.xor_(x86::eax, x86::eax);   // finished
          a_.jmp(exit_);
        }
        a_.bind(finished);
        a_.bind(labels_[id].out);
      }
      region_ = r.parent;
      if (r.parentLeft) none(p_.regions[region_].mask, endOf(region_));
      return;
    }
    case Op::Break: {
      uint32_t r = region_;
      if (p_.flat[v]) {
        a_.jmp(leftBy(v, r));
        return;
      }
      const uint32_t from = p_.regions[region_].mask;
      for (uint32_t left = uint32_t(i.imm) + 1; r; r = p_.regions[r].parent) {
        if (r != region_) {
          const uint32_t m = p_.regions[r].mask;
          for (uint32_t part = 0; part < p_.unroll; part++) {
            const Ymm d = vregTarget(m, part);
            bin(x86::Inst::kIdVandnps, d, vregSource(from, part), vregSource(m, part));
            vregFinish(m, part, d);
          }
        }
        const Op op = p_.regions[r].op;
        if ((op == Op::Loop || op == Op::Block) && --left == 0) break;
      }
      if (p_.regions[region_].op == Op::Loop)
        for (uint32_t part = 0; part < p_.unroll; part++) {
          const Ymm d = vregTarget(from, part);
          a_.vxorps(d.xmm(), d.xmm(), d.xmm());
          vregFinish(from, part, d);
        }
      a_.jmp(endOf(region_));
      return;
    }
    case Op::Barrier: {
      suspend(v, interp::Progress::Barrier);
      return;
    }
    default: fail(v, "unknown marker");
  }
}

void Emitter::varSet(Value v) {
  const Value var = f_.operands(v)[0], value = f_.operands(v)[1];
  const uint32_t id = p_.vregOf[var];
  if (!isUniform(value) && p_.vregOf[value] == id) return;   // computed there, or the variable itself
  const Type t = f_.type(var);
  const bool keep = p_.a.nan[var] == interp::NanBits::Kept;
  const uint32_t mask = p_.regions[region_].mask;
  for (uint32_t part = 0; part < partsOf(t); part++) {
    const Source s = keep ? settled(value, part, t0()) : source(value, part);
    const Ymm d = vregTarget(id, part);
    if (!p_.masked[v]) {
      if (s.isReg) {
        vregFinish(id, part, s.reg());
        continue;
      }
      move(d, s);
    } else {
      const Ymm m = ir::typeBytes(t) == 8 ? wideMaskOf(vregSource(mask, part / 2), part, t1()) : vregLoad(mask, part, t1());
      blend(d, vregSource(id, part), s, m);
    }
    vregFinish(id, part, d);
  }
}

}  // namespace pumice::jit
