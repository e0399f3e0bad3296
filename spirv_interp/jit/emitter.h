// Writes the machine code of one routine. Split by kind of operation into emit_*.cpp.
//
// Registers: rbx frame, r12 bank, r13 ChunkCall, r14 pool of constants, rbp first lane; the other general ones and
// ymm13 .. ymm15 are scratch within an operation (plan.h). Every operation writes its result last (allocate.cpp relies on it).
//
// Values that do not depend on the lane are computed by the preamble, once a draw, and stand in the bank as whole
// vectors (32 bytes each), so that they are memory operands. The preamble is emitted by the same functions, with one
// register per value of any type and every value in the bank.
#pragma once

#include <asmjit/x86.h>

#include <functional>
#include <memory>

#include "spirv_interp/ir/value_table.h"
#include "spirv_interp/jit/frame.h"
#include "spirv_interp/jit/plan.h"
#include "spirv_interp/jit/vector_assembler.h"

namespace pumice::jit {

namespace x86 = asmjit::x86;
using InstId = asmjit::InstId;
using x86::Ymm;
using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

struct Emitted {
  std::vector<std::byte> pool;
  std::vector<std::unique_ptr<CallOut>> callOuts;
  std::vector<std::unique_ptr<LocalAccess>> localAccesses;
  uint32_t bankBytes = 0, frameBytes = 0, localBytes = 0;
  uint32_t bankKept = 0;   //!< of bankBytes, from the start: what the body reads; the rest is the preamble's own
  uint32_t chunkLanes = 0;
  bool suspends = false, wholeBlocks = false;
  bool groups = false;   //!< chunks of a work group follow one another inside of one call
  size_t operations = 0, preambleOperations = 0;
};

//! Bytes from a chunk's frame to the next one's.
inline uint32_t frameStride(const Emitted& e) { return (e.frameBytes + e.localBytes + 63) & ~63u; }

//! The one instruction that does this to vectors in either order, or 0.
InstId commutative(Op op, Type t);

class Emitter {
 public:
  //! AVX-512 if the plan has its registers.
  Emitter(const Plan& plan, asmjit::CodeHolder& code, const interp::KernelTable& kernels);
  //! Emits body and preamble. An empty string, or why not.
  std::string run(Emitted& out, asmjit::Label& body, asmjit::Label& preamble);

 private:
  // --- places (emitter.cpp)
  uint32_t partsOf(Type t) const { return single_ ? 1 : ir::typeBytes(t) == 8 ? p_.unroll * 2 : p_.unroll; }
  Source source(Value v, uint32_t part) {
    if (isUniform(v)) return uniformSource(v);
    return p_.vregOf[v] == kNone ? placeless(v) : vregSource(p_.vregOf[v], part);
  }
  Source uniformSource(Value v);
  Source placeless(Value v);   //!< an error
  //! v in a register: its own or `scratch`.
  Ymm load(Value v, uint32_t part, Ymm scratch);
  Source settled(Value v, uint32_t part, Ymm scratch);   //!< NaNs canonical, if somebody may have made others
  Ymm loadSettled(Value v, uint32_t part, Ymm scratch);
  void canonical(Type t, Ymm to, Ymm from);   //!< uses t1; `to` may be `from`
  //! The register to compute part of v in; finish() puts it where it belongs.
  Ymm target(Value v, uint32_t part) { return preamble_ ? t2() : vregTarget(p_.vregOf[v], part); }
  void finish(Value v, uint32_t part, const Ymm& from) { preamble_ ? finishUniform(v, from) : vregFinish(p_.vregOf[v], part, from); }
  //! The same, looked up once for all parts.
  struct Parts {
    const Vreg* r = nullptr;   //!< null: `all`
    Source all;
  };
  Parts parts(Value v) {
    if (isUniform(v) || p_.vregOf[v] == kNone) return {nullptr, source(v, 0)};
    return {&p_.vregs[p_.vregOf[v]], {}};
  }
  Source source(const Parts& x, uint32_t part) const { return x.r ? vregSource(*x.r, part) : x.all; }
  void finishUniform(Value v, Ymm from);
  Source vregSource(uint32_t vreg, uint32_t part) const { return vregSource(p_.vregs[vreg], part); }
  Source vregSource(const Vreg& r, uint32_t part) const {
    if (r.flat) part = 0;
    if (r.reg[part] >= 0) return {true, uint8_t(r.reg[part]), 0};
    return slotSource(r.slot[part]);
  }
  Ymm vregLoad(uint32_t vreg, uint32_t part, Ymm scratch);
  Ymm vregTarget(uint32_t vreg, uint32_t part) const {
    const int8_t r = p_.vregs[vreg].reg[part];
    return r >= 0 ? Ymm(uint32_t(r)) : t2();
  }
  void vregFinish(uint32_t vreg, uint32_t part, const Ymm& from) {
    const Vreg& r = p_.vregs[vreg];
    if (r.reg[part] < 0) a_.store(slotSource(r.slot[part]), from);
    else if (uint32_t(r.reg[part]) != from.id()) a_.move(Ymm(uint32_t(r.reg[part])), reg(from));
  }
  void move(const Ymm& to, Source from) {
    if (!from.is(to)) a_.move(to, from);
  }
  Source slotSource(uint32_t slot) const { return {false, uint8_t(x86::Gp::kIdBx), int32_t(kFrameSlots + slot * kVectorBytes)}; }   // rbx: frame_
  x86::Mem frameMem(uint32_t offset, uint32_t part = 0) const { return x86::ptr(frame_, int32_t(offset + part * kVectorBytes)); }
  x86::Mem bankMem(uint32_t slot) const { return x86::ptr(bank_, int32_t(slot * kVectorBytes)); }
  uint32_t bankSlot(Value v);
  bool isConst(Value v) const { return f_.insts[v].op == Op::Const; }
  bool isUniform(Value v) const { return p_.a.uniform[v]; }
  //! A uniform's bits as a memory operand of its first element.
  x86::Mem scalar(Value v);

  // --- constants
  x86::Mem pool32(uint32_t bits) { return pool64(uint64_t(bits) << 32 | bits); }
  x86::Mem pool64(uint64_t bits);
  x86::Mem poolVector(const uint32_t (&words)[8]);
  x86::Mem poolOf(Type t, uint64_t bits);

  // --- small helpers
  void bin(InstId id, Ymm d, Source a, Source b, bool commutes = false);
  void cmp(InstId id, Ymm d, Source a, Source b, uint32_t predicate);
  //! d = a * b + c, product and c negated as said.
  void mul(Ymm d, Source a, Source b, Source c, bool wide, bool negative, bool subtract);
  void blend(Ymm d, Source no, Source yes, Ymm mask);   //!< by 32-bit elements
  static Source reg(const Ymm& r) { return {true, uint8_t(r.id()), 0}; }
  static Source mem(const x86::Mem& m) { return {false, uint8_t(m.baseId()), m.offsetLo32()}; }
  //! The mask v for the 64-bit elements of `part`.
  Ymm wideMask(Value v, uint32_t part, Ymm scratch);
  Ymm wideMaskOf(Source narrow, uint32_t part, Ymm scratch);
  //! Two 64-bit comparisons' results as one mask, in `low`.
  void narrowMask(Ymm low, Ymm high);
  void maskBits(const x86::Gp& to, Value mask);                 //!< bit per lane of the chunk; uses rax... `to` and r11
  void vregMaskBits(const x86::Gp& to, uint32_t vreg);
  void maskFromBits(Ymm to, const x86::Gp& bits, uint32_t part);   //!< bits: of the chunk

  // --- operations
  void operation(Value v);
  bool alu(Value v);             // emit_alu.cpp
  bool convert(Value v);         // emit_convert.cpp
  bool binParts(InstId id, Value v, const Parts& x, const Parts& y, bool commutes);
  void floatMinMax(Value v);
  void negate(Value v);
  void fma(Value v);
  void compare(Value v);
  void maskOperation(Value v);
  void select(Value v);
  void shift(Value v);
  bool multiplyHigh(Value v);
  void multiplyWide(Value v);
  void divide(Value v);
  bool lanes(Value v);           // emit_lanes.cpp: quads, subgroups, rows of the caller
  void input(Value v);
  void output(Value v);
  void laneId(Value v);
  void quadLoad(Value v);
  void derivative(Value v);
  bool reduce(Value v);
  bool memory(Value v);          // emit_memory.cpp
  bool callOut(Value v);         // emit_call.cpp
  void callThunk(const void* function, const void* site);
  void localMemory(Value v);      // emit_local.cpp
  bool isAligned(Value offset);

  // --- memory (emit_memory.cpp, emit_tile.cpp)
  struct Range;   // of a buffer, prepared in the bank
  uint32_t rangeSlot(Value base, Value size, uint32_t table, uint32_t constant, uint32_t bytes, bool store);
  uint32_t pointerSlot(Value base, Value offset, Value size, uint32_t table, uint32_t constant, uint32_t bytes);
  void emitRange(const Range& r);
  void uniformLoad(Value v);      // preamble
  void broadcast(Ymm d, const x86::Gp& address, Type t);
  void loadRange(Value v, Value offset, const x86::Gp& base, const x86::Gp& biased, const x86::Mem& limit);
  void spreadOffsets(const Ymm& offsets, const Ymm& scratch);
  x86::Gp laneOffset(uint32_t lane);
  void loadScattered(Value v, const Ymm& off, uint32_t part, const x86::Gp& base, const x86::Mem& limit);
  void loadPair(Value v, const x86::Gp& base, const x86::Mem& limit);
  void loadAddresses(Value v);    // emit_gather.cpp
  struct FootprintPart;           // emit_filter.h
  bool filter(Value v);           // emit_filter.cpp
  void filterHalvesPart(const FootprintPart& f);
  void filterBytesMasks();        // emit_filter_bytes.cpp
  void filterBytesPart(const FootprintPart& f);
  void loadTexelPairs(const x86::Mem& row0, const x86::Mem& row1);
  void useTexelFetch();
  void fetchTexels();
  void filterLevelsLimit(const x86::Mem& limit);   // emit_filter_levels.cpp
  void filterLevelsPart(const FootprintPart& f, bool two, uint32_t mode, uint32_t part, bool addresses);
  void fetchAtBorder(uint32_t mode);
  bool atomic(Value v);           // emit_atomic.cpp
  void updateShared(Value v, InstId change, const x86::Mem& limit);
  x86::Mem bufferRange(Value base, Value size, uint32_t constant, uint32_t bytes, bool store);   //!< rsi: base
  void storeRange(Value v, Value offset, Value value, const x86::Gp& base, const x86::Mem& limit);
  struct SharedRange {
    uint32_t constant = 0, bytes = 0;
    bool store = false;
  };
  void findSharedRanges();
  void makeSharedRange(const SharedRange& r, uint32_t place);
  x86::Mem sharedRange(uint32_t constant, uint32_t bytes, bool store);
  //! The size of work-group memory is known, and the range lies within it.
  bool isStaticRange(uint32_t constant, uint32_t bytes) const { return f_.groupSize[0] && uint64_t(constant) + bytes <= f_.sharedBytes; }
  // emit_pattern.cpp
  const LanePattern* pattern(Value v) const {
    const uint32_t k = patternOf(f_.insts[v]);
    return k ? &p_.patterns[k - 1] : nullptr;
  }
  void patternStart(const LanePattern& q, Value first, uint32_t more, const x86::Mem& limit, const asmjit::Label& outside);
  void patternOffsets(const LanePattern& q, Source first, uint32_t part);
  void loadPattern(Value v, const LanePattern& q, Value first, const x86::Mem& limit);
  void storePattern(const LanePattern& q, Value first, Value value, const x86::Mem& limit);
  // emit_words.cpp
  void words(const Words& w);
  x86::Mem rangeOf(Value access);   //!< rsi: base
  template <class Address>
  void loadWords(const Words& w, uint32_t part, Address address);
  template <class Address>
  void storeWords(const Words& w, uint32_t part, Address address);
  void storeLanes(const Ymm& offsets, const Ymm& values, uint32_t mask, uint32_t part, const x86::Gp& base, const x86::Mem& limit);
  //! Runs behind the routine's end: what hardly ever happens does not stand in the way.
  void later(std::function<void()> emit) { later_.push_back(std::move(emit)); }
  bool allActive() const { return f_.groupSize[0] && p_.regions[region_].mask == p_.regions[0].mask; }
  bool mayBeLinear(Value offset);
  bool isUnbounded(Value size) const;
  void tileLoad(Value v);
  void tileStore(Value v);
  bool wholeHere() const { return p_.wholeBlocks && p_.regions[region_].mask == p_.regions[0].mask; }
  void wholeTileLoad(Value v);
  void wholeTileStore(Value v);

  // --- control (emit_control.cpp)
  void control(Value v);
  const asmjit::Label& endOf(uint32_t region) const;
  const asmjit::Label& leftBy(Value brk, uint32_t region) const;   //!< where a break of all lanes goes
  void enterLoop(uint32_t region);
  void leaveLoop();
  void varSet(Value v);
  void none(uint32_t vreg, const asmjit::Label& to);     //!< jumps if no lane is active
  void any(uint32_t vreg, const asmjit::Label& to);
  void testMask(uint32_t vreg);
  void saveRegisters();
  void restoreRegisters();
  uint32_t liveRegisters(Value at) const;
  void suspend(Value at, interp::Progress why);
  void nextChunk();
  void body();
  void loadAhead();
  void makePreamble();

  void fail(Value v, const char* what);

  const Plan& p_;
  const Function& f_;
  const interp::KernelTable& kernels_;
  VectorAssembler a_;
  Emitted* out_ = nullptr;
  bool preamble_ = false;
  bool single_ = false;         //!< the operation has one part only: preamble, or flat
  std::string error_;
  uint32_t region_ = 0;
  Value doneAlready_ = 0;       //!< an instruction that the one before has emitted
  bool quadPointers_ = false;   //!< r8 .. r11 hold the addresses of the chunk's quads' records

  const x86::Gp frame_ = x86::rbx, bank_ = x86::r12, call_ = x86::r13, pool_ = x86::r14, lane0_ = x86::rbp;
  static constexpr Ymm t0() { return x86::ymm13; }
  static constexpr Ymm t1() { return x86::ymm14; }
  static constexpr Ymm t2() { return x86::ymm15; }

  ir::ValueTable pooled_;   // offsets in the pool, + 1, of vectors of equal words
  std::vector<std::pair<std::vector<uint32_t>, uint32_t>> pooledVectors_;
  std::vector<uint32_t> bankSlot_;          // by value, + 1; of a constant: in the pool
  uint32_t bankSlots_ = 0;
  std::vector<Range> ranges_;
  std::vector<int8_t> linear_;              // by value: mayBeLinear, -1 unknown
  std::vector<uint8_t> aligned_;            // by value: isAligned; empty: unknown
  std::vector<uint32_t> localArea_;         // by LocalAlloc
  std::vector<int8_t> hot_;                 // by uniform value: its register for now, or -1
  std::vector<std::pair<Value, int8_t>> hotBefore_;   // what hot_ was before each loop that is open
  std::vector<size_t> hotMarks_;            // by open loop: size of hotBefore_
  std::vector<SharedRange> sharedRanges_;
  std::vector<std::pair<uint32_t, uint32_t>> staticRanges_;   // highest offset; place in the pool
  uint32_t sharedPlace_ = 0;                // of their copies in the frame
  struct RegionLabels {
    asmjit::Label end, start, out;   //!< out: behind a loop's end
  };
  std::vector<RegionLabels> labels_;
  uint32_t footprintScratch_ = 0;           // in the frame; 0: none yet
  bool fetchesTexels_ = false;
  std::vector<asmjit::Label> resumes_;
  std::vector<std::function<void()>> later_;
  asmjit::Label begin_, dispatch_, step_;   //!< of a chunk: its start, where it goes on, the end of its turn
  asmjit::Label exit_, thunk_, fetchTexels_;
  std::array<asmjit::Label, 4> fetchAtBorder_;
  uint32_t fetchesAtBorder_ = 0;            // bit by address mode
  bool usesThunk_ = false;
};

struct Emitter::Range {
  Value base = 0, offset = 0, size = 0;   // base 0: a table
  uint32_t table = 0, constant = 0, bytes = 0;
  bool store = false;
  uint32_t slot = 0;                      // limit (vector), then base, base + 2^31; with `offset`: one pointer
};

}  // namespace pumice::jit
