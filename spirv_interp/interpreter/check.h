// Reports of PUMICE_CHECK (spirv_interp/ir/checks.h): what `check` operations become.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "spirv_interp/interpreter/bytecode.h"
#include "spirv_interp/ir/checks.h"

namespace pumice::interp {

//! A shader whose checks share what they have said.
struct WatchedShader {
  explicit WatchedShader(const CheckedShader& s) : shader(s) {}
  const CheckedShader shader;
  //! Whether this is to be said: nothing like it was said before. A line that is there several times, inlined, is one place.
  bool firstReport(const struct CheckSite& site, const std::string& text);

 private:
  std::mutex mutex_;
  std::set<std::string> said_;
};

//! One `check` of a routine; the kernel finds it through its imm.
struct CheckSite {
  ir::CheckPlace place;
  uint32_t line = 0;
  std::vector<ir::Type> types;   //!< of the operands
  uint32_t count = 0;
  std::shared_ptr<WatchedShader> shader;
  std::atomic<bool> reported{false};
};

//! src: rows of the operands; imm: the CheckSite. Logs the first lane that it finds wanting.
const Code* checkKernel(RunState& s, const Code* c);

//! Operands per code. What has more goes on in the codes behind it, which are not run.
constexpr uint32_t kCheckOperands = 5;
//! Prints what the active lanes print, in their order.
const Code* printKernel(RunState& s, const Code* c);

}  // namespace pumice::interp
