// What the printer and the parser share: how an operation's immediate is written, and the words of the text
// form.
//
//   function "name" shared=64
//   %1 = const f32 0x3fc00000 ; 1.5          also read: const f32 1.5, const i32 -3
//   %2 = table.load i32 push+16 %3           tables: push, draw, set0 .. set7, constants
//   %4 = load f32 +8 %base, %offset, %size !volatile @12
//   if %m                                    regions are indented; break 1
//   %5 = tile.load f32 0:16+4                plane : bytes of an element + byte offset
//   %8 = shader.input f32 2:1                variable : component
//   %6 = atomic i32 add+4 %b, %o, %s, %v
//   %9 = subgroup.reduce f32 fadd:inclusive:32 %10    operation : kind : lanes of a cluster
//   %7 = image tuple {sample 2d arrayed operands=5 image=0 sampler=1 texel=f32} %..
// `;` starts a comment, `@n` is a source line, `~draw` a rate, names of values are free.
#pragma once

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

enum class ImmKind : uint8_t { None, Const, Number, Offset, Table, Pair, Tile, Atomic, Image, Reduce };
ImmKind immKind(Op op);

inline constexpr const char* kTypeNames[] = {"none", "mask", "i8",  "i16", "i32",
                                             "i64",  "f16",  "f32", "f64", "tuple"};
inline constexpr const char* kRateNames[] = {"constant", "draw", "workgroup", "subgroup", "lane"};
inline constexpr const char* kAtomicNames[] = {"add", "smin", "smax", "umin", "umax", "and",
                                               "or",  "xor",  "xchg", "fadd", "ld",   "st"};
inline constexpr const char* kReduceNames[] = {"iadd", "fadd", "imul", "fmul", "smin", "smax", "umin",
                                               "umax", "fmin", "fmax", "and",  "or",   "xor"};
inline constexpr const char* kScanNames[] = {"reduce", "inclusive", "exclusive"};
inline constexpr const char* kImageKindNames[] = {"sample",      "fetch",       "gather",    "read",
                                                  "write",       "atomic",      "querysize", "querylod",
                                                  "querylevels", "querysamples"};
inline constexpr const char* kImageDimNames[] = {"1d", "2d", "3d", "cube", "rect", "buffer", "subpass"};
struct InstFlagName {
  const char* name;
  uint8_t flag;
};
inline constexpr InstFlagName kInstFlagNames[] = {
    {"volatile", kInstVolatile}, {"nocontract", kInstNoContract}, {"nonuniform", kInstNonUniform},
    {"keep", kInstKeep},
    {"declared", kInstDeclared}};

}  // namespace pumice::ir
