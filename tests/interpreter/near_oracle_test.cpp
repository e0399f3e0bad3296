// Random float programs without decisions: f32 is as near to the oracle as an error bound that is carried along says.
#include "fixture.h"
#include "spirv_interp/ir/builder.h"
#include "tests/support/choices.h"

namespace pumice::interp {
namespace {

constexpr unsigned kInputs = 8, kOperations = 32;
constexpr double kUnit = 0x1p-24, kTiny = 0x1p-148;

struct Step {
  Op op;
  unsigned a, b, c;   // numbers of earlier values, inputs first
};

//! Bound of |f32 - exact| for a result r of operands x with bounds e. Not finite: nothing can be said.
double bound(Op op, double r, const double* x, const double* e) {
  const double rounding = std::fabs(r) * kUnit * 1.01 + kTiny;
  // Functions are good to a few units in the last place (docs/ulp.md), relative to the larger of result and 2^-20 for those that cross zero.
  const double function = std::fabs(r) * kUnit * 10 + 0x1p-40;
  switch (op) {
    case Op::FAdd:
    case Op::FSub: return e[0] + e[1] + rounding;
    case Op::FMul: return std::fabs(x[0]) * e[1] + std::fabs(x[1]) * e[0] + e[0] * e[1] + rounding;
    case Op::Fma: return std::fabs(x[0]) * e[1] + std::fabs(x[1]) * e[0] + e[0] * e[1] + e[2] + rounding;
    case Op::FDiv: return std::fabs(x[1]) > e[1] ? (e[0] + std::fabs(r) * e[1]) / (std::fabs(x[1]) - e[1]) * 1.01 + rounding : INFINITY;
    case Op::FNeg:
    case Op::FAbs: return e[0];
    case Op::FMin:
    case Op::FMax: return std::max(e[0], e[1]);
    case Op::FSqrt: return x[0] > e[0] ? e[0] / (2 * std::sqrt(x[0] - e[0])) + rounding : INFINITY;
    case Op::FExp2: return e[0] < 1 ? std::fabs(r) * e[0] * 1.5 + function : INFINITY;
    case Op::FLog2: return x[0] > 2 * e[0] ? e[0] / (x[0] - e[0]) * 1.5 + function + 0x1p-23 : INFINITY;
    case Op::FSin:
    case Op::FCos: return std::fabs(x[0]) < 1000 ? e[0] + function + 0x1p-22 : INFINITY;
    case Op::FTanh:
    case Op::FAtan: return e[0] + function + 0x1p-23;
    default: return INFINITY;
  }
}

TEST(NearOracle, f32KeepsWithinTheErrorThatItsStepsMayMake) {
  static constexpr Op kOps[] = {Op::FAdd, Op::FSub, Op::FMul, Op::Fma, Op::FDiv, Op::FNeg, Op::FAbs, Op::FMin, Op::FMax,
                                Op::FSqrt, Op::FExp2, Op::FLog2, Op::FSin, Op::FCos, Op::FTanh, Op::FAtan, Op::FAdd, Op::FMul, Op::Fma};
  uint64_t checked = 0, sharp = 0, values = 0, differ = 0;
  for (uint64_t seed = 1; seed <= 300 && !HasFailure(); seed++) {
    testing::Choices r(seed);
    Function f;
    ir::Builder b(f);
    std::vector<Value> list;
    for (unsigned k = 0; k < kInputs; k++) list.push_back(b.input(Type::F32, k));
    std::vector<Step> steps;
    for (unsigned k = 0; k < kOperations; k++) {
      auto one = [&] { return r.chance(60) ? uint32_t(list.size()) - 1 - r.below(std::min<uint32_t>(6, uint32_t(list.size()))) : r.below(uint32_t(list.size())); };
      const Step s{r.of(kOps), one(), one(), one()};
      const unsigned count = ir::opInfo(s.op).operandCount;
      const Value v[] = {list[s.a], list[s.b], list[s.c]};
      list.push_back(b.emit(s.op, Type::F32, std::span<const Value>(v, count)));
      steps.push_back(s);
      b.output(k, list.back());
    }
    ASSERT_EQ(ir::verify(f), "");
    RowRun plain(kInputs, kOperations), oracle(kInputs, kOperations);
    for (unsigned k = 0; k < kInputs; k++)
      for (unsigned lane = 0; lane < kMaxLanes; lane++) {
        const uint64_t bits = testing::calmBits(r, Type::F32);
        plain.inputs[k].set(Type::F32, lane, bits);
        oracle.inputs[k].set(Type::F32, lane, bits);
      }
    plain(f);
    oracle(f, defaultTarget(), {ir::Numerics::Oracle, {}});
    for (unsigned lane = 0; lane < kMaxLanes; lane++) {
      std::vector<double> x, e;
      for (unsigned k = 0; k < kInputs; k++) {
        x.push_back(ir::floatValue(Type::F32, plain.inputs[k].get(Type::F32, lane)));
        e.push_back(0);
      }
      for (unsigned k = 0; k < kOperations; k++) {
        const Step& s = steps[k];
        const double got = ir::floatValue(Type::F32, plain.outputs[k].get(Type::F32, lane));
        const double exact = ir::floatValue(Type::F32, oracle.outputs[k].get(Type::F32, lane));
        const double operands[] = {x[s.a], x[s.b], x[s.c]}, errors[] = {e[s.a], e[s.b], e[s.c]};
        const double most = bound(s.op, got, operands, errors);
        x.push_back(got);
        e.push_back(std::isfinite(got) && most < 1e30 ? most : INFINITY);
        values++;
        if (!std::isfinite(e.back())) continue;
        checked++;
        sharp += most <= std::fabs(got) * 1e-4;
        differ += got != exact;
        // The oracle's output is itself rounded to f32.
        ASSERT_LE(std::fabs(got - exact), most + std::fabs(exact) * kUnit) << "seed " << seed << ", lane " << lane << ", value " << k << " (" << ir::opInfo(s.op).text
                                                                         << "): " << got << ", not " << exact << "\n" << ir::print(f);
      }
    }
  }
  // The bounds say something, and there is something to say.
  EXPECT_GT(checked, values / 2);
  EXPECT_GT(sharp, checked / 2);
  EXPECT_GT(differ, checked / 20);
}

}  // namespace
}  // namespace pumice::interp
