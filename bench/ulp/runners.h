// Two ways of evaluating a function on many inputs: the interpreter at once, and a compute shader through the
// Vulkan API on any driver.
#pragma once

#include <ctime>
#include <memory>
#include <string>
#include <vector>

#include "bench/ulp/functions.h"

namespace pumice::ulp {

//! Processor time of the process so far, in nanoseconds: other programs on the machine hardly disturb it.
inline double processorTime() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return double(t.tv_sec) * 1e9 + double(t.tv_nsec);
}

//! Results of the interpreter (double holds every type's values). Empty if it cannot run the function.
std::vector<double> interpret(const Function& f, ir::Type type, const Inputs& inputs);
//! Nanoseconds of processor time a lane, of one call beyond a copy; the least of several measurements.
double interpreterNanoseconds(const Function& f, ir::Type type);

//! Through a compute shader. Functions throw std::runtime_error if the driver refuses something.
class ComputeDriver {
 public:
  virtual ~ComputeDriver() = default;
  virtual std::string name() const = 0;
  //! Empty if the driver has no such type.
  virtual std::vector<double> run(const Function& f, ir::Type type, const Inputs& inputs) = 0;
  //! Of f32: nanoseconds of processor time a lane, of one call beyond a loop without it, all threads together.
  virtual double nanoseconds(const Function& f) = 0;
};
//! Pumice (of the build tree) and lavapipe, as far as they are there.
std::vector<std::unique_ptr<ComputeDriver>> openDrivers();

}  // namespace pumice::ulp
