// Runs lane IR functions on the interpreter, for tests: rows of bits in, rows of bits out.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "base/fpenv.h"
#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/ir.h"
#include "tests/support/choices.h"

namespace pumice::interp {

using ir::Function, ir::Inst, ir::Op, ir::Type, ir::Value;

//! Memory of one row, as callers must allocate it. Masks: 16 bytes of bits.
struct Row {
  alignas(64) std::byte bytes[kMaxLanes * 8] = {};
  uint64_t get(Type t, unsigned lane) const {
    if (t == Type::Mask) return uint64_t(bytes[lane / 8]) >> (lane % 8) & 1;
    uint64_t v = 0;
    std::memcpy(&v, bytes + lane * ir::typeBytes(t), ir::typeBytes(t));
    return v;
  }
  void set(Type t, unsigned lane, uint64_t v) {
    if (t == Type::Mask) {
      auto& b = bytes[lane / 8];
      b = (b & ~(std::byte(1) << (lane % 8))) | std::byte(v & 1) << (lane % 8);
    } else {
      std::memcpy(bytes + lane * ir::typeBytes(t), &v, ir::typeBytes(t));
    }
  }
};

inline Function parsed(std::string_view text) {
  Function f;
  std::string error;
  const bool ok = ir::parse(text, f, error);
  if (ok) error = ir::verify(f);
  EXPECT_EQ(error, "");
  return ok && error.empty() ? f : Function{};
}

//! Appends an instruction as it is, without folding.
inline Value append(Function& f, Op op, Type type, std::initializer_list<Value> operands, uint64_t imm = 0) {
  Inst i;
  i.op = op;
  i.type = type;
  i.imm = imm;
  i.firstOperand = uint32_t(f.operandPool.size());
  i.operandCount = uint32_t(operands.size());
  f.operandPool.insert(f.operandPool.end(), operands);
  f.insts.push_back(i);
  return Value(f.insts.size() - 1);
}

struct RowRun {
  uint32_t lanes = kMaxLanes;
  uint64_t active[kMaxLanes / 64] = {~uint64_t(0), ~uint64_t(0)};
  std::vector<Row> inputs, outputs;
  Table tables[ir::kTableCount] = {};
  std::vector<const std::byte*> quads;
  std::vector<TilePlane> planes;
  std::vector<std::byte> shared;

  explicit RowRun(size_t inputCount = 0, size_t outputCount = 0) : inputs(inputCount), outputs(outputCount) {}

  void operator()(const Function& f, const Target& target = defaultTarget(), const CompileOptions& options = {}) {
    auto compiled = compileInterpreterFor(f, options, target);
    ASSERT_TRUE(compiled) << compiled.error().message;
    execute(**compiled);
  }
  void execute(const Executable& e) {
    withContext([&](const ExecContext& c) { e.run(e.preamble(tables), c); });
  }
  //! Calls `use` with what an executor is handed for this row.
  template <class F>
  void withContext(F use) {
    base::ScopedFpEnv environment;
    std::vector<const void*> in;
    std::vector<void*> out;
    for (const Row& r : inputs) in.push_back(r.bytes);
    for (Row& r : outputs) out.push_back(r.bytes);
    ExecContext c;
    c.lanes = lanes;
    std::memcpy(c.active, active, sizeof active);
    c.inputs = in.data();
    c.outputs = out.data();
    c.tables = tables;
    c.quadRecords = quads.data();
    c.tilePlanes = planes.data();
    c.shared = shared.data();
    c.sharedBytes = shared.size();
    use(std::as_const(c));
  }
};

using Random = pumice::testing::Choices;
using pumice::testing::awkwardBits;

constexpr Type kDataTypes[] = {Type::I8, Type::I16, Type::I32, Type::I64, Type::F16, Type::F32, Type::F64};

}  // namespace pumice::interp
