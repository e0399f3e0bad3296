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
    const UniformBank bank = e.preamble(tables);
    e.run(bank, c);
  }
};

//! xorshift: the same numbers everywhere.
struct Random {
  uint64_t state;
  explicit Random(uint64_t seed) : state(seed * 0x9e3779b97f4a7c15u + 1) {}
  uint64_t next() {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return state * 0x2545f4914f6cdd1du;
  }
  uint32_t below(uint32_t n) { return uint32_t((next() >> 32) * n >> 32); }
  bool chance(uint32_t percent) { return below(100) < percent; }
};

//! Bits of a type, the awkward ones often.
inline uint64_t randomBits(Random& r, Type t) {
  static constexpr float kFloats[] = {0.0f, -0.0f, 1.0f, -1.0f, 0.5f, -0.5f, 1.5f, 2.5f, -2.5f, 3.0f, 0.99999994f, 1e-40f, -1e-45f, 1.17549435e-38f,
                                      3.4028235e38f, -3.4028235e38f, 2147483648.0f, -2147483648.0f, 2147483520.0f, 4294967296.0f, 4294967040.0f,
                                      8388608.5f, 16777216.0f, 65504.0f, 65519.9f, 65520.0f, 6e-8f, 2.9802322e-8f, 9.2233720e18f, 1.8446744e19f, -9.2233720e18f,
                                      255.5f, -128.9f, 127.5f, 32767.9f};
  const uint64_t raw = r.next() & ir::allOnes(t);
  if (t == Type::Mask) return raw & 1;
  if (ir::isFloat(t)) {
    switch (r.below(8)) {
      case 0: return ir::floatBits(t, kFloats[r.below(std::size(kFloats))]);
      case 1: return ir::floatBits(t, r.chance(50) ? INFINITY : -INFINITY);
      case 2: return r.chance(30) ? ir::floatBits(t, NAN) | (r.next() & 0xff) : raw;
      case 3:
      case 4: return ir::floatBits(t, double(int64_t(raw & 0xffff) - 32768) / 256);
      case 5: return ir::floatBits(t, double(int32_t(raw)));
      default: return raw;
    }
  }
  switch (r.below(6)) {
    case 0: return r.below(4) & ir::allOnes(t);
    case 1: return uint64_t(-int64_t(r.below(4))) & ir::allOnes(t);
    case 2: return (uint64_t(1) << (r.below(ir::typeBytes(t) * 8))) & ir::allOnes(t);
    case 3: return (ir::allOnes(t) >> 1) + r.below(3);
    case 4: return r.below(256);
    default: return raw;
  }
}

constexpr Type kDataTypes[] = {Type::I8, Type::I16, Type::I32, Type::I64, Type::F16, Type::F32, Type::F64};

}  // namespace pumice::interp
