// pumice_ulp [samples]: measures every function against MPFR and prints docs/ulp.md.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "bench/ulp/runners.h"
#include "spirv_interp/interpreter/executor.h"
#include "tests/ir/mpfr_reference.h"

namespace pumice::ulp {
namespace {

using ir::Type;

struct Error {
  double largest = 0, sum = 0, at = 0, atY = 0;
  double share = 0;                 //!< largest error as a share of what Vulkan allows
  size_t count = 0, wrongKind = 0;  //!< NaN or infinity where a number is due, or the other way round
  bool measured = false;

  void add(double ulps, double difference, double allowed, double x, double y) {
    measured = true;
    ++count;
    if (std::isinf(ulps)) {
      ++wrongKind;
      return;
    }
    sum += ulps;
    if (ulps > largest) largest = ulps, at = x, atY = y;
    if (std::isfinite(allowed) && allowed > 0) share = std::max(share, difference / allowed);
  }
};

std::string number(double x) {
  char text[48];
  std::snprintf(text, sizeof text,
                x == 0                  ? "0"
                : x < 0.001 || x >= 1e5 ? "%.1e"
                : x < 10                ? "%.3f"
                                        : "%.1f",
                x);
  return text;
}
std::string where(const Error& e, bool two) {
  char text[80];
  std::snprintf(text, sizeof text, two ? "%.7g, %.7g" : "%.9g", e.at, e.atY);
  return text;
}
//! Four cells: largest, mean, share of the allowance, wrong kinds.
std::string cells(const Error& e) {
  if (!e.measured) return " – | – | – | – |";
  const double n = double(e.count - e.wrongKind);
  return " " + number(e.largest) + " | " + number(n > 0 ? e.sum / n : 0) + " | " +
         (e.share > 0 ? number(e.share) : "–") + " | " + std::to_string(e.wrongKind) + " |";
}

struct Row {
  Error dense;      //!< of the first domain
  double time = 0;  //!< of the interpreter
};

class Report {
 public:
  explicit Report(size_t samples) : samples_(samples), drivers_(openDrivers()) {}

  void print() {
    head();
    for (Type t : {Type::F32, Type::F64, Type::F16}) errors(t);
    times();
    findings();
  }

 private:
  static const char* typeName(Type t) { return t == Type::F16 ? "f16" : t == Type::F32 ? "f32" : "f64"; }
  ComputeDriver* driver(bool tested) {
    for (auto& d : drivers_)
      if ((d->name().rfind("llvmpipe", 0) == 0) != tested) return d.get();
    return nullptr;
  }

  void head() {
    std::printf(
        "# Error of the functions of GLSL.std.450\n\n"
        "Made by `./dev report` (bench/ulp); do not edit. The exact values are MPFR's, with 200 bits.\n\n"
        "Errors are in units of the last place of the exact result (of the smallest denormal below the "
        "normal range). A domain of numbers\n"
        "holds %zu inputs, half evenly spread, half at random; *extremes* are inputs of random bits (any "
        "exponent, either sign, all of them\n"
        "for f16), zeros, infinities, NaN, denormals and the borders of overflow. *Allowed* is the largest "
        "error as a share of what Vulkan's\n"
        "precision table allows for that input (where it says something; denormal operands and results may "
        "be flushed and are left out).\n"
        "*Kind* counts results that are NaN or infinite where a number is due, or the other way round. pow "
        "is measured as exp2(y * log2(x)): a\n"
        "negative base is due to give NaN.\n\n"
        "Pumice computes here with its interpreter (%s), what is made of several operations (radians and below) through its driver; "
        "every executor gives the same bits.%s\n\n",
        samples_, interp::interpreterTarget(),
        driver(false)
            ? (" The other driver is `" + driver(false)->name() + "`, through a compute shader.").c_str()
            : "");
  }

  void errors(Type t) {
    const bool others = t == Type::F32 && driver(false);
    std::printf("## %s\n\n| function | inputs | largest | mean | allowed | kind | largest at |", typeName(t));
    if (others) std::printf(" lavapipe: largest | mean | allowed | kind |");
    std::printf("\n|---|---|---|---|---|---|---|%s\n", others ? "---|---|---|---|" : "");
    ir::Reference exact;
    for (size_t k = 0; k < kFunctions.size(); ++k) {
      const Function& f = kFunctions[k];
      if (t == Type::F64 && !f.ofDoubles) continue;
      bool first = true;
      for (const Inputs& inputs : inputsFor(f, t, samples_)) {
        std::vector<double> theirs, driven;
        if (others) theirs = driver(false)->run(f, t, inputs);
        if ((t == Type::F32 || f.exact) && driver(true)) driven = driver(true)->run(f, t, inputs);
        const std::vector<double> ours = f.exact ? driven : interpret(f, t, inputs);
        Error a, b;
        for (size_t i = 0; i < inputs.x.size(); ++i) {
          const double x = inputs.x[i], y = f.arguments == 2 ? inputs.y[i] : 0;
          if (f.exact) exact.evaluateWith(f.exact, x, y);
          else exact.evaluate(f.op, x, y);
          const double allowed = vulkanAllows(f, t, x, y, exact.value());
          if (!ours.empty())
            a.add(exact.ulps(ir::floatFormat(t), ours[i]), exact.difference(ours[i]), allowed, x, y);
          if (!theirs.empty())
            b.add(exact.ulps(ir::floatFormat(t), theirs[i]), exact.difference(theirs[i]), allowed, x, y);
          if (!driven.empty() && !(std::isnan(ours[i]) ? std::isnan(driven[i]) : ours[i] == driven[i]))
            ++driverDiffers_;
        }
        std::printf("| %s | %s |%s %s |", f.name, inputs.name.c_str(), cells(a).c_str(),
                    where(a, f.arguments == 2).c_str());
        if (others) std::printf("%s", cells(b).c_str());
        std::printf("\n");
        std::fflush(stdout);
        if (first) rows_[size_t(t)].push_back({a, 0}), theirDense_.push_back(b);
        if (first && t != Type::F16 && !(a.largest <= f.aim))
          missed_.push_back(std::string(f.name) + " of " + typeName(t) + " over " + inputs.name + " (" +
                            number(a.largest) + ", aim " + number(f.aim) + ")");
        if (a.share > 1)
          exceeds_.push_back(std::string(f.name) + " of " + typeName(t) + " over " + inputs.name);
        if (b.share > 1) theirExceeds_.push_back(std::string(f.name) + " over " + inputs.name);
        first = false;
      }
    }
    std::printf("\n");
  }

  void times() {
    std::printf(
        "## Error against run time\n\n"
        "Nanoseconds of processor time a lane. *Interpreter*: rows of %u lanes, one call beyond a copy. "
        "*Vulkan*: a "
        "compute shader\nwith a loop of calls, less the same loop without them, all threads of the driver "
        "together. The least of several runs;\n0 is less than what can be measured; on a shared machine "
        "single entries may be too high. Errors are the largest "
        "of f32 in "
        "the first domain above.\n\n"
        "| function | interpreter f16 | f32 | f64 | Vulkan: Pumice | its error | lavapipe | its error "
        "|\n|---|---|---|---|---|---|---|---|\n",
        interp::kMaxLanes);
    for (size_t k = 0; k < kFunctions.size(); ++k) {
      const Function& f = kFunctions[k];
      std::printf("| %s |", f.name);
      for (Type t : {Type::F16, Type::F32, Type::F64}) std::printf(f.exact ? " – |" : " %.2f |", f.exact ? 0 : interpreterNanoseconds(f, t));
      for (bool tested : {true, false}) {
        ComputeDriver* d = driver(tested);
        const Error& e = tested ? rows_[size_t(Type::F32)][k].dense : theirDense_[k];
        if (d)
          std::printf(" %.2f |", d->nanoseconds(f));
        else
          std::printf(" – |");
        std::printf(" %s |", e.measured ? number(e.largest).c_str() : "–");
      }
      std::printf("\n");
      std::fflush(stdout);
    }
    std::printf("\n");
  }

  static void list(const char* text, const std::vector<std::string>& what) {
    std::printf("- %s: %s", text, what.empty() ? "none" : "");
    for (size_t k = 0; k < what.size(); ++k) std::printf("%s%s", k ? "; " : "", what[k].c_str());
    std::printf(".\n");
  }
  void findings() {
    std::printf("## Findings\n\n");
    list(
        "Functions of Pumice that miss their aim (division and square root exactly rounded; exp2, log2, exp, "
        "log, inversesqrt 2; others 4)",
        missed_);
    list("Functions of Pumice beyond what Vulkan allows", exceeds_);
    if (driver(false)) list("Functions of lavapipe beyond what Vulkan allows", theirExceeds_);
    if (driver(true))
      std::printf("- Results through Pumice's Vulkan driver that differ from the interpreter's: %zu.\n",
                  driverDiffers_);
  }

  const size_t samples_;
  std::vector<std::unique_ptr<ComputeDriver>> drivers_;
  std::vector<Row> rows_[16];
  std::vector<Error> theirDense_;
  std::vector<std::string> missed_, exceeds_, theirExceeds_;
  size_t driverDiffers_ = 0;
};

}  // namespace
}  // namespace pumice::ulp

int main(int argc, char** argv) {
  const long samples = argc > 1 ? std::atol(argv[1]) : 40000;
  if (samples < 100) {
    std::fprintf(stderr, "usage: pumice_ulp [samples, at least 100]\n");
    return 2;
  }
  try {
    pumice::ulp::Report(size_t(samples)).print();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "pumice_ulp: %s\n", e.what());
    return 1;
  }
  return 0;
}
