#include "spirv_interp/jit/vector_assembler.h"

#include <array>

#include "spirv_interp/jit/plan.h"
#include "spirv_interp/jit/scalar.h"

namespace pumice::jit {
namespace {

namespace x86 = asmjit::x86;
namespace I = x86::Inst;
using asmjit::Error, asmjit::InstId, asmjit::Operand, asmjit::Operand_;

//! How an instruction is written when a register above ymm15 stands in it.
enum class Form : uint8_t {
  Same,       //!< has an EVEX form of the same name
  Renamed,
  Compare,    //!< gives a mask register, which becomes a vector again
  Blend,      //!< is one vpternlogd, for low registers too: whole elements are ones or zeros
  Bits,       //!< moves signs to a general register, by way of a mask register
  Test,       //!< sets the zero flag only
  Gather,     //!< takes its mask from a mask register
  Halves,     //!< of two vectors, by a constant
  Low,        //!< has none: kLowScratch stands for the result
};
struct Rule {
  Form form = Form::Same;
  bool wide = false;         //!< elements of 64 bits
  uint16_t id = 0;           //!< of Renamed
};
struct Row {
  InstId from;
  Rule rule;
};
constexpr Row kRows[] = {
    {I::kIdVpand, {Form::Renamed, false, I::kIdVpandd}},
    {I::kIdVpandn, {Form::Renamed, false, I::kIdVpandnd}},
    {I::kIdVpor, {Form::Renamed, false, I::kIdVpord}},
    {I::kIdVpxor, {Form::Renamed, false, I::kIdVpxord}},
    {I::kIdVextracti128, {Form::Renamed, false, I::kIdVextracti32x4}},
    {I::kIdVextractf128, {Form::Renamed, false, I::kIdVextractf32x4}},
    {I::kIdVinserti128, {Form::Renamed, false, I::kIdVinserti32x4}},
    {I::kIdVinsertf128, {Form::Renamed, false, I::kIdVinsertf32x4}},
    {I::kIdVroundps, {Form::Renamed, false, I::kIdVrndscaleps}},   // the same constants: no scale
    {I::kIdVroundpd, {Form::Renamed, true, I::kIdVrndscalepd}},
    {I::kIdVcmpps, {Form::Compare, false}},
    {I::kIdVcmppd, {Form::Compare, true}},
    {I::kIdVpcmpeqd, {Form::Compare, false}},
    {I::kIdVpcmpeqq, {Form::Compare, true}},
    {I::kIdVpcmpgtd, {Form::Compare, false}},
    {I::kIdVpcmpgtq, {Form::Compare, true}},
    {I::kIdVblendvps, {Form::Blend, false}},
    {I::kIdVblendvpd, {Form::Blend, true}},
    {I::kIdVmovmskps, {Form::Bits, false}},
    {I::kIdVmovmskpd, {Form::Bits, true}},
    {I::kIdVptest, {Form::Test, false}},
    {I::kIdVgatherdps, {Form::Gather, false}},
    {I::kIdVgatherqps, {Form::Gather, false}},
    {I::kIdVgatherdpd, {Form::Gather, true}},
    {I::kIdVgatherqpd, {Form::Gather, true}},
    {I::kIdVblendps, {Form::Halves, false}},
    {I::kIdVpblendd, {Form::Low, false}},
};
constexpr auto kRules = [] {
  std::array<Rule, I::_kIdCount> rules{};
  for (const Row& r : kRows) rules[r.from] = r.rule;
  return rules;
}();

constexpr x86::Ymm kLow = x86::Ymm(kLowScratch);
constexpr Operand kNoMore[3];

bool high(const Operand_& o) {
  if (o.isReg()) return o.as<x86::Reg>().isVec() && o.id() >= 16;
  return o.isMem() && o.as<x86::Mem>().hasIndexReg() && o.as<x86::Mem>().indexId() >= 16;
}

}  // namespace

[[gnu::always_inline]] inline bool VectorAssembler::write(InstId id, const Operand_& o0, const Operand_& o1, const Operand_& o2, const Operand_& o3) {
  if (!direct_ || remainingSpace() < kVexBytes) return false;
  const VexRow& vector = kVexRows[id];
  uint8_t* end;
  if (vector.form != VexForm::None) {
    end = writeVex(_bufferPtr, vector, o0, o1, o2, o3);
  } else {
    const ScalarRow& scalar = kScalarRows[id];
    if (scalar.form == ScalarForm::None || instOptions() != asmjit::InstOptions::kNone) return false;   // lock
    end = writeScalar(_bufferPtr, scalar, o0, o1, o2);
  }
  if (!end) return false;
  wrote(end);
  return true;
}

bool VectorAssembler::direct(InstId id, const Operand_& o0, const Operand_& o1, const Operand_& o2, const Operand_& o3) { return write(id, o0, o1, o2, o3); }

Error VectorAssembler::_emit(InstId id, const Operand_& o0, const Operand_& o1, const Operand_& o2, const Operand_* more) {
  if (write(id, o0, o1, o2, more[0])) return asmjit::kErrorOk;
  const Rule rule = evex_ ? kRules[id & 0xffff] : Rule{};
  const auto plain = [&](InstId which, const Operand_& a, const Operand_& b, const Operand_& c = kNoMore[0], const Operand_* d = kNoMore) {
    return Assembler::_emit(which, a, b, c, d);
  };
  if (rule.form == Form::Same || (rule.form != Form::Blend && !high(o0) && !high(o1) && !high(o2))) return plain(id, o0, o1, o2, more);
  const x86::KReg mask = x86::k1;
  const InstId toMask = rule.wide ? I::kIdVpmovq2m : I::kIdVpmovd2m;
  Error e;
  switch (rule.form) {
    case Form::Renamed: return plain(rule.id, o0, o1, o2, more);
    case Form::Compare:
      if (!high(o1) && !high(o2)) break;
      if ((e = plain(id, mask, o1, o2, more))) return e;
      return plain(rule.wide ? I::kIdVpmovm2q : I::kIdVpmovm2d, o0, mask);
    case Form::Blend: {
      // (to, no, yes, mask). The constant's bit 4a + 2b + c is the result for the bits of the three operands; only the last
      // may be in memory.
      const Operand_ &no = o1, &yes = o2, &by = more[0];
      const auto is = [&](const Operand_& o) { return o.isReg() && o.id() == o0.id(); };
      const auto logic = [&](const Operand_& b, const Operand_& c, uint32_t table) {
        const Operand_ constant[3] = {asmjit::imm(table), kNoMore[0], kNoMore[0]};
        return plain(I::kIdVpternlogd, o0, b, c, constant);
      };
      if (is(no)) return logic(by, yes, 0xb8);
      if (is(yes)) return logic(by, no, 0xe2);
      if (!is(by) && (e = plain(I::kIdVmovaps, o0, by))) return e;
      return logic(no, yes, 0xac);
    }
    case Form::Bits:
      if ((e = plain(toMask, mask, o1))) return e;
      return plain(I::kIdKmovb, o0, mask);
    case Form::Test:
      if ((e = plain(I::kIdVptestmd, mask, o0, o1))) return e;
      return plain(I::kIdKortestb, mask, mask);
    case Form::Gather:
      if ((e = plain(toMask, mask, o2))) return e;
      setExtraReg(mask);
      return plain(id, o0, o1);
    case Form::Halves: {
      const Operand_ constant[3] = {asmjit::imm(2), kNoMore[0], kNoMore[0]};   // low of the first, high of the second
      if (!more[0].isImm() || more[0].as<asmjit::Imm>().value() != 0xf0) return reportError(asmjit::kErrorInvalidInstruction);
      return plain(I::kIdVshuff32x4, o0, o1, o2, constant);
    }
    default: break;
  }
  // The result alone may be high.
  if ((e = plain(id, kLow, o1, o2, more))) return e;
  return plain(I::kIdVmovaps, o0, kLow);
}

}  // namespace pumice::jit
