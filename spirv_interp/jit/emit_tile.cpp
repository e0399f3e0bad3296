// Attachments: a quad's four elements are neighbours in memory. Quads without an active lane are not touched.
#include "spirv_interp/jit/emitter.h"

namespace pumice::jit {

namespace I = x86::Inst;

namespace {
struct Tile {
  uint32_t plane, element, byteOffset;
  explicit Tile(uint64_t imm) : plane(uint32_t(imm >> 32)), element(uint32_t(imm >> 16 & 0xffff)), byteOffset(uint32_t(imm & 0xffff)) {}
};
}  // namespace

//! rsi: the plane, rdi: its quads' elements, r10d: active lanes.
static void tilePlane(x86::Assembler& a, const x86::Gp& call, const Tile& t) {
  a.mov(x86::rcx, x86::ptr(call, offsetof(ChunkCall, tilePlanes)));
  a.mov(x86::rsi, x86::ptr(x86::rcx, int32_t(t.plane * sizeof(interp::TilePlane) + offsetof(interp::TilePlane, base))));
  a.mov(x86::rdi, x86::ptr(x86::rcx, int32_t(t.plane * sizeof(interp::TilePlane) + offsetof(interp::TilePlane, quadElement))));
}
//! rax: where the quad's first element lies, less byteOffset. `quad`: of the chunk; its number in the row is lane0 / 4 more.
static void tileQuad(x86::Assembler& a, const x86::Gp& lane0, const Tile& t, uint32_t quad) {
  a.mov(x86::eax, x86::ptr(x86::rdi, lane0, 0, int32_t(quad * 4)));
  if (t.element > 1) a.imul(x86::rax, x86::rax, t.element);
  a.add(x86::rax, x86::rsi);
}

//! Rows of whole blocks: the sixteen elements of a block are neighbours, all lanes are active.
namespace {
class BlockAddress {
 public:
  BlockAddress(x86::Assembler& a, const x86::Gp& lane0, const Tile& t) : a_(a), lane0_(lane0), t_(t) {}
  //! Of lane `lane` of the chunk (a multiple of four). Uses rax; addresses of one block follow one another.
  x86::Mem at(uint32_t lane, bool ofElement = false) {
    if (lane / 16 != block_) {
      block_ = lane / 16;
      a_.mov(x86::eax, x86::ptr(x86::rdi, lane0_, 0, int32_t(block_ * 16)));
      if (!scaled()) a_.imul(x86::rax, x86::rax, t_.element);
    }
    const int32_t offset = int32_t(lane % 16 * t_.element + (ofElement ? 0 : t_.byteOffset));
    const uint32_t shift = t_.element == 8 ? 3 : t_.element == 4 ? 2 : t_.element == 2 ? 1 : 0;
    return x86::ptr(x86::rsi, x86::rax, scaled() ? shift : 0, offset);
  }

 private:
  bool scaled() const { return t_.element == 1 || t_.element == 2 || t_.element == 4 || t_.element == 8; }
  x86::Assembler& a_;
  const x86::Gp& lane0_;
  const Tile& t_;
  uint32_t block_ = ~0u;
};
}  // namespace

void Emitter::wholeTileLoad(Value v) {
  const Inst& i = f_.insts[v];
  const Tile t(i.imm);
  const uint32_t bytes = ir::typeBytes(i.type), lanes = bytes == 8 ? 4 : 8;   // of a part
  tilePlane(a_, call_, t);
  BlockAddress address(a_, lane0_, t);
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Ymm d = target(v, part);
    const uint32_t lane = part * lanes;
    if (t.element == bytes) {
      const x86::Mem m = address.at(lane);
      if (bytes >= 4) a_.vmovups(d, m);
      else if (bytes == 2) a_.vpmovzxwd(d, m);
      else a_.vpmovzxbd(d, m);
    } else if (bytes == 4 && t.element == 8) {
      a_.vmovups(t0(), address.at(lane, true));
      a_.vshufps(t0(), t0(), address.at(lane + 4, true), t.byteOffset ? 0xdd : 0x88);
      a_.vpermq(d, t0(), 0xd8);
    } else {
      for (uint32_t q = 0; q < lanes / 4 || (bytes == 8 && q < 2); q++) {
        // Four elements, of 64 bits two.
        const x86::Xmm x = q ? t0().xmm() : t1().xmm();
        for (uint32_t k = 0; k < (bytes == 8 ? 2u : 4u); k++) {
          x86::Mem m = address.at(lane);
          m.addOffset(int64_t(q * (bytes == 8 ? 2 : 4) + k) * t.element);
          if (bytes == 8) {
            if (k) a_.vpinsrq(x, x, m, k);
            else a_.vmovq(x, m);
          } else if (bytes == 4) {
            if (k) a_.vpinsrd(x, x, m, k);
            else a_.vmovd(x, m);
          } else {
            m.setSize(bytes);
            a_.movzx(x86::ecx, m);
            if (k) a_.vpinsrd(x, x, x86::ecx, k);
            else a_.vmovd(x, x86::ecx);
          }
        }
      }
      a_.vinserti128(d, t1(), t0().xmm(), 1);
    }
    finish(v, part, d);
  }
}

void Emitter::wholeTileStore(Value v) {
  const Inst& i = f_.insts[v];
  const Value value = f_.operands(v)[0];
  const Type type = f_.type(value);
  const Tile t(i.imm);
  const uint32_t bytes = ir::typeBytes(type), lanes = bytes == 8 ? 4 : 8;
  tilePlane(a_, call_, t);
  BlockAddress address(a_, lane0_, t);
  for (uint32_t part = 0; part < partsOf(type); part++) {
    const Source from = settled(value, part, t2());
    Ymm s = t2();
    if (from.isReg) s = from.reg();
    else a_.move(s, from);
    const uint32_t lane = part * lanes;
    if (t.element == bytes && bytes >= 4) {
      a_.vmovups(address.at(lane), s);
    } else if (t.element == bytes) {
      a_.vextracti128(t0().xmm(), s, 1);
      a_.vpackusdw(t0().xmm(), s.xmm(), t0().xmm());
      if (bytes == 1) {
        a_.vpackuswb(t0().xmm(), t0().xmm(), t0().xmm());
        a_.vmovq(address.at(lane), t0().xmm());
      } else {
        a_.vmovups(address.at(lane), t0().xmm());
      }
    } else {
      for (uint32_t half = 0; half < 2; half++) {
        x86::Xmm x = s.xmm();
        if (half) {
          a_.vextracti128(t0().xmm(), s, 1);
          x = t0().xmm();
        }
        for (uint32_t k = 0; k < lanes / 2; k++) {
          x86::Mem m = address.at(lane);
          m.addOffset(int64_t(half * lanes / 2 + k) * t.element);
          switch (bytes) {
            case 1: a_.vpextrb(m, x, k * 4); break;
            case 2: a_.vpextrw(m, x, k * 2); break;
            case 4: a_.vpextrd(m, x, k); break;
            default: a_.vpextrq(m, x, k);
          }
        }
      }
    }
  }
}

void Emitter::tileLoad(Value v) {
  if (wholeHere()) return wholeTileLoad(v);
  const Inst& i = f_.insts[v];
  const Tile t(i.imm);
  const uint32_t bytes = ir::typeBytes(i.type), quads = bytes == 8 ? 1 : 2;   // of a part
  const int32_t offset = int32_t(t.byteOffset), step = int32_t(t.element);
  vregMaskBits(x86::r10d, p_.regions[region_].mask);
  tilePlane(a_, call_, t);
  for (uint32_t part = 0; part < partsOf(i.type); part++) {
    const Ymm d = target(v, part);
    a_.vpxor(d, d, d);
    for (uint32_t q = 0; q < quads; q++) {
      const uint32_t quad = part * quads + q;
      const asmjit::Label skip = a_.newLabel();
      a_.test(x86::r10d, 15u << (4 * quad));
      a_.jz(skip);
      tileQuad(a_, lane0_, t, quad);
      const x86::Mem first = x86::ptr(x86::rax, offset);
      if (bytes == 8) {
        if (t.element == 8) {
          a_.vmovups(d, first);
        } else {
          a_.vmovq(t0().xmm(), first);
          a_.vpinsrq(t0().xmm(), t0().xmm(), x86::ptr(x86::rax, offset + step), 1);
          a_.vmovq(t1().xmm(), x86::ptr(x86::rax, offset + 2 * step));
          a_.vpinsrq(t1().xmm(), t1().xmm(), x86::ptr(x86::rax, offset + 3 * step), 1);
          a_.vinserti128(d, t0(), t1().xmm(), 1);
        }
      } else {
        const x86::Xmm x = q ? t0().xmm() : d.xmm();
        if (t.element == bytes) {
          if (bytes == 4 && q) a_.vinsertf128(d, d, first, 1);
          else if (bytes == 4) a_.vmovups(x, first);
          else if (bytes == 2) a_.vpmovzxwd(x, first);
          else a_.vpmovzxbd(x, first);
        } else {
          for (int32_t k = 0; k < 4; k++) {
            const x86::Mem m = x86::ptr(x86::rax, offset + k * step);
            if (bytes == 4) {
              if (k) a_.vpinsrd(x, x, m, k);
              else a_.vmovd(x, m);
              continue;
            }
            if (bytes == 2) a_.movzx(x86::ecx, x86::word_ptr(x86::rax, offset + k * step));
            else a_.movzx(x86::ecx, x86::byte_ptr(x86::rax, offset + k * step));
            if (k) a_.vpinsrd(x, x, x86::ecx, k);
            else a_.vmovd(x, x86::ecx);
          }
        }
        if (q && !(t.element == bytes && bytes == 4)) a_.vinserti128(d, d, t0().xmm(), 1);
      }
      a_.bind(skip);
    }
    finish(v, part, d);
  }
}

void Emitter::tileStore(Value v) {
  if (wholeHere()) return wholeTileStore(v);
  const Inst& i = f_.insts[v];
  const Value value = f_.operands(v)[0];
  const Type type = f_.type(value);
  const Tile t(i.imm);
  const uint32_t bytes = ir::typeBytes(type), quads = bytes == 8 ? 1 : 2;
  const int32_t offset = int32_t(t.byteOffset);
  vregMaskBits(x86::r10d, p_.regions[region_].mask);
  tilePlane(a_, call_, t);
  for (uint32_t part = 0; part < partsOf(type); part++) {
    const Ymm s = loadSettled(value, part, t2());
    for (uint32_t q = 0; q < quads; q++) {
      const uint32_t quad = part * quads + q;
      const asmjit::Label some = a_.newLabel(), again = a_.newLabel(), skip = a_.newLabel();
      a_.mov(x86::ecx, x86::r10d);
      if (quad) a_.shr(x86::ecx, 4 * quad);
      a_.and_(x86::ecx, 15);
      a_.jz(skip);
      tileQuad(a_, lane0_, t, quad);
      const x86::Mem first = x86::ptr(x86::rax, offset);
      if (t.element == bytes) {
        // A whole quad at once.
        a_.cmp(x86::ecx, 15);
        a_.jne(some);
        if (bytes == 8) {
          a_.vmovups(first, s);
        } else if (bytes == 4) {
          if (q) a_.vextractf128(first, s, 1);
          else a_.vmovups(first, s.xmm());
        } else {
          x86::Xmm x = s.xmm();
          if (q) {
            a_.vextracti128(t0().xmm(), s, 1);
            x = t0().xmm();
          }
          a_.vpackusdw(t0().xmm(), x, x);
          if (bytes == 2) {
            a_.vmovq(first, t0().xmm());
          } else {
            a_.vpackuswb(t0().xmm(), t0().xmm(), t0().xmm());
            a_.vmovd(first, t0().xmm());
          }
        }
        a_.jmp(skip);
        a_.bind(some);
      }
      a_.vmovaps(frameMem(frameRow(1)), s);
      a_.bind(again);
      a_.tzcnt(x86::edx, x86::ecx);
      a_.imul(x86::r9d, x86::edx, t.element);
      if (bytes == 8) a_.mov(x86::r8, x86::ptr(frame_, x86::rdx, 3, int32_t(frameRow(1))));
      else a_.mov(x86::r8d, x86::ptr(frame_, x86::rdx, 2, int32_t(frameRow(1) + q * 16)));
      switch (bytes) {
        case 1: a_.mov(x86::byte_ptr(x86::rax, x86::r9, 0, offset), x86::r8b); break;
        case 2: a_.mov(x86::word_ptr(x86::rax, x86::r9, 0, offset), x86::r8w); break;
        case 4: a_.mov(x86::dword_ptr(x86::rax, x86::r9, 0, offset), x86::r8d); break;
        default: a_.mov(x86::qword_ptr(x86::rax, x86::r9, 0, offset), x86::r8);
      }
      a_.blsr(x86::ecx, x86::ecx);
      a_.jnz(again);
      a_.bind(skip);
    }
  }
}

}  // namespace pumice::jit
