#include "pipeline/routine_code.h"

#include <algorithm>
#include <map>
#include <mutex>

#include "base/hash.h"
#include "base/log.h"
#include "pipeline/each_row.h"
#include "pipeline/ideas.h"
#include "spirv_interp/ir/bytes.h"
#include "spirv_interp/jit/engine.h"

namespace pumice::pipeline {

namespace {

base::Result<std::unique_ptr<interp::Executable>> makeExecutable(const ir::Function& f, const interp::CompileOptions& options, bool wholeBlocks) {
  const Ideas off = disabledIdeas();
  constexpr uint32_t kOneVector = 8;   // lanes
  auto made = jit::makeExecutable(f, options, wholeBlocks, off & bit(Idea::Interleaving) ? kOneVector : 0);
  if (!made || !(off & bit(Idea::Preamble))) return made;
  return preambleEachRow(std::move(made).value());
}

}  // namespace

struct RoutineCode::Making {
  Making(const ir::Function& f, interp::CompileOptions options, bool wholeBlocks)
      : task([this, f, options = std::move(options), wholeBlocks] {
          try {
            auto made = makeExecutable(f, options, wholeBlocks);
            if (made) executable = std::move(made).value();
            else error = made.error().message;
          } catch (const std::bad_alloc&) {
            error = "out of memory";
          }
        }),
        name(f.name) {}
  std::vector<std::byte> bytes;   //!< what it is made from
  std::unique_ptr<interp::Executable> executable;   //!< these two are the task's until it is done
  std::string error;
  base::Task task;
  const std::string name;
  std::atomic<bool> told{false};   //!< why there is no executable
};

//! By the bytes of the function that they are made from, as long as somebody has them.
class RoutineCode::Known {
 public:
  //! The one that is known, or `fresh`, which is from now on.
  template <typename Make>
  std::shared_ptr<Making> findOrInsert(std::vector<std::byte> bytes, bool& fresh, Make&& make) {
    const uint64_t hash = base::hashBytes(bytes.data(), bytes.size());
    std::vector<std::shared_ptr<Making>> others;   // not to be destroyed, should they be the last, under the lock
    {
      std::lock_guard lock(mutex_);
      if (auto found = find(hash, bytes, others)) return found;
    }
    Making* entry = make().release();
    entry->bytes = std::move(bytes);
    std::shared_ptr<Making> shared(entry, [this, hash](Making* e) {
      {
        std::lock_guard lock(mutex_);
        auto [it, end] = entries_.equal_range(hash);
        while (it != end && it->second.entry != e) ++it;
        if (it != end) entries_.erase(it);
      }
      delete e;
    });
    std::lock_guard lock(mutex_);
    if (auto found = find(hash, entry->bytes, others)) {   // somebody was quicker
      others.push_back(std::move(shared));
      return found;
    }
    entries_.emplace(hash, Entry{entry, shared});
    fresh = true;
    return shared;
  }

  //! Never destroyed, since threads may still compile while the process ends; without executables it holds nothing that a driver
  //! that is unloaded would leave behind.
  static Known& all() {
    union Forever {
      Known known;
      Forever() : known() {}
      ~Forever() {}
    };
    static Forever forever;
    return forever.known;
  }

 private:
  struct Entry {
    const Making* entry;
    std::weak_ptr<Making> shared;
  };
  std::shared_ptr<Making> find(uint64_t hash, const std::vector<std::byte>& bytes, std::vector<std::shared_ptr<Making>>& others) {
    for (auto [it, end] = entries_.equal_range(hash); it != end; ++it) {
      auto entry = it->second.shared.lock();
      if (entry && entry->bytes == bytes) return entry;
      others.push_back(std::move(entry));
    }
    return nullptr;
  }
  std::mutex mutex_;
  std::multimap<uint64_t, Entry> entries_;   // no memory while empty
};

bool RoutineCode::ready(base::ThreadPool* workers) const {
  Making& m = *making_;
  workers ? workers->finish(m.task) : m.task.finish();
  if (m.executable) return true;
  if (!m.told.exchange(true)) base::logError("%s: %s", m.name.c_str(), m.error.c_str());
  return false;
}

const interp::Executable* RoutineCode::operator->() const { return making_->executable.get(); }

base::Result<RoutineCode> compileRoutine(const ir::Function& f, ir::Numerics numerics, interp::CheckedShader checked, bool wholeBlocks,
                                         base::ThreadPool* workers) {
  using Making = RoutineCode::Making;
  interp::CompileOptions options;
  options.numerics = numerics;
  options.checked = std::move(checked);
  const auto make = [&] { return std::make_unique<Making>(f, std::move(options), wholeBlocks); };
  std::shared_ptr<Making> making;
  bool fresh = false;
  // What is watched says which shader it is of.
  if (std::any_of(f.insts.begin(), f.insts.end(), [](const ir::Inst& i) { return i.op == ir::Op::Check; })) {
    making = make();
  } else {
    ir::ByteWriter w;
    w.value(numerics);
    w.value(wholeBlocks);
    ir::fields(w, f);
    for (const uint16_t size : f.groupSize) w.value(size);
    making = RoutineCode::Known::all().findOrInsert(std::move(w.bytes), fresh, make);
  }
  if (workers && jit::emitsCode()) {
    if (fresh) workers->post({making, &making->task});
  } else {
    making->task.finish();
    if (!making->executable) return base::Error{making->error};
  }
  return RoutineCode(std::move(making));
}

}  // namespace pumice::pipeline
