// What generated code and the code around it share: the frame of a chunk, the arguments of a call.
#pragma once

#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/jit/plan.h"

namespace pumice::jit {

// The frame of a chunk: its registers while it waits or calls out, operands of call-outs, slots, local memory.
constexpr uint32_t kFrameSave = 0;
constexpr uint32_t kFrameRows = kFrameSave + kMaxRegisters * kVectorBytes;
constexpr uint32_t kFrameRowBytes = 32 * 8;    //!< 32 lanes of 64 bits
constexpr uint32_t kFrameRowCount = 6;         //!< five operands and the result
constexpr uint32_t kFrameExec = kFrameRows + kFrameRowCount * kFrameRowBytes;   //!< u32: active lanes at a call-out
constexpr uint32_t kFrameResume = kFrameExec + 4;                               //!< u32: where to go on; 0: from the start
constexpr uint32_t kFrameSlots = kFrameExec + 64;
constexpr uint32_t frameRow(uint32_t k) { return kFrameRows + k * kFrameRowBytes; }

constexpr uint32_t kTurns = 256;
constexpr uint32_t kResumeNever = ~0u;   //!< kFrameResume: has finished

//! Arguments of a call.
struct ChunkCall {
  const void* const* inputs;
  void* const* outputs;
  const interp::Table* tables;
  const std::byte* const* quadRecords;     //!< of the chunk's quads, all of them
  const interp::TilePlane* tilePlanes;
  std::byte* shared;
  uint64_t sharedBytes;
  std::byte* local;                        //!< of this chunk
  const interp::ExecContext* context;
  const std::byte* bank;
  const std::atomic<bool>* stop;           //!< ExecContext's
  uint32_t lane0;                          //!< first lane of the chunk
  uint32_t active;                         //!< bit per lane of the chunk
  uint32_t lanes;                          //!< wholeBlocks: of the row
  uint32_t chunksLeft;                     //!< Emitted::groups: with this one, until the end of the row
  uint32_t waiting;                        //!< chunks that came to a barrier
  uint32_t chunks;                         //!< of a whole work group
  std::byte* firstFrame;                   //!< of a whole work group, which goes on behind barriers by itself; null: of one chunk
  uint32_t turns;                          //!< loop turns until a routine that may wait gives way, or looks at stop
};

//! Generated code. Gives interp::Progress; the preamble nothing.
using Entry = uint32_t (*)(std::byte* frame, std::byte* bank, ChunkCall* call, const std::byte* pool);

//! An operation that an interpreter's kernel does. Operands stand in the frame's rows, those of 8 and 16 bits as 32.
struct CallOut {
  interp::Kernel kernel = nullptr;
  interp::Code code{};
  ir::Type operands[5] = {};
  ir::Type result = ir::Type::None;
  uint32_t lanes = 0;
  bool uniform = false;   // the elements are not the chunk's lanes
};
//! Called from generated code.
void runCallOut(std::byte* frame, const CallOut* site, ChunkCall* call);

//! Local memory of a chunk: word w of its lane l lies at word w * lanes + l.
struct LocalAccess {
  uint32_t area = 0, size = 0, constant = 0, bytes = 0, lanes = 0;
  bool store = false;
};
//! Any width at any offset. Rows: 0 the offsets, 1 the values to store; 5 the result, as elements of `bytes` (at least 4).
void runLocalAccess(std::byte* frame, const LocalAccess* site, ChunkCall* call);

//! What an access to a range that has no room for it reads, and where it writes.
const std::byte* zeroBlock();
std::byte* sinkBlock();

}  // namespace pumice::jit
