// Values that are the same in the four lanes of a quad: derivatives, and what is computed from them alone, as levels of detail are. One
// vector holds those of all quads of a chunk ("shared"): of q parts, lane k of each half is that of the half's quad in part k * q / 4.
#pragma once

#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::jit {

//! Marks values that may be shared, given which are uniform. None if something else would look at one than a
//! quad.swizzle, or a filter of levels, which takes what it needs.
std::vector<uint8_t> findShared(const ir::Function& f, const std::vector<uint8_t>& uniform);

//! Puts a quad.swizzle (which changes nothing there) between values worth sharing and those who look at them by lane; afterwards
//! findShared() finds them. Needs rates.
void shareAmongQuads(ir::Function& f);

}  // namespace pumice::jit
