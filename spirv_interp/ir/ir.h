// Lane IR: the one form of everything that a draw executes per vertex, per pixel or per invocation.
//
// A Function is a flat list of instructions. Each instruction defines at most one value: a typed *row*,
// one element per lane. Vectors and matrices are scalarised. The value's id is the index of its
// instruction (0 is a reserved no-op, so id 0 means "none").
//
// Control flow is structured, by markers in the list: if/else/endif, loop/endloop, block/endblock, break.
// At any point a mask E of active lanes holds:
//   if m .. else .. endif   E & m, then E & ~m; a side that no lane runs is skipped
//   block .. endblock       lanes that break out of the block wait at its end
//   loop .. endloop         repeats until no lane is active at endloop (all have left by break)
//   break k                 all active lanes leave k+1 enclosing loop/block constructs (innermost first)
//                           and wait behind the outermost of these; E becomes empty
// `continue` is a break out of a block that is the loop's body; `return` out of a block that is the function.
// After a construct ends, E is what it was at its start, less the lanes that left an enclosing construct.
//
// A value may be used only where its definition dominates it within the structure: later in the same
// region or in a region nested in it. What leaves a region otherwise goes through a `var`.
// Inactive lanes of a row hold rubbish; nothing may depend on them (quad operations read helper lanes,
// which are active).
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pumice::ir {

enum class Type : uint8_t { None, Mask, I8, I16, I32, I64, F16, F32, F64, Tuple };

//! Size of one lane's element in memory, in bytes (masks and tuples have none: 0).
constexpr unsigned typeBytes(Type t) {
  constexpr uint8_t kBytes[] = {0, 0, 1, 2, 4, 8, 2, 4, 8, 0};
  return kBytes[static_cast<unsigned>(t)];
}
constexpr bool isFloat(Type t) { return t >= Type::F16 && t <= Type::F64; }
constexpr bool isInt(Type t) { return t >= Type::I8 && t <= Type::I64; }
//! The integer type of the same width.
constexpr Type intOf(Type t) {
  return t == Type::F16 ? Type::I16 : t == Type::F32 ? Type::I32 : t == Type::F64 ? Type::I64 : t;
}

constexpr unsigned kVariadic = 255;

//! How often a value changes; computed by the rate pass. Lower is rarer.
enum class Rate : uint8_t { Constant, Draw, WorkGroup, Subgroup, Lane };

enum class Op : uint8_t {
  Nop,
#define PUMICE_OP(name, text, count, result, operands, flags) name,
#include "spirv_interp/ir/ops.inc"
#undef PUMICE_OP
  kCount
};

enum OpFlags : uint8_t { kPure = 1, kEffect = 2, kRead = 4, kControl = 8, kHigh = 16 };
enum class ResultRule : uint8_t { None, Mask, Same, Any, I32, I64, Tuple };
enum class OperandRule : uint8_t { Float, Int, Num, Mask, CmpF, CmpI, Sel, Cvt, Free };

struct OpInfo {
  const char* text;
  uint8_t operandCount;
  ResultRule result;
  OperandRule operands;
  uint8_t flags;
};
inline constexpr OpInfo kOps[] = {
    {"nop", 0, ResultRule::None, OperandRule::Free, 0},
#define PUMICE_OP(name, text, count, result, operands, flags) {text, count, ResultRule::result, OperandRule::operands, flags},
#include "spirv_interp/ir/ops.inc"
#undef PUMICE_OP
};
static_assert(std::size(kOps) == size_t(Op::kCount));
constexpr const OpInfo& opInfo(Op op) { return kOps[size_t(op)]; }
//! A component of a bilinear footprint.
constexpr bool isFilter(Op op) { return op == Op::FilterHalves || op == Op::FilterBytes || op == Op::FilterLevel || op == Op::FilterLevels; }
//! One that finds its addresses, too. What it is told of levels (from operand kLevelOperand on) may be the same in a quad.
constexpr bool filtersLevels(Op op) { return op == Op::FilterLevel || op == Op::FilterLevels; }
constexpr uint32_t kLevelOperand = 4;
constexpr uint32_t kFilterClampX = 4, kFilterClampY = 8;   //!< in their immediate, beside the byte

using Value = uint32_t;  //!< id of an instruction; 0 = none

struct Inst {
  Op op = Op::Nop;
  Type type = Type::None;
  Rate rate = Rate::Lane;
  uint8_t flags = 0;           //!< InstFlags
  uint32_t firstOperand = 0;   //!< index in Function::operands
  uint32_t operandCount = 0;
  uint32_t line = 0;           //!< source line of the shader, 0 = unknown
  uint64_t imm = 0;
};
enum InstFlags : uint8_t {
  kInstVolatile = 1,      //!< memory access that may not be merged or hoisted
  kInstNoContract = 2,    //!< SPIR-V NoContraction
  kInstNonUniform = 4,
  kInstKeep = 8,          //!< ftof that keeps the double in oracle mode (see Numerics); otherwise without meaning
  kInstIndexed = 64,      //!< access whose indices the `check` before it looks at (checks.h)
  kInstDeclaredVariable = 32,  //!< var or local.alloc that the shader itself declares (a hint for checks.h)
  kInstDeclared = 16,     //!< comparison that rounds f16 and f32 operands to their type in oracle mode too: of what is stored
};

//! Subgroups are runs of this many consecutive lanes, on every machine.
constexpr uint32_t kSubgroupLanes = 32;
//! SubgroupReduce. The tree is fixed: at distance 1, 2, 4, ... each lane takes in its partner, lower lane first; an inactive lane
//! counts as the operation's identity (fold.h). Scans use the same order (Hillis-Steele: lane i takes in lane i - distance), so
//! that results do not depend on the machine; an exclusive scan is the inclusive one of the lane before, the first lane's the identity.
enum class ReduceOp : uint8_t { IAdd, FAdd, IMul, FMul, SMin, SMax, UMin, UMax, FMin, FMax, And, Or, Xor };
enum class ScanKind : uint8_t { Reduce, Inclusive, Exclusive };

enum class AtomicOp : uint8_t { Add, SMin, SMax, UMin, UMax, And, Or, Xor, Exchange, FAdd, Load, Store };

//! Tables that routines read through TableLoad. All are constant during a draw or dispatch.
enum Table : uint32_t {
  kTablePush = 0,   //!< push constants
  kTableDraw = 1,   //!< draw constants (pipeline/draw_constants.h)
  kTableConstants = 2,   //!< texture::constantTable(), the same for every routine
  kTableSet0 = 3,   //!< memory of descriptor set n is kTableSet0 + n (texture/descriptor.h)
  kMaxDescriptorSets = 32,
  kTableCount = kTableSet0 + kMaxDescriptorSets,
};

//! What an `image` instruction does. Operands come in the order of the flags below, each scalarised.
enum class ImageKind : uint8_t { Sample, Fetch, Gather, Read, Write, Atomic, QuerySize, QueryLod, QueryLevels, QuerySamples };
enum class ImageDim : uint8_t { D1, D2, D3, Cube, Rect, Buffer, SubpassData };
enum ImageOperands : uint16_t {
  kImageDref = 1,          //!< 1 operand
  kImageBias = 2,          //!< 1
  kImageLod = 4,           //!< 1
  kImageGrad = 8,          //!< ddx then ddy, `dimensions` each
  kImageOffset = 16,       //!< `dimensions` i32
  kImageSample = 32,       //!< 1 i32
  kImageMinLod = 64,       //!< 1
  kImageProj = 128,        //!< already divided by the frontend; informative
  kImageGatherComponent = 256,  //!< 1 i32
  kImageOffsets = 512,     //!< gather with four offsets, 8 i32
};
//! Operand order: image array element (i32), sampler array element (i32), coordinates (dimensions + arrayed),
//! then those of `operands` by rising bit, then for Write the 4 texel components, for Atomic the value (and comparator).
struct ImageOpInfo {
  ImageKind kind = ImageKind::Sample;
  ImageDim dim = ImageDim::D2;
  bool arrayed = false;
  bool multisampled = false;
  bool implicitLod = false;
  AtomicOp atomic = AtomicOp::Add;
  bool compareExchange = false;
  uint16_t operands = 0;       //!< ImageOperands
  uint32_t imageResource = 0;  //!< index in the shader's resources
  uint32_t samplerResource = 0;
  Type texelType = Type::F32;  //!< type of the components (f32, i32; sign does not matter here)
  bool texelSigned = false;
  uint32_t storageFormat = 0;  //!< SPIR-V ImageFormat, 0 = unknown
};
//! Number of coordinates without the layer (Cube: 3).
constexpr unsigned imageDimensions(ImageDim d) {
  constexpr uint8_t k[] = {1, 2, 3, 3, 2, 1, 2};
  return k[static_cast<unsigned>(d)];
}

struct Function {
  std::string name;
  std::vector<Inst> insts{Inst{}};   //!< insts[0] is the reserved no-op
  std::vector<Value> operandPool;
  std::vector<ImageOpInfo> imageOps;
  uint32_t sharedBytes = 0;          //!< work-group memory used
  //! Not zero: a promise of who runs the function about work groups of this size (x, y, z). Inputs 0 to 2 are the local invocation's
  //! id, 3 to 5 its work group's; each aligned run of 32 lanes of a row is of one work group, whose invocations come in order and a
  //! multiple of 32 at a time, all of them active. Work-group memory has sharedBytes at least.
  uint16_t groupSize[3] = {};

  std::span<const Value> operands(const Inst& i) const { return {operandPool.data() + i.firstOperand, i.operandCount}; }
  std::span<const Value> operands(Value v) const { return operands(insts[v]); }
  Type type(Value v) const { return insts[v].type; }
};

//! Text form, one instruction a line: `%12 = fadd f32 %10, %11`. parse(print(f)) == f up to renumbering.
std::string print(const Function& f);
//! On error returns false and says why with the line number.
bool parse(std::string_view text, Function& out, std::string& error);
//! Checks structure, scoping, operand and result types. Returns an empty string if the function is valid.
std::string verify(const Function& f);

}  // namespace pumice::ir
