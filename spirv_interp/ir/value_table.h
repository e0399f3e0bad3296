// Hash table of available values with undo: what was added since a mark is forgotten by rewind(). Entries
// leave only in the reverse of the order they came, so linear probing needs no tombstones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace pumice::ir {

class ValueTable {
 public:
  //! The value with this hash for which equal(value) holds, or 0.
  template <class Equal>
  uint32_t find(uint32_t hash, Equal&& equal) const {
    if (slots_.empty()) return 0;
    for (size_t i = hash & (slots_.size() - 1);; i = (i + 1) & (slots_.size() - 1)) {
      const Slot& s = slots_[i];
      if (!s.value) return 0;
      if (s.hash == hash && equal(s.value)) return s.value;
    }
  }

  void insert(uint32_t hash, uint32_t value) {
    if ((log_.size() + 1) * 2 > slots_.size()) grow(slots_.empty() ? 256 : slots_.size() * 4);
    log_.push_back({{hash, value}, 0});
    place(log_.back());
  }

  //! Makes room for about so many.
  void reserve(size_t values) {
    size_t slots = 256;
    while (slots < values * 2) slots *= 2;
    if (slots > slots_.size()) grow(slots);
  }

  size_t mark() const { return log_.size(); }
  void rewind(size_t mark) {
    while (log_.size() > mark) {
      slots_[log_.back().index] = {};
      log_.pop_back();
    }
  }

 private:
  struct Slot {
    uint32_t hash = 0, value = 0;
  };
  struct Entry {
    Slot slot;
    size_t index;
  };
  void place(Entry& e) {
    size_t i = e.slot.hash & (slots_.size() - 1);
    while (slots_[i].value) i = (i + 1) & (slots_.size() - 1);
    slots_[i] = e.slot;
    e.index = i;
  }
  void grow(size_t slots) {
    slots_.assign(slots, {});
    log_.reserve(slots / 2);
    for (Entry& e : log_) place(e);
  }
  std::vector<Slot> slots_;  // size is a power of two
  std::vector<Entry> log_;
};

}  // namespace pumice::ir
