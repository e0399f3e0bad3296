// A Wayland compositor of a few lines, in a thread: it keeps what each commit showed and answers when it is
// told to.
#pragma once

#include <wayland-server.h>

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

namespace pumice::test {

struct Commit {
  uint32_t width = 0, height = 0, format = 0;  //!< format: wl_shm's
  std::vector<uint32_t> pixels;
};

class Compositor {
 public:
  //! What it does not do by itself at every commit.
  struct Manners {
    bool answerFrames = true;    //!< frame callbacks, at once; false: never (a hidden window)
    bool releaseBuffers = true;  //!< at once; false: when the next but one is there
  };
  explicit Compositor(Manners manners);
  ~Compositor() { stop(); }
  Compositor(const Compositor&) = delete;

  //! The socket of the one client.
  int clientFile() const { return clientFile_; }
  //! The last of at least `count` commits; empty if they do not come within a while.
  Commit waitFor(size_t count);
  //! Answers one frame callback that was held back.
  void answerFrame();
  size_t commits();
  //! True when a buffer that was not released has changed.
  bool torn();
  //! Ends the connection, as a compositor does that dies.
  void stop();

 private:
  struct Surface;
  struct Requests;
  void commit(Surface& surface);

  Manners manners_;
  int clientFile_ = -1;
  wl_display* display_ = nullptr;
  wl_client* client_ = nullptr;
  int wake_ = -1;
  wl_event_source* wakeSource_ = nullptr;
  bool stop_ = false;  // this and the rest: under the mutex
  uint32_t framesToAnswer_ = 0;
  bool torn_ = false;
  std::vector<Commit> commits_;
  std::vector<wl_resource*> heldFrames_;
  std::vector<std::pair<wl_resource*, Commit>> heldBuffers_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::thread thread_;
};

}  // namespace pumice::test
