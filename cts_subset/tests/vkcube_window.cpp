#include "cts_subset/tests/vkcube_window.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>
#include <xcb/xcb.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <map>
#include <memory>

namespace pumice::cts {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kTimeout = std::chrono::seconds(90);

bool installed(const std::string& program) {
  if (program.find('/') != std::string::npos) return access(program.c_str(), X_OK) == 0;
  std::string path = std::getenv("PATH") ? std::getenv("PATH") : "/usr/bin:/bin";
  for (size_t at = 0; at <= path.size();) {
    size_t end = std::min(path.find(':', at), path.size());
    if (access((path.substr(at, end - at) + "/" + program).c_str(), X_OK) == 0) return true;
    at = end + 1;
  }
  return false;
}

// A child process that does not outlive this object.
class Child {
 public:
  // `output` becomes standard output and error; `kept` stays open in the child.
  Child(std::vector<std::string> words, const std::vector<std::string>& environment, int output, int kept) {
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    pid = fork();
    if (pid != 0) return;
    for (const std::string& entry : environment) putenv(const_cast<char*>(entry.c_str()));
    dup2(output, 1);
    dup2(output, 2);
    if (kept >= 0) fcntl(kept, F_SETFD, 0);
    execvp(argv[0], argv.data());
    _exit(127);
  }
  ~Child() {
    if (ended()) return;
    kill(pid, SIGTERM);
    auto deadline = Clock::now() + std::chrono::seconds(5);
    while (!ended() && Clock::now() < deadline) usleep(10000);
    if (ended()) return;
    kill(pid, SIGKILL);
    waitpid(pid, nullptr, 0);
  }
  bool ended() {
    if (!over && waitpid(pid, &status, WNOHANG) == pid) over = true;
    return over;
  }
  std::string failure() const {
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
    if (WIFSIGNALED(status)) return "ended by signal " + std::to_string(WTERMSIG(status));
    return "exit status " + std::to_string(WEXITSTATUS(status));
  }

 private:
  pid_t pid = -1;
  int status = 0;
  bool over = false;
};

struct Pipe {
  int ends[2] = {-1, -1};
  Pipe() {
    if (pipe2(ends, O_CLOEXEC) != 0) ends[0] = ends[1] = -1;
    fcntl(ends[0], F_SETFL, O_NONBLOCK);
  }
  ~Pipe() {
    close(ends[0]);
    close(ends[1]);
  }
  std::string readSome() {
    char text[4096];
    ssize_t n = read(ends[0], text, sizeof text);
    return n > 0 ? std::string(text, size_t(n)) : std::string();
  }
};

// A window manager of one idea: the program's window goes into a frame that has no background, so
// that its last picture stays in the frame when the window is destroyed.
class Frame {
 public:
  explicit Frame(xcb_connection_t* c) : connection(c) {
    screen = xcb_setup_roots_iterator(xcb_get_setup(connection)).data;
    uint32_t mask = XCB_EVENT_MASK_SUBSTRUCTURE_REDIRECT | XCB_EVENT_MASK_SUBSTRUCTURE_NOTIFY;
    xcb_change_window_attributes(connection, screen->root, XCB_CW_EVENT_MASK, &mask);
    xcb_flush(connection);
  }

  void handleEvents() {
    while (xcb_generic_event_t* raw = xcb_poll_for_event(connection)) {
      std::unique_ptr<xcb_generic_event_t, decltype(&std::free)> event(raw, std::free);
      int kind = event->response_type & 0x7f;
      if (kind == XCB_MAP_REQUEST) adopt(reinterpret_cast<xcb_map_request_event_t*>(event.get())->window);
      if (kind == XCB_CONFIGURE_REQUEST)
        allow(*reinterpret_cast<xcb_configure_request_event_t*>(event.get()));
    }
  }

  Picture picture() {
    Picture none;
    if (!frame) return none;
    auto cookie = xcb_get_image(connection, XCB_IMAGE_FORMAT_Z_PIXMAP, frame, 0, 0, uint16_t(width),
                                uint16_t(height), ~0u);
    xcb_get_image_reply_t* reply = xcb_get_image_reply(connection, cookie, nullptr);
    if (!reply) return none;
    Picture picture(width, height);
    const uint8_t* data = xcb_get_image_data(reply);
    for (size_t i = 0; i < picture.rgba.size(); i += 4) {  // 24 bits deep: BGRX
      picture.rgba[i] = data[i + 2];
      picture.rgba[i + 1] = data[i + 1];
      picture.rgba[i + 2] = data[i];
      picture.rgba[i + 3] = 255;
    }
    std::free(reply);
    return picture;
  }

 private:
  void adopt(xcb_window_t window) {
    if (frame) {
      xcb_map_window(connection, window);
      xcb_flush(connection);
      return;
    }
    auto reply = xcb_get_geometry_reply(connection, xcb_get_geometry(connection, window), nullptr);
    if (!reply) return;
    width = reply->width, height = reply->height;
    std::free(reply);
    frame = xcb_generate_id(connection);
    // No value for the background: None, so the server never paints the frame.
    uint32_t redirect = 1;
    xcb_create_window(connection, XCB_COPY_FROM_PARENT, frame, screen->root, 0, 0, uint16_t(width),
                      uint16_t(height), 0, XCB_WINDOW_CLASS_INPUT_OUTPUT, screen->root_visual,
                      XCB_CW_OVERRIDE_REDIRECT, &redirect);
    xcb_map_window(connection, frame);
    xcb_reparent_window(connection, window, frame, 0, 0);
    xcb_map_window(connection, window);
    xcb_flush(connection);
  }

  void allow(const xcb_configure_request_event_t& wanted) {
    // Position stays ours; the size is the program's.
    const uint32_t kSize[] = {wanted.width, wanted.height};
    xcb_configure_window(connection, wanted.window, XCB_CONFIG_WINDOW_WIDTH | XCB_CONFIG_WINDOW_HEIGHT,
                         kSize);
    xcb_flush(connection);
  }

  xcb_connection_t* connection;
  xcb_screen_t* screen = nullptr;
  xcb_window_t frame = 0;
  uint32_t width = 0, height = 0;
};

}  // namespace

WindowRun runInWindow(const std::vector<std::string>& program, const std::vector<std::string>& environment) {
  WindowRun run;
  for (const std::string& needed : {std::string("Xvfb"), program[0]})
    if (!installed(needed)) {
      run.missing = true;
      run.problem = needed + " is not installed";
      return run;
    }
  auto deadline = Clock::now() + kTimeout;

  Pipe displayNumber, serverLog, log;
  Child server({"Xvfb", "-displayfd", std::to_string(displayNumber.ends[1]), "-screen", "0", "800x800x24",
                "-noreset", "-nolisten", "tcp"},
               {}, serverLog.ends[1], displayNumber.ends[1]);
  std::string number;
  while (number.find('\n') == std::string::npos) {
    if (server.ended() || Clock::now() > deadline) {
      run.problem = "Xvfb did not start: " + serverLog.readSome();
      return run;
    }
    usleep(10000);
    number += displayNumber.readSome();
  }
  std::string display(":");
  display.append(number, 0, number.find('\n'));
  std::unique_ptr<xcb_connection_t, decltype(&xcb_disconnect)> connection(
      xcb_connect(display.c_str(), nullptr), xcb_disconnect);
  if (xcb_connection_has_error(connection.get())) {
    run.problem = "cannot connect to Xvfb at " + display;
    return run;
  }
  Frame frame(connection.get());

  std::vector<std::string> complete = environment;
  complete.push_back("DISPLAY=" + display);
  Child client(program, complete, log.ends[1], -1);
  while (!client.ended()) {
    if (Clock::now() > deadline) {
      run.problem = program[0] + " did not end in time";
      return run;
    }
    pollfd wait{xcb_get_file_descriptor(connection.get()), POLLIN, 0};
    poll(&wait, 1, 20);
    frame.handleEvents();
    run.output += log.readSome();
  }
  run.output += log.readSome();
  if (!client.failure().empty()) {
    run.problem = program[0] + ": " + client.failure() + "\n" + run.output;
    return run;
  }
  run.picture = frame.picture();
  if (run.picture.rgba.empty()) run.problem = program[0] + " never showed a window";
  return run;
}

}  // namespace pumice::cts
