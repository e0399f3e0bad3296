// Ideas that save work without changing a bit of any picture. Each can be turned off: for measurements and for the tests that hold
// this to be true.
#pragma once

#include <cstdint>

namespace pumice::pipeline {

// X(id, name)
#define PUMICE_IDEAS(X)               \
  X(VisibleFirst, "visible-first")    \
  X(HiZ, "hi-z")                      \
  X(OneRecord, "one-record")          \
  X(WholeBlocks, "whole-blocks")      \
  X(LazyClear, "lazy-clear")          \
  X(OneColor, "one-color")            \
  X(Squares, "squares")               \
  X(InUnit, "in-unit")                \
  X(Preamble, "preamble")             \
  X(Interleaving, "interleaving")     \
  X(SpecialisedSampling, "specialised-sampling") \
  X(RunsItself, "runs-itself")

enum class Idea : uint32_t {
#define PUMICE_IDEA(id, name) id,
  PUMICE_IDEAS(PUMICE_IDEA)
#undef PUMICE_IDEA
};

//! A set of ideas: bit per Idea.
using Ideas = uint32_t;
constexpr Ideas bit(Idea i) { return 1u << uint32_t(i); }

//! From PUMICE_DISABLE, names with commas between; read once.
Ideas disabledIdeas();

}  // namespace pumice::pipeline
