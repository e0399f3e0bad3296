// The single passes that passes.cpp strings together. Each returns whether it changed the function's shape
// in a way that makes another round worth while.
#pragma once

#include <vector>

#include "spirv_interp/ir/ir.h"

namespace pumice::ir {

//! Folding and value numbering through a builder; values of vars are followed along the structure and their
//! reads replaced; branches on constants, blocks that nothing breaks out of and code behind a break vanish.
//! Constants, vars and local memory move to the start.
bool forwardVariables(Function& f);
//! Removes what no effect depends on, vars that are not read and stores overwritten before any read.
bool removeDeadCode(Function& f);
//! Turns an `if` that only sets vars to cheap values into selects.
bool convertIfs(Function& f);

//! For every structure marker the one that ends its region: if -> else or endif, else -> endif, loop ->
//! endloop, block -> endblock; 0 for other instructions. The function must be balanced.
std::vector<Value> regionEnds(const Function& f);

//! A function with everything of f but its instructions.
Function withoutInstructions(const Function& f);

}  // namespace pumice::ir
