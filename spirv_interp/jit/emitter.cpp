#include "spirv_interp/jit/emitter.h"

#include <algorithm>
#include <cstring>

#include "base/result.h"

namespace pumice::jit {

namespace {
class KeepError final : public asmjit::ErrorHandler {
 public:
  explicit KeepError(std::string& message) : message_(message) {}
  void handleError(asmjit::Error, const char* message, asmjit::BaseEmitter*) override {
    if (message_.empty()) message_ = message;
  }

 private:
  std::string& message_;
};
}  // namespace

Emitter::Emitter(const Plan& plan, asmjit::CodeHolder& code, const interp::KernelTable& kernels)
    : p_(plan), f_(*plan.f), kernels_(kernels), a_(&code, plan.registers == kRegistersAvx512), bankSlot_(f_.insts.size(), 0), linear_(f_.insts.size(), -1), hot_(f_.insts.size(), -1) {}

std::string Emitter::run(Emitted& out, asmjit::Label& bodyLabel, asmjit::Label& preambleLabel) {
  out_ = &out;
  KeepError handler(error_);
  a_.setErrorHandler(&handler);
  bodyLabel = a_.newLabel();
  preambleLabel = a_.newLabel();
  thunk_ = a_.newLabel();
  out.chunkLanes = p_.unroll * kVectorLanes;
  out.suspends = p_.suspends;
  out.wholeBlocks = p_.wholeBlocks;
  out.groups = f_.groupSize[0] && !p_.mayWait && !p_.wholeBlocks && (p_.suspends || !p_.has(Op::LocalAlloc));
  for (Value v = 1; v < f_.insts.size() && p_.has(Op::LocalAlloc); v++)
    if (f_.insts[v].op == Op::LocalAlloc && p_.a.needed[v]) {
      localArea_.resize(f_.insts.size(), 0);
      localArea_[v] = out.localBytes;
      const uint64_t bytes = uint64_t(f_.insts[v].imm + 3) / 4 * 4 * out.chunkLanes;
      if (bytes > (16u << 20) || out.localBytes + bytes > (16u << 20)) return "too much local memory";
      out.localBytes += uint32_t(bytes);
    }
  if (p_.frameSlots > (1u << 18)) return "too many values live at once";
  out.frameBytes = kFrameSlots + p_.frameSlots * kVectorBytes;
  findSharedRanges();
  sharedPlace_ = out.frameBytes;
  out.frameBytes += uint32_t(sharedRanges_.size()) * 2 * kVectorBytes;
  // Guesses that save buffers from growing step by step.
  out.pool.reserve(64 * kVectorBytes);
  a_.code()->reserveBuffer(&a_.code()->textSection()->buffer(), 1024 + f_.insts.size() * (10 + 8 * p_.unroll));

  a_.bind(bodyLabel);
  body();
  out.bankKept = bankSlots_ * kVectorBytes;
  a_.align(asmjit::AlignMode::kCode, 16);
  a_.bind(preambleLabel);
  makePreamble();
  if (usesThunk_) {
    a_.align(asmjit::AlignMode::kCode, 16);
    a_.bind(thunk_);
    a_.sub(x86::rsp, 8);
    saveRegisters();
    a_.vzeroupper();
    a_.call(x86::rax);
    restoreRegisters();
    a_.add(x86::rsp, 8);
    a_.ret();
  }
  for (uint32_t mode = 0; mode < fetchAtBorder_.size(); mode++)
    if (fetchesAtBorder_ >> mode & 1) fetchAtBorder(mode);
  if (fetchesTexels_) {
    a_.align(asmjit::AlignMode::kCode, 16);
    fetchTexels();
  }
  out.bankBytes = bankSlots_ * kVectorBytes;
  a_.setErrorHandler(nullptr);
  return error_;
}

void Emitter::fail(Value v, const char* what) {
  if (error_.empty()) error_ = base::errorf("line %u: %%%u (%s): %s", f_.insts[v].line, v, ir::opInfo(f_.insts[v].op).text, what).message;
}

// --- constants

x86::Mem Emitter::pool64(uint64_t bits) {
  const uint32_t hash = uint32_t((bits * 0x9e3779b97f4a7c15u) >> 32);
  uint32_t offset = pooled_.find(hash, [&](uint32_t at) { return std::memcmp(out_->pool.data() + (at - 1), &bits, 8) == 0; });
  if (!offset) {
    offset = uint32_t(out_->pool.size()) + 1;
    pooled_.insert(hash, offset);
    out_->pool.resize(out_->pool.size() + kVectorBytes);
    for (unsigned k = 0; k < 4; k++) std::memcpy(out_->pool.data() + (offset - 1) + 8 * k, &bits, 8);
  }
  return x86::ptr(pool_, int32_t(offset - 1));
}
x86::Mem Emitter::poolVector(const uint32_t (&words)[8]) {
  for (const auto& [have, offset] : pooledVectors_)
    if (std::equal(have.begin(), have.end(), words)) return x86::ptr(pool_, int32_t(offset));
  const uint32_t offset = uint32_t(out_->pool.size());
  out_->pool.resize(offset + kVectorBytes);
  std::memcpy(out_->pool.data() + offset, words, kVectorBytes);
  pooledVectors_.push_back({{words, words + 8}, offset});
  return x86::ptr(pool_, int32_t(offset));
}
x86::Mem Emitter::poolOf(Type t, uint64_t bits) {
  if (t == Type::Mask) return pool64(bits & 1 ? ~uint64_t(0) : 0);
  return ir::typeBytes(t) == 8 ? pool64(bits) : pool32(uint32_t(bits));
}

// --- places

uint32_t Emitter::bankSlot(Value v) {
  if (!bankSlot_[v]) bankSlot_[v] = ++bankSlots_;
  return bankSlot_[v] - 1;
}

x86::Mem Emitter::scalar(Value v) {
  if (isConst(v)) return poolOf(f_.type(v), f_.insts[v].imm);
  return bankMem(bankSlot(v));
}

Ymm Emitter::vregLoad(uint32_t id, uint32_t part, Ymm scratch) {
  const Source s = vregSource(id, part);
  if (s.isReg) return s.reg();
  a_.move(scratch, s);
  return scratch;
}
Source Emitter::uniformSource(Value v) {
  if (hot_[v] >= 0 && !preamble_) return {true, uint8_t(hot_[v]), 0};
  if (!isConst(v)) return mem(bankMem(bankSlot(v)));
  if (!bankSlot_[v]) bankSlot_[v] = uint32_t(poolOf(f_.type(v), f_.insts[v].imm).offsetLo32()) / kVectorBytes + 1;
  return {false, uint8_t(pool_.id()), int32_t((bankSlot_[v] - 1) * kVectorBytes)};
}
Source Emitter::placeless(Value v) {
  fail(v, "has no place");
  return reg(t0());
}
Ymm Emitter::load(Value v, uint32_t part, Ymm scratch) {
  const Source s = source(v, part);
  if (s.isReg) return s.reg();
  a_.move(scratch, s);
  return scratch;
}
void Emitter::finishUniform(Value v, Ymm from) {
  if (ir::isFloat(f_.type(v)) && p_.a.nan[v] == interp::NanBits::Arithmetic) canonical(f_.type(v), from, from);
  a_.vmovaps(bankMem(bankSlot(v)), from);
}

void Emitter::canonical(Type t, Ymm to, Ymm from) {
  switch (t) {
    case Type::F16:
      a_.vpand(t1(), from, pool32(0x7fff));
      a_.vpcmpgtd(t1(), t1(), pool32(0x7c00));
      a_.vblendvps(to, from, pool32(0x7e00), t1());
      return;
    case Type::F32:
      a_.vcmpps(t1(), from, from, 3);
      a_.vblendvps(to, from, pool32(0x7fc00000), t1());
      return;
    default:
      a_.vcmppd(t1(), from, from, 3);
      a_.vblendvpd(to, from, pool64(0x7ff8000000000000), t1());
  }
}
//! `scratch` must not be t1.
Source Emitter::settled(Value v, uint32_t part, Ymm scratch) {
  const Type t = f_.type(v);
  if (isUniform(v) || !ir::isFloat(t) || p_.a.nan[v] != interp::NanBits::Arithmetic) return source(v, part);
  canonical(t, scratch, load(v, part, scratch));
  return reg(scratch);
}
Ymm Emitter::loadSettled(Value v, uint32_t part, Ymm scratch) {
  const Source s = settled(v, part, scratch);
  move(scratch, s);
  return scratch;
}

// --- helpers

void Emitter::bin(InstId id, Ymm d, Source a, Source b, bool commutes) {
  if (a.isReg) a_.emit(id, d, a.reg(), b);
  else if (commutes && b.isReg) a_.emit(id, d, b.reg(), a);
  else {
    const Ymm s = b.is(d) ? t0() : d;   // t0 is free when an operand stands in the result
    a_.move(s, a);
    a_.emit(id, d, s, b);
  }
}
void Emitter::cmp(InstId id, Ymm d, Source a, Source b, uint32_t predicate) {
  Ymm first = a.reg();
  if (!a.isReg) {
    first = b.is(d) ? t0() : d;
    a_.move(first, a);
  }
  a_.emit(id, d, first, b, asmjit::imm(predicate));
}
void Emitter::blend(Ymm d, Source no, Source yes, Ymm mask) {
  Ymm first = no.reg();
  if (!no.isReg) {
    first = yes.is(d) || mask.id() == d.id() ? t0() : d;
    a_.move(first, no);
  }
  a_.emit(x86::Inst::kIdVblendvps, d, first, yes, mask);
}

Ymm Emitter::wideMaskOf(Source narrow, uint32_t part, Ymm scratch) {
  if (narrow.isReg) {
    if (part & 1) {
      a_.vextracti128(scratch.xmm(), narrow.reg(), 1);
      a_.vpmovsxdq(scratch, scratch.xmm());
    } else {
      a_.vpmovsxdq(scratch, narrow.reg().xmm());
    }
  } else {
    x86::Mem m = narrow.mem();
    m.addOffset(part & 1 ? 16 : 0);
    a_.vpmovsxdq(scratch, m);
  }
  return scratch;
}
Ymm Emitter::wideMask(Value v, uint32_t part, Ymm scratch) { return wideMaskOf(source(v, part / 2), part, scratch); }

void Emitter::narrowMask(Ymm low, Ymm high) {
  a_.vshufps(low, low, high, 0x88);
  a_.vpermq(low, low, 0xd8);
}

void Emitter::vregMaskBits(const x86::Gp& to, uint32_t id) {
  for (uint32_t part = 0; part < p_.unroll; part++) {
    const x86::Gp r = part ? x86::r11d : to;
    a_.vmovmskps(r, vregLoad(id, part, t0()));
    if (!part) continue;
    a_.shl(r, 8 * part);
    a_.or_(to, r);
  }
}
void Emitter::maskBits(const x86::Gp& to, Value v) {
  if (!isUniform(v)) return vregMaskBits(to, p_.vregOf[v]);
  a_.mov(to, scalar(v));
}
void Emitter::maskFromBits(Ymm to, const x86::Gp& bits, uint32_t part) {
  a_.vmovd(to.xmm(), bits);
  a_.vpbroadcastd(to, to.xmm());
  uint32_t words[8];
  for (unsigned k = 0; k < 8; k++) words[k] = 1u << (8 * part + k);
  const x86::Mem m = poolVector(words);
  a_.vpand(to, to, m);
  a_.vpcmpeqd(to, to, m);
}

// --- body and preamble

void Emitter::saveRegisters() {
  for (uint32_t r = 0; r < kMaxRegisters; r++)
    if (p_.used >> r & 1) a_.vmovaps(frameMem(kFrameSave, r), x86::ymm(r));
}
uint32_t Emitter::liveRegisters(Value at) const {
  uint32_t live = 0;
  for (const Vreg& r : p_.vregs)
    for (uint32_t part = 0; part < p_.parts(r) && r.start < at && at <= r.end && !r.unused; part++)
      if (r.reg[part] >= 0) live |= 1u << r.reg[part];
  return live;
}
void Emitter::restoreRegisters() {
  for (uint32_t r = 0; r < kMaxRegisters; r++)
    if (p_.used >> r & 1) a_.vmovaps(x86::ymm(r), frameMem(kFrameSave, r));
}

void Emitter::operation(Value v) {
  if (alu(v) || convert(v) || lanes(v) || memory(v) || callOut(v)) return;
  fail(v, "neither emitter nor kernels have this operation");
}

void Emitter::body() {
  exit_ = a_.newLabel();
  for (const x86::Gp& r : {x86::rbx, x86::rbp, x86::r12, x86::r13, x86::r14, x86::r15}) a_.push(r);
  a_.sub(x86::rsp, 8);
  a_.mov(frame_, x86::rdi);
  a_.mov(bank_, x86::rsi);
  a_.mov(call_, x86::rdx);
  a_.mov(pool_, x86::rcx);
  a_.mov(x86::ebp, x86::dword_ptr(call_, offsetof(ChunkCall, lane0)));
  begin_ = a_.newLabel();
  dispatch_ = a_.newLabel();
  step_ = a_.newLabel();
  if (p_.suspends) {
    a_.mov(x86::eax, x86::dword_ptr(frame_, kFrameResume));
    a_.test(x86::eax, x86::eax);
    a_.jnz(dispatch_);
  }
  a_.bind(begin_);
  labels_.resize(p_.regions.size());
  labels_[0].end = a_.newLabel();
  region_ = 0;

  const uint32_t all = p_.regions[0].mask;
  const asmjit::Label again = a_.newLabel();
  if (p_.wholeBlocks) {
    loadAhead();
    a_.align(asmjit::AlignMode::kCode, 16);
    a_.bind(again);
  } else {
    a_.mov(x86::eax, x86::dword_ptr(call_, offsetof(ChunkCall, active)));
  }
  for (uint32_t part = 0; part < p_.unroll && !(p_.wholeBlocks && !p_.vregs[all].end); part++) {
    const Ymm d = vregTarget(all, part);
    if (p_.wholeBlocks) a_.vpcmpeqd(d, d, d);
    else maskFromBits(d, x86::eax, part);
    vregFinish(all, part, d);
  }
  for (size_t k = 0; k < sharedRanges_.size(); k++) makeSharedRange(sharedRanges_[k], sharedPlace_ + uint32_t(k) * 2 * kVectorBytes);
  for (Value v : p_.zeroed)
    for (uint32_t part = 0; part < p_.parts(p_.vregs[p_.vregOf[v]]); part++) {
      const Ymm d = target(v, part);
      a_.vxorps(d.xmm(), d.xmm(), d.xmm());
      finish(v, part, d);
    }

  for (Value v = 1; v < f_.insts.size() && error_.empty(); v++) {
    if (!p_.a.needed[v] || p_.a.uniform[v]) continue;
    const Op op = f_.insts[v].op;
    if (op == Op::Nop || op == Op::Var || op == Op::LocalAlloc) continue;
    out_->operations++;
    if (p_.folded[v] || p_.pairSecond[v] || v == doneAlready_) continue;
    if (p_.wordsOf[v]) {
      if (const Words& w = p_.words[p_.wordsOf[v] - 1]; w.at == v) words(w);
      continue;
    }
    if (op == Op::QuadLoad && p_.vregOf[v] != kNone && p_.vregs[p_.vregOf[v]].ahead) continue;
    if (op != Op::QuadLoad && op != Op::VarGet && op != Op::VarSet && ir::opInfo(op).operands == ir::OperandRule::Free) quadPointers_ = false;
    if (ir::opInfo(op).flags & ir::kControl || op == Op::Barrier) control(v);
    else {
      single_ = p_.flat[v] || p_.shared[v];
      operation(v);
      single_ = false;
    }
  }
  quadPointers_ = false;
  a_.bind(labels_[0].end);
  if (p_.wholeBlocks) {
    a_.add(lane0_.r32(), p_.unroll * kVectorLanes);
    a_.mov(x86::dword_ptr(call_, offsetof(ChunkCall, lane0)), lane0_.r32());
    a_.cmp(lane0_.r32(), x86::dword_ptr(call_, offsetof(ChunkCall, lanes)));
    a_.jb(again);
  }
  if (out_->groups) nextChunk();
  a_.xor_(x86::eax, x86::eax);
  static_assert(int(interp::Progress::Finished) == 0);
  a_.bind(exit_);
  a_.vzeroupper();
  a_.add(x86::rsp, 8);
  for (const x86::Gp& r : {x86::r15, x86::r14, x86::r13, x86::r12, x86::rbp, x86::rbx}) a_.pop(r);
  a_.ret();
  for (size_t k = 0; k < later_.size() && error_.empty(); k++) later_[k]();
  later_.clear();

  if (!p_.suspends) return;
  a_.bind(dispatch_);
  for (size_t k = 0; k < resumes_.size(); k++) {
    a_.cmp(x86::eax, uint32_t(k + 1));
    a_.je(resumes_[k]);
  }
  if (out_->groups) a_.jmp(step_);
  else a_.ud2();
}

//! A chunk's turn is over: the next one's. Behind the last one's all go on together that wait at a barrier.
void Emitter::nextChunk() {
  const asmjit::Label round = a_.newLabel(), finished = a_.newLabel(), go = a_.newLabel();
  if (p_.suspends) a_.mov(x86::dword_ptr(frame_, kFrameResume), kResumeNever);
  a_.bind(step_);
  a_.dec(x86::dword_ptr(call_, offsetof(ChunkCall, chunksLeft)));
  a_.jz(round);
  a_.add(lane0_.r32(), p_.unroll * kVectorLanes);
  a_.mov(x86::dword_ptr(call_, offsetof(ChunkCall, lane0)), lane0_.r32());
  if (!p_.suspends) {
    a_.jmp(begin_);
    a_.bind(round);
    return;
  }
  a_.add(frame_, frameStride(*out_));
  if (out_->localBytes) a_.add(x86::qword_ptr(call_, offsetof(ChunkCall, local)), frameStride(*out_));
  a_.bind(go);
  a_.mov(x86::eax, x86::dword_ptr(frame_, kFrameResume));
  a_.test(x86::eax, x86::eax);
  a_.jnz(dispatch_);
  a_.jmp(begin_);

  a_.bind(round);
  a_.cmp(x86::dword_ptr(call_, offsetof(ChunkCall, waiting)), 0);
  a_.je(finished);
  a_.mov(x86::eax, uint32_t(interp::Progress::Barrier));
  a_.mov(x86::rcx, x86::ptr(call_, offsetof(ChunkCall, firstFrame)));
  a_.test(x86::rcx, x86::rcx);
  a_.jz(exit_);
  const asmjit::Label on = a_.newLabel();
  a_.mov(x86::rax, x86::ptr(call_, offsetof(ChunkCall, stop)));
  a_.test(x86::rax, x86::rax);
  a_.jz(on);
  a_.cmp(x86::byte_ptr(x86::rax), 0);
  a_.jnz(finished);
  a_.bind(on);
  a_.mov(frame_, x86::rcx);
  if (out_->localBytes) {
    a_.add(x86::rcx, out_->frameBytes);
    a_.mov(x86::ptr(call_, offsetof(ChunkCall, local)), x86::rcx);
  }
  a_.xor_(lane0_.r32(), lane0_.r32());
  a_.mov(x86::dword_ptr(call_, offsetof(ChunkCall, lane0)), lane0_.r32());
  a_.mov(x86::eax, x86::dword_ptr(call_, offsetof(ChunkCall, chunks)));
  a_.mov(x86::dword_ptr(call_, offsetof(ChunkCall, chunksLeft)), x86::eax);
  a_.mov(x86::dword_ptr(call_, offsetof(ChunkCall, waiting)), 0);
  a_.jmp(go);
  a_.bind(finished);
}

//! What all chunks of the row read from their one record.
void Emitter::loadAhead() {
  if (p_.ahead.empty()) return;
  a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, quadRecords)));
  a_.mov(x86::rax, x86::ptr(x86::rsi));
  for (Value v : p_.ahead) {
    a_.vbroadcastss(t2(), x86::ptr(x86::rax, int32_t(uint32_t(f_.insts[v].imm))));
    vregFinish(p_.vregOf[v], 0, t2());
  }
}

void Emitter::makePreamble() {
  preamble_ = single_ = true;
  for (const x86::Gp& r : {x86::rbx, x86::rbp, x86::r12, x86::r13, x86::r14, x86::r15}) a_.push(r);
  a_.sub(x86::rsp, 8);
  a_.mov(frame_, x86::rdi);
  a_.mov(bank_, x86::rsi);
  a_.mov(call_, x86::rdx);
  a_.mov(pool_, x86::rcx);
  a_.xor_(x86::ebp, x86::ebp);
  const Value end = bankSlots_ ? Value(f_.insts.size()) : 0;   // 0: nothing is uniform but constants
  std::vector<uint8_t> wanted(end, 0);
  for (Value v = end; v-- > 1;) {
    wanted[v] |= bankSlot_[v] != 0;
    if (wanted[v] && !isConst(v))
      for (Value o : f_.operands(v)) wanted[o] = 1;
  }
  for (Value v = 1; v < end && error_.empty(); v++)
    if (wanted[v] && !isConst(v)) {
      out_->preambleOperations++;
      operation(v);
    }
  for (const Range& r : ranges_) emitRange(r);
  a_.vzeroupper();
  a_.add(x86::rsp, 8);
  for (const x86::Gp& r : {x86::r15, x86::r14, x86::r13, x86::r12, x86::rbp, x86::rbx}) a_.pop(r);
  a_.ret();
  preamble_ = single_ = false;
}

}  // namespace pumice::jit
