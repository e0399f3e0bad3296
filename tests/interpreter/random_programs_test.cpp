// Random structured programs: every instruction set, partial rows, and the program after the passes must give
// the bits of a reference that runs one lane at a time by ir/fold.h.
#include "fixture.h"
#include "spirv_interp/ir/passes.h"

namespace pumice::interp {
namespace {

constexpr unsigned kInputs = 8, kOutputs = 8;

//! Makes a valid function with control flow of bounded run time.
class Generator {
 public:
  explicit Generator(uint64_t seed) : r_(seed) {}

  Function make() {
    static constexpr Type kInputTypes[kInputs] = {Type::I32, Type::F32, Type::F32, Type::I32, Type::F64, Type::I64, Type::Mask, Type::F16};
    for (unsigned k = 0; k < kInputs; k++) add(Op::Input, kInputTypes[k], {}, k);
    for (unsigned k = 0; k < 4; k++) add(Op::UniformInput, k % 2 ? Type::F32 : Type::I32, {}, 8 * k);
    for (unsigned k = 0; k < 4; k++) vars_.push_back(append(f_, Op::Var, k % 2 ? Type::F32 : r_.chance(50) ? Type::I32 : Type::Mask, {}));
    body(20 + r_.below(50), 0);
    for (unsigned k = 0; k < kOutputs; k++) {
      Value v = k < vars_.size() ? append(f_, Op::VarGet, f_.type(vars_[k]), {vars_[k]}) : any();
      append(f_, Op::Output, Type::None, {v}, k);
    }
    return std::move(f_);
  }

 private:
  Value add(Op op, Type t, std::initializer_list<Value> operands, uint64_t imm = 0) {
    const Value v = append(f_, op, t, operands, imm);
    values_.push_back(v);
    return v;
  }
  Value any() { return values_[r_.below(uint32_t(values_.size()))]; }
  Value of(Type t) {
    for (int tries = 0; tries < 12; tries++) {
      const Value v = values_[values_.size() - 1 - r_.below(uint32_t(tries < 6 ? std::min<size_t>(values_.size(), 24) : values_.size()))];
      if (f_.type(v) == t) return v;
    }
    return add(Op::Const, t, {}, randomBits(r_, t));
  }

  void operation() {
    for (;;) {
      const Op op = Op(1 + r_.below(kOpCount - 1));
      const ir::OpInfo& info = ir::opInfo(op);
      if (!(info.flags & ir::kPure) || (info.flags & ir::kHigh) || info.operands == ir::OperandRule::Free) continue;
      Type t = kDataTypes[r_.below(std::size(kDataTypes))];
      if (r_.chance(60)) t = r_.chance(50) ? Type::F32 : Type::I32;
      Type operand = t;
      switch (info.operands) {
        case ir::OperandRule::Float: if (!ir::isFloat(t)) continue; break;
        case ir::OperandRule::Int: if (!ir::isInt(t)) continue; break;
        case ir::OperandRule::CmpF: if (!ir::isFloat(t)) continue; t = Type::Mask; break;
        case ir::OperandRule::CmpI: if (!ir::isInt(t)) continue; t = Type::Mask; break;
        case ir::OperandRule::Mask: t = operand = Type::Mask; break;
        case ir::OperandRule::Sel: if (r_.chance(15)) t = operand = Type::Mask; break;
        case ir::OperandRule::Cvt: operand = kDataTypes[r_.below(std::size(kDataTypes))]; break;
        default: continue;
      }
      Value v[3] = {};
      for (unsigned k = 0; k < info.operandCount; k++) v[k] = of(info.operands == ir::OperandRule::Sel && k == 0 ? Type::Mask : operand);
      const size_t values = f_.insts.size(), pool = f_.operandPool.size();
      if (info.operandCount == 1) append(f_, op, t, {v[0]});
      else if (info.operandCount == 2) append(f_, op, t, {v[0], v[1]});
      else append(f_, op, t, {v[0], v[1], v[2]});
      if (valid(f_.insts.back())) return values_.push_back(Value(values));
      f_.insts.resize(values);
      f_.operandPool.resize(pool);
    }
  }
  //! Conversions and high multiplications are not allowed for every type.
  bool valid(const Inst& i) const {
    Function g;
    uint32_t first = 0;
    std::vector<Value> in;
    for (Value o : f_.operands(i)) in.push_back(append(g, Op::Input, f_.type(o), {}, first++));
    const uint32_t start = uint32_t(g.operandPool.size());
    g.operandPool.insert(g.operandPool.end(), in.begin(), in.end());
    const Value v = append(g, i.op, i.type, {});
    g.insts[v].firstOperand = start;
    g.insts[v].operandCount = uint32_t(in.size());
    return ir::verify(g).empty();
  }

  void body(unsigned length, unsigned depth) {
    const size_t scope = values_.size();
    for (unsigned n = 0; n < length; n++) {
      const uint32_t what = r_.below(100);
      if (what < 65) operation();
      else if (what < 75) {
        const Value var = vars_[r_.below(uint32_t(vars_.size()))];
        append(f_, Op::VarSet, Type::None, {var, of(f_.type(var))});
      } else if (what < 83) {
        const Value var = vars_[r_.below(uint32_t(vars_.size()))];
        add(Op::VarGet, f_.type(var), {var});
      } else if (what < 86) add(Op::ExecMask, Type::Mask, {});
      else if (depth < 4) construct(length / 2, depth, what);
      else operation();
      if (depth && breaks_ && r_.chance(6)) {
        append(f_, Op::Break, Type::None, {}, r_.below(breaks_));
        break;
      }
    }
    values_.resize(scope ? scope : values_.size());
  }

  void construct(unsigned length, unsigned depth, uint32_t what) {
    if (what < 92) {
      append(f_, Op::If, Type::None, {of(Type::Mask)});
      body(length, depth + 1);
      if (r_.chance(50)) {
        append(f_, Op::Else, Type::None, {});
        body(length, depth + 1);
      }
      append(f_, Op::EndIf, Type::None, {});
    } else if (what < 95) {
      append(f_, Op::Block, Type::None, {});
      breaks_++;
      body(length, depth + 1);
      breaks_--;
      append(f_, Op::EndBlock, Type::None, {});
    } else {
      // A counter that each lane carries ends the loop after lane-dependent rounds.
      const Value limit = add(Op::And, Type::I32, {of(Type::I32), append(f_, Op::Const, Type::I32, {}, 3)});
      const Value counter = append(f_, Op::Var, Type::I32, {});
      const Value one = append(f_, Op::Const, Type::I32, {}, 1);
      const size_t scope = values_.size();
      append(f_, Op::Loop, Type::None, {});
      breaks_++;
      const Value now = append(f_, Op::VarGet, Type::I32, {counter});
      values_.push_back(now);
      const Value done = append(f_, Op::ULe, Type::Mask, {limit, now});
      append(f_, Op::If, Type::None, {done});
      append(f_, Op::Break, Type::None, {}, 0);
      append(f_, Op::EndIf, Type::None, {});
      const Value next = append(f_, Op::IAdd, Type::I32, {now, one});
      append(f_, Op::VarSet, Type::None, {counter, next});
      body(length, depth + 1);
      breaks_--;
      values_.resize(scope);
      append(f_, Op::EndLoop, Type::None, {});
    }
  }

  Random r_;
  Function f_;
  std::vector<Value> values_, vars_;
  uint32_t breaks_ = 0;
};

//! One lane, by the definitions of ir.h. Values out of a break's reach are simply not run.
class Reference {
 public:
  Reference(const Function& f, const RowRun& run, const uint64_t* uniforms) : f_(f), run_(run), uniforms_(uniforms), partner_(f.insts.size()) {
    std::vector<Value> open;
    for (Value v = 1; v < f.insts.size(); v++) {
      const Op op = f.insts[v].op;
      if (op == Op::Else || op == Op::EndIf || op == Op::EndLoop || op == Op::EndBlock) {
        partner_[open.back()] = v;
        partner_[v] = open.back();
        open.pop_back();
      }
      if (op == Op::If || op == Op::Else || op == Op::Loop || op == Op::Block) open.push_back(v);
    }
  }

  void operator()(unsigned lane, uint64_t out[kOutputs]) {
    std::vector<uint64_t> value(f_.insts.size(), 0);
    std::vector<Value> stack;   // open loops and blocks
    for (Value v = 1; v < f_.insts.size(); v++) {
      const Inst& i = f_.insts[v];
      const auto o = f_.operands(v);
      switch (i.op) {
        case Op::Const: value[v] = i.imm; break;
        case Op::Input: value[v] = run_.inputs[i.imm].get(i.type, lane); break;
        case Op::UniformInput: value[v] = uniforms_[i.imm / 8] & ir::allOnes(i.type); break;
        case Op::Var: break;   // zero at the start of the routine
        case Op::VarGet: value[v] = value[o[0]]; break;
        case Op::VarSet: value[o[0]] = value[o[1]]; break;
        case Op::ExecMask: value[v] = 1; break;
        case Op::Output: out[i.imm] = value[o[0]]; break;
        case Op::If: if (!(value[o[0]] & 1)) v = partner_[v]; break;          // to after else, or endif
        case Op::Else: v = partner_[v]; break;                                // the then side ran
        case Op::EndIf: break;
        case Op::Loop:
        case Op::Block: stack.push_back(v); break;
        case Op::EndBlock: stack.pop_back(); break;
        case Op::EndLoop: v = partner_[v]; break;                             // again, behind `loop`
        case Op::Break: {
          Value target = 0;
          for (uint64_t k = 0; k <= i.imm; k++) {
            target = stack.back();
            stack.pop_back();
          }
          v = partner_[target];
          break;
        }
        default: {
          uint64_t args[3] = {};
          for (size_t k = 0; k < o.size(); k++) args[k] = value[o[k]];
          ASSERT_TRUE(ir::foldConstant(i.op, i.type, f_.type(o.back()), {args, o.size()}, value[v])) << ir::opInfo(i.op).text;
        }
      }
    }
  }

 private:
  const Function& f_;
  const RowRun& run_;
  const uint64_t* uniforms_;
  std::vector<Value> partner_;
};

void check(uint64_t seed, bool optimise) {
  const Function f = Generator(seed).make();
  ASSERT_EQ(ir::verify(f), "") << "seed " << seed;
  Function g = f;
  if (optimise) {
    ir::optimise(g);
    ASSERT_EQ(ir::verify(g), "") << "optimised, seed " << seed << "\n" << ir::print(f);
  }
  Random r(seed + 77);
  static constexpr uint32_t kLanes[] = {1, 3, 5, 64, 127, 128};
  const uint32_t lanes = kLanes[r.below(std::size(kLanes))];
  RowRun start(kInputs, kOutputs);
  start.lanes = lanes;
  if (r.chance(30)) start.active[0] = r.next();
  uint64_t uniforms[4];
  for (unsigned k = 0; k < 4; k++) uniforms[k] = randomBits(r, k % 2 ? Type::F32 : Type::I32);
  start.tables[ir::kTableDraw] = {reinterpret_cast<const std::byte*>(uniforms), sizeof uniforms};
  for (Value v = 1; v < f.insts.size(); v++)
    if (f.insts[v].op == Op::Input)
      for (unsigned lane = 0; lane < kMaxLanes; lane++) start.inputs[f.insts[v].imm].set(f.insts[v].type, lane, randomBits(r, f.insts[v].type));

  Type outputTypes[kOutputs];
  for (Value v = 1; v < f.insts.size(); v++)
    if (f.insts[v].op == Op::Output) outputTypes[f.insts[v].imm] = f.type(f.operands(v)[0]);

  Reference reference(f, start, uniforms);
  std::vector<std::array<uint64_t, kOutputs>> want(lanes);
  for (uint32_t lane = 0; lane < lanes; lane++)
    if (start.active[lane / 64] >> (lane % 64) & 1) reference(lane, want[lane].data());

  if (optimise) {
    // The oracle has results of its own, but the same on every target.
    std::vector<Row> first;
    for (const Target& target : availableTargets()) {
      RowRun run = start;
      run(g, target, {ir::Numerics::Oracle});
      if (first.empty()) first = run.outputs;
      for (uint32_t lane = 0; lane < lanes; lane++)
        for (unsigned k = 0; k < kOutputs && (start.active[lane / 64] >> (lane % 64) & 1); k++)
          ASSERT_EQ(run.outputs[k].get(outputTypes[k], lane), first[k].get(outputTypes[k], lane)) << target.name << " oracle, seed " << seed << "\n" << ir::print(g);
    }
  }
  for (const Target& target : availableTargets()) {
    RowRun run = start;
    run(g, target);
    for (uint32_t lane = 0; lane < lanes; lane++) {
      if (!(start.active[lane / 64] >> (lane % 64) & 1)) continue;
      for (unsigned k = 0; k < kOutputs; k++)
        ASSERT_EQ(run.outputs[k].get(outputTypes[k], lane), want[lane][k])
            << target.name << " seed " << seed << " lane " << lane << " output " << k << (optimise ? " (optimised)\n" : "\n") << ir::print(g);
    }
  }
}

TEST(RandomPrograms, giveTheBitsOfTheOneLaneReferenceOnEveryTarget) {
  for (uint64_t seed = 1; seed <= 700 && !testing::Test::HasFailure(); seed++) check(seed, false);
}

TEST(RandomPrograms, giveTheSameBitsAfterThePasses) {
  for (uint64_t seed = 5001; seed <= 5500 && !testing::Test::HasFailure(); seed++) check(seed, true);
}

}  // namespace
}  // namespace pumice::interp
