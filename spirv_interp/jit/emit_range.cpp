// Bounds that do not depend on the lane are prepared by the preamble as a Range: the highest offset allowed, as a vector, and the
// base. A range with no room at all becomes offset 0 of a block of zeros (of a sink, for stores).
#include "spirv_interp/jit/emit_range.h"

#include <algorithm>
#include <cstring>

namespace pumice::jit {

static constexpr size_t kMaxSharedRanges = 32;

//! A device address: nothing may be read for lanes that are not active.
bool Emitter::isUnbounded(Value size) const { return isConst(size) && f_.insts[size].imm >> 62; }

uint32_t Emitter::rangeSlot(Value base, Value size, uint32_t table, uint32_t constant, uint32_t bytes, bool store) {
  // Equal ones stand close together.
  for (size_t k = ranges_.size(), last = k > 64 ? k - 64 : 0; k-- > last;)
    if (const Range& r = ranges_[k]; !r.offset && r.base == base && r.size == size && r.table == table && r.constant == constant && r.bytes == bytes && r.store == store)
      return r.slot;
  if (base) {
    if (!isConst(base)) bankSlot(base);
    if (!isConst(size)) bankSlot(size);
  }
  Range r{base, 0, size, table, constant, bytes, store, bankSlots_};
  bankSlots_ += 2;
  ranges_.push_back(r);
  return r.slot;
}
uint32_t Emitter::pointerSlot(Value base, Value offset, Value size, uint32_t table, uint32_t constant, uint32_t bytes) {
  for (Value v : {base, offset, size})
    if (v && !isConst(v)) bankSlot(v);
  ranges_.push_back({base, offset, size, table, constant, bytes, false, bankSlots_});
  return bankSlots_++;
}

//! In the preamble. With an offset: one pointer.
void Emitter::emitRange(const Range& r) {
  const asmjit::Label bad = a_.newLabel(), done = a_.newLabel();
  if (r.base) {
    a_.mov(x86::rsi, scalar(r.base));
    a_.mov(x86::rdx, scalar(r.size));
  } else {
    a_.mov(x86::rcx, x86::ptr(call_, offsetof(ChunkCall, tables)));
    a_.mov(x86::rsi, x86::ptr(x86::rcx, int32_t(r.table * sizeof(interp::Table) + offsetof(interp::Table, data))));
    a_.mov(x86::rdx, x86::ptr(x86::rcx, int32_t(r.table * sizeof(interp::Table) + offsetof(interp::Table, size))));
  }
  // rax: constant and, for a pointer, offset; rdx: the last start possible
  a_.mov(x86::eax, r.constant);
  if (r.offset) {
    if (f_.type(r.offset) == Type::I64) {
      a_.add(x86::rax, scalar(r.offset));
      a_.jc(bad);
    } else {
      a_.mov(x86::ecx, scalar(r.offset));
      a_.add(x86::rax, x86::rcx);
    }
  }
  a_.test(x86::rsi, x86::rsi);
  a_.jz(bad);
  a_.sub(x86::rdx, r.bytes);
  a_.jb(bad);
  a_.sub(x86::rdx, x86::rax);
  a_.jb(bad);
  a_.add(x86::rsi, x86::rax);
  a_.jmp(done);
  a_.bind(bad);
  a_.xor_(x86::edx, x86::edx);
  a_.mov(x86::rsi, uint64_t(reinterpret_cast<uintptr_t>(r.store ? sinkBlock() : zeroBlock())));
  a_.bind(done);
  if (r.offset) {
    a_.mov(bankMem(r.slot), x86::rsi);
    return;
  }
  a_.mov(x86::eax, 0xffffffffu);
  a_.cmp(x86::rdx, x86::rax);
  a_.cmova(x86::rdx, x86::rax);
  a_.vmovd(t0().xmm(), x86::edx);
  a_.vpbroadcastd(t0(), t0().xmm());
  a_.vmovaps(bankMem(r.slot), t0());
  a_.mov(at(bankMem(r.slot), kRangeBase), x86::rsi);
  a_.mov(x86::eax, 0x80000000u);
  a_.add(x86::rsi, x86::rax);
  a_.mov(at(bankMem(r.slot), kRangeBiased), x86::rsi);
  a_.mov(at(bankMem(r.slot), kRangeLast), x86::rdx);
}

//! Work-group memory as ranges, made in the frame when a chunk starts: its size is not known before.
void Emitter::findSharedRanges() {
  if (!p_.has(Op::SharedLoad) && !p_.has(Op::SharedStore) && !p_.has(Op::SharedAtomic)) return;
  for (Value v = 1; v < f_.insts.size(); v++) {
    const Inst& i = f_.insts[v];
    if (!p_.a.needed[v] || (i.op != Op::SharedLoad && i.op != Op::SharedStore && i.op != Op::SharedAtomic)) continue;
    const bool store = i.op != Op::SharedLoad;
    const SharedRange r{uint32_t(i.imm), ir::typeBytes(store ? f_.type(f_.operands(v)[1]) : i.type), store};
    if (isStaticRange(r.constant, r.bytes)) continue;
    if (std::none_of(sharedRanges_.begin(), sharedRanges_.end(),
                     [&](const SharedRange& k) { return k.constant == r.constant && k.bytes == r.bytes && k.store == r.store; }))
      sharedRanges_.push_back(r);
    if (sharedRanges_.size() == kMaxSharedRanges) return;
  }
}

void Emitter::makeSharedRange(const SharedRange& r, uint32_t place) {
  const asmjit::Label bad = a_.newLabel(), done = a_.newLabel();
  a_.mov(x86::rdx, x86::ptr(call_, offsetof(ChunkCall, sharedBytes)));
  a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, shared)));
  a_.mov(x86::rcx, uint64_t(r.constant) + r.bytes);
  a_.sub(x86::rdx, x86::rcx);
  a_.jb(bad);
  a_.mov(x86::ecx, r.constant);
  a_.add(x86::rsi, x86::rcx);
  a_.jmp(done);
  a_.bind(bad);
  a_.xor_(x86::edx, x86::edx);
  a_.mov(x86::rsi, uint64_t(reinterpret_cast<uintptr_t>(r.store ? sinkBlock() : zeroBlock())));
  a_.bind(done);
  a_.mov(x86::edi, 0x80000000u);
  a_.add(x86::rdi, x86::rsi);
  a_.vmovd(t0().xmm(), x86::edx);
  a_.vpbroadcastd(t0(), t0().xmm());
  a_.vmovaps(frameMem(place), t0());
  a_.mov(at(frameMem(place), kRangeBase), x86::rsi);
  a_.mov(at(frameMem(place), kRangeBiased), x86::rdi);
  a_.mov(at(frameMem(place), kRangeLast), x86::rdx);
}

//! rsi: base, rdi: base + 2^31; gives the range.
x86::Mem Emitter::sharedRange(uint32_t constant, uint32_t bytes, bool store) {
  if (isStaticRange(constant, bytes)) {
    const uint32_t last = f_.sharedBytes - constant - bytes;
    auto r = std::find_if(staticRanges_.begin(), staticRanges_.end(), [&](const auto& k) { return k.first == last; });
    if (r == staticRanges_.end()) {
      r = staticRanges_.insert(r, {last, uint32_t(out_->pool.size())});
      out_->pool.resize(out_->pool.size() + 2 * kVectorBytes);
      for (unsigned k = 0; k < kVectorLanes; k++) std::memcpy(out_->pool.data() + r->second + 4 * k, &last, 4);
      std::memcpy(out_->pool.data() + r->second + kRangeLast, &last, 4);
    }
    a_.mov(x86::rsi, x86::ptr(call_, offsetof(ChunkCall, shared)));
    if (constant) a_.add(x86::rsi, constant);
    if (bytes < 4) {
      a_.mov(x86::edi, 0x80000000u);
      a_.add(x86::rdi, x86::rsi);
    }
    return x86::ptr(pool_, int32_t(r->second));
  }
  uint32_t place = frameRow(4);   // too many of them: made each time
  for (size_t k = 0; k < sharedRanges_.size(); k++)
    if (const SharedRange& r = sharedRanges_[k]; r.constant == constant && r.bytes == bytes && r.store == store)
      place = sharedPlace_ + uint32_t(k) * 2 * kVectorBytes;
  if (place == frameRow(4)) makeSharedRange({constant, bytes, store}, place);
  const x86::Mem range = frameMem(place);
  a_.mov(x86::rsi, at(range, kRangeBase));
  if (!store) a_.mov(x86::rdi, at(range, kRangeBiased));
  return range;
}

x86::Mem Emitter::bufferRange(Value base, Value size, uint32_t constant, uint32_t bytes, bool store) {
  const x86::Mem range = bankMem(rangeSlot(base, size, 0, constant, bytes, store));
  a_.mov(x86::rsi, at(range, kRangeBase));
  return range;
}

}  // namespace pumice::jit
