// Rows whose quads all read the same record.
#pragma once

#include <cstdint>

namespace pumice::ir {

//! In the imm of quad.load, beside the byte offset in the low 32 bits: the caller promises that all quads of a row have the same
//! record. So the value is the same in all lanes, though it changes from row to row.
constexpr uint64_t kOneRecord = uint64_t(1) << 32;

}  // namespace pumice::ir
