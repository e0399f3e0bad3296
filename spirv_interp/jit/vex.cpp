#include "spirv_interp/jit/vex.h"

namespace pumice::jit {
namespace {

namespace I = asmjit::x86::Inst;
using enum VexForm;

struct Code {
  VexForm form;
  uint8_t map;      //!< 1: 0f, 2: 0f 38, 3: 0f 3a
  uint8_t prefix;   //!< 0: none, 1: 66, 2: f3, 3: f2
  bool w;
  uint8_t opcode, store = 0;
};
struct Row {
  uint32_t id;
  Code code;
};
constexpr Row kRows[] = {
    // --- 0f: floats
    {I::kIdVmovups, {Move, 1, 0, false, 0x10, 0x11}},
    {I::kIdVmovaps, {Move, 1, 0, false, 0x28, 0x29}},
    {I::kIdVsqrtps, {Rm, 1, 0, false, 0x51}},
    {I::kIdVsqrtpd, {Rm, 1, 1, false, 0x51}},
    {I::kIdVandps, {Rvm, 1, 0, false, 0x54}},
    {I::kIdVandnps, {Rvm, 1, 0, false, 0x55}},
    {I::kIdVorps, {Rvm, 1, 0, false, 0x56}},
    {I::kIdVxorps, {Rvm, 1, 0, false, 0x57}},
    {I::kIdVaddps, {Rvm, 1, 0, false, 0x58}},
    {I::kIdVaddpd, {Rvm, 1, 1, false, 0x58}},
    {I::kIdVmulps, {Rvm, 1, 0, false, 0x59}},
    {I::kIdVmulpd, {Rvm, 1, 1, false, 0x59}},
    {I::kIdVcvtdq2ps, {Rm, 1, 0, false, 0x5b}},
    {I::kIdVcvtps2dq, {Rm, 1, 1, false, 0x5b}},
    {I::kIdVcvttps2dq, {Rm, 1, 2, false, 0x5b}},
    {I::kIdVsubps, {Rvm, 1, 0, false, 0x5c}},
    {I::kIdVsubpd, {Rvm, 1, 1, false, 0x5c}},
    {I::kIdVminps, {Rvm, 1, 0, false, 0x5d}},
    {I::kIdVminpd, {Rvm, 1, 1, false, 0x5d}},
    {I::kIdVdivps, {Rvm, 1, 0, false, 0x5e}},
    {I::kIdVdivpd, {Rvm, 1, 1, false, 0x5e}},
    {I::kIdVmaxps, {Rvm, 1, 0, false, 0x5f}},
    {I::kIdVmaxpd, {Rvm, 1, 1, false, 0x5f}},
    {I::kIdVcmpps, {RvmImm, 1, 0, false, 0xc2}},
    {I::kIdVcmppd, {RvmImm, 1, 1, false, 0xc2}},
    {I::kIdVshufps, {RvmImm, 1, 0, false, 0xc6}},
    // --- 0f: integers
    {I::kIdVpcmpgtd, {Rvm, 1, 1, false, 0x66}},
    {I::kIdVpshufd, {RmImm, 1, 1, false, 0x70}},
    {I::kIdVpsrld, {Shift, 1, 1, false, 0x72, 2}},
    {I::kIdVpsrad, {Shift, 1, 1, false, 0x72, 4}},
    {I::kIdVpslld, {Shift, 1, 1, false, 0x72, 6}},
    {I::kIdVpsrlq, {Shift, 1, 1, false, 0x73, 2}},
    {I::kIdVpsllq, {Shift, 1, 1, false, 0x73, 6}},
    {I::kIdVpcmpeqd, {Rvm, 1, 1, false, 0x76}},
    {I::kIdVpaddq, {Rvm, 1, 1, false, 0xd4}},
    {I::kIdVpand, {Rvm, 1, 1, false, 0xdb}},
    {I::kIdVpandn, {Rvm, 1, 1, false, 0xdf}},
    {I::kIdVpor, {Rvm, 1, 1, false, 0xeb}},
    {I::kIdVpxor, {Rvm, 1, 1, false, 0xef}},
    {I::kIdVpmuludq, {Rvm, 1, 1, false, 0xf4}},
    {I::kIdVpsubd, {Rvm, 1, 1, false, 0xfa}},
    {I::kIdVpsubq, {Rvm, 1, 1, false, 0xfb}},
    {I::kIdVpaddd, {Rvm, 1, 1, false, 0xfe}},
    // --- 0f 38
    {I::kIdVcvtph2ps, {Rm, 2, 1, false, 0x13}},
    {I::kIdVptest, {Rm, 2, 1, false, 0x17}},
    {I::kIdVbroadcastss, {Rm, 2, 1, false, 0x18}},
    {I::kIdVbroadcastsd, {Rm, 2, 1, false, 0x19}},
    {I::kIdVpmovsxdq, {Rm, 2, 1, false, 0x25}},
    {I::kIdVpmuldq, {Rvm, 2, 1, false, 0x28}},
    {I::kIdVpcmpeqq, {Rvm, 2, 1, false, 0x29}},
    {I::kIdVpackusdw, {Rvm, 2, 1, false, 0x2b}},
    {I::kIdVpmovzxbd, {Rm, 2, 1, false, 0x31}},
    {I::kIdVpmovzxwd, {Rm, 2, 1, false, 0x33}},
    {I::kIdVpmovzxdq, {Rm, 2, 1, false, 0x35}},
    {I::kIdVpcmpgtq, {Rvm, 2, 1, false, 0x37}},
    {I::kIdVpminsd, {Rvm, 2, 1, false, 0x39}},
    {I::kIdVpminud, {Rvm, 2, 1, false, 0x3b}},
    {I::kIdVpmaxsd, {Rvm, 2, 1, false, 0x3d}},
    {I::kIdVpmaxud, {Rvm, 2, 1, false, 0x3f}},
    {I::kIdVpmulld, {Rvm, 2, 1, false, 0x40}},
    {I::kIdVpsrlvd, {Rvm, 2, 1, false, 0x45}},
    {I::kIdVpsrlvq, {Rvm, 2, 1, true, 0x45}},
    {I::kIdVpsravd, {Rvm, 2, 1, false, 0x46}},
    {I::kIdVpsllvd, {Rvm, 2, 1, false, 0x47}},
    {I::kIdVpsllvq, {Rvm, 2, 1, true, 0x47}},
    {I::kIdVpbroadcastd, {Rm, 2, 1, false, 0x58}},
    {I::kIdVpbroadcastq, {Rm, 2, 1, false, 0x59}},
#define PUMICE_FMA(name, opcode)                                        \
  {I::kIdV##name##132ps, {Rvm, 2, 1, false, 0x90 + opcode}},            \
      {I::kIdV##name##132pd, {Rvm, 2, 1, true, 0x90 + opcode}},         \
      {I::kIdV##name##213ps, {Rvm, 2, 1, false, 0xa0 + opcode}},        \
      {I::kIdV##name##213pd, {Rvm, 2, 1, true, 0xa0 + opcode}},         \
      {I::kIdV##name##231ps, {Rvm, 2, 1, false, 0xb0 + opcode}},        \
      {I::kIdV##name##231pd, {Rvm, 2, 1, true, 0xb0 + opcode}}
    PUMICE_FMA(fmadd, 8),
    PUMICE_FMA(fmsub, 10),
    PUMICE_FMA(fnmadd, 12),
    PUMICE_FMA(fnmsub, 14),
#undef PUMICE_FMA
    // --- 0f 3a
    {I::kIdVpermq, {RmImm, 3, 1, true, 0x00}},
    {I::kIdVpblendd, {RvmImm, 3, 1, false, 0x02}},
    {I::kIdVpermilps, {RmImm, 3, 1, false, 0x04}},
    {I::kIdVperm2f128, {RvmImm, 3, 1, false, 0x06}},
    {I::kIdVroundps, {RmImm, 3, 1, false, 0x08}},
    {I::kIdVroundpd, {RmImm, 3, 1, false, 0x09}},
    {I::kIdVblendps, {RvmImm, 3, 1, false, 0x0c}},
    {I::kIdVinsertf128, {RvmImm, 3, 1, false, 0x18}},
    {I::kIdVinserti128, {RvmImm, 3, 1, false, 0x38}},
    {I::kIdVblendvps, {RvmReg, 3, 1, false, 0x4a}},
    {I::kIdVblendvpd, {RvmReg, 3, 1, false, 0x4b}},
    // --- parts of vectors, other places
    {I::kIdVunpcklps, {Rvm, 1, 0, false, 0x14}},
    {I::kIdVunpckhps, {Rvm, 1, 0, false, 0x15}},
    {I::kIdVpunpckldq, {Rvm, 1, 1, false, 0x62}},
    {I::kIdVpackuswb, {Rvm, 1, 1, false, 0x67}},
    {I::kIdVpunpckhdq, {Rvm, 1, 1, false, 0x6a}},
    {I::kIdVpunpcklqdq, {Rvm, 1, 1, false, 0x6c}},
    {I::kIdVpunpckhqdq, {Rvm, 1, 1, false, 0x6d}},
    {I::kIdVcvtps2pd, {RmReg, 1, 0, false, 0x5a}},
    {I::kIdVcvtpd2ps, {RmReg, 1, 1, false, 0x5a}},
    {I::kIdVextractf128, {MrImm, 3, 1, false, 0x19}},
    {I::kIdVextracti128, {MrImm, 3, 1, false, 0x39}},
    {I::kIdVpinsrd, {RvmGpImm, 3, 1, false, 0x22}},
    {I::kIdVpinsrq, {RvmGpImm, 3, 1, true, 0x22}},
    {I::kIdVpextrd, {MrGpImm, 3, 1, false, 0x16}},
    {I::kIdVpextrq, {MrGpImm, 3, 1, true, 0x16}},
    {I::kIdVmovmskps, {GpRm, 1, 0, false, 0x50}},
    {I::kIdVmovd, {Carry, 1, 1, false, 0x6e, 0x7e}},
    {I::kIdVmovq, {Carry, 1, 1, true, 0x6e, 0x7e}},
    {I::kIdBlsr, {GpVm, 2, 0, false, 0xf3, 1}},
};

}  // namespace

constinit const std::array<VexRow, I::_kIdCount> kVexRows = [] {
  std::array<VexRow, I::_kIdCount> rows{};
  for (const auto& [id, c] : kRows)
    rows[id] = {c.form, c.opcode, c.store, 0xc4u | (0xe0u | c.map) << 8 | (uint32_t(c.w) << 7 | 0x78u | c.prefix) << 16};
  return rows;
}();

uint8_t* writeVex(uint8_t* at, const VexRow& row, const asmjit::Operand_& o0, const asmjit::Operand_& o1, const asmjit::Operand_& o2,
                  const asmjit::Operand_& o3) {
  using asmjit::Operand_;
  const Operand_ *reg = &o0, *rm = &o1;
  VexRow other;   // where operands choose among encodings
  const VexRow* code = &row;
  uint32_t opcode = row.opcode, v = 0, r;
  uint32_t tail = 0, tailBytes = 0;   // a constant behind all
  bool wide = false;
  const auto constant = [&](const Operand_& o) {
    tail = o.as<asmjit::Imm>().valueAs<uint8_t>();
    tailBytes = 1;
    return o.isImm();
  };
  const auto scalar = [&](const Operand_& o) { return row.head >> 23 & 1 ? vex::isGpq(o) : vex::isGpd(o); };
  switch (row.form) {
    case VexForm::None: return nullptr;
    case VexForm::Rvm:
    case VexForm::RvmImm:
    case VexForm::RvmGpImm:
    case VexForm::RvmReg:
      rm = &o2;
      v = o1.id();
      if (!vex::isLowVector(o1)) return nullptr;
      if (row.form == VexForm::Rvm) {
        if (!o3.isNone()) return nullptr;
      } else if (row.form == VexForm::RvmReg) {
        if (!vex::isLowVector(o3)) return nullptr;
        tail = o3.id() << 4;
        tailBytes = 1;
      } else if (!constant(o3)) {
        return nullptr;
      }
      break;
    case VexForm::Move:
      if (o0.isMem()) {
        reg = &o1, rm = &o0;
        opcode = row.store;
      }
      [[fallthrough]];
    case VexForm::Rm:
    case VexForm::RmReg:
      if (!o2.isNone() || (row.form == VexForm::RmReg && rm->isMem())) return nullptr;
      break;
    case VexForm::Shift:
    case VexForm::RmImm:
      if (!constant(o2) || !o3.isNone()) return nullptr;
      break;
    case VexForm::MrImm:
    case VexForm::MrGpImm:
      reg = &o1, rm = &o0;
      if (!constant(o2) || !o3.isNone()) return nullptr;
      break;
    case VexForm::GpRm:
      if (!vex::isGpd(o0) || !vex::isLowVector(o1) || !o2.isNone()) return nullptr;
      return encodeVex(at, row, opcode, o0.id(), 0, vex::isYmm(o1), false, o1.id(), 0, 0, 0);
    case VexForm::GpVm:
      if (!(vex::isGpd(o0) && vex::isGpd(o1)) || !o2.isNone()) return nullptr;
      return encodeVex(at, row, opcode, row.store, o0.id(), false, false, o1.id(), 0, 0, 0);
    case VexForm::Carry: {
      if (!o2.isNone()) return nullptr;
      const bool store = !vex::isLowVector(o0);
      if (store) reg = &o1, rm = &o0, opcode = row.store;
      if (vex::isYmm(*reg)) return nullptr;
      if (rm->isMem() && row.head >> 23 & 1) {   // vmovq has two more for memory
        other = row;
        other.head ^= store ? 1u << 23 : 1u << 23 | 3u << 16;
        opcode = store ? 0xd6 : 0x7e;
        code = &other;
      } else if (!rm->isMem() && !scalar(*rm)) {
        return nullptr;
      }
      break;
    }
  }
  if (!vex::isLowVector(*reg)) return nullptr;
  r = reg->id();
  wide = vex::isYmm(*reg);
  if (row.form == VexForm::Shift) {
    v = r;
    r = row.store;
  }
  if (rm->isMem()) {
    if (!vex::isAddress(*rm)) return nullptr;
    const auto& m = rm->as<asmjit::x86::Mem>();
    return encodeVex(at, *code, opcode, r, v, wide, true, m.baseId(), m.offsetLo32(), tail, tailBytes, m.hasIndex() ? m.indexId() : kNoIndex, m.shift());
  }
  if (vex::isLowVector(*rm)) {
    if (row.form == VexForm::RvmGpImm || row.form == VexForm::MrGpImm) return nullptr;
    wide |= rm == &o1 && vex::isYmm(*rm);   // of conversions the larger side counts
  } else if (!((row.form == VexForm::RvmGpImm || row.form == VexForm::MrGpImm || row.form == VexForm::Carry) && scalar(*rm))) {
    return nullptr;
  }
  return encodeVex(at, *code, opcode, r, v, wide, false, rm->id(), 0, tail, tailBytes);
}

}  // namespace pumice::jit
