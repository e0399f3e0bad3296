// Routines by key. Keys are short and entries few: a list compared by hash first.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "base/hash.h"
#include "pipeline/routine.h"

namespace pumice::pipeline {

constexpr size_t kMaxVariants = 64;   //!< per stage and pipeline; then the oldest is forgotten

uint64_t hashImages(std::span<const ImageState> images);
inline uint64_t hashKey(const VertexKey& k) { return base::hashCombine(uint64_t(k.numerics), hashImages(k.images)); }
inline uint64_t hashKey(const FragmentKey& k) {
  return base::hashCombine(uint64_t(k.numerics) | uint64_t(k.countSamples) << 8 | uint64_t(k.statistics) << 9 | uint64_t(k.settled) << 10 | uint64_t(k.rows) << 11 | uint64_t(k.depthTiled) << 16, hashImages(k.images));
}

//! Few entries with short keys: a list in order of making, compared by hash first.
template <typename Key, typename Routine>
class Variants {
 public:
  //! `known` says whether there is an entry; its routine may be null.
  std::shared_ptr<const Routine> find(const Key& key, bool& known) const {
    const uint64_t hash = hashKey(key);
    std::lock_guard lock(mutex_);
    for (const Entry& e : entries_)
      if (e.hash == hash && e.key == key) {
        known = true;
        return e.routine;
      }
    known = false;
    return nullptr;
  }
  //! Returns the entry that holds the key afterwards: another thread may have been first. The mutex is never held while
  //! a routine is made.
  std::shared_ptr<const Routine> insert(const Key& key, std::shared_ptr<const Routine> routine) {
    const uint64_t hash = hashKey(key);
    std::lock_guard lock(mutex_);
    for (const Entry& e : entries_)
      if (e.hash == hash && e.key == key) return e.routine;
    if (entries_.size() >= kMaxVariants) entries_.erase(entries_.begin());
    entries_.push_back({hash, key, routine});
    return routine;
  }

 private:
  struct Entry {
    uint64_t hash;
    Key key;
    std::shared_ptr<const Routine> routine;   //!< null: cannot be made (the reason was logged once)
  };
  mutable std::mutex mutex_;
  std::vector<Entry> entries_;
};

}  // namespace pumice::pipeline
