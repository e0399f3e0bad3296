#include "spirv_interp/ir/checks.h"

#include <cmath>

#include "base/env.h"
#include "base/log.h"
#include "spirv_interp/ir/builder.h"
#include "spirv_interp/ir/pass_list.h"

namespace pumice::ir {

unsigned wantedChecks() {
  const auto text = base::envString(base::EnvVar::Check);
  if (!text) return 0;
  unsigned checks = 0;
  std::string unknown;
  for (size_t at = 0; at <= text->size();) {
    const size_t end = std::min(text->find(',', at), text->size());
    const std::string word = text->substr(at, end - at);
    at = end + 1;
    if (word == "bounds") checks |= kCheckBounds;
    else if (word == "nan") checks |= kCheckNan;
    else if (word == "uninit") checks |= kCheckUninit;
    else if (word == "printf") checks |= kCheckPrintf;
    else unknown = word;
  }
  if (!unknown.empty() && base::firstComplaint(base::EnvVar::Check, *text))
    base::logError("PUMICE_CHECK: there is no \"%s\"; there are bounds, nan, uninit, printf", unknown.c_str());
  return checks;
}

namespace {

class Inserter {
 public:
  Inserter(const Function& f, unsigned checks, bool helpers, std::span<const ByteRange> zeroed)
      : in_(f), out_(withoutInstructions(f)), b_(out_), checks_(checks), helpers_(helpers), zeroed_(zeroed), map_(f.insts.size()), shadow_(f.insts.size()) {}

  Function run() {
    // Behind work-group memory stands its shadow.
    if (checks_ & kCheckUninit) out_.sharedBytes = 2 * in_.sharedBytes;
    std::vector<Value> operands;
    for (Value v = 1; v < in_.insts.size(); ++v) {
      const Inst& i = in_.insts[v];
      const OpInfo& info = opInfo(i.op);
      operands.clear();
      for (Value o : in_.operands(i)) operands.push_back(map_[o]);
      b_.setLine(i.line);
      lanes_ = i.flags & kInstIndexed ? indexed_ : 0;
      if (i.op == Op::Check && checkPlace(i.imm).kind == CheckKind::Index) {
        indexed_ = b_.maskAnd(operands[0], b_.ult(operands[1], operands[2]));
        if (!(checks_ & kCheckBounds)) continue;
      }
      if (checks_ & kCheckBounds) bounds(i, operands);
      if (checks_ & kCheckUninit) reads(i, operands);
      b_.setInstFlags(i.flags & ~kInstIndexed);
      map_[v] = b_.emit(i.op, i.type, operands, i.imm);
      b_.setInstFlags(0);
      const bool converts = i.op == Op::FToF || ((i.op == Op::SToF || i.op == Op::UToF) && i.type == Type::F16);   // wider floats hold every integer
      if ((checks_ & kCheckNan) && isFloat(i.type) && (info.operands == OperandRule::Float || converts)) finite(i, map_[v], operands);
      if ((checks_ & kCheckNan) && isFloat(i.type)) sums(i, map_[v], operands);
      if (checks_ & kCheckUninit) writes(v, i, operands);
    }
    return std::move(out_);
  }

 private:
  Value counts() { return lanes_ ? lanes_ : allLanes(); }
  Value allLanes() { return helpers_ ? b_.maskNot(b_.emit(Op::HelperMask, Type::Mask, {})) : b_.mask(true); }
  void check(const CheckPlace& place, std::initializer_list<Value> values) {
    std::vector<Value> operands{counts()};
    operands.insert(operands.end(), values.begin(), values.end());
    b_.emit(Op::Check, Type::None, operands, checkImm(place));
  }

  void bounds(const Inst& i, std::span<const Value> o) {
    const Type type = i.type != Type::None || o.empty() ? i.type : b_.type(o.back());
    switch (i.op) {
      case Op::Load:
      case Op::LoadConst:
      case Op::Store:
      case Op::Atomic:
      case Op::AtomicCas:
        // A buffer without end is an address of the application's.
        if (out_.insts[o[2]].op == Op::Const && out_.insts[o[2]].imm == ~uint64_t(0))
          return check({CheckKind::Address, i.op, type, uint32_t(i.imm)}, {o[0], o[1]});
        return check({CheckKind::Buffer, i.op, type, uint32_t(i.imm)}, {o[0], o[1], o[2]});
      case Op::ImageOp: return texel(i, o);
      case Op::SharedLoad:
      case Op::SharedStore:
      case Op::SharedAtomic:
      case Op::SharedAtomicCas: return check({CheckKind::Local, i.op, type, uint32_t(i.imm)}, {o[0], b_.i32(in_.sharedBytes)});
      case Op::LocalLoad:
      case Op::LocalStore: return check({CheckKind::Local, i.op, type, uint32_t(i.imm)}, {o[1], b_.i32(uint32_t(out_.insts[o[0]].imm))});
      default: return;
    }
  }

  // One check for each coordinate of a texel that is named by whole numbers, and for its level and sample.
  void texel(const Inst& i, std::span<const Value> o) {
    const ImageOpInfo info = in_.imageOps[i.imm];
    const bool named = info.kind == ImageKind::Fetch || info.kind == ImageKind::Read || info.kind == ImageKind::Write || info.kind == ImageKind::Atomic;
    if (!named || info.dim == ImageDim::SubpassData) return;
    const bool cube = info.dim == ImageDim::Cube;   // written through faces, which count as layers
    const unsigned dimensions = imageDimensions(info.dim);
    size_t next = 2 + dimensions + info.arrayed;
    next += bool(info.operands & kImageDref) + bool(info.operands & kImageBias);
    const Value level = info.operands & kImageLod ? o[next++] : 0;
    if (info.operands & kImageGrad) next += 2 * dimensions;
    const size_t offsets = next;
    if (info.operands & kImageOffset) next += dimensions;
    const Value sample = info.operands & kImageSample ? o[next] : 0;

    const auto query = [&](ImageKind kind) {
      ImageOpInfo q = info;
      q.kind = kind;
      q.compareExchange = false;
      q.operands = kind == ImageKind::QuerySize && level ? kImageLod : 0;
      std::vector<Value> operands{o[0], o[1]};
      if (q.operands) operands.push_back(level);
      const uint64_t index = out_.imageOps.size();
      out_.imageOps.push_back(q);
      b_.setInstFlags(i.flags & kInstNonUniform);
      const Value tuple = b_.emit(Op::ImageOp, Type::Tuple, operands, index);
      b_.setInstFlags(0);
      return tuple;
    };
    Value lanes = counts();
    const auto require = [&](TexelAxis axis, Value at, Value tuple, unsigned component) {
      const Value size = b_.emit(Op::TupleGet, Type::I32, {tuple}, component);
      const Value operands[] = {lanes, at, size};
      b_.emit(Op::Check, Type::None, operands, checkImm({CheckKind::Texel, i.op, Type::None, uint32_t(info.kind) | uint32_t(axis) << 8}));
      lanes = b_.maskAnd(lanes, b_.ult(at, size));   // what is wrong once is not looked at again
    };
    if (level) require(TexelAxis::Level, level, query(ImageKind::QueryLevels), 0);
    const Value size = query(ImageKind::QuerySize);
    for (unsigned k = 0; k < (cube ? 2 : dimensions); k++) {
      const Value at = info.operands & kImageOffset ? b_.iadd(o[2 + k], o[offsets + k]) : o[2 + k];
      require(TexelAxis(k), at, size, k);
    }
    if (info.arrayed && !cube) require(TexelAxis::Layer, o[2 + dimensions], size, dimensions);
    if (sample) require(TexelAxis::Sample, sample, query(ImageKind::QuerySamples), 0);
  }

  void finite(const Inst& i, Value result, std::span<const Value> o) {
    // A value that the builder knows is no operation any more.
    if (out_.insts[result].op != i.op || i.op == Op::FNeg || i.op == Op::FAbs) return;
    const CheckPlace place{CheckKind::Finite, i.op, i.type};
    if (o.size() == 1) check(place, {result, o[0]});
    else if (o.size() == 2) check(place, {result, o[0], o[1]});
    else check(place, {result, o[0], o[1], o[2]});
  }

  // Sums and products over a subgroup are watched where every value that goes into them is finite; what is added atomically
  // beside what was there.
  void sums(const Inst& i, Value result, std::span<const Value> o) {
    const auto fadd = [&](Value old, Value value) { check({CheckKind::Finite, i.op, i.type}, {b_.fadd(old, value), old, value}); };
    if (i.op == Op::Atomic && AtomicOp(i.imm >> 32) == AtomicOp::FAdd) return fadd(result, o[3]);
    if (i.op == Op::SharedAtomic && AtomicOp(i.imm >> 32) == AtomicOp::FAdd) return fadd(result, o[1]);
    const auto reduce = ReduceOp(i.imm & 0xff);
    if (i.op != Op::SubgroupReduce || (reduce != ReduceOp::FAdd && reduce != ReduceOp::FMul)) return;
    const Value finite = b_.flt(b_.fabs(o[0]), b_.floatConstant(i.type, HUGE_VAL));
    const Value ones = b_.i32(~0u);
    const Value together = b_.emit(Op::SubgroupReduce, Type::I32, {b_.select(finite, ones, b_.i32(0))}, (i.imm & ~uint64_t(0xff)) | uint64_t(ReduceOp::And));
    const Value operands[] = {b_.maskAnd(counts(), b_.maskAnd(finite, b_.ieq(together, ones))), result, o[0]};
    b_.emit(Op::Check, Type::None, operands, checkImm({CheckKind::Finite, i.op, i.type, uint32_t(reduce)}));
  }

  // Beside each of the shader's variables stands one that remembers where it was written: a mask, or for private arrays
  // memory with every written byte set.
  // What lies outside is no matter of theirs.
  void reads(const Inst& i, std::span<const Value> o) {
    const auto given = in_.operands(i);
    if (i.op == Op::VarGet && shadow_[given[0]]) check({CheckKind::Written, i.op, i.type}, {b_.get(shadow_[given[0]])});
    if (i.op == Op::LocalLoad && shadow_[given[0]]) {
      const Value bytes = b_.emit(Op::LocalLoad, intOf(i.type), {shadow_[given[0]], o[1]}, i.imm);
      written(i, o[1], out_.insts[o[0]].imm, b_.ieq(bytes, b_.constant(intOf(i.type), ~uint64_t(0))));
    }
    if (i.op == Op::SharedLoad) sharedRead(i, o[0], i.type);
    const bool overwrites = i.op == Op::SharedAtomic && (AtomicOp(i.imm >> 32) == AtomicOp::Store || AtomicOp(i.imm >> 32) == AtomicOp::Exchange);
    if ((i.op == Op::SharedAtomic && !overwrites) || i.op == Op::SharedAtomicCas) sharedRead(i, o[0], i.type);
  }
  void sharedRead(const Inst& i, Value offset, Type type) {
    const Type t = intOf(type);
    const uint32_t at = uint32_t(i.imm);
    const Value bytes = b_.emit(Op::SharedLoad, t, {offset}, at + in_.sharedBytes);
    Value known = b_.ieq(bytes, b_.constant(t, ~uint64_t(0)));
    for (const ByteRange& zero : zeroed_) known = b_.maskOr(known, b_.ult(b_.isub(b_.iadd(offset, b_.i32(at)), b_.i32(zero.begin)), b_.i32(zero.end - zero.begin)));
    written(i, offset, in_.sharedBytes, known);
  }
  void written(const Inst& i, Value offset, uint64_t size, Value known) {
    const uint64_t needed = uint64_t(uint32_t(i.imm)) + typeBytes(i.type);
    if (needed > size) return;
    const Value operands[] = {b_.maskAnd(counts(), b_.ule(offset, b_.i32(uint32_t(size - needed)))), known};
    b_.emit(Op::Check, Type::None, operands, checkImm({CheckKind::Written, i.op, i.type}));
  }
  void writes(Value v, const Inst& i, std::span<const Value> o) {
    const auto given = in_.operands(i);
    if (i.op == Op::Var && (i.flags & kInstDeclaredVariable)) shadow_[v] = b_.var(Type::Mask);
    if (i.op == Op::LocalAlloc && (i.flags & kInstDeclaredVariable)) shadow_[v] = b_.emit(Op::LocalAlloc, Type::I32, {}, i.imm);
    if (i.op == Op::VarSet && shadow_[given[0]]) b_.set(shadow_[given[0]], b_.mask(true));
    if (i.op == Op::LocalStore && shadow_[given[0]]) {
      const Type t = intOf(b_.type(o[2]));
      b_.emit(Op::LocalStore, Type::None, {shadow_[given[0]], o[1], b_.constant(t, ~uint64_t(0))}, i.imm);
    }
    const bool loads = i.op == Op::SharedAtomic && AtomicOp(i.imm >> 32) == AtomicOp::Load;
    if (loads || (i.op != Op::SharedStore && i.op != Op::SharedAtomic && i.op != Op::SharedAtomicCas)) return;
    const Type t = intOf(i.op == Op::SharedStore ? b_.type(o[1]) : i.type);
    const uint32_t at = uint32_t(i.imm), bytes = typeBytes(t);
    if (uint64_t(at) + bytes > in_.sharedBytes) return;
    // Out of bounds nothing may be marked.
    b_.beginIf(b_.ule(o[0], b_.i32(in_.sharedBytes - at - bytes)));
    b_.emit(Op::SharedStore, Type::None, {o[0], b_.constant(t, ~uint64_t(0))}, at + in_.sharedBytes);
    b_.endIf();
  }

  const Function& in_;
  Function out_;
  Builder b_;
  const unsigned checks_;
  const bool helpers_;
  const std::span<const ByteRange> zeroed_;
  Value indexed_ = 0, lanes_ = 0;   //!< lanes whose indices are right, at the last check of them; those that count, 0 = all
  std::vector<Value> map_, shadow_;
};

}  // namespace

void insertChecks(Function& f, unsigned checks, bool helpers, std::span<const ByteRange> zeroed) {
  if (!(checks & (kCheckBounds | kCheckNan | kCheckUninit))) return;
  removeDeadCode(f);   // what nobody uses is not read either
  f = Inserter(f, checks, helpers, zeroed).run();
}

}  // namespace pumice::ir
