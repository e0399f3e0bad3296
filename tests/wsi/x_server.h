// An Xvfb of the test's own, and windows on it, made through libxcb or Xlib.
#pragma once

#include <X11/Xlib.h>
#include <sys/types.h>
#include <xcb/xcb.h>

#include <cstdint>
#include <string>
#include <vector>

#undef None
#undef Bool
#undef Status
#undef Success

namespace pumice::test {

class XServer {
 public:
  //! `arguments` after those that every server gets; "24" is the depth of the screen's root.
  explicit XServer(const std::string& depth = "24", const std::vector<std::string>& arguments = {});
  ~XServer();
  XServer(const XServer&) = delete;
  bool running() const { return !display.empty(); }
  pid_t process() const { return process_; }
  std::string display;  //!< ":7"

 private:
  pid_t process_ = -1;
};

//! A connection that looks at a window from outside.
class XObserver {
 public:
  explicit XObserver(const XServer& server);
  ~XObserver();
  XObserver(const XObserver&) = delete;
  //! Pixels of the window, as the server keeps them; empty when it is gone.
  std::vector<uint32_t> read(xcb_window_t window, uint32_t width, uint32_t height);
  //! Sizes and destroys behind the back of the window's owner.
  void resize(xcb_window_t window, uint32_t width, uint32_t height);
  void destroy(xcb_window_t window);

 private:
  void sync();
  xcb_connection_t* connection_;
};

//! A mapped window without borders, by the library that the surface is made for.
struct XWindow {
  enum class Library { Xcb, Xlib };
  //! depth 0: that of the root. x: where it is on the screen (windows that overlap hide each other's pixels).
  XWindow(const XServer& server, Library library, uint32_t width, uint32_t height, uint8_t depth = 0,
          int16_t x = 0);
  ~XWindow();
  XWindow(const XWindow&) = delete;
  //! Reads all events; false when one of them is an error. (Under Xlib an error has ended the process.)
  bool noErrors();

  Library library;
  Display* xlib = nullptr;
  xcb_connection_t* connection = nullptr;
  xcb_window_t window = 0;
  xcb_visualid_t visual = 0;
};

}  // namespace pumice::test
