// Runs a small lane IR function over many values in the interpreter.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <vector>

#include "spirv_interp/interpreter/executor.h"
#include "spirv_interp/ir/builder.h"
#include "texture/builders.h"

namespace pumice::texture {

// Inputs and outputs are rows of 32-bit words.
class IrProgram {
 public:
  IrProgram(uint32_t inputs, uint32_t outputs, const std::function<void(ir::Builder&)>& build) : inputs_(inputs), outputs_(outputs) {
    ir::Function f;
    ir::Builder b(f);
    build(b);
    std::string problem = ir::verify(f);
    EXPECT_EQ(problem, "") << ir::print(f);
    if (!problem.empty()) return;
    auto compiled = interp::compileInterpreter(f, {});
    EXPECT_TRUE(compiled) << (compiled ? "" : compiled.error().message);
    if (compiled) executable_ = std::move(compiled).value();
    ConstantTable constants = constantTable();
    tables_[ir::kTableConstants] = {constants.data, constants.size};
  }

  explicit operator bool() const { return executable_ != nullptr; }
  void setTable(uint32_t table, const void* data, size_t size) { tables_[table] = {static_cast<const std::byte*>(data), size}; }

  // in[i][n]: word n of input i. The result has the same shape.
  std::vector<std::vector<uint32_t>> run(const std::vector<std::vector<uint32_t>>& in) {
    size_t count = in.empty() ? 1 : in[0].size();
    std::vector<std::vector<uint32_t>> out(outputs_, std::vector<uint32_t>(count));
    std::vector<Row> rows(inputs_ + outputs_);
    std::vector<const void*> inputRows;
    std::vector<void*> outputRows;
    for (uint32_t i = 0; i < inputs_; ++i) inputRows.push_back(rows[i].data());
    for (uint32_t i = 0; i < outputs_; ++i) outputRows.push_back(rows[inputs_ + i].data());
    interp::UniformBank bank = executable_->preamble(tables_.data());
    for (size_t at = 0; at < count; at += interp::kMaxLanes) {
      size_t lanes = std::min<size_t>(interp::kMaxLanes, count - at);
      interp::ExecContext context;
      context.lanes = uint32_t((lanes + 3) & ~size_t(3));
      for (size_t l = 0; l < lanes; ++l) context.active[l / 64] |= uint64_t(1) << (l % 64);
      for (uint32_t i = 0; i < inputs_; ++i) std::memcpy(rows[i].data(), in[i].data() + at, lanes * 4);
      context.inputs = inputRows.data();
      context.outputs = outputRows.data();
      context.tables = tables_.data();
      executable_->run(bank, context);
      for (uint32_t i = 0; i < outputs_; ++i) std::memcpy(out[i].data() + at, rows[inputs_ + i].data(), lanes * 4);
    }
    return out;
  }

 private:
  struct alignas(64) Row : std::array<uint32_t, interp::kMaxLanes> {};
  uint32_t inputs_, outputs_;
  std::unique_ptr<interp::Executable> executable_;
  std::array<interp::Table, ir::kTableCount> tables_{};
};

}  // namespace pumice::texture
