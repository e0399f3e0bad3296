#include <bit>
#include <cstdlib>
#include <string>
#include <unordered_map>
#include <vector>

#include "spirv_interp/ir/fold.h"
#include "spirv_interp/ir/text.h"

namespace pumice::ir {

namespace {

template <size_t N>
bool lookUp(const char* const (&names)[N], std::string_view word, size_t& index) {
  for (index = 0; index < N; ++index)
    if (word == names[index]) return true;
  return false;
}

bool parseNumber(std::string_view word, uint64_t& out) {
  if (word.empty()) return false;
  const std::string s(word);
  char* end = nullptr;
  out = s[0] == '-' ? uint64_t(std::strtoll(s.c_str(), &end, 0)) : std::strtoull(s.c_str(), &end, 0);
  return *end == 0;
}

bool parseConstant(Type t, std::string_view word, uint64_t& out) {
  if (isFloat(t) && (!word.starts_with("0x") || word.find('p') != word.npos)) {
    const std::string s(word);
    char* end = nullptr;
    // An f32 is read as such: through double it could round twice.
    out = t == Type::F32 ? floatBits(t, std::strtof(s.c_str(), &end))
                         : floatBits(t, std::strtod(s.c_str(), &end));
    return end != s.c_str() && *end == 0;
  }
  if (!parseNumber(word, out)) return false;
  if (word[0] == '-') out &= allOnes(t);
  return (out & ~allOnes(t)) == 0;
}

// "low" alone or "high<separator>low".
bool split(std::string_view word, char separator, std::string_view& first, uint64_t& second) {
  const size_t at = word.find(separator);
  first = word.substr(0, at);
  second = 0;
  return at == word.npos || parseNumber(word.substr(at + 1), second);
}

class Parser {
 public:
  explicit Parser(Function& f) : f_(f) {
    for (size_t i = 1; i < static_cast<size_t>(Op::kCount); ++i) ops_[opInfo(Op(i)).text] = Op(i);
  }

  bool line(std::string_view text, std::string& error) {
    tokenize(text);
    next_ = 0;
    error.clear();
    if (words_.empty()) return true;
    if (words_[0] == "function") return header(error);
    std::string_view name;
    if (words_.size() >= 2 && words_[0][0] == '%' && words_[1] == "=") {
      name = words_[0].substr(1);
      next_ = 2;
    }
    return instruction(name, error);
  }

 private:
  void tokenize(std::string_view text) {
    words_.clear();
    size_t i = 0;
    while (i < text.size()) {
      const char c = text[i];
      if (c == ';') return;
      if (c == ' ' || c == '\t' || c == ',' || c == '\r') {
        ++i;
        continue;
      }
      size_t end = i + 1;
      if (c == '"' || c == '{') {
        end = text.find(c == '"' ? '"' : '}', end);
        end = end == text.npos ? text.size() : end + 1;
      } else {
        while (end < text.size() && std::string_view(" \t\r,;").find(text[end]) == std::string_view::npos)
          ++end;
      }
      words_.push_back(text.substr(i, end - i));
      i = end;
    }
  }

  //! 8x4x1
  bool parseGroup(std::string_view text) {
    for (uint16_t& size : f_.groupSize) {
      const size_t end = text.find('x');
      uint64_t n = 0;
      if (!parseNumber(text.substr(0, end), n) || !n || n > 1024 || (end == text.npos) != (&size == f_.groupSize + 2)) return false;
      size = uint16_t(n);
      text = end == text.npos ? text : text.substr(end + 1);
    }
    return true;
  }

  bool header(std::string& error) {
    for (size_t i = 1; i < words_.size(); ++i) {
      uint64_t n = 0;
      if (words_[i][0] == '"')
        f_.name = std::string(words_[i].substr(1, words_[i].size() - 2));
      else if (words_[i].starts_with("shared=") && parseNumber(words_[i].substr(7), n))
        f_.sharedBytes = uint32_t(n);
      else if (words_[i].starts_with("group=") && parseGroup(words_[i].substr(6)))
        continue;
      else
        return fail(error, "unknown word in function header", words_[i]);
    }
    return true;
  }

  bool instruction(std::string_view name, std::string& error) {
    if (next_ >= words_.size()) return fail(error, "operation expected", "");
    const auto found = ops_.find(words_[next_]);
    if (found == ops_.end()) return fail(error, "unknown operation", words_[next_]);
    ++next_;
    Inst inst;
    inst.op = found->second;
    if (!name.empty()) {
      size_t t = 0;
      if (next_ >= words_.size() || !lookUp(kTypeNames, words_[next_], t))
        return fail(error, "type expected", word());
      inst.type = Type(t);
      ++next_;
    } else if (opInfo(inst.op).result != ResultRule::None) {
      return fail(error, "result needs a name", opInfo(inst.op).text);
    }
    if (!immediate(inst, error)) return false;
    inst.firstOperand = uint32_t(f_.operandPool.size());
    for (; next_ < words_.size(); ++next_)
      if (!suffix(inst, words_[next_], error)) return false;
    f_.insts.push_back(inst);
    if (!name.empty() && !names_.emplace(std::string(name), Value(f_.insts.size() - 1)).second)
      return fail(error, "defined twice", name);
    return true;
  }

  bool suffix(Inst& inst, std::string_view w, std::string& error) {
    uint64_t n = 0;
    size_t rate = 0;
    if (w[0] == '%') {
      const auto v = names_.find(std::string(w.substr(1)));
      if (v == names_.end()) return fail(error, "not defined before its use", w);
      f_.operandPool.push_back(v->second);
      ++inst.operandCount;
      return true;
    }
    if (w[0] == '!') {
      for (const InstFlagName& flag : kInstFlagNames)
        if (w.substr(1) == flag.name) {
          inst.flags |= flag.flag;
          return true;
        }
    }
    if (w[0] == '@' && parseNumber(w.substr(1), n)) {
      inst.line = uint32_t(n);
      return true;
    }
    if (w[0] == '~' && lookUp(kRateNames, w.substr(1), rate)) {
      inst.rate = Rate(rate);
      return true;
    }
    return fail(error, "unexpected word", w);
  }

  bool immediate(Inst& inst, std::string& error) {
    const ImmKind kind = immKind(inst.op);
    if (kind == ImmKind::None) return true;
    const std::string_view w = word();
    std::string_view first;
    uint64_t low = 0, high = 0;
    size_t index = 0;
    bool ok = true;
    switch (kind) {
      case ImmKind::None:
        break;
      case ImmKind::Const:
        ok = parseConstant(inst.type, w, inst.imm);
        break;
      case ImmKind::Number:
        ok = parseNumber(w, inst.imm);
        break;
      case ImmKind::Offset:
        if (!w.starts_with("+")) return true;
        ok = parseNumber(w.substr(1), inst.imm);
        break;
      case ImmKind::Table:
        ok = split(w, '+', first, low);
        if (first == "push")
          high = kTablePush;
        else if (first == "draw")
          high = kTableDraw;
        else if (first == "constants")
          high = kTableConstants;
        else if (first.starts_with("set"))
          ok = ok && parseNumber(first.substr(3), high) && high < kMaxDescriptorSets, high += kTableSet0;
        else
          ok = false;
        inst.imm = high << 32 | low;
        break;
      case ImmKind::Pair:
        ok = split(w, ':', first, low) && parseNumber(first, high);
        inst.imm = high << 32 | low;
        break;
      case ImmKind::Tile: {
        const size_t colon = w.find(':');
        uint64_t bytes = 0;
        ok = colon != w.npos && parseNumber(w.substr(0, colon), high) &&
             split(w.substr(colon + 1), '+', first, low) && parseNumber(first, bytes) && bytes <= 0xffff &&
             low <= 0xffff;
        inst.imm = high << 32 | bytes << 16 | low;
        break;
      }
      case ImmKind::Atomic:
        ok = split(w, '+', first, low) && lookUp(kAtomicNames, first, index);
        inst.imm = uint64_t(index) << 32 | low;
        break;
      case ImmKind::Reduce: {
        const size_t colon = w.find(':');
        size_t scan = 0;
        ok = colon != w.npos && lookUp(kReduceNames, w.substr(0, colon), index) && split(w.substr(colon + 1), ':', first, low) &&
             lookUp(kScanNames, first, scan) && low <= 0x80000000u && std::has_single_bit(low);
        if (ok) inst.imm = index | scan << 8 | uint64_t(std::countr_zero(low)) << 16;
        break;
      }
      case ImmKind::Image:
        ok = image(inst, w, error);
        break;
    }
    ++next_;
    if (ok) return true;
    return error.empty() ? fail(error, "bad immediate", w) : false;
  }

  bool image(Inst& inst, std::string_view text, std::string& error) {
    if (text.size() < 2 || text[0] != '{') return false;
    text = text.substr(1, text.size() - 2);
    ImageOpInfo info;
    while (!text.empty()) {
      const size_t end = text.find(' ');
      const std::string_view w = text.substr(0, end);
      text = end == text.npos ? std::string_view() : text.substr(end + 1);
      if (!w.empty() && !imageWord(info, w)) return fail(error, "unknown word of an image operation", w);
    }
    inst.imm = f_.imageOps.size();
    f_.imageOps.push_back(info);
    return true;
  }

  static bool imageWord(ImageOpInfo& info, std::string_view w) {
    size_t index = 0;
    const size_t eq = w.find('=');
    if (eq == w.npos) {
      // "atomic" is both a kind and a key; without '=' it is the kind.
      if (lookUp(kImageKindNames, w, index))
        info.kind = ImageKind(index);
      else if (lookUp(kImageDimNames, w, index))
        info.dim = ImageDim(index);
      else if (w == "arrayed")
        info.arrayed = true;
      else if (w == "multisampled")
        info.multisampled = true;
      else if (w == "implicit")
        info.implicitLod = true;
      else if (w == "cas")
        info.compareExchange = true;
      else if (w == "signed")
        info.texelSigned = true;
      else
        return false;
      return true;
    }
    const std::string_view key = w.substr(0, eq), value = w.substr(eq + 1);
    if (key == "atomic" && lookUp(kAtomicNames, value, index)) return info.atomic = AtomicOp(index), true;
    if (key == "texel" && lookUp(kTypeNames, value, index)) return info.texelType = Type(index), true;
    uint64_t n = 0;
    if (!parseNumber(value, n)) return false;
    if (key == "operands")
      info.operands = uint16_t(n);
    else if (key == "image")
      info.imageResource = uint32_t(n);
    else if (key == "sampler")
      info.samplerResource = uint32_t(n);
    else if (key == "format")
      info.storageFormat = uint32_t(n);
    else
      return false;
    return true;
  }

  std::string_view word() const { return next_ < words_.size() ? words_[next_] : std::string_view(); }

  static bool fail(std::string& error, const char* what, std::string_view word) {
    error = std::string(what) + " '" + std::string(word) + "'";
    return false;
  }

  Function& f_;
  std::vector<std::string_view> words_;
  size_t next_ = 0;
  std::unordered_map<std::string_view, Op> ops_;
  std::unordered_map<std::string, Value> names_;
};

}  // namespace

bool parse(std::string_view text, Function& out, std::string& error) {
  out = Function{};
  Parser parser(out);
  unsigned lineNumber = 0;
  while (!text.empty()) {
    const size_t end = text.find('\n');
    ++lineNumber;
    if (!parser.line(text.substr(0, end), error)) {
      error = "line " + std::to_string(lineNumber) + ": " + error;
      return false;
    }
    text = end == text.npos ? std::string_view() : text.substr(end + 1);
  }
  return true;
}

}  // namespace pumice::ir
