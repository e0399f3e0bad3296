#include "spirv_interp/interpreter/code_list.h"

#include <algorithm>
#include <utility>

namespace pumice::interp {
namespace {

constexpr uint32_t kRowBytes = kMaxLanes * 4;     // 8-byte elements take two
constexpr uint32_t kMaxRowUnits = 1 << 14;        // 8 MiB

//! First fit over equal units.
class Places {
 public:
  uint32_t take(uint32_t count) {
    uint32_t run = 0;
    for (uint32_t i = lowest_; i < used_.size(); i++) {
      run = used_[i] ? 0 : run + 1;
      if (run == count) {
        mark(i + 1 - count, count, true);
        return i + 1 - count;
      }
    }
    const uint32_t start = uint32_t(used_.size()) - run;
    used_.resize(start + count, 0);
    mark(start, count, true);
    return start;
  }
  void give(uint32_t start, uint32_t count) {
    mark(start, count, false);
    lowest_ = std::min(lowest_, start);
  }
  uint32_t size() const { return uint32_t(used_.size()); }

 private:
  void mark(uint32_t start, uint32_t count, bool used) {
    for (uint32_t i = start; i < start + count; i++) used_[i] = used;
    if (used && start == lowest_) lowest_ = start + count;
  }
  std::vector<uint8_t> used_;
  uint32_t lowest_ = 0;   // nothing is free below
};

}  // namespace

Operand CodeList::newRow(ir::Type type) {
  rows_.push_back({.bytes = ir::typeBytes(type)});
  return {Operand::Row, type, uint32_t(rows_.size() - 1)};
}

void CodeList::use(Operand o) {
  if (o.kind != Operand::Row) return;
  Row& row = rows_[o.index];
  const uint32_t here = uint32_t(items_.size());
  if (row.def == ~0u) row.def = here;
  row.end = std::max(row.end, here);
  for (Loop& loop : loops_)   // outermost first
    if (loop.begin > row.def) {
      if (loop.outside.empty() || loop.outside.back() != o.index) loop.outside.push_back(o.index);
      break;
    }
}

size_t CodeList::add(Kernel kernel, Operand dst, std::span<const Operand> src, uint64_t imm) {
  Item item{};
  item.code.run = kernel;
  item.code.imm = imm;
  for (size_t i = 0; i < src.size(); i++) {
    use(src[i]);
    item.code.src[i] = src[i].index;
    if (src[i].kind == Operand::Row) item.rows |= uint8_t(1u << i);
  }
  use(dst);
  item.code.dst = dst.index;
  if (dst.kind == Operand::Row) item.rows |= 0x80;
  items_.push_back(item);
  return items_.size() - 1;
}

void CodeList::endLoop() {
  const uint32_t last = uint32_t(items_.size() - 1);
  for (uint32_t r : loops_.back().outside) rows_[r].end = std::max(rows_[r].end, last);
  loops_.pop_back();
}

bool CodeList::finish(std::vector<Code>& out, size_t& registerBytes) {
  Places rows, masks;
  auto units = [](const Row& r) { return r.bytes == 8 ? 2u : 1u; };
  auto give = [&](const Row& r) { (r.bytes ? rows : masks).give(r.place, units(r)); };

  // Rows that start and end at each item, as lists through the rows.
  constexpr uint32_t kNone = ~0u;
  std::vector<uint32_t> starts(items_.size(), kNone), ends(items_.size(), kNone);
  std::vector<uint32_t> nextStart(rows_.size(), kNone), nextEnd(rows_.size(), kNone);
  for (uint32_t r = uint32_t(rows_.size()); r-- > 0;) {
    if (rows_[r].def == kNone) continue;   // never used
    nextStart[r] = std::exchange(starts[rows_[r].def], r);
    nextEnd[r] = std::exchange(ends[rows_[r].end], r);
  }
  for (size_t i = 0; i < items_.size(); i++) {
    const Item& item = items_[i];
    // A result may take the place of an operand that ends here, element for element: not when sizes differ,
    // as a kernel may then overwrite what it has still to read.
    uint32_t reused = ~0u;
    const uint32_t dst = item.rows & 0x80 ? item.code.dst : ~0u;
    if (dst != ~0u && rows_[dst].def == i && nextStart[starts[i]] == kNone)
      for (unsigned k = 0; k < 5 && reused == ~0u; k++) {
        const uint32_t r = item.code.src[k];
        if (item.rows >> k & 1 && rows_[r].end == i && rows_[r].def != i && rows_[r].bytes == rows_[dst].bytes) reused = r;
      }
    for (uint32_t r = starts[i]; r != kNone; r = nextStart[r])
      rows_[r].place = r == dst && reused != ~0u ? rows_[reused].place : (rows_[r].bytes ? rows : masks).take(units(rows_[r]));
    for (uint32_t r = ends[i]; r != kNone; r = nextEnd[r])
      if (r != reused) give(rows_[r]);
    if (rows.size() > kMaxRowUnits) return false;
  }

  const uint32_t maskStart = rows.size() * kRowBytes;
  auto place = [&](uint32_t r) { return rows_[r].bytes ? rows_[r].place * kRowBytes : maskStart + rows_[r].place * kMaskBytes; };
  out.clear();
  out.reserve(items_.size());
  for (const Item& item : items_) {
    Code c = item.code;
    for (unsigned k = 0; k < 5; k++)
      if (item.rows >> k & 1) c.src[k] = place(c.src[k]);
    if (item.rows & 0x80) c.dst = place(c.dst);
    out.push_back(c);
  }
  registerBytes = maskStart + masks.size() * kMaskBytes;
  return true;
}

}  // namespace pumice::interp
