#include "spirv_interp/jit/scalar.h"

namespace pumice::jit {
namespace {

namespace x86 = asmjit::x86;
namespace I = x86::Inst;
using asmjit::Operand_;
using enum ScalarForm;

struct Row {
  uint32_t id;
  ScalarRow code;
};
constexpr Row kRows[] = {
    {I::kIdAdd, {Alu, 0x01, 0}},
    {I::kIdOr, {Alu, 0x09, 1}},
    {I::kIdAnd, {Alu, 0x21, 4}},
    {I::kIdSub, {Alu, 0x29, 5}},
    {I::kIdXor, {Alu, 0x31, 6}},
    {I::kIdCmp, {Alu, 0x39, 7}},
    {I::kIdMov, {Mov, 0x89}},
    {I::kIdShl, {Shift, 0xc1, 4}},
    {I::kIdShr, {Shift, 0xc1, 5}},
    {I::kIdSar, {Shift, 0xc1, 7}},
    {I::kIdTest, {Test, 0x85}},
    {I::kIdPush, {Stack, 0x50}},
    {I::kIdPop, {Stack, 0x58}},
    {I::kIdTzcnt, {Load, 0xbc, 0, 0xf3}},
    {I::kIdCmova, {Load, 0x47}},
    {I::kIdLea, {Address, 0x8d}},
    {I::kIdImul, {Multiply, 0xaf}},
};

using vex::isGpd, vex::isGpq;
bool isGp(const Operand_& o) { return isGpd(o) || isGpq(o); }
int64_t constant(const Operand_& o) { return o.as<asmjit::Imm>().value(); }

//! `tailBytes` of `tail` at the end; `r`: ModRM.reg; rm: a register or an address.
uint8_t* encode(uint8_t* at, uint8_t prefix, bool wide, bool escape, uint8_t opcode, uint32_t r, const Operand_& rm, uint32_t tail, uint32_t tailBytes) {
  const bool memory = rm.isMem();
  uint32_t base = rm.id(), index = kNoIndex;
  uint64_t rest = (r & 7) << 3;
  uint32_t restBits = 8;
  if (memory) {
    const x86::Mem& m = rm.as<x86::Mem>();
    base = m.baseId();
    if (m.hasIndex()) index = m.indexId();
    restBits = addressBytes(rest, base, index, m.shift(), m.offsetLo32());
  } else {
    rest |= 0xc0 | (base & 7);
  }
  if (prefix) *at++ = prefix;
  const uint32_t rex = uint32_t(wide) << 3 | (r & 8) >> 1 | (index & 8) >> 2 | base >> 3;
  if (rex) *at++ = uint8_t(0x40 | rex);
  if (escape) *at++ = 0x0f;
  *at++ = opcode;
  std::memcpy(at, &rest, sizeof rest);
  at += restBits / 8;
  std::memcpy(at, &tail, sizeof tail);
  return at + tailBytes;
}

}  // namespace

constinit const std::array<ScalarRow, I::_kIdCount> kScalarRows = [] {
  std::array<ScalarRow, I::_kIdCount> rows{};
  for (const auto& [id, code] : kRows) rows[id] = code;
  return rows;
}();

uint8_t* writeScalar(uint8_t* at, const ScalarRow& row, const Operand_& o0, const Operand_& o1, const Operand_& o2) {
  const bool wide = isGpq(o0);
  if (row.form == Stack) {
    if (!wide || !o1.isNone()) return nullptr;
    if (o0.id() & 8) *at++ = 0x41;
    *at++ = uint8_t(row.opcode + (o0.id() & 7));
    return at;
  }
  const bool toMemory = o0.isMem();
  if (toMemory ? !vex::isAddress(o0) : !isGp(o0)) return nullptr;
  const auto rm = [&](const Operand_& o) { return o.isMem() ? vex::isAddress(o) : o.signature().bits() == o0.signature().bits(); };
  if (!o2.isNone()) {
    if (row.form != Multiply || toMemory || o1.isMem() || !rm(o1) || !o2.isImm()) return nullptr;
    const int64_t c = constant(o2);
    if (c != int32_t(c)) return nullptr;
    const bool small = c == int8_t(c);
    return encode(at, 0, wide, false, small ? 0x6b : 0x69, o0.id(), o1, uint32_t(c), small ? 1 : 4);
  }
  switch (row.form) {
    case Alu:
      if (o1.isImm()) {
        const int64_t c = constant(o1);
        const uint32_t bytes = toMemory ? o0.as<x86::Mem>().size() : wide ? 8 : 4;
        if (c != int8_t(c) || (bytes != 4 && bytes != 8)) return nullptr;   // the others have several encodings
        return encode(at, 0, bytes == 8, false, 0x83, row.digit, o0, uint32_t(c), 1);
      }
      [[fallthrough]];
    case Mov:
      if (toMemory) {
        if (!isGp(o1)) return nullptr;
        return encode(at, 0, isGpq(o1), false, row.opcode, o1.id(), o0, 0, 0);
      }
      if (o1.isMem()) return rm(o1) ? encode(at, 0, wide, false, row.opcode + 2, o0.id(), o1, 0, 0) : nullptr;
      if (o1.isImm()) {
        const int64_t c = constant(o1);
        if (wide || c != uint32_t(c)) return nullptr;
        if (o0.id() & 8) *at++ = 0x41;
        *at++ = uint8_t(0xb8 + (o0.id() & 7));
        const uint32_t bits = uint32_t(c);
        std::memcpy(at, &bits, sizeof bits);
        return at + sizeof bits;
      }
      return rm(o1) ? encode(at, 0, wide, false, row.opcode, o1.id(), o0, 0, 0) : nullptr;
    case Shift: {
      if (toMemory || !o1.isImm()) return nullptr;
      const uint8_t count = uint8_t(constant(o1));
      if (count < 2) return nullptr;
      return encode(at, 0, wide, false, row.opcode, row.digit, o0, count, 1);
    }
    case Test: return !toMemory && !o1.isMem() && rm(o1) ? encode(at, 0, wide, false, row.opcode, o1.id(), o0, 0, 0) : nullptr;
    case Multiply:
    case Load: return !toMemory && rm(o1) ? encode(at, row.prefix, wide, true, row.opcode, o0.id(), o1, 0, 0) : nullptr;
    case Address: return !toMemory && o1.isMem() && rm(o1) ? encode(at, 0, wide, false, row.opcode, o0.id(), o1, 0, 0) : nullptr;
    default: return nullptr;
  }
}

}  // namespace pumice::jit
