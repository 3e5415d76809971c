// forceserver watch: shows the state of a server again and again.
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "ending.h"
#include "look.h"
#include "words.h"

namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

// A terminal on which each text replaces the one before. At the end the former content of the terminal returns.
class Screen {
 public:
  Screen() { std::printf("\033[?1049h\033[?25l"); }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;
  ~Screen() {
    std::printf("\033[?25h\033[?1049l");
    for (const std::string& line : lines_) std::puts(line.c_str());  // the last look stays
    std::fflush(stdout);
  }
  void show(std::vector<std::string> lines) {
    winsize window{};
    std::size_t rows = 24, columns = 80;
    if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_row > 1 && window.ws_col > 1) {
      rows = window.ws_row;
      columns = window.ws_col;
    }
    std::printf("\033[H");
    const bool is_cut = lines.size() >= rows;
    for (std::size_t i = 0; i < std::min(lines.size(), is_cut ? rows - 2 : rows); ++i) {
      std::printf("%s\033[K\n", fit(lines[i], columns - 1).c_str());
    }
    if (is_cut) std::printf("... and %zu lines more\033[K", lines.size() - (rows - 2));
    std::printf("\033[J");
    lines_ = std::move(lines);
  }

 private:
  std::vector<std::string> lines_;
};

// Adds the events since the last call. Leaves out the event that tells every new client that the device is ready, if
// the device was ready before.
void add_events(const Scene& scene, double connected, std::vector<fs_event>& events) {
  for (;;) {
    fs_event event;
    event = scene.next_event(0);
    if (event.kind == FS_EVENT_DISCONNECTED) throw Error(FS_ERROR_DISCONNECTED);
    if (event.kind == FS_EVENT_NONE) return;
    const bool is_old = event.kind == FS_EVENT_DEVICE && event.status == FS_OK && event.time < connected;
    if (!is_old) events.push_back(event);
  }
}

int look_on(const WatchOptions& options) {
  const std::string endpoint = full_endpoint(options.server);
  const Scene scene = connect(options.server, "watch");  // it may wait, and can be interrupted
  const double connected = scene.get_time();
  const Ending ending;
  const bool in_place = !options.json && isatty(STDOUT_FILENO);
  std::unique_ptr<Screen> screen;
  if (in_place) screen = std::make_unique<Screen>();

  Look before = take_look(scene, endpoint);
  auto next = Clock::now();
  for (unsigned i = 0; options.count == 0 || i < options.count; ++i) {
    std::vector<fs_event> events;
    next = std::max(next + std::chrono::duration_cast<Clock::duration>(Seconds(options.interval)), Clock::now());
    for (double left = 1; left > 0;) {  // in short steps, to notice the end of the server at once
      left = Seconds(next - Clock::now()).count();
      if (ending.wait(std::clamp(left, 0.0, 0.1))) return exit_fine;
      add_events(scene, connected, events);
    }
    Look now = take_look(scene, endpoint);
    now.events = std::move(events);
    if (options.json) {
      std::puts(to_json(now, before).c_str());
    } else if (in_place) {
      screen->show(to_text(now, before));
    } else {
      for (const std::string& line : to_text(now, before)) std::puts(line.c_str());
      std::puts("");
    }
    if (!write_out()) return exit_fine;
    before = std::move(now);
  }
  return exit_fine;
}

}  // namespace

int watch(const WatchOptions& options) {
  return at_server(options.server, [&] { return look_on(options); });
}
