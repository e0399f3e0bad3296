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
    if (first_ <= number_ && now - returned_ > kAtOnce) breaks();
    begun_ = now;
    return ++number_;
  }
  //! The call with it returns. `itself`: the work was done in it.
  void submitted(uint64_t now, bool itself = false) {
    returned_ = now;
    itself_ |= itself;
    if (itself && now - begun_ > kLong) breaks();   // beside so much work a thread wakes up for nothing, and others may want the queue
  }
  //! A wait that has all the time begins: for the submission of that number, 0: for something else.
  void waits(uint64_t now, uint64_t number) {
    if (first_ > number_) return;   // nothing was submitted since the last one
    if (number < first_ || now - returned_ > kAtOnce) breaks();
    else if (++streak_ >= kSure * turns_) turns_ = kTurns;
    itself_ = false;
    first_ = number_ + 1;
  }
  bool waitsAtOnce() const { return streak_ >= turns_; }

 private:
  static constexpr uint64_t kAtOnce = 50'000, kLong = 4'000'000, kTurns = 3, kMostTurns = kTurns << 12, kSure = 8;
  //! Who was wrong to count on it counts on it later next time: a program may have waited for small things between large ones.
  void breaks() {
    if (itself_ && turns_ < kMostTurns) turns_ *= 4;
    streak_ = 0;
    itself_ = false;
  }
  uint64_t number_ = 0, first_ = 1;   //!< the last submission; the first one since the last wait
  uint64_t begun_ = 0, returned_ = 0, streak_ = 0;
  uint64_t turns_ = kTurns;           //!< in a row, to count on the next one
  bool itself_ = false;               //!< one since the last wait was done in its call
};

}  // namespace pumice::icd
