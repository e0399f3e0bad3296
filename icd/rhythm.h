// How an application goes about submitting and waiting.
#pragma once

#include <cstdint>

namespace pumice::icd {

//! An application that comes back at once to wait for all that it has just submitted may as well do the work itself: then no thread has to
//! wake up for it, nor it for a thread, which takes as long as a small frame. Times in nanoseconds of one clock.
class Rhythm {
 public:
  //! Of the submission that begins now. Above 0.
  uint64_t submits(uint64_t now) {
    if (first_ <= number_ && now - returned_ > kAtOnce) streak_ = 0;
    return ++number_;
  }
  //! The call with it returns.
  void submitted(uint64_t now) { returned_ = now; }
  //! A wait that has all the time begins: for the submission of that number, 0: for something else.
  void waits(uint64_t now, uint64_t number) {
    if (first_ > number_) return;   // nothing was submitted since the last one
    streak_ = number >= first_ && now - returned_ <= kAtOnce ? streak_ + 1 : 0;
    first_ = number_ + 1;
  }
  bool waitsAtOnce() const { return streak_ >= kTurns; }

 private:
  static constexpr uint64_t kAtOnce = 50'000, kTurns = 3;
  uint64_t number_ = 0, first_ = 1;   //!< the last submission; the first one since the last wait
  uint64_t returned_ = 0, streak_ = 0;
};

}  // namespace pumice::icd
