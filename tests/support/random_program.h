// Random valid programs of lane IR, for comparing executors with each other and with the reference (reference.h).
//
// A program is built for a World (world.h), which holds what it reads and writes. It is free of races and of anything that
// Vulkan leaves to the order of invocations, reads no rubbish of inactive lanes, ends soon, and shows addresses to nobody: so
// its results are the same to the bit on every executor, instruction set and number of threads. They depend on the length
// of the rows only as far as lane ids and subgroups do.
//
//   Choices choices(seed);                          // or a fuzzer's bytes
//   const Program program = makeProgram(choices);
//   World world(program, seed, {.rowLanes = 32});
//   const Results want = world.evaluate(program.function);   // the reference
//   const Results got = world.run(*executable);              // any executor; both begin with the same memory
//   EXPECT_EQ(world.difference(want, got), "");
#pragma once

#include <functional>
#include <vector>

#include "spirv_interp/ir/ir.h"
#include "tests/support/choices.h"

namespace pumice::testing {

struct ProgramOptions {
  unsigned length = 40;      //!< of the body, in instructions; about 60 operations come of it
  bool highMath = true;      //!< fexp2, fsin, ...: lowered by the executor
  bool controlFlow = true;   //!< if, loop, block, break, switch
  bool memory = true;        //!< buffers, tables, local memory
  bool workGroups = true;    //!< shared memory and barriers
  bool atomics = true;
  bool subgroups = true;
  bool quads = true;         //!< derivatives, swizzles, quad records, tiles
  uint32_t types = ~0u;      //!< bit per ir::Type that values may have (i32, i64 and masks always may)
  //! Restricts what is emitted to what an executor can run, if set: operation, its type (for stores, comparisons and
  //! conversions that of the last operand too).
  std::function<bool(ir::Op, ir::Type type, ir::Type operand)> accepts = nullptr;
};

struct Program {
  ir::Function function;
  std::vector<ir::Type> inputs, outputs;   //!< by slot
  bool quads = false;                      //!< row lengths must be multiples of 4
};

Program makeProgram(Choices& choices, const ProgramOptions& options = {});

//! Operations that programs never hold: they are expanded when routines are linked, report (PUMICE_CHECK), or tell the time.
bool isAbstract(ir::Op op);
//! Instructions that compute or act: without constants, variables' declarations and the function's outputs.
unsigned operationCount(const ir::Function& f);

// --- what programs and worlds agree on

//! Inputs that every program has first; the others are data of any type.
enum FixedInput : uint32_t {
  kGlobalIndex = 0,   //!< i32: the invocation among all
  kLocalIndex = 1,    //!< i32: the invocation within its work group
  kFixedInputs,
};
//! In the draw constants: address (i64) and size (i64) of each buffer, then data.
enum class BufferId : uint32_t { Data, MoreData, Own, Totals, kCount };
constexpr uint32_t bufferConstant(BufferId b) { return uint32_t(b) * 16; }
constexpr uint32_t kDrawData = uint32_t(BufferId::kCount) * 16;
constexpr uint32_t kDrawDataBytes = 64;
constexpr uint32_t kDataBytes = 1024, kMoreDataBytes = 513;   //!< of the buffers that are only read
//! Memory of each invocation's own (BufferId::Own by global index; the front of work-group memory by local index): columns
//! of elements of 1, 2, 4 and 8 bytes.
constexpr uint32_t ownColumn(unsigned bytes, uint32_t invocations) { return (bytes - 1) * invocations; }
constexpr uint32_t kMaxInvocations = 1024, kMaxGroupLanes = 256;    //!< of a World
constexpr uint32_t kOwnBytes = 15 * kMaxInvocations, kSharedOwnBytes = 15 * kMaxGroupLanes;
//! Places that all invocations add to: 16 of 8 bytes for each of the eight operations up to AtomicOp::Xor; i32, then i64.
constexpr uint32_t kTotalsBytes = 2 * 8 * 16 * 8;
constexpr uint32_t kSharedTotals = kSharedOwnBytes, kSharedBytes = kSharedTotals + kTotalsBytes;
constexpr uint32_t kTableBytes = 96;                          //!< of each table but the draw constants
constexpr uint32_t kQuadRecordBytes = 64;
constexpr uint32_t kTilePlanes = 3;
constexpr uint32_t kTileElementBytes[kTilePlanes] = {4, 8, 16};

}  // namespace pumice::testing
