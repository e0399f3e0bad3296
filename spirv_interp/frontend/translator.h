// The translation of one entry point: what all its parts share. One file per concept:
//   types.cpp        the type table, layouts of our own memory
//   constants.cpp    constants, specialization
//   interface.cpp    inputs, outputs, built-ins, resources
//   pointers.cpp     variables and access chains
//   memory.cpp       loads, stores, copies, atomics
//   arithmetic.cpp, composites.cpp, glsl450.cpp, image.cpp
//   subgroup.cpp     subgroups and quads
//   control_flow.cpp structured control flow to markers, function calls
//   tidy.cpp         last repairs: scopes, unused blocks
//   translate.cpp    the whole; what is taken and what refused is listed in support.cpp
//
// Errors within the room are thrown as TranslateError and caught in translate(); none leaves it.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "spirv_interp/frontend/module.h"
#include "spirv_interp/frontend/shader.h"
#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/checks.h"

namespace pumice::frontend {

using ir::Op;
using ir::Type;
using ir::Value;

struct TranslateError {
  std::string message;
};
[[noreturn, gnu::format(printf, 1, 2)]] void fail(const char* format, ...);

// Limits against absurd modules.
constexpr uint32_t kMaxInstructions = 2'000'000;  // of lane IR, after inlining
constexpr uint32_t kMaxValueScalars = 1u << 16;   // scalars of one value or register variable
constexpr uint64_t kMaxCopiedScalars = 1u << 26;  // scalars of all values that are made
constexpr uint32_t kMaxTypeDepth = 64;
constexpr uint32_t kMaxTypes = 1u << 18;
constexpr uint32_t kMaxMembers = 1u << 22;        // of all structures together
constexpr uint32_t kMaxNesting = 256;             // constructs and calls
constexpr uint32_t kMaxLocalBytes = 1u << 20;     // private memory per lane
constexpr uint32_t kMaxSharedBytes = 1u << 20;    // the device's limit is checked by the pipeline

struct TypeInfo {
  enum Kind : uint8_t {
    None, Void, Bool, Int, Float, Vector, Matrix, Array, RuntimeArray, Struct, Pointer, Image, Sampler, SampledImage,
    Function
  };
  Kind kind = None;
  Type scalar = Type::None;          //!< Bool, Int, Float, and of the elements of Vector and Matrix
  bool isSigned = false;
  uint32_t element = 0;              //!< Vector, Matrix (column), arrays, Pointer, SampledImage (the image)
  uint32_t count = 0;                //!< Vector, Matrix, Array
  std::vector<uint32_t> members;     //!< Struct
  std::vector<uint32_t> memberScalar;   //!< Struct: first flat scalar of each member (saturated)
  std::vector<uint64_t> memberOffset;   //!< Struct: in our own layout
  bool isEmpty = false;              //!< a structure without members, or of nothing but such
  spv::StorageClass storage{};       //!< Pointer
  uint32_t scalars = 0;              //!< flat number of scalars (saturated), 0 for opaque and run-time sized types
  uint32_t depth = 0;
  uint64_t naturalSize = 0;          //!< bytes in our own layout (local and shared memory)
  uint32_t naturalAlign = 1;
  //! Whether there are values of the type; an empty structure's have no scalars.
  bool hasValue() const { return scalars != 0 || isEmpty; }
  const Instruction* image = nullptr;  //!< Image: the OpTypeImage
};

//! How an aggregate lies in explicitly laid out memory, beyond what its type says.
struct MatrixLayout {
  uint32_t stride = 0;       //!< MatrixStride of the member that holds the matrix
  bool rowMajor = false;
  uint32_t vectorStride = 0; //!< a column of a row-major matrix: bytes between components; 0 = packed
};

enum class Home : uint8_t {
  Registers,  //!< ir variables, one per scalar
  Values,     //!< read-only SSA values, one per scalar (inputs)
  Local,      //!< private memory, natural layout
  Shared,     //!< work-group memory, natural layout
  Buffer,     //!< uniform or storage buffer, explicit layout
  Physical,   //!< buffer device address
  Push,       //!< push constants
  Opaque,     //!< images, samplers
};

struct Variable {
  uint32_t id = 0;
  uint32_t type = 0;                 //!< pointee
  spv::StorageClass storage{};
  Home home = Home::Registers;
  std::vector<Value> scalars;        //!< Registers: the variables; Values: the values
  Value alloc = 0;                   //!< Local
  uint32_t offset = 0;               //!< Shared: first byte
  uint32_t resource = 0;             //!< Buffer, Opaque
  bool constant = false;             //!< Buffer: LoadConst may be used
  bool isVolatile = false;
  std::vector<uint8_t> written;      //!< outputs: per scalar, stored to somewhere
  std::vector<Type> types;           //!< of the scalars (Registers, Values, Local)
};

struct Pointer {
  Variable* variable = nullptr;      //!< null for Home::Physical and for variable pointers
  Home home = Home::Registers;
  uint32_t type = 0;                 //!< pointee
  uint64_t offset = 0;               //!< constant part: bytes, or scalars for Registers and Values
  Value dynamic = 0;                 //!< bytes, i32
  Value element = 0;                 //!< array element of the resource, 0 = element 0
  Value base = 0;                    //!< Physical and variable pointers to buffers: i64 address
  Value size = 0;                    //!< variable pointers to buffers: i64, bytes behind `base`
  MatrixLayout layout;
  uint64_t arrayStride = 0;          //!< bytes from this element to the next of the array that it lies in; 0 = in none
  bool isVolatile = false;
  bool nonUniform = false;
  struct Index { Value value; uint32_t count; TypeInfo::Kind of; bool isSigned; };
  std::vector<Index> indices;        //!< that may lead out of what they index; only for PUMICE_CHECK
  //! `type` is still the array of descriptors. In a variable pointer to one `base` is the resource's number.
  bool resourceArray = false;
  // OpImageTexelPointer
  uint32_t texelImage = 0;           //!< id of the pointer to the image
  uint32_t texelCoordinate = 0;      //!< id
  uint32_t texelSample = 0;          //!< id
};

//! An image, a sampler or both, known symbolically.
struct Opaque {
  uint32_t imageType = 0;            //!< OpTypeImage, 0 = none
  uint32_t image = ~0u, sampler = ~0u;  //!< resources
  Value imageElement = 0, samplerElement = 0;
  bool nonUniform = false;
};

struct Val {
  enum Kind : uint8_t { None, Data, Ptr, Opq };
  Kind kind = None;
  uint32_t type = 0;
  //! Data; also of pointers that may vary from lane to lane: their number form (pointers.cpp).
  std::vector<Value> scalars;
  // Shared, for there may be millions of ids and few are pointers.
  std::shared_ptr<const frontend::Pointer> pointer;  //!< Ptr; of Data that is a pointer, its layout only, or null
  std::shared_ptr<const frontend::Opaque> opaque;    //!< Opq
};

class Translator;
//! Translates one instruction. `aux` is what the table says.
using Handler = void (*)(Translator&, const Instruction&, uint32_t aux);
struct HandlerEntry {
  spv::Op op;
  Handler handler;
  uint32_t aux = 0;
};
// One table per file; translate.cpp joins them.
std::span<const HandlerEntry> arithmeticHandlers();
std::span<const HandlerEntry> compositeHandlers();
std::span<const HandlerEntry> memoryHandlers();
std::span<const HandlerEntry> imageHandlers();
std::span<const HandlerEntry> controlHandlers();
std::span<const HandlerEntry> subgroupHandlers();
//! Null if the opcode is not translated by a handler.
const HandlerEntry* findHandler(spv::Op op);
//! Opcodes of modules, types, constants and control flow, which are translated elsewhere than by handlers.
bool handledElsewhere(spv::Op op);

void translateGlsl450(Translator& t, const Instruction& inst);
bool handlesGlsl450(uint32_t number);

class Translator {
 public:
  Translator(const Module& module, Shader& shader, std::span<const SpecializationConstant> specialization);

  //! Everything, up to and without the passes.
  void run(Stage stage, std::string_view entryPoint);

  const Module& module;
  Shader& shader;
  ir::Builder b;

  // --- types (types.cpp)
  const TypeInfo& type(uint32_t id) const;
  uint32_t pointee(uint32_t pointerType) const { return type(pointerType).element; }
  //! The types of the scalars of a value type, in flat order.
  void flatten(uint32_t typeId, std::vector<Type>& out) const;
  //! First flat scalar of a member or element.
  uint32_t flatOffset(const TypeInfo& aggregate, uint32_t index) const;
  uint64_t naturalOffset(const TypeInfo& structType, uint32_t member) const;
  //! Type of member or element `index`; fails if there is none.
  uint32_t elementType(const TypeInfo& aggregate, uint32_t index) const;
  const TypeInfo& scalarInfo(uint32_t typeId) const;  //!< of the type or of its elements

  // --- values
  const Val& val(uint32_t id) const;
  const std::vector<Value>& data(uint32_t id) const;
  Value scalar(uint32_t id) const;
  const Pointer& pointer(uint32_t id);
  const Opaque& opaque(uint32_t id) const;
  uint32_t typeOf(uint32_t id) const { return val(id).type; }
  void define(const Instruction& inst, std::vector<Value> scalars);
  void definePointer(const Instruction& inst, Pointer pointer);
  //! The scalars of a pointer as a value: none if it cannot be one.
  std::vector<Value> pointerScalars(const Pointer& p);
  //! The layout that the pointee of a pointer has beyond its type (MatrixStride), for pointers made from it.
  void inheritLayout(uint32_t pointerId, uint32_t fromId);
  void defineOpaque(const Instruction& inst, Opaque opaque);
  void setVal(uint32_t id, Val v);
  std::vector<Value> zeros(uint32_t typeId);
  //! The constant that an id is.
  std::optional<uint64_t> constantOf(uint32_t id) const;
  uint64_t requireConstant(uint32_t id, const char* what) const;
  Value watchedLanes();  //!< those that count for checks: helper invocations do not
  Value toI32(Value v, bool isSigned = true);
  Value resize(Value v, Type to, bool isSigned);  //!< integer to integer

  // --- constants (constants.cpp)
  void translateConstant(const Instruction& inst);

  // --- interface (interface.cpp)
  void declareVariable(const Instruction& inst);
  void flushOutputs();
  void finishInterface();
  uint32_t resourceOf(Variable& variable);
  //! Whether any member, and every member, of a structure has a decoration.
  std::pair<bool, bool> onMembers(uint32_t structType, spv::Decoration kind);
  //! What the pointer leads to within an input, interpolated at another place.
  std::vector<Value> interpolateAt(const Pointer& pointer, SampleLocation sampling, std::span<const Value> operands);

  // --- memory (pointers.cpp, memory.cpp)
  void findDynamicVariables();
  void declareLocal(Variable& variable);
  Variable& makePrivate(uint32_t id, uint32_t pointeeType, spv::StorageClass storage, bool dynamic);
  Pointer pointerTo(Variable& variable);
  Pointer accessChain(Pointer p, std::span<const uint32_t> indices);
  //! `fromStart`: the index counts from the start of an array, so a negative one is out of bounds.
  void addScaled(Pointer& p, uint32_t indexId, uint64_t stride, bool fromStart = false);
  void markWritten(const Pointer& p);
  void useElement(uint32_t resource, Value element);
  std::vector<Value> load(const Pointer& p);
  void store(const Pointer& p, const std::vector<Value>& scalars);
  struct BufferAddress { Value base = 0, offset = 0, size = 0; };
  BufferAddress address(const Pointer& p);
  //! Before accesses through `p`: the flags that they get.
  uint8_t checkIndices(const Pointer& p);
  void chooseDescriptor(Pointer& p);  //!< of a variable pointer into arrays of descriptors: the one it leads to
  bool isDynamic(uint32_t pointerId) const { return dynamicPointers_.count(pointerId) != 0; }

  // --- subgroups (subgroup.cpp)
  Value subgroupLane();  //!< number of the lane within its subgroup
  Value laneMask(spv::BuiltIn builtIn);
  Value subgroupBuiltIn(spv::BuiltIn builtIn, uint32_t component);  //!< 0 if it is none of subgroups

  // --- control flow (control_flow.cpp)
  void translateFunctionCall(const Instruction& inst);
  void translateBody(const FunctionBody& function);
  void terminate();  //!< active lanes leave the shader
  uint32_t localSizeOf(uint32_t id) const;

  // --- instructions
  void translateInstruction(const Instruction& inst);
  //! v * w + acc in the one form that contraction gives.
  Value dot(std::span<const Value> a, std::span<const Value> b, bool noContraction);

  std::unordered_map<uint32_t, Variable*> variableOfId;
  std::deque<Variable> variables;
  const unsigned checks;             //!< of PUMICE_CHECK (ir/checks.h)
  std::vector<ir::ByteRange> zeroedShared;  //!< work-group memory with an initializer
  bool anyMemoryWrites = false;
  bool variablePointers = false;     //!< the module may select among pointers to buffers and work-group memory
  bool storesThroughVariablePointers = false;
  Stage stage = Stage::Vertex;

 private:
  friend struct TypeBuilder;
  void translateType(const Instruction& inst);
  void checkCapabilities();
  void findMemoryWrites(const EntryPoint& entry);
  void applyExecutionModes(const EntryPoint& entry);

  // interface.cpp
  struct IoLeaf { uint32_t variable = ~0u, component = 0, builtIn = ~0u; };  //!< of Shader::inputs or outputs
  void declareInput(Variable& variable);
  void declareOutput(Variable& variable);
  struct IoCursor;
  void assignIo(uint32_t typeId, IoCursor cursor, std::vector<IoLeaf>& leaves, bool output);
  void appendIo(uint32_t typeId, const IoCursor& cursor, std::vector<IoLeaf>& leaves, bool output);
  uint32_t locationsOf(uint32_t typeId) const;
  Value readInput(const IoLeaf& leaf, Type type);
  std::unordered_map<const Variable*, std::vector<IoLeaf>> io_;
  std::unordered_map<uint64_t, uint32_t> interpolatedInputs_;  //!< (input, sampling) -> input that InterpolateAt made

  // memory.cpp
  template <typename Visit>
  void visitScalars(uint32_t typeId, uint64_t offset, const MatrixLayout& layout, bool explicitLayout, Visit&& visit);
  Value loadScalar(const Pointer& p, Type type, uint64_t offset, const BufferAddress& at);
  void storeScalar(const Pointer& p, Value value, uint64_t offset, const BufferAddress& at);

  // control_flow.cpp
  struct Target {
    uint32_t label = 0;
    uint32_t depth = 0;   //!< break depth outside of the construct that a branch to the label leaves
    Value enter = 0;      //!< switch case: mask variable to set
  };
  struct Frame {
    const FunctionBody* function = nullptr;
    size_t targetBase = 0;
    uint32_t returnDepth = 0;
    std::vector<Value> returnVars;
    std::unordered_set<uint32_t> visited;  //!< labels translated
    std::unordered_map<uint32_t, std::vector<Value>> phis;
  };
  Frame& frame() { return frames_.back(); }
  const BasicBlock& block(uint32_t label);
  void chain(uint32_t label, uint32_t fallthrough, bool insideLoop = false);
  void branch(uint32_t from, uint32_t to, uint32_t fallthrough);
  void conditional(Value condition, uint32_t from, uint32_t whenTrue, uint32_t whenFalse, uint32_t fallthrough);
  void loopConstruct(const BasicBlock& header);
  void switchConstruct(const BasicBlock& header, const Instruction& terminator);
  void blockInstructions(const BasicBlock& block);
  void edge(uint32_t from, uint32_t to);  //!< what the phis of `to` get from `from`
  bool hasPhis(uint32_t label);
  const Target* findTarget(uint32_t label) const;
  void leave(const Target& target);
  std::vector<Value>& phiVars(const Instruction& phi);
  std::vector<uint32_t> switchOrder(const std::vector<uint32_t>& targets, uint32_t merge, std::set<uint32_t>& entered);
  std::vector<uint32_t> successors(const BasicBlock& block) const;

  std::deque<Frame> frames_;
  std::vector<Target> targets_;
  uint32_t exitDepth_ = 0;
  uint32_t nesting_ = 0;

  std::unordered_map<uint32_t, TypeInfo> types_;
  std::vector<uint32_t> slots_;  //!< id -> index in values_ + 1
  std::deque<Val> values_;
  std::unordered_set<uint32_t> dynamicPointers_;
  std::unordered_map<uint32_t, std::span<const std::byte>> specialization_;
  uint64_t localBytes_ = 0;
  uint64_t constantScalars_ = 0;
  uint64_t valueScalars_ = 0;
  std::unordered_map<uint64_t, std::pair<bool, bool>> memberDecorations_;  //!< (type, kind) -> on any, on every member
  uint64_t memberCount_ = 0;
  uint32_t workgroupSizeConstant_ = 0;
};

//! Moves constants and variables to the front, takes blocks away that nothing leaves, and sends values that are
//! used outside of their region through variables.
void tidy(ir::Function& f);

//! A conversion between floating-point types that is arithmetic: the oracle does not round (ir::kInstKeep).
inline Value convertKept(ir::Builder& b, Type to, Value v) {
  b.setInstFlags(ir::kInstKeep);
  const Value converted = b.convert(ir::Op::FToF, to, v);
  b.setInstFlags(0);
  return converted;
}

}  // namespace pumice::frontend
