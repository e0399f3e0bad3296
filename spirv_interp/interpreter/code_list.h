// A list of kernel calls in the making: operands are virtual rows, which get their places in the register
// file when the list is finished (linear scan, so that the file stays in the first-level cache).
#pragma once

#include <vector>

#include "spirv_interp/interpreter/bytecode.h"

namespace pumice::interp {

//! A row (virtual register) or a uniform (byte offset in the bank).
struct Operand {
  enum Kind : uint8_t { None, Row, Uniform } kind = None;
  ir::Type type = ir::Type::None;
  uint32_t index = 0;
  bool isUniform() const { return kind == Uniform; }
};

class CodeList {
 public:
  Operand newRow(ir::Type type);

  //! Appends a call and gives its position.
  size_t add(Kernel kernel, Operand dst, std::span<const Operand> src, uint64_t imm = 0);
  size_t add(Kernel kernel, Operand dst, std::initializer_list<Operand> src, uint64_t imm = 0) {
    return add(kernel, dst, std::span<const Operand>(src.begin(), src.size()), imm);
  }
  Code& at(size_t position) { return items_[position].code; }
  size_t size() const { return items_.size(); }

  void beginLoop() { loops_.push_back({items_.size(), {}}); }
  //! After the last instruction of the loop has been added.
  void endLoop();

  //! Gives rows their places. False if there are too many.
  bool finish(std::vector<Code>& out, size_t& registerBytes);

 private:
  struct Row {
    uint32_t bytes;            //!< of an element; 0: mask
    uint32_t def = ~0u, end = 0;
    uint32_t place = 0;        //!< in units of its area
  };
  struct Item {
    Code code;
    uint8_t rows = 0;          //!< bit i: src[i] is a row; bit 7: dst is
  };
  struct Loop {
    size_t begin;
    std::vector<uint32_t> outside;   //!< rows used within that live from before it
  };

  void use(Operand o);

  std::vector<Row> rows_;
  std::vector<Item> items_;
  std::vector<Loop> loops_;
};

}  // namespace pumice::interp
