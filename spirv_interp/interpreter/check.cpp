#include "spirv_interp/interpreter/check.h"

#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "base/address_ranges.h"
#include "base/log.h"
#include "spirv_interp/interpreter/memory.h"
#include "spirv_interp/ir/debug_print.h"
#include "spirv_interp/ir/fold.h"

namespace pumice::interp {
namespace {

using ir::CheckKind, ir::Op, ir::Type;

uint64_t operand(const RunState& s, const Code* c, const CheckSite& site, unsigned k, uint32_t lane) {
  const Type t = site.types[k];
  const uint32_t place = c[k / kCheckOperands].src[k % kCheckOperands];
  if (t == Type::Mask) return s.mask(place)[lane / 64] >> lane % 64 & 1;
  uint64_t v = 0;
  std::memcpy(&v, s.registers + place + lane * ir::typeBytes(t), ir::typeBytes(t));
  return v;
}

int64_t signedValue(Type t, uint64_t bits) {
  const unsigned unused = 64 - 8 * ir::typeBytes(t);
  return int64_t(bits << unused) >> unused;
}

bool finite(Type t, uint64_t bits) { return !ir::isFloat(t) || std::isfinite(ir::floatValue(t, bits)); }

std::string number(Op op, Type t, uint64_t bits) {
  if (!ir::isFloat(t)) return std::to_string(op == Op::SToF ? signedValue(t, bits) : int64_t(bits));
  char text[40];
  const double x = ir::floatValue(t, bits);
  if (x != x) return "NaN";
  std::snprintf(text, sizeof text, t == Type::F64 ? "%.17g" : "%.9g", x);
  return text;
}

const char* access(Op op) {
  switch (op) {
    case Op::Store:
    case Op::SharedStore:
    case Op::LocalStore: return "store";
    case Op::Atomic:
    case Op::AtomicCas:
    case Op::SharedAtomic:
    case Op::SharedAtomicCas: return "atomic";
    default: return "load";
  }
}

std::string outside(const CheckSite& site, uint64_t offset, uint64_t size, const char* what) {
  char text[200];
  std::snprintf(text, sizeof text, "bounds: %s of %u bytes at byte %" PRIu64 " of %s of %" PRIu64 " bytes", access(site.place.op),
                ir::typeBytes(site.place.type), offset + site.place.constant, what, size);
  return text;
}

std::string wildAddress(const CheckSite& site, uint64_t address) {
  const unsigned bytes = ir::typeBytes(site.place.type);
  const base::AddressRanges::Place place = base::addressRanges().find(address);
  if (place.known && address - place.begin <= place.size && bytes <= place.size - (address - place.begin)) return {};
  char text[220];
  int n = std::snprintf(text, sizeof text, "bounds: %s of %u bytes at address 0x%" PRIx64 ", where no buffer is", access(site.place.op), bytes, address);
  if (place.known)
    std::snprintf(text + n, sizeof text - size_t(n), " (%" PRIu64 " bytes behind the start of a buffer of %" PRIu64 " bytes)", address - place.begin, place.size);
  return text;
}

std::string texel(const CheckSite& site, uint32_t at, uint32_t count) {
  static constexpr const char* kAxes[] = {"x", "y", "z", "layer", "level", "sample"};
  const auto kind = ir::ImageKind(site.place.constant & 0xff);
  const char* what = kind == ir::ImageKind::Fetch ? "fetch of a texel" : kind == ir::ImageKind::Read ? "load of a texel" : kind == ir::ImageKind::Write ? "store of a texel" : "atomic on a texel";
  char text[120];
  std::snprintf(text, sizeof text, "bounds: %s at %s %d of %u", what, kAxes[site.place.constant >> 8], int32_t(at), count);
  return text;
}

//! What is wrong with a lane; empty: nothing.
std::string problem(const RunState& s, const Code* c, const CheckSite& site, uint32_t lane) {
  const auto value = [&](unsigned k) { return operand(s, c, site, k, lane); };
  const unsigned bytes = ir::typeBytes(site.place.type);
  uint64_t at;
  switch (site.place.kind) {
    case CheckKind::Buffer:
      if (inside(value(2), site.place.constant, bytes, value(3), at) && value(1)) return {};
      return value(1) ? outside(site, value(2), value(3), "a buffer") : std::string("bounds: ") + access(site.place.op) + " where no buffer is bound";
    case CheckKind::Local:
      if (inside(value(1), site.place.constant, bytes, value(2), at)) return {};
      return outside(site, value(1), value(2), site.place.op == Op::LocalLoad || site.place.op == Op::LocalStore ? "a private variable" : "work-group memory");
    case CheckKind::Finite: {
      if (finite(site.types[1], value(1))) return {};
      const Op op = site.place.op;
      std::string text = std::string("nan: ") + ir::opInfo(op).text + (op == Op::SubgroupReduce ? "." + std::string(ir::opInfo(ir::reduceOperation(ir::ReduceOp(site.place.constant))).text) : std::string()) + "(";
      for (unsigned k = 2; k < site.count; k++) {
        if (!finite(site.types[k], value(k))) return {};
        text += (k > 2 ? ", " : "") + number(op, site.types[k], value(k));
      }
      return text + (op == Op::SubgroupReduce ? ", ...) = " : ") = ") + number(op, site.types[1], value(1));
    }
    case CheckKind::Texel: return value(1) < value(2) ? std::string() : texel(site, uint32_t(value(1)), uint32_t(value(2)));
    case CheckKind::Vertex: {
      if (inside(value(1), 0, value(2), value(3), at)) return {};
      char text[160];
      std::snprintf(text, sizeof text, "bounds: fetch of %u bytes for location %u at byte %" PRIu64 " of a vertex buffer of %" PRIu64 " bytes", unsigned(value(2)),
                    site.place.constant, value(1), value(3));
      return text;
    }
    case CheckKind::Address: return wildAddress(site, value(1) + value(2) + site.place.constant);
    case CheckKind::Written:
      return value(1) ? std::string() : "uninit: read of a variable that has not been written";
    case CheckKind::Index: {
      if (value(1) < value(2)) return {};
      static constexpr const char* kWhat[] = {"an array", "a vector", "a matrix"};
      return "bounds: index " + std::to_string(signedValue(site.types[1], value(1))) + " of " + kWhat[site.place.constant % 3] + " of " + std::to_string(value(2));
    }
    case CheckKind::Print: break;
  }
  return {};
}

bool counts(const RunState& s, const Code* c, uint32_t lane) {
  return s.active(lane) && (s.mask(c->src[0])[lane / 64] >> lane % 64 & 1);
}

//! The text without its numbers.
std::string kindOfText(const std::string& text) {
  std::string out;
  for (char ch : text)
    if (!(ch >= '0' && ch <= '9') && !std::strchr(".+-", ch)) out += ch;
  return out;
}

constinit std::mutex printing;   // the lines of a row stay together

}  // namespace

bool WatchedShader::firstReport(const CheckSite& site, const std::string& text) {
  // Without a line the numbers tell places apart.
  std::string key = std::to_string(site.line) + ':';
  if (site.line) {
    key += std::to_string(uint32_t(site.place.kind)) + ':' + std::to_string(uint32_t(site.place.op)) + ':';
    if (site.place.kind == CheckKind::Texel || site.place.kind == CheckKind::Vertex || site.place.kind == CheckKind::Index) key += std::to_string(site.place.constant);
  }
  key += site.line ? kindOfText(text) : text;
  std::lock_guard lock(mutex_);
  return said_.insert(std::move(key)).second;
}

const Code* printKernel(RunState& s, const Code* c) {
  const CheckSite& site = *reinterpret_cast<const CheckSite*>(c->imm);
  const Code* next = c + (site.count + kCheckOperands - 1) / kCheckOperands;
  const ir::PrintCall& call = ir::printCall(site.place.constant);
  std::vector<ir::PrintedScalar> values(site.count - 1);
  std::lock_guard lock(printing);
  bool enough = false;
  for (uint32_t lane = 0; lane < s.lanes && !enough; lane++) {
    if (!counts(s, c, lane)) continue;
    for (uint32_t k = 1; k < site.count; k++) values[k - 1] = {site.types[k], operand(s, c, site, k, lane)};
    std::string text = ir::printedText(call, values);
    if (!text.empty() && text.back() == '\n') text.pop_back();
    for (size_t at = 0; at <= text.size();) {
      if ((enough = !ir::countPrintedLine())) break;
      const size_t end = std::min(text.find('\n', at), text.size());
      base::logPrinted("%.*s", int(end - at), text.data() + at);
      at = end + 1;
    }
  }
  return next;
}

const Code* checkKernel(RunState& s, const Code* c) {
  CheckSite& site = *reinterpret_cast<CheckSite*>(c->imm);
  if (site.reported.load(std::memory_order_relaxed)) return c + 1;
  for (uint32_t lane = 0; lane < s.lanes; lane++) {
    if (!counts(s, c, lane)) continue;
    const std::string text = problem(s, c, site, lane);
    if (text.empty()) continue;
    if (site.reported.exchange(true) || !site.shader->firstReport(site, text)) break;
    const CheckedShader& shader = site.shader->shader;
    char line[24] = "unknown line";
    if (site.line) std::snprintf(line, sizeof line, "line %u", site.line);
    base::logError("PUMICE_CHECK %s; %s, %s, %s", text.c_str(), shader.name.empty() ? "a shader" : shader.name.c_str(), line,
                   shader.invocation ? shader.invocation(*s.context, lane).c_str() : ("lane " + std::to_string(lane)).c_str());
    break;
  }
  return c + 1;
}

}  // namespace pumice::interp
