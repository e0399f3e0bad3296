// Instructions that are written directly have the bytes that asmjit gives them.
#include "spirv_interp/jit/vex.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "spirv_interp/jit/scalar.h"

namespace pumice::jit {
namespace {

namespace x86 = asmjit::x86;
using asmjit::Operand;

std::string hex(const uint8_t* bytes, size_t count) {
  std::string text;
  for (size_t k = 0; k < count; k++) {
    char two[4];
    std::snprintf(two, sizeof two, "%02x ", bytes[k]);
    text += two;
  }
  return text;
}

class Comparison {
 public:
  Comparison() {
    holder_.init(asmjit::Environment::host());
    holder_.attach(&a_);
    a_.addDiagnosticOptions(asmjit::DiagnosticOptions::kValidateAssembler);
  }
  //! Whether asmjit has such an instruction at all. `must`: it has to be written.
  bool compare(uint32_t id, const std::vector<Operand>& operands, bool must = true) {
    const Operand o[4] = {operands[0], operands[1], operands.size() > 2 ? operands[2] : Operand(), operands.size() > 3 ? operands[3] : Operand()};
    a_.setOffset(0);
    const Operand more[3] = {o[3], Operand(), Operand()};
    if (a_._emit(id, o[0], o[1], o[2], more)) return false;
    uint8_t bytes[2 * kVexBytes];
    std::memset(bytes, 0xee, sizeof bytes);
    const VexRow& row = kVexRows[id];
    const uint8_t* end = row.form != VexForm::None ? writeVex(bytes, row, o[0], o[1], o[2], o[3]) : writeScalar(bytes, kScalarRows[id], o[0], o[1], o[2]);
    if (!end && !must) return false;
    if (end && size_t(end - bytes) == a_.offset() && !std::memcmp(bytes, a_.bufferData(), a_.offset())) return true;
    asmjit::String text;
    asmjit::InstAPI::instIdToString(asmjit::Arch::kX64, id, text);
    EXPECT_NE(end, nullptr) << text.data() << ": not written";
    if (!end) return true;
    const std::string wanted = hex(a_.bufferData(), a_.offset()), got = hex(bytes, size_t(end - bytes));
    asmjit::String operandText;
    for (const Operand& x : o)
      if (!x.isNone()) {
        operandText.append(" ");
        asmjit::Formatter::formatOperand(operandText, asmjit::FormatFlags::kNone, &a_, asmjit::Arch::kX64, x);
      }
    EXPECT_EQ(got, wanted) << text.data() << operandText.data();
    return true;
  }

 private:
  asmjit::CodeHolder holder_;
  x86::Assembler a_;
};

std::vector<Operand> vectors() {
  std::vector<Operand> all;
  for (const uint32_t r : {0u, 7u, 8u, 13u, 15u}) {
    all.push_back(x86::ymm(r));
    all.push_back(x86::xmm(r));
  }
  return all;
}
std::vector<Operand> places() {
  std::vector<Operand> all = vectors();
  for (const x86::Gp& base : {x86::rax, x86::rbx, x86::rsp, x86::rbp, x86::r11, x86::r12, x86::r13, x86::r14})
    for (const int32_t offset : {0, 32, -128, 127, 128, -129, 0x12345678}) {
      all.push_back(x86::ptr(base, offset));
      if (offset == 32 || offset == 127 || offset == -128 || base.id() == x86::Gp::kIdBx || base.id() == 11 || base.id() == 14) continue;
      for (const x86::Gp& index : {x86::rbp, x86::r12}) all.push_back(x86::ptr(base, index, uint32_t(offset) & 3, offset));
    }
  return all;
}
std::vector<Operand> scalars(bool addresses, uint32_t bytes) {
  std::vector<Operand> all;
  for (const uint32_t r : {0u, 3u, 4u, 5u, 8u, 12u, 13u, 15u}) {
    if (bytes & 4) all.push_back(x86::gpd(r));
    if (bytes & 8) all.push_back(x86::gpq(r));
  }
  for (const Operand& o : places())
    if (addresses && o.isMem()) {
      all.push_back(o);
      for (const uint32_t size : {4u, 8u})
        if (bytes & size) {
          x86::Mem m = o.as<x86::Mem>();
          m.setSize(size);
          all.push_back(m);
        }
    }
  return all;
}

TEST(Vex, writesWhatAsmjitWrites) {
  Comparison comparison;
  size_t rows = 0;
  for (uint32_t id = 0; id < kVexRows.size(); id++) {
    const VexForm form = kVexRows[id].form;
    if (form == VexForm::None) continue;
    rows++;
    size_t compared = 0;
    if (form > VexForm::RmReg) continue;   // below
    const bool imm = form == VexForm::RvmImm || form == VexForm::RmImm || form == VexForm::Shift;
    for (const Operand& d : vectors())
      for (const Operand& m : places()) {
        if (form == VexForm::Shift && m.isMem()) continue;   // EVEX only
        if (form == VexForm::RmReg && m.isMem()) continue;   // asmjit's
        if (form == VexForm::Rvm || form == VexForm::RvmImm || form == VexForm::RvmReg) {
          for (const Operand& a : vectors()) {
            if (a.signature() != d.signature()) continue;
            std::vector<Operand> operands{d, a, m};
            if (imm) operands.push_back(asmjit::imm(0xa5));
            if (form == VexForm::RvmReg) operands.push_back(vex::isYmm(d) ? Operand(x86::ymm11) : Operand(x86::xmm11));
            compared += comparison.compare(id, operands);
          }
        } else {
          std::vector<Operand> operands{d, m};
          if (imm) operands.push_back(asmjit::imm(0x1b));
          compared += comparison.compare(id, operands);
          if (form == VexForm::Move) compared += comparison.compare(id, {m, d});
        }
        if (HasFailure()) return;
      }
    EXPECT_GT(compared, 40u) << "instruction " << id;
  }
  EXPECT_GT(rows, 80u);
}

TEST(Vex, writesWhatMovesElements) {
  Comparison c;
  size_t compared = 0;
  const auto all = [&](uint32_t id, const std::vector<Operand>& first, const std::vector<Operand>& second, bool must = true) {
    for (const Operand& a : first)
      for (const Operand& b : second)
        if (!HasFailure()) compared += c.compare(id, {a, b}, must);
  };
  const std::vector<Operand> words = scalars(true, 4), longs = scalars(true, 8);
  all(x86::Inst::kIdVmovd, vectors(), words);
  all(x86::Inst::kIdVmovd, words, vectors());
  all(x86::Inst::kIdVmovq, vectors(), longs);
  all(x86::Inst::kIdVmovq, longs, vectors());
  all(x86::Inst::kIdVmovq, vectors(), vectors(), false);
  all(x86::Inst::kIdVmovmskps, scalars(false, 4), vectors());
  all(x86::Inst::kIdBlsr, scalars(false, 4), scalars(false, 4));
  for (const Operand& v : vectors())
    for (const Operand& p : places()) {
      if (HasFailure()) return;
      for (const uint32_t id : {x86::Inst::kIdVextracti128, x86::Inst::kIdVextractf128}) compared += c.compare(id, {p, v, asmjit::imm(1)});
    }
  for (const bool wide : {false, true})
    for (const Operand& m : wide ? longs : words)
      for (const Operand& v : vectors()) {
        if (HasFailure()) return;
        compared += c.compare(wide ? x86::Inst::kIdVpinsrq : x86::Inst::kIdVpinsrd, {v, x86::xmm9, m, asmjit::imm(1)});
        compared += c.compare(wide ? x86::Inst::kIdVpextrq : x86::Inst::kIdVpextrd, {m, v, asmjit::imm(1)});
      }
  EXPECT_GT(compared, 5000u);
}

TEST(Scalar, writesWhatAsmjitWrites) {
  Comparison c;
  size_t compared = 0;
  std::vector<Operand> second = scalars(true, 12);
  for (const int64_t constant : {0ll, 1ll, 2ll, 31ll, 127ll, -1ll, -128ll, 128ll, -129ll, 255ll, 0x7fffffffll, 0x80000000ll, 0xffffffffll, -0x80000000ll, 0x100000000ll, 0x7f0012345678ll})
    second.push_back(asmjit::imm(constant));
  for (uint32_t id = 0; id < kScalarRows.size(); id++) {
    if (kScalarRows[id].form == ScalarForm::None) continue;
    size_t before = compared;
    for (const Operand& a : scalars(true, 12)) {
      if (HasFailure()) return;
      if (kScalarRows[id].form == ScalarForm::Stack) compared += c.compare(id, {a, Operand()}, false);
      else
        for (const Operand& b : second) {
          compared += c.compare(id, {a, b}, false);
          if (kScalarRows[id].form == ScalarForm::Multiply)
            for (const int64_t constant : {1, -1, 127, 128, -129, 0x12345678}) compared += c.compare(id, {a, b, asmjit::imm(constant)}, false);
        }
    }
    EXPECT_GE(compared - before, 8u) << id;
  }
  EXPECT_GT(compared, 10000u);
}

//! What has another encoding is left to asmjit.
TEST(Vex, leavesOtherFormsAlone) {
  uint8_t bytes[kVexBytes];
  const Operand none, three = asmjit::imm(3);
  const uint32_t add = x86::Inst::kIdVaddps;
  EXPECT_NE(writeVex(bytes, kVexRows[add], x86::ymm0, x86::ymm1, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::ymm16, x86::ymm1, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::ymm0, x86::ymm17, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::ymm0, x86::ymm1, x86::ymm31, none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::zmm0, x86::zmm1, x86::zmm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::ymm0, x86::ymm1, x86::ptr(x86::rax, x86::ymm2, 2, 8), none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::ymm0, x86::ymm1, x86::ptr(x86::eax, 8), none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::ymm0, x86::ymm1, x86::ptr(uint64_t(8)), none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[add], x86::ymm0, x86::ymm1, x86::ymm2, three), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[x86::Inst::kIdVpslld], x86::ymm0, x86::ymm1, x86::xmm2, none), nullptr);   // a count in a register
  EXPECT_EQ(writeVex(bytes, kVexRows[x86::Inst::kIdVpermilps], x86::ymm0, x86::ymm1, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[x86::Inst::kIdVmovaps], x86::ymm0, x86::rax, none, none), nullptr);
  EXPECT_EQ(writeVex(bytes, kVexRows[x86::Inst::kIdMov], x86::rax, x86::rcx, none, none), nullptr);
}

}  // namespace
}  // namespace pumice::jit
