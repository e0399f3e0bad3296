// What generated code calls.
#include <algorithm>
#include <bit>
#include <cstring>

#include "spirv_interp/interpreter/memory.h"
#include "spirv_interp/jit/frame.h"

namespace pumice::jit {

using ir::Type;

namespace {
alignas(64) constexpr std::byte kZeros[64] = {};
alignas(64) std::byte sink[64];   // nobody reads it

//! Elements of 8 and 16 bits stand as 32 in registers.
template <class T>
void narrow(std::byte* row, uint32_t lanes) {
  for (uint32_t i = 0; i < lanes; i++) interp::write<T>(row + i * sizeof(T), T(interp::read<uint32_t>(row + i * 4)));
}
template <class T>
void widen(std::byte* row, uint32_t lanes) {
  for (uint32_t i = lanes; i-- > 0;) interp::write<uint32_t>(row + i * 4, interp::read<T>(row + i * sizeof(T)));
}
}  // namespace

const std::byte* zeroBlock() { return kZeros; }
std::byte* sinkBlock() { return sink; }

void runCallOut(std::byte* frame, const CallOut* site, ChunkCall* call) {
  interp::RunState s{};
  s.lanes = s.rounded = site->lanes < 16 ? 16 : site->lanes;
  s.exec[0] = interp::read<uint32_t>(frame + kFrameExec);
  s.all[0] = (uint64_t(1) << s.lanes) - 1;
  if (!site->uniform) s.lanes = std::min(s.lanes, uint32_t(std::bit_width(call->active)));
  s.registers = frame + kFrameRows;
  s.uniforms = call->bank;
  s.tables = call->tables;
  s.context = call->context;
  for (unsigned k = 0; k < 5; k++) {
    std::byte* row = frame + frameRow(k);
    switch (ir::typeBytes(site->operands[k])) {
      case 1: narrow<uint8_t>(row, site->lanes); break;
      case 2: narrow<uint16_t>(row, site->lanes); break;
      default: break;
    }
  }
  site->kernel(s, &site->code);
  switch (ir::typeBytes(site->result)) {
    case 1: widen<uint8_t>(frame + frameRow(5), site->lanes); break;
    case 2: widen<uint16_t>(frame + frameRow(5), site->lanes); break;
    default: break;
  }
}

void runLocalAccess(std::byte* frame, const LocalAccess* site, ChunkCall* call) {
  const uint32_t exec = interp::read<uint32_t>(frame + kFrameExec), element = site->bytes < 4 ? 4 : site->bytes;
  std::byte* area = call->local + site->area;
  for (uint32_t lane = 0; lane < site->lanes; lane++) {
    uint64_t value = 0, at;
    std::byte* result = frame + frameRow(5) + lane * element;
    if (!site->store) std::memset(result, 0, element);
    if (!(exec >> lane & 1)) continue;
    if (!interp::inside(interp::read<uint32_t>(frame + frameRow(0) + lane * 4), site->constant, site->bytes, site->size, at)) continue;
    if (site->store) std::memcpy(&value, frame + frameRow(1) + lane * element, element);
    for (uint32_t b = 0; b < site->bytes; b++) {
      std::byte& byte = area[(((at + b) >> 2) * site->lanes + lane) * 4 + ((at + b) & 3)];
      if (site->store) byte = std::byte(value >> (8 * b));
      else value |= uint64_t(byte) << (8 * b);
    }
    if (!site->store) std::memcpy(result, &value, element);
  }
}

}  // namespace pumice::jit
