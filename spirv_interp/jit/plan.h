// What is known before code is emitted: which values live in registers and for how long, what a region's active lanes
// are called, which variables may be set without a mask.
#pragma once

#include <vector>

#include "spirv_interp/interpreter/analysis.h"
#include "spirv_interp/ir/ir.h"
#include "spirv_interp/jit/lane_patterns.h"

namespace pumice::jit {

//! Bytes of a vector register.
constexpr uint32_t kVectorBytes = 32;
constexpr uint32_t kVectorLanes = 8;      //!< 32-bit elements
constexpr uint32_t kMaxUnroll = 4;
constexpr uint32_t kMaxParts = 2 * kMaxUnroll;
//! Vector registers that values may have, a bit each. ymm13 .. ymm15 are scratch of the emitter; with 32 registers ymm12 is one
//! of VectorAssembler, for instructions that only know the lower 16.
constexpr uint32_t kRegistersAvx2 = 0x1fff, kRegistersAvx512 = 0xffff0fff;
constexpr uint32_t kLowScratch = 12;
constexpr uint32_t kMaxRegisters = 32;

//! Something that lives in registers: a value, a variable, or the active lanes of a region. It has one vector register
//! (part) per 8 lanes, of 64-bit types two. A part has one place for its whole life: a register or a slot of the frame.
//! Elements of 8 and 16 bits are zero-extended to 32; a mask is all ones or zeros in 32 bits.
struct Vreg {
  uint32_t start = 0, end = 0;   //!< positions (values' ids) of the first definition and the last use
  float weight = 0;              //!< uses, those in loops counting more
  bool wide = false;             //!< 64-bit elements
  bool flat = false;             //!< all lanes hold the same, or all lanes of a quad (Plan::shared): one part serves for all
  bool uniform = false;          //!< a constant or a value of the bank, for a while in a register: needs no slot
  bool unused = false;           //!< another Vreg took its place
  bool ahead = false;            //!< written once a row: has a slot for all its life, and no register
  int8_t reg[kMaxParts];         //!< -1: in the frame
  uint32_t held = 0;             //!< the allocator's: registers it has now, a bit each
  uint32_t slot[kMaxParts];      //!< index of its vector in the frame
};

constexpr uint32_t kNone = ~0u;

//! A stretch of instructions with one set of active lanes, from its opening marker to the one that ends it.
struct Region {
  ir::Op op = ir::Op::Nop;       //!< If, Else, Loop, Block; Nop: the function
  ir::Value begin = 0, end = 0;
  uint32_t parent = kNone;
  uint32_t mask = kNone;         //!< Vreg of the active lanes; may be the parent's
  uint32_t condition = kNone;    //!< Vreg that the else looks at
  bool own = false;              //!< mask is the region's own: some lanes may leave before others, or not enter
  bool uniform = false;          //!< an if (or else) whose condition is the same in all lanes
  bool parentLeft = false;       //!< a break within leaves the parent too, which may be empty behind this
};

//! A uniform value that a loop without inner ones uses: loaded before the loop if a register is left.
struct Hot {
  ir::Value value = 0;
  uint32_t region = 0, vreg = 0;
};

//! Accesses to three or four neighbouring words at one offset, done as one: 16 bytes of each lane, turned into a vector for each word.
struct Words {
  ir::Value member[4] = {};
  uint32_t count = 0;
  ir::Value at = 0;              //!< where they are done: loads at the first, stores at the last
};

struct Plan {
  const ir::Function* f = nullptr;
  interp::Analysis a;
  uint32_t unroll = 1;           //!< vector registers of a 32-bit value
  std::vector<Vreg> vregs;
  std::vector<uint32_t> vregOf;  //!< by value (of a var: its register); kNone
  std::vector<Region> regions;   //!< [0] is the function
  std::vector<uint32_t> regionOf;//!< by instruction: the region that a marker opens, for end markers the one that ends
  std::vector<uint8_t> masked;   //!< by VarSet: inactive lanes must keep their value
  //! By value (or var): it is the same in all lanes, active or not, though it changes during a run: counters of loops that
  //! all lanes run alike, and what is computed from them. By break: all lanes of the construct leave together.
  std::vector<uint8_t> flat;
  std::vector<uint8_t> shared;   //!< by value: one vector for all parts, of an element for each quad (quads.h)
  std::vector<ir::Value> zeroed; //!< vars that must be zero at the start
  std::vector<uint8_t> folded;   //!< by value: not computed, as its users look through it: an fneg (fma), a shift to an upper word (trunc), halves on their way to f32
  //! Loads whose addresses are mostly neighbours: columns x and x + 1 of a texture. By the first the second, and back; both are done where
  //! the second stands.
  std::vector<ir::Value> pairSecond, pairFirst;
  //! By load of 64 bits: only its words are looked at. Its two parts then hold lanes 0, 1, 4, 5 and 2, 3, 6, 7, from which one shuffle
  //! takes the words of all eight in order.
  std::vector<uint8_t> crossed;
  std::vector<uint8_t> taken;    //!< by value: somebody takes it; empty if there are no atomics
  std::vector<Words> words;
  std::vector<uint32_t> wordsOf; //!< by access: index + 1 in words, 0: is none
  std::vector<ir::Value> footprint;   //!< by component of a filter: the first of its footprint, which makes all of them; may be empty
  std::vector<uint8_t> number;   //!< by f32 value: no NaN
  std::vector<uint8_t> signless; //!< by float value: where it is a zero nobody sees its sign
  std::vector<uint8_t> fitsInt;  //!< by FToS to i32: the number is known to be one, and within i32's range
  std::vector<Hot> hot;          //!< by region
  std::vector<LanePattern> patterns;   //!< of accesses, by patternOf() - 1
  bool mayWait = false;          //!< chunks must give way in loops
  bool suspends = false;         //!< mayWait, or a barrier
  bool wholeBlocks = false;      //!< JitOptions; chunks follow one another inside of one call
  std::vector<ir::Value> ahead;  //!< wholeBlocks: what is loaded once a row, before its first chunk. In the frame
  uint32_t registers = kRegistersAvx2;   //!< to be had
  bool upperFirst = false;       //!< the highest free one is taken, not the lowest, whose instructions are shorter
  uint32_t used = 0;             //!< had by something
  uint32_t frameSlots = 0;       //!< vectors of the frame

  bool has(ir::Op op) const { return a.present[size_t(op)]; }
  ir::Value madeAt(ir::Value v) const { return footprint.empty() || !footprint[v] ? v : footprint[v]; }
  bool inRegister(ir::Value v) const { return !a.uniform[v] && vregOf[v] != kNone; }
  uint32_t parts(const Vreg& r) const { return r.flat ? 1 : r.wide ? unroll * 2 : unroll; }
};

//! Everything but places. `lanes`: 8, 16 or 32; 0: chosen here. `wholeBlocks`: as JitOptions; taken if chunks need no state of
//! their own.
Plan makePlan(const ir::Function& f, uint32_t lanes, bool wholeBlocks, uint32_t registers, std::vector<LanePattern> patterns = {});
//! By value: all lanes have it alike, be it uniform or not.
std::vector<uint8_t> flatValues(const ir::Function& f);
//! Gives each part of each Vreg its place: a linear scan over positions.
void allocate(Plan& plan);

//! The operation reads parts of its operands after it has written parts of its result, so they may not share registers.
bool crossesParts(const ir::Function& f, ir::Value v);

}  // namespace pumice::jit
