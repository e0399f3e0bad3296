#include "tests/wsi/x_server.h"

#include <X11/Xlib-xcb.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>

namespace pumice::test {

XServer::XServer(const std::string& depth, const std::vector<std::string>& arguments) {
  int ends[2];
  if (pipe(ends)) return;
  const std::string screen = "400x300x" + depth, end = std::to_string(ends[1]);
  std::vector<const char*> words = {"Xvfb", "-displayfd", end.c_str(), "-noreset",    "-nolisten",
                                    "tcp",  "-screen",    "0",         screen.c_str()};
  for (const std::string& a : arguments) words.push_back(a.c_str());
  words.push_back(nullptr);
  process_ = fork();
  if (process_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    close(ends[0]);
    int nowhere = open("/dev/null", O_RDWR);
    dup2(nowhere, 0);
    dup2(nowhere, 1);
    dup2(nowhere, 2);
    unsetenv("LD_PRELOAD");
    execvp("Xvfb", const_cast<char* const*>(words.data()));
    _exit(127);
  }
  close(ends[1]);
  std::string number;
  pollfd file{ends[0], POLLIN, 0};
  char c;
  while (poll(&file, 1, 30000) > 0 && ::read(ends[0], &c, 1) == 1 && c != '\n') number += c;
  close(ends[0]);
  if (!number.empty()) display = ":" + number;
}

XServer::~XServer() {
  if (process_ <= 0) return;
  kill(process_, SIGTERM);
  waitpid(process_, nullptr, 0);
}

XObserver::XObserver(const XServer& server) : connection_(xcb_connect(server.display.c_str(), nullptr)) {}
XObserver::~XObserver() { xcb_disconnect(connection_); }

void XObserver::sync() {
  std::free(xcb_get_input_focus_reply(connection_, xcb_get_input_focus(connection_), nullptr));
}

std::vector<uint32_t> XObserver::read(xcb_window_t window, uint32_t width, uint32_t height) {
  std::vector<uint32_t> pixels;
  auto cookie = xcb_get_image(connection_, XCB_IMAGE_FORMAT_Z_PIXMAP, window, 0, 0, uint16_t(width),
                              uint16_t(height), ~0u);
  if (auto* reply = xcb_get_image_reply(connection_, cookie, nullptr)) {
    const uint32_t bytes = reply->depth > 16  ? 4
                           : reply->depth > 8 ? 2
                                              : 1,
                   pitch = (width * bytes + 3) / 4 * 4;
    const uint8_t* data = xcb_get_image_data(reply);
    for (uint32_t y = 0; y < height; y++)
      for (uint32_t x = 0; x < width; x++) {
        uint32_t pixel = 0;
        std::memcpy(&pixel, data + size_t(y) * pitch + x * bytes, bytes);
        pixels.push_back(pixel);
      }
    std::free(reply);
  }
  return pixels;
}

void XObserver::resize(xcb_window_t window, uint32_t width, uint32_t height) {
  const uint32_t values[] = {width, height};
  xcb_configure_window(connection_, window, XCB_CONFIG_WINDOW_WIDTH | XCB_CONFIG_WINDOW_HEIGHT, values);
  sync();
}

void XObserver::destroy(xcb_window_t window) {
  xcb_destroy_window(connection_, window);
  sync();
}

XWindow::XWindow(const XServer& server, Library l, uint32_t width, uint32_t height, uint8_t depth, int16_t x)
    : library(l) {
  if (l == Library::Xlib) {
    xlib = XOpenDisplay(server.display.c_str());
    connection = XGetXCBConnection(xlib);
  } else {
    connection = xcb_connect(server.display.c_str(), nullptr);
  }
  xcb_screen_t* screen = xcb_setup_roots_iterator(xcb_get_setup(connection)).data;
  if (!depth) depth = screen->root_depth;
  for (auto d = xcb_screen_allowed_depths_iterator(screen); d.rem; xcb_depth_next(&d))
    if (d.data->depth == depth && xcb_depth_visuals_length(d.data) > 0)
      visual = xcb_depth_visuals(d.data)[0].visual_id;
  if (depth == screen->root_depth) visual = screen->root_visual;
  if (!visual) return;
  xcb_colormap_t map = xcb_generate_id(connection);
  xcb_create_colormap(connection, XCB_COLORMAP_ALLOC_NONE, map, screen->root, visual);
  // No background: what is seen was put there, and stays when the window shrinks.
  const uint32_t values[] = {0, XCB_EVENT_MASK_STRUCTURE_NOTIFY, map};
  window = xcb_generate_id(connection);
  xcb_create_window(connection, depth, window, screen->root, x, 0, uint16_t(width), uint16_t(height), 0,
                    XCB_WINDOW_CLASS_INPUT_OUTPUT, visual,
                    XCB_CW_BORDER_PIXEL | XCB_CW_EVENT_MASK | XCB_CW_COLORMAP, values);
  xcb_map_window(connection, window);
  std::free(xcb_get_input_focus_reply(connection, xcb_get_input_focus(connection), nullptr));
}

XWindow::~XWindow() {
  if (xlib)
    XCloseDisplay(xlib);
  else
    xcb_disconnect(connection);
}

bool XWindow::noErrors() {
  if (xlib) {
    XSync(xlib, 0);
    while (XPending(xlib)) {
      XEvent event;
      XNextEvent(xlib, &event);
    }
    return true;
  }
  std::free(xcb_get_input_focus_reply(connection, xcb_get_input_focus(connection), nullptr));
  bool good = true;
  while (xcb_generic_event_t* event = xcb_poll_for_event(connection)) {
    good &= event->response_type != 0;
    std::free(event);
  }
  return good && !xcb_connection_has_error(connection);
}

}  // namespace pumice::test
