// Routines by key. Keys are short and entries few: a list compared by hash first.
#pragma once

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "base/hash.h"
#include "pipeline/routine.h"

namespace pumice::pipeline {

constexpr size_t kMaxVariants = 64;        //!< per stage and pipeline; then the one not used for longest is forgotten
constexpr size_t kTableStates = 64;        //!< states of one image or sampler among which a table routine chooses
constexpr size_t kMaxForgotten = 4096;     //!< keys that are remembered without their routines

uint64_t hashImages(std::span<const ImageState> images);
inline uint64_t hashKey(const VertexKey& k) { return base::hashCombine(uint64_t(k.numerics), hashImages(k.images)); }
inline uint64_t hashKey(const FragmentKey& k) {
  return base::hashCombine(uint64_t(k.numerics) | uint64_t(k.countSamples) << 8 | uint64_t(k.statistics) << 9 | uint64_t(k.settled) << 10 | uint64_t(k.rows) << 11 | uint64_t(k.depthTiled) << 16, hashImages(k.images));
}

//! Adds the states of `more` that `images` lacks, use by use. False, and nothing changed: one use would have more than kTableStates.
bool addStates(std::vector<ImageState>& images, std::span<const ImageState> more);

//! Few entries with short keys: a list, compared by hash first. A program that goes through more states than are kept would make the
//! same routines again and again. So the key of a forgotten routine stays, and when it comes back, one *table routine* is made for it and
//! all that were forgotten with it: it finds out from the descriptors which state they are in, as routines do that index arrays of them.
template <typename Key, typename Routine>
class Variants {
 public:
  //! `known` says whether there is an entry; its routine may be null.
  std::shared_ptr<const Routine> find(const Key& key, bool& known) const {
    const uint64_t hash = hashKey(key);
    std::lock_guard lock(mutex_);
    known = true;
    if (const Entry* e = entry(hash, key)) {
      e->used = ++clock_;
      return e->routine;
    }
    if (!tables_.empty()) {
      Key bare = key;
      bare.images.clear();
      for (const Table& t : tables_)
        if (t.bare == bare && std::all_of(key.images.begin(), key.images.end(), [&](const ImageState& s) { return std::find(t.images.begin(), t.images.end(), s) != t.images.end(); }))
          return t.routine;
    }
    known = false;
    return nullptr;
  }
  //! Returns the entry that holds the key afterwards: another thread may have been first. The mutex is never held while
  //! a routine is made.
  std::shared_ptr<const Routine> insert(const Key& key, std::shared_ptr<const Routine> routine) {
    const uint64_t hash = hashKey(key);
    std::lock_guard lock(mutex_);
    if (const Entry* e = entry(hash, key)) return e->routine;
    if (entries_.size() >= kMaxVariants) {
      const auto oldest = std::min_element(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) { return a.used < b.used; });
      if (forgotten_.size() >= kMaxForgotten) forgotten_.erase(forgotten_.begin());
      forgotten_.push_back(std::move(oldest->key));
      entries_.erase(oldest);
    }
    entries_.push_back({hash, key, routine, ++clock_});
    return routine;
  }
  //! If the key was forgotten: the key of a table routine that serves it and others, which are no longer forgotten.
  std::optional<Key> tableKey(const Key& key) {
    std::lock_guard lock(mutex_);
    if (std::find(forgotten_.begin(), forgotten_.end(), key) == forgotten_.end()) return {};
    Key wide = key;
    std::erase_if(forgotten_, [&](const Key& other) {
      Key alike = other;
      alike.images = wide.images;
      return alike == wide && addStates(wide.images, other.images);
    });
    return wide;
  }
  void insertTable(const Key& wide, std::shared_ptr<const Routine> routine) {
    Table t{wide, wide.images, std::move(routine)};
    t.bare.images.clear();
    std::lock_guard lock(mutex_);
    tables_.push_back(std::move(t));
  }

 private:
  struct Entry {
    uint64_t hash;
    Key key;
    std::shared_ptr<const Routine> routine;   //!< null: cannot be made (the reason was logged once)
    mutable uint64_t used;
  };
  struct Table {
    Key bare;                                 //!< without images
    std::vector<ImageState> images;
    std::shared_ptr<const Routine> routine;
  };
  const Entry* entry(uint64_t hash, const Key& key) const {
    for (const Entry& e : entries_)
      if (e.hash == hash && e.key == key) return &e;
    return nullptr;
  }
  mutable std::mutex mutex_;
  mutable uint64_t clock_ = 0;
  std::vector<Entry> entries_;
  std::vector<Key> forgotten_;
  std::vector<Table> tables_;
};

}  // namespace pumice::pipeline
