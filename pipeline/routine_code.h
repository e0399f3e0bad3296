// The executables of routines. They may still be in the making when a pipeline exists: workers emit them while the application
// goes on, and who needs one first emits it, or waits for the worker.
#pragma once

#include <memory>

#include "base/threads.h"
#include "spirv_interp/interpreter/executor.h"

namespace pumice::pipeline {

class RoutineCode {
 public:
  RoutineCode() = default;
  //! Waits for it, or makes it; to be asked by a thread before it uses it. False if it cannot be made (the reason is logged once).
  //! With `workers` it does their other tasks while one is at it: those will be needed next.
  bool ready(base::ThreadPool* workers = nullptr) const;
  const interp::Executable* operator->() const;

 private:
  friend base::Result<RoutineCode> compileRoutine(const ir::Function&, ir::Numerics, interp::CheckedShader, bool, base::ThreadPool*);
  struct Making;
  class Known;
  explicit RoutineCode(std::shared_ptr<Making> making) : making_(std::move(making)) {}
  std::shared_ptr<Making> making_;
};

//! Routines with the same IR have one executable as long as one of them lives: a vertex shader is compiled once for many pipelines.
//! With `workers` the JIT's work is left to them, and what fails then is told by ready().
base::Result<RoutineCode> compileRoutine(const ir::Function& f, ir::Numerics numerics, interp::CheckedShader checked = {}, bool wholeBlocks = false,
                                         base::ThreadPool* workers = nullptr);

}  // namespace pumice::pipeline
