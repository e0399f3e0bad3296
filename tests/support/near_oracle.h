// Random float programs without decisions: f32 must be as near to the oracle as an error bound that is carried along says.
#pragma once

#include <string>

#include "tests/support/choices.h"

namespace pumice::testing {

//! How much the bounds had to say, summed over calls.
struct NearOracleCounts {
  uint64_t values = 0;    //!< of all lanes
  uint64_t checked = 0;   //!< those with a finite bound
  uint64_t sharp = 0;     //!< those with a bound below 1e-4 of the value
  uint64_t differ = 0;    //!< those that are not the oracle's
};
//! Builds a program of the choices and runs it in f32 and in double; says what is further from the oracle than it may be, or nothing.
std::string nearOracleProblem(Choices& choices, NearOracleCounts& counts);

}  // namespace pumice::testing
