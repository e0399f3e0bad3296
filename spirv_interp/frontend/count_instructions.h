// SPIRV-Tools' validator parses a module twice, the first time only to count its instructions, so that it can make room: a fifth
// of its time. Between the two stands a function of ours that the linker puts there (CMakeLists.txt), and that only steps from
// instruction to instruction.
#pragma once

namespace pumice::frontend {

//! The next parse by this thread that counts is done so. Only for the one version of SPIRV-Tools whose counting is known;
//! otherwise, and where SPIRV-Tools is a shared library, nothing happens.
class QuickCount {
 public:
  QuickCount();
  ~QuickCount();
  QuickCount(const QuickCount&) = delete;
  QuickCount& operator=(const QuickCount&) = delete;
};

}  // namespace pumice::frontend
