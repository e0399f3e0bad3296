// Instructions that are written directly have the bytes that asmjit gives them.
#include "spirv_interp/jit/vex.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

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
  //! Whether asmjit has such an instruction at all.
  bool compare(uint32_t id, const std::vector<Operand>& operands) {
    const Operand o[4] = {operands[0], operands[1], operands.size() > 2 ? operands[2] : Operand(), operands.size() > 3 ? operands[3] : Operand()};
    a_.setOffset(0);
    const Operand more[3] = {o[3], Operand(), Operand()};
    if (a_._emit(id, o[0], o[1], o[2], more)) return false;
    uint8_t bytes[2 * kVexBytes];
    std::memset(bytes, 0xee, sizeof bytes);
    const uint8_t* end = writeVex(bytes, id, o[0], o[1], o[2], o[3]);
    asmjit::String text;
    asmjit::InstAPI::instIdToString(asmjit::Arch::kX64, id, text);
    EXPECT_NE(end, nullptr) << text.data() << ": not written";
    if (!end) return true;
    const std::string wanted = hex(a_.bufferData(), a_.offset()), got = hex(bytes, size_t(end - bytes));
    EXPECT_EQ(got, wanted) << text.data() << " with " << (o[1].isMem() || o[2].isMem() ? "memory" : "registers");
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
    for (const int32_t offset : {0, 32, -128, 127, 128, -129, 0x12345678}) all.push_back(x86::ptr(base, offset));
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
    const bool imm = form == VexForm::RvmImm || form == VexForm::RmImm || form == VexForm::Shift;
    for (const Operand& d : vectors())
      for (const Operand& m : places()) {
        if (form == VexForm::Shift && m.isMem()) continue;   // EVEX only
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

//! What has another encoding is left to asmjit.
TEST(Vex, leavesOtherFormsAlone) {
  uint8_t bytes[kVexBytes];
  const Operand none, three = asmjit::imm(3);
  const uint32_t add = x86::Inst::kIdVaddps;
  EXPECT_NE(writeVex(bytes, add, x86::ymm0, x86::ymm1, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::ymm16, x86::ymm1, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::ymm0, x86::ymm17, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::ymm0, x86::ymm1, x86::ymm31, none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::zmm0, x86::zmm1, x86::zmm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::ymm0, x86::ymm1, x86::ptr(x86::rax, x86::rcx, 2, 8), none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::ymm0, x86::ymm1, x86::ptr(x86::eax, 8), none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::ymm0, x86::ymm1, x86::ptr(uint64_t(8)), none), nullptr);
  EXPECT_EQ(writeVex(bytes, add, x86::ymm0, x86::ymm1, x86::ymm2, three), nullptr);
  EXPECT_EQ(writeVex(bytes, x86::Inst::kIdVpslld, x86::ymm0, x86::ymm1, x86::xmm2, none), nullptr);   // a count in a register
  EXPECT_EQ(writeVex(bytes, x86::Inst::kIdVpermilps, x86::ymm0, x86::ymm1, x86::ymm2, none), nullptr);
  EXPECT_EQ(writeVex(bytes, x86::Inst::kIdVmovaps, x86::ymm0, x86::rax, none, none), nullptr);
  EXPECT_EQ(writeVex(bytes, x86::Inst::kIdMov, x86::rax, x86::rcx, none, none), nullptr);
}

}  // namespace
}  // namespace pumice::jit
