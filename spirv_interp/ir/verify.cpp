#include <bit>
#include <string>
#include <vector>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/text.h"
#include "spirv_interp/ir/one_record.h"

namespace pumice::ir {

namespace {

bool isData(Type t) { return t != Type::None && t != Type::Tuple; }
bool isSized(Type t) { return typeBytes(t) != 0; }

class Verifier {
 public:
  explicit Verifier(const Function& f) : f_(f), region_(f.insts.size(), 0) {}

  std::string run() {
    if (f_.insts.empty() || f_.insts[0].op != Op::Nop) return "instruction 0 must be the reserved nop";
    open_.push_back(true);
    stack_.push_back({Op::Nop, 0});
    for (at_ = 1; at_ < f_.insts.size() && error_.empty(); ++at_) {
      const Inst& i = f_.insts[at_];
      if (i.op == Op::Nop || i.op >= Op::kCount)
        fail("not an operation");
      else if (i.type > Type::Tuple || i.rate > Rate::Lane)
        fail("no such type or rate");
      else if (uint64_t(i.firstOperand) + i.operandCount > f_.operandPool.size())
        fail("operands outside the pool");
      else if (count(i) && scoping(i) && result(i) && operands(i))
        structure(i);
      region_[at_] = stack_.back().region;
    }
    if (error_.empty() && stack_.size() > 1)
      error_ = std::string("'") + opInfo(stack_.back().op).text + "' is not closed";
    return error_;
  }

 private:
  struct Region {
    Op op;
    uint32_t region;
  };

  bool fail(const std::string& what) {
    const Inst& i = f_.insts[at_];
    const char* text = i.op < Op::kCount ? opInfo(i.op).text : "?";
    error_ = "%" + std::to_string(at_) + " (" + text + "): " + what;
    if (i.line) error_ += " @" + std::to_string(i.line);
    return false;
  }
  bool check(bool ok, const char* what) { return ok || fail(what); }

  Type type(const Inst& i, unsigned k) const { return f_.type(f_.operands(i)[k]); }

  bool count(const Inst& i) {
    const unsigned want = opInfo(i.op).operandCount;
    return check(want == kVariadic || want == i.operandCount, "wrong number of operands");
  }

  bool scoping(const Inst& i) {
    for (Value v : f_.operands(i)) {
      if (v == 0 || v >= at_) return fail("operand %" + std::to_string(v) + " is not defined before its use");
      if (f_.type(v) == Type::None) return fail("operand %" + std::to_string(v) + " has no value");
      if (!open_[region_[v]]) return fail("operand %" + std::to_string(v) + " is used outside its region");
      if (f_.type(v) == Type::Tuple && i.op != Op::TupleGet) return fail("a tuple is read by tuple.get only");
    }
    return true;
  }

  bool result(const Inst& i) {
    switch (opInfo(i.op).result) {
      case ResultRule::None:
        return check(i.type == Type::None, "has no result");
      case ResultRule::Mask:
        return check(i.type == Type::Mask, "result must be a mask");
      case ResultRule::I32:
        return check(i.type == Type::I32, "result must be i32");
      case ResultRule::I64:
        return check(i.type == Type::I64, "result must be i64");
      case ResultRule::Tuple:
        return check(i.type == Type::Tuple, "result must be a tuple");
      case ResultRule::Any:
      case ResultRule::Same:
        return check(isData(i.type), "result needs a type");
    }
    return true;
  }

  bool operands(const Inst& i) {
    const OperandRule rule = opInfo(i.op).operands;
    switch (rule) {
      case OperandRule::Float:
      case OperandRule::Int:
      case OperandRule::Num:
        if (!check(rule == OperandRule::Int ? isInt(i.type)
                                            : isFloat(i.type) || (rule == OperandRule::Num && isInt(i.type)),
                   rule == OperandRule::Int ? "must be of an integer type" : "must be of a float type"))
          return false;
        if ((i.op == Op::SMulHi || i.op == Op::UMulHi) && i.type != Type::I32) return fail("must be i32");
        for (unsigned k = 0; k < i.operandCount; ++k)
          if (type(i, k) != i.type) return fail("operand type differs from the result's");
        return immediate(i);
      case OperandRule::Mask:
        for (unsigned k = 0; k < i.operandCount; ++k)
          if (type(i, k) != Type::Mask) return fail("operand must be a mask");
        return true;
      case OperandRule::CmpF:
        return check(isFloat(type(i, 0)) && type(i, 0) == type(i, 1), "must compare two of one float type");
      case OperandRule::CmpI:
        return check(isInt(type(i, 0)) && type(i, 0) == type(i, 1), "must compare two of one integer type");
      case OperandRule::Sel:
        return check(type(i, 0) == Type::Mask, "selects by a mask") &&
               check(type(i, 1) == i.type && type(i, 2) == i.type, "operand type differs from the result's");
      case OperandRule::Cvt:
        return conversion(i, type(i, 0), i.type);
      case OperandRule::Free:
        return free(i) && immediate(i);
    }
    return true;
  }

  bool conversion(const Inst& i, Type from, Type to) {
    bool ok = false;
    switch (i.op) {
      case Op::FToF:
        ok = isFloat(from) && isFloat(to) && from != to;
        break;
      case Op::FToS:
      case Op::FToU:
        ok = isFloat(from) && isInt(to);
        break;
      case Op::SToF:
      case Op::UToF:
        ok = isInt(from) && isFloat(to);
        break;
      case Op::SExt:
      case Op::ZExt:
        ok = isInt(from) && isInt(to) && typeBytes(from) < typeBytes(to);
        break;
      case Op::Trunc:
        ok = isInt(from) && isInt(to) && typeBytes(from) > typeBytes(to);
        break;
      case Op::BitCast:
        ok = isSized(from) && typeBytes(from) == typeBytes(to) && from != to;
        break;
      default:
        break;
    }
    return check(ok, "cannot convert between these types");
  }

  bool address(const Inst& i) {
    return check(type(i, 0) == Type::I64, "base must be i64") &&
           check(type(i, 1) == Type::I32 || type(i, 1) == Type::I64, "offset must be i32 or i64") &&
           check(type(i, 2) == Type::I64, "size must be i64");
  }

  bool free(const Inst& i) {
    const std::span<const Value> v = f_.operands(i);
    switch (i.op) {
      case Op::VarGet:
      case Op::VarSet:
        return check(f_.insts[v[0]].op == Op::Var, "operand must be a var") &&
               check(type(i, 0) == (i.op == Op::VarGet ? i.type : type(i, 1)), "type differs from the var's");
      case Op::Output:
        return check(isData(type(i, 0)), "value needs a type");
      case Op::If:
        return check(type(i, 0) == Type::Mask, "needs a mask");
      case Op::QuadSwizzle:
        return check(type(i, 0) == i.type, "operand type differs from the result's");
      case Op::SubgroupShuffle:
        return check(isSized(i.type) && type(i, 0) == i.type, "operand type differs from the result's") &&
               check(type(i, 1) == Type::I32, "lane must be i32");
      case Op::SubgroupReduce:
        return check(isSized(i.type) && type(i, 0) == i.type, "operand type differs from the result's");
      case Op::TableLoad:
        return check(type(i, 0) == Type::I32 && isSized(i.type), "needs an i32 offset and a sized type");
      case Op::Load:
      case Op::LoadConst:
        return address(i) && check(isSized(i.type), "needs a sized type");
      case Op::FilterHalves:
      case Op::FilterBytes: {
        constexpr Type kTypes[] = {Type::I64, Type::I64, Type::I32, Type::I32, Type::I32, Type::I32, Type::F32, Type::F32};
        for (unsigned k = 0; k < std::size(kTypes); ++k)
          if (type(i, k) != kTypes[k]) return fail("operand of the wrong type");
        return check(i.type == Type::F32, "result must be f32");
      }
      case Op::FilterLevel:
      case Op::FilterLevels: {
        constexpr Type kTypes[] = {Type::I64, Type::I64, Type::F32, Type::F32, Type::I32, Type::I32, Type::I32,
                                   Type::I32, Type::I32, Type::I32, Type::I32, Type::I32, Type::F32};
        for (unsigned k = 0; k < i.operandCount; ++k)
          if (type(i, k) != kTypes[k]) return fail("operand of the wrong type");
        return check(i.type == Type::F32, "result must be f32");
      }
      case Op::Store:
        return address(i) && check(isSized(type(i, 3)), "needs a sized value");
      case Op::Atomic:
        return address(i) && check(isSized(i.type) && type(i, 3) == i.type, "value type differs");
      case Op::AtomicCas:
        return address(i) &&
               check(isSized(i.type) && type(i, 3) == i.type && type(i, 4) == i.type, "value type differs");
      case Op::LocalLoad:
      case Op::LocalStore:
        return check(f_.insts[v[0]].op == Op::LocalAlloc, "operand must be a local.alloc") &&
               check(type(i, 1) == Type::I32, "offset must be i32") &&
               check(isSized(i.op == Op::LocalLoad ? i.type : type(i, 2)), "needs a sized type");
      case Op::SharedLoad:
        return check(type(i, 0) == Type::I32 && isSized(i.type), "needs an i32 offset and a sized type");
      case Op::SharedStore:
        return check(type(i, 0) == Type::I32 && isSized(type(i, 1)), "needs an i32 offset and a sized value");
      case Op::SharedAtomic:
        return check(type(i, 0) == Type::I32 && isSized(i.type) && type(i, 1) == i.type,
                     "offset or value type is wrong");
      case Op::SharedAtomicCas:
        return check(
            type(i, 0) == Type::I32 && isSized(i.type) && type(i, 1) == i.type && type(i, 2) == i.type,
            "offset or value type is wrong");
      case Op::QuadLoad:
      case Op::TileLoad:
        return check(isSized(i.type), "needs a sized type");
      case Op::TileStore:
        return check(isSized(type(i, 0)), "needs a sized value");
      case Op::ShaderOutput:
        return check(i.operandCount >= 1, "needs a value");
      case Op::Descriptor:
        return check(type(i, 0) == Type::I32, "array element must be i32");
      case Op::TupleGet:
        return check(type(i, 0) == Type::Tuple, "operand must be a tuple");
      default:
        return true;
    }
  }

  bool immediate(const Inst& i) {
    const uint64_t high = i.imm >> 32;
    switch (i.op) {
      case Op::Const:
        return check((i.imm & ~allOnes(i.type)) == 0, "bits beyond the type's width");
      case Op::QuadDdx:
      case Op::QuadDdy:
        return check(i.imm <= 1, "0 (coarse) or 1 (fine) expected");
      case Op::QuadSwizzle:
        return check(i.imm <= 255, "two bits for each of four lanes expected");
      case Op::SubgroupReduce: {
        const uint64_t op = i.imm & 0xff;
        if (op > uint64_t(ReduceOp::Xor) || (i.imm >> 8 & 0xff) > uint64_t(ScanKind::Exclusive) ||
            i.imm >> 16 > uint64_t(std::countr_zero(kSubgroupLanes)))
          return fail("no such reduction");
        return check(isFloat(i.type) == (opInfo(reduceOperation(ReduceOp(op))).operands == OperandRule::Float),
                     "reduction and type do not fit");
      }
      case Op::TableLoad:
        return check(high < kTableCount, "no such table");
      case Op::QuadLoad:
        return check((i.imm & ~(kOneRecord | kPlaneInUnit)) >> 32 == 0, "immediate out of range");
      case Op::TileLoad:
      case Op::TileStore:
        return check((i.imm & 0xffff) + typeBytes(i.op == Op::TileLoad ? i.type : type(i, 0)) <=
                         (i.imm >> 16 & 0xffff),
                     "value outside the plane's element");
      case Op::FilterHalves:
      case Op::FilterBytes:
        return check(i.imm < 4, "no such component");
      case Op::FilterLevel:
      case Op::FilterLevels:
        return check(i.imm < 16, "no such component or address mode");
      case Op::Atomic:
      case Op::SharedAtomic:
        return check(high < std::size(kAtomicNames), "no such atomic operation");
      case Op::ImageOp:
        return check(i.imm < f_.imageOps.size(), "no such image operation") && image(i, f_.imageOps[i.imm]);
      case Op::Descriptor:
        return true;
      case Op::TupleGet:
        return check(f_.insts[f_.operands(i)[0]].op != Op::Descriptor || i.imm < 2, "no such component");
      case Op::Input:
      case Op::UniformInput:
      case Op::Output:
      case Op::Load:
      case Op::LoadConst:
      case Op::Store:
      case Op::AtomicCas:
      case Op::SharedAtomicCas:
      case Op::LocalAlloc:
      case Op::LocalLoad:
      case Op::LocalStore:
      case Op::SharedLoad:
      case Op::SharedStore:
        return check(high == 0, "immediate out of range");
      default:
        return true;
    }
  }

  // Whoever expands an image operation may rely on the operands that its description promises.
  bool image(const Inst& i, const ImageOpInfo& info) {
    if (info.kind > ImageKind::QuerySamples || info.dim > ImageDim::SubpassData ||
        info.atomic > AtomicOp::Store || info.texelType > Type::F64)
      return fail("no such image operation");
    const bool query = info.kind >= ImageKind::QuerySize && info.kind != ImageKind::QueryLod;
    const unsigned dimensions = imageDimensions(info.dim);
    unsigned want = query ? 2 : 2 + dimensions + info.arrayed;
    constexpr ImageOperands kSingle[] = {kImageDref,   kImageBias,   kImageLod,
                                         kImageSample, kImageMinLod, kImageGatherComponent};
    for (ImageOperands o : kSingle) want += (info.operands & o) != 0;
    if (info.operands & kImageGrad) want += 2 * dimensions;
    if (info.operands & kImageOffset) want += dimensions;
    if (info.operands & kImageOffsets) want += 8;
    if (info.kind == ImageKind::Write) want += 4;
    if (i.operandCount < want || type(i, 0) != Type::I32 || type(i, 1) != Type::I32)
      return fail("wrong operands");
    return true;
  }

  void openRegion(Op op) {
    if (op == Op::Loop || op == Op::Block) ++breakDepth_;
    open_.push_back(true);
    stack_.push_back({op, uint32_t(open_.size() - 1)});
  }
  bool closeRegion(Op want, Op alternative, const char* what) {
    if (stack_.back().op != want && stack_.back().op != alternative) return fail(what);
    if (want == Op::Loop || want == Op::Block) --breakDepth_;
    open_[stack_.back().region] = false;
    stack_.pop_back();
    return true;
  }

  void structure(const Inst& i) {
    switch (i.op) {
      case Op::If:
      case Op::Loop:
      case Op::Block:
        openRegion(i.op);
        break;
      case Op::Else:
        if (closeRegion(Op::If, Op::If, "no if is open here")) openRegion(Op::Else);
        break;
      case Op::EndIf:
        closeRegion(Op::If, Op::Else, "no if is open here");
        break;
      case Op::EndLoop:
        closeRegion(Op::Loop, Op::Loop, "no loop is open here");
        break;
      case Op::EndBlock:
        closeRegion(Op::Block, Op::Block, "no block is open here");
        break;
      case Op::Break:
        check(i.imm < breakDepth_, "leaves more constructs than are open");
        break;
      default:
        break;
    }
  }

  const Function& f_;
  std::vector<uint32_t> region_;  // region that holds each instruction
  std::vector<bool> open_;        // by region
  std::vector<Region> stack_;
  Value at_ = 0;
  uint64_t breakDepth_ = 0;
  std::string error_;
};

}  // namespace

std::string verify(const Function& f) { return Verifier(f).run(); }

}  // namespace pumice::ir
