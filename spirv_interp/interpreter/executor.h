// What an executor of lane IR is given and what it promises. The interpreter implements it; the JIT will.
//
// A *row* is an array of one element per lane, padded to a multiple of 64 bytes by whoever allocates it
// (executors may read and write whole vectors up to kMaxLanes elements).
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "base/arena.h"
#include "base/result.h"
#include "spirv_interp/ir/ir.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::interp {

using base::Result;

//! Longest row. 128 lanes of f32 with a register file of 13 to 26 KiB measured best (64 of f64).
constexpr uint32_t kMaxLanes = 128;

using ir::kSubgroupLanes;
static_assert(kMaxLanes % kSubgroupLanes == 0);

struct Table {
  const std::byte* data = nullptr;
  uint64_t size = 0;
};
using Tables = Table[ir::kTableCount];

//! One plane of an attachment, in 4x4-block memory (texture/layout.h). A quad's four elements are contiguous.
struct TilePlane {
  std::byte* base = nullptr;
  const uint32_t* quadElement = nullptr;  //!< per quad of the row: element index of its first pixel
};
constexpr uint32_t kMaxTilePlanes = 160;  //!< (8 colours + depth + stencil) x 16 samples

//! Everything one run over a row needs. Plain data; owned by the caller.
struct ExecContext {
  uint32_t lanes = 0;                               //!< 1..kMaxLanes; a multiple of 4 when the routine uses quads
  uint64_t active[kMaxLanes / 64] = {};             //!< bit per lane: active at the start
  const void* const* inputs = nullptr;              //!< rows by input slot (a mask row: kMaxLanes bits)
  void* const* outputs = nullptr;                   //!< rows by output slot
  const Table* tables = nullptr;                    //!< as many as the routine names
  const std::byte* const* quadRecords = nullptr;    //!< per quad (all of lanes / 4, active or not): the record QuadLoad reads
  const TilePlane* tilePlanes = nullptr;
  std::byte* shared = nullptr;                      //!< work-group memory
  uint64_t sharedBytes = 0;
  const std::atomic<bool>* stop = nullptr;          //!< once set, loops are left within a few hundred turns and the row counts as finished
};

struct BankRelease {
  bool own = true;   //!< not an arena's
  void operator()(uint64_t* p) const {
    if (own) delete[] p;
  }
};
//! Draw-rate values, computed once per draw by the preamble. Read-only during run().
class UniformBank {
 public:
  std::unique_ptr<uint64_t[], BankRelease> slots;   //!< 8 bytes per value (masks: 0 or 1)
  //! Zeroes; in the arena, if there is one and it has room.
  static UniformBank make(size_t words, base::Arena* arena) {
    uint64_t* memory = arena ? arena->alloc<uint64_t>(words) : nullptr;
    UniformBank bank;
    bank.slots = {memory ? memory : new uint64_t[words], BankRelease{!memory}};
    std::fill_n(bank.slots.get(), words, 0);
    return bank;
  }
};

//! What a row that has not finished needs to go on: position, masks, registers, local memory. Used again row after row.
class RowState {
 public:
  virtual ~RowState() = default;
};

enum class Progress : uint8_t {
  Finished,
  Barrier,   //!< goes on when every other row of the work group is at a barrier or has finished
  Yielded,   //!< gave way in a loop: it may be waiting for what another row of the work group writes
};

//! An executable routine. The caller sets the floating-point environment (base/fpenv.h). Immutable after compilation; run() may be called from many threads at once.
class Executable {
 public:
  virtual ~Executable() = default;
  //! Computes the draw-rate values, in the arena if there is one. Tables must stay valid until the last run() with this bank.
  virtual UniformBank preamble(const Table* tables, base::Arena* arena = nullptr) const = 0;
  //! Runs a row to its end. Barriers do nothing: the row is the whole work group.
  virtual void run(const UniformBank& bank, const ExecContext& context) const = 0;
  //! Lanes that run() takes at once, if every lane is active.
  virtual uint32_t longestRow() const { return kMaxLanes; }
  //! For work groups of several rows. Null: out of memory.
  virtual std::unique_ptr<RowState> newRowState() const = 0;
  //! Runs a row until it has finished or must wait. Until it has finished, bank and context must stay valid and the
  //! state belongs to the row; resume() goes on.
  virtual Progress start(const UniformBank& bank, const ExecContext& context, RowState& row) const = 0;
  virtual Progress resume(RowState& row) const = 0;
  //! Whether runGroup() can be had: for routines with ir::Function::groupSize.
  virtual bool runsGroups() const { return false; }
  //! Runs a whole work group, as one row of all its invocations in order (of any number; ExecContext::active is not looked at), barriers
  //! included. Of inputs 3 to 5 only every eighth element needs to be there.
  virtual void runGroup(const UniformBank&, const ExecContext&) const {}
  //! For statistics and tests.
  virtual size_t instructionCount() const = 0;
  virtual size_t preambleInstructionCount() const = 0;
  virtual size_t registerBytes() const = 0;
};

//! For reports of PUMICE_CHECK: the shader that a routine holds, and what its lanes are.
struct CheckedShader {
  std::string name;
  std::string (*invocation)(const ExecContext& context, uint32_t lane) = nullptr;
};

struct CompileOptions {
  ir::Numerics numerics = ir::Numerics::F32;
  CheckedShader checked;   //!< only looked at if the function holds `check` operations
};

//! Interpreter. The function must verify() and hold no abstract operations; high-level math is lowered here
//! (on a copy) by ir::lowerMath. Errors: an operation without a kernel for its type, too many rows.
base::Result<std::unique_ptr<Executable>> compileInterpreter(const ir::Function& f, const CompileOptions& options);

//! Name of the instruction set the kernels use on this machine ("AVX3", "AVX2", "SSE4", ...; PUMICE_ISA forces a lower one).
const char* interpreterTarget();

}  // namespace pumice::interp
