#include "spirv_interp/interpreter/check.h"

#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "base/address_ranges.h"
#include "base/log.h"
#include "spirv_interp/interpreter/memory.h"
#include "spirv_interp/ir/fold.h"

namespace pumice::interp {
namespace {

using ir::CheckKind, ir::Op, ir::Type;

uint64_t operand(const RunState& s, const Code* c, const CheckSite& site, unsigned k, uint32_t lane) {
  const Type t = site.types[k];
  if (t == Type::Mask) return s.mask(c->src[k])[lane / 64] >> lane % 64 & 1;
  uint64_t v = 0;
  std::memcpy(&v, s.registers + c->src[k] + lane * ir::typeBytes(t), ir::typeBytes(t));
  return v;
}

std::string number(Type t, uint64_t bits) {
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
      if (std::isfinite(ir::floatValue(site.types[1], value(1)))) return {};
      std::string text = std::string("nan: ") + ir::opInfo(site.place.op).text + "(";
      for (unsigned k = 2; k < site.count; k++) {
        if (!std::isfinite(ir::floatValue(site.types[k], value(k)))) return {};
        text += (k > 2 ? ", " : "") + number(site.types[k], value(k));
      }
      return text + ") = " + number(site.types[1], value(1));
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
  }
  return {};
}

}  // namespace

const Code* checkKernel(RunState& s, const Code* c) {
  CheckSite& site = *reinterpret_cast<CheckSite*>(c->imm);
  if (site.reported.load(std::memory_order_relaxed)) return c + 1;
  const uint64_t* counts = s.mask(c->src[0]);
  for (uint32_t lane = 0; lane < s.lanes; lane++) {
    if (!s.active(lane) || !(counts[lane / 64] >> lane % 64 & 1)) continue;
    const std::string text = problem(s, c, site, lane);
    if (text.empty()) continue;
    if (site.reported.exchange(true)) break;
    const CheckedShader& shader = *site.shader;
    char line[24] = "unknown line";
    if (site.line) std::snprintf(line, sizeof line, "line %u", site.line);
    base::logError("PUMICE_CHECK %s; %s, %s, %s", text.c_str(), shader.name.empty() ? "a shader" : shader.name.c_str(), line,
                   shader.invocation ? shader.invocation(*s.context, lane).c_str() : ("lane " + std::to_string(lane)).c_str());
    break;
  }
  return c + 1;
}

}  // namespace pumice::interp
