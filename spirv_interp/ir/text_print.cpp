#include <cstdio>
#include <string>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/text.h"

namespace pumice::ir {

ImmKind immKind(Op op) {
  switch (op) {
    case Op::Const:
      return ImmKind::Const;
    case Op::Input:
    case Op::UniformInput:
    case Op::Output:
    case Op::Break:
    case Op::QuadDdx:
    case Op::QuadDdy:
    case Op::QuadSwizzle:
    case Op::LocalAlloc:
    case Op::QuadLoad:
    case Op::Descriptor:
    case Op::TupleGet:
    case Op::FilterHalves:
    case Op::FilterBytes:
    case Op::FilterLevel:
    case Op::FilterLevels:
      return ImmKind::Number;
    case Op::Load:
    case Op::LoadConst:
    case Op::Store:
    case Op::AtomicCas:
    case Op::LocalLoad:
    case Op::LocalStore:
    case Op::SharedLoad:
    case Op::SharedStore:
    case Op::SharedAtomicCas:
      return ImmKind::Offset;
    case Op::TableLoad:
      return ImmKind::Table;
    case Op::TileLoad:
    case Op::TileStore:
      return ImmKind::Tile;
    case Op::ShaderInput:
    case Op::ShaderOutput:
    case Op::Builtin:
      return ImmKind::Pair;
    case Op::Atomic:
    case Op::SharedAtomic:
      return ImmKind::Atomic;
    case Op::ImageOp:
      return ImmKind::Image;
    case Op::SubgroupReduce:
      return ImmKind::Reduce;
    default:
      return ImmKind::None;
  }
}

namespace {

std::string number(const char* format, auto... args) {
  char text[96];
  std::snprintf(text, sizeof text, format, args...);
  return text;
}

std::string tableName(uint64_t table) {
  if (table == kTablePush) return "push";
  if (table == kTableDraw) return "draw";
  if (table == kTableConstants) return "constants";
  return number("set%llu", static_cast<unsigned long long>(table - kTableSet0));
}

std::string constantText(Type t, uint64_t bits) {
  const auto x = static_cast<unsigned long long>(bits);
  if (isFloat(t)) return number("0x%llx ; %.9g", x, floatValue(t, bits));
  if (t == Type::I32 && int32_t(bits) < 0) return number("%d", int32_t(bits));
  return number("%llu", x);
}

std::string imageText(const ImageOpInfo& i) {
  std::string s = "{";
  s += kImageKindNames[static_cast<size_t>(i.kind)];
  s += std::string(" ") + kImageDimNames[static_cast<size_t>(i.dim)];
  if (i.arrayed) s += " arrayed";
  if (i.multisampled) s += " multisampled";
  if (i.implicitLod) s += " implicit";
  if (i.compareExchange) s += " cas";
  if (i.texelSigned) s += " signed";
  if (i.kind == ImageKind::Atomic) s += std::string(" atomic=") + kAtomicNames[static_cast<size_t>(i.atomic)];
  s += number(" operands=%u image=%u sampler=%u", unsigned(i.operands), i.imageResource, i.samplerResource);
  s += std::string(" texel=") + kTypeNames[static_cast<size_t>(i.texelType)];
  if (i.storageFormat) s += number(" format=%u", i.storageFormat);
  return s + "}";
}

// The comment of a constant must stand last, so it is returned apart.
std::string immText(const Function& f, const Inst& i, std::string& comment) {
  const auto imm = static_cast<unsigned long long>(i.imm);
  const auto high = static_cast<unsigned>(i.imm >> 32), low = static_cast<unsigned>(i.imm);
  switch (immKind(i.op)) {
    case ImmKind::None:
      return "";
    case ImmKind::Const: {
      std::string s = constantText(i.type, i.imm);
      if (const size_t at = s.find(" ;"); at != std::string::npos) {
        comment = s.substr(at);
        s.resize(at);
      }
      return " " + s;
    }
    case ImmKind::Number:
      return number(" %llu", imm);
    case ImmKind::Offset:
      return i.imm ? number(" +%llu", imm) : "";
    case ImmKind::Table:
      return " " + tableName(high) + number("+%u", low);
    case ImmKind::Pair:
      return number(" %u:%u", high, low);
    case ImmKind::Tile:
      return number(" %u:%u+%u", high, low >> 16, low & 0xffff);
    case ImmKind::Atomic:
      return high < std::size(kAtomicNames) ? number(" %s+%u", kAtomicNames[high], low) : " ?";
    case ImmKind::Reduce: {
      const size_t op = i.imm & 0xff, scan = i.imm >> 8 & 0xff, log = i.imm >> 16;
      if (op >= std::size(kReduceNames) || scan >= std::size(kScanNames) || log > 31) return " ?";
      return number(" %s:%s:%u", kReduceNames[op], kScanNames[scan], 1u << log);
    }
    case ImmKind::Image:
      return i.imm < f.imageOps.size() ? " " + imageText(f.imageOps[i.imm]) : " {?}";
  }
  return "";
}

}  // namespace

std::string print(const Function& f) {
  std::string s = "function \"" + f.name + "\"";
  if (f.sharedBytes) s += number(" shared=%u", f.sharedBytes);
  if (f.groupSize[0]) s += number(" group=%ux%ux%u", unsigned(f.groupSize[0]), unsigned(f.groupSize[1]), unsigned(f.groupSize[2]));
  s += "\n";
  size_t depth = 1;
  for (Value v = 1; v < f.insts.size(); ++v) {
    const Inst& i = f.insts[v];
    const bool closes = i.op == Op::Else || i.op == Op::EndIf || i.op == Op::EndLoop || i.op == Op::EndBlock;
    if (closes && depth > 1) --depth;
    s.append(depth * 2, ' ');
    if (i.op == Op::If || i.op == Op::Else || i.op == Op::Loop || i.op == Op::Block) ++depth;
    if (i.type != Type::None) s += number("%%%u = ", v);
    s += opInfo(i.op).text;
    if (i.type != Type::None) s += std::string(" ") + kTypeNames[static_cast<size_t>(i.type)];
    std::string comment;
    s += immText(f, i, comment);
    const char* separator = " ";
    for (Value o : f.operands(i)) {
      s += number("%s%%%u", separator, o);
      separator = ", ";
    }
    for (const InstFlagName& n : kInstFlagNames)
      if (i.flags & n.flag) s += std::string(" !") + n.name;
    if (i.rate != Rate::Lane) s += std::string(" ~") + kRateNames[static_cast<size_t>(i.rate)];
    if (i.line) s += number(" @%u", i.line);
    s += comment + "\n";
  }
  return s;
}

}  // namespace pumice::ir
