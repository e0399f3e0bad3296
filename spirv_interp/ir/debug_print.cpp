#include "spirv_interp/ir/debug_print.h"

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <deque>
#include <mutex>
#include <string_view>

#include "base/log.h"
#include "spirv_interp/ir/fold.h"

namespace pumice::ir {
namespace {

struct Kept {
  std::mutex mutex;
  std::deque<PrintCall> calls;
};
// Never destroyed: threads of the application may compile while the process already exits.
Kept& kept() {
  static Kept* all = new Kept;
  return *all;
}

constinit std::atomic<uint32_t> printedLines{0};

constexpr uint32_t kMostDigits = 200;   // of a width or precision

struct Conversion {
  std::string spec;        //!< "%", flags, width, precision: all checked
  bool precision = false;
  unsigned components = 0; //!< 0: as many as the value has
  char letter = 0;
  size_t end = 0;          //!< behind it
};

// What begins at the '%' at `at`; letter 0: nothing that is known.
Conversion conversion(std::string_view f, size_t at) {
  Conversion c;
  size_t i = at + 1;
  const auto digits = [&] {
    unsigned n = 0;
    while (i < f.size() && f[i] >= '0' && f[i] <= '9') n = std::min(n * 10 + unsigned(f[i++] - '0'), kMostDigits);
    return n;
  };
  const auto is = [&](std::string_view set) { return i < f.size() && set.find(f[i]) != f.npos; };
  c.spec = "%";
  while (is("-+ #0")) {
    if (c.spec.find(f[i]) == c.spec.npos) c.spec += f[i];
    i++;
  }
  if (is("123456789")) c.spec += std::to_string(digits());
  if (is(".")) {
    i++;
    c.precision = true;
    c.spec += "." + std::to_string(digits());
  }
  if (is("v") && i + 1 < f.size() && f[i + 1] >= '2' && f[i + 1] <= '4') {
    c.components = unsigned(f[i + 1] - '0');
    i += 2;
  }
  while (is("hl")) i++;
  if (!is("diuxXofFeEgGaAs")) return c;
  c.letter = f[i];
  c.end = i + 1;
  return c;
}

std::string scalarText(const Conversion& c, PrintedScalar v) {
  char text[2 * kMostDigits + 400];   // the greatest double has 309 digits before its point
  const unsigned bits = std::max(typeBytes(v.type) * 8, 1u);
  const bool isInteger = std::strchr("diuxXo", c.letter) != nullptr;
  if (isInteger) {
    uint64_t x = v.bits;
    if ((c.letter == 'd' || c.letter == 'i') && v.type != Type::Mask && bits < 64) x = uint64_t(int64_t(x << (64 - bits)) >> (64 - bits));
    std::snprintf(text, sizeof text, (c.spec + "ll" + c.letter).c_str(), (unsigned long long)x);
  } else {
    const Type as = isFloat(v.type) ? v.type : bits == 64 ? Type::F64 : bits == 32 ? Type::F32 : Type::F16;
    const double x = v.type == Type::Mask ? double(v.bits) : floatValue(as, v.bits);
    std::snprintf(text, sizeof text, (c.spec + c.letter).c_str(), x);
  }
  return text;
}

}  // namespace

uint32_t keepPrintCall(PrintCall call) {
  Kept& all = kept();
  std::lock_guard lock(all.mutex);
  const auto at = std::find(all.calls.begin(), all.calls.end(), call);
  const size_t number = size_t(at - all.calls.begin());
  if (at == all.calls.end()) all.calls.push_back(std::move(call));
  return uint32_t(number);
}

const PrintCall& printCall(uint32_t number) {
  Kept& all = kept();
  std::lock_guard lock(all.mutex);
  return all.calls.at(number);
}

bool countPrintedLine() {
  if (printedLines.load(std::memory_order_relaxed) > kMostPrintedLines) return false;
  const uint32_t before = printedLines.fetch_add(1, std::memory_order_relaxed);
  if (before == kMostPrintedLines) base::logPrinted("%u lines are enough: shaders print nothing more on this device", kMostPrintedLines);
  return before < kMostPrintedLines;
}

void restartPrinting() { printedLines.store(0, std::memory_order_relaxed); }

std::string printedText(const PrintCall& call, std::span<const PrintedScalar> values) {
  std::string out;
  const std::string_view f = call.format;
  size_t argument = 0, value = 0;
  for (size_t at = 0; at < f.size();) {
    if (f[at] != '%') {
      const size_t next = std::min(f.find('%', at), f.size());
      out += f.substr(at, next - at);
      at = next;
      continue;
    }
    if (at + 1 < f.size() && f[at + 1] == '%') {
      out += '%';
      at += 2;
      continue;
    }
    Conversion c = conversion(f, at);
    if (!c.letter || argument == call.arguments.size()) {
      out += f[at++];
      continue;
    }
    const PrintCall::Argument& a = call.arguments[argument++];
    at = c.end;
    const size_t first = value;
    const size_t count = std::min<size_t>(a.scalars, values.size() - std::min(values.size(), first));
    value += count;
    if (!count) {
      out += a.text.empty() && c.letter != 's' ? "?" : a.text;
      continue;
    }
    // "%ul" is an older way to say "%lu".
    if (std::strchr("uxdi", c.letter) && at < f.size() && f[at] == 'l' && values[first].type == Type::I64) at++;
    if (c.letter == 's') c.letter = isFloat(values[first].type) ? 'g' : 'd', c.spec = "%";
    for (size_t k = 0; k < std::min<size_t>(count, c.components ? c.components : count); k++) {
      if (k) out += ", ";
      out += scalarText(c, values[first + k]);
    }
  }
  return out;
}

}  // namespace pumice::ir
