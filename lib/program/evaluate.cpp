// forceserver evaluate: reads positions and writes the forces there.
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <string_view>
#include <vector>

#include "program.h"

namespace {

const std::size_t batch_size = 8192;

// Takes the next number, and one comma or semicolon after it, off the line. Returns nothing when there is no number.
std::optional<double> take_number(std::string_view& line) {
  const char* const blanks = " \t\r";
  line.remove_prefix(std::min(line.find_first_not_of(blanks), line.size()));
  if (line.starts_with('+') && !line.starts_with("+-")) line.remove_prefix(1);  // from_chars does not accept a '+'
  double value = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), value);
  if (error != std::errc() || !std::isfinite(value)) return {};
  line.remove_prefix(end - line.data());
  if (!line.empty() && !std::strchr(" \t\r,;", line.front())) return {};
  line.remove_prefix(std::min(line.find_first_not_of(blanks), line.size()));
  if (line.starts_with(',') || line.starts_with(';')) line.remove_prefix(1);
  return value;
}

// Returns nothing when the line is not a position.
std::optional<fs_vec3> parse_position(std::string_view line) {
  const auto x = take_number(line), y = take_number(line), z = take_number(line);
  if (!x || !y || !z || line.find_first_not_of(" \t\r") != line.npos) return {};
  return fs_vec3{*x, *y, *z};
}

class Progress {
 public:
  explicit Progress(const std::string& input) : shown_(isatty(STDERR_FILENO)) {
    std::error_code none;
    if (shown_ && input != "-") size_ = std::filesystem::file_size(input, none);
    if (none) size_ = 0;
  }
  void print(std::size_t done, std::streamoff at) {
    if (!shown_) return;
    std::fprintf(stderr, "\r\033[K%zu positions", done);
    if (size_ > 0 && at > 0) std::fprintf(stderr, ", %.0f %%", 100.0 * double(at) / double(size_));
    drawn_ = true;
  }
  ~Progress() {
    if (drawn_) std::fprintf(stderr, "\r\033[K");
  }

 private:
  bool shown_, drawn_ = false;
  std::uintmax_t size_ = 0;
};

// Says which objects have a contact that a point without memory does not feel.
void tell_contacts(const Scene& scene, const std::string& only) {
  for (const fs_report& report : scene.get_reports()) {
    if (!only.empty() && only != report.name) continue;
    const forceserver::Object object = scene.object_get(report.name);
    fs_shape_info info = fs_shape_info_init();
    if (object.shape) forceserver::throw_on_error(fs_shape_get_info(object.shape, &info));
    const bool is_open = object.shape && !info.has_inside;
    const bool is_left_out = object.contact.keep == FS_KEEP_EITHER || (object.contact.keep != FS_KEEP_NONE && is_open);
    if (!object.enabled || !is_left_out) continue;
    std::fprintf(stderr, "forceserver: the contact of '%s' is left out: it keeps a hand on the side from which it comes\n",
                 report.name);
  }
}

}  // namespace

int evaluate(const EvaluateOptions& options) {
  const double begin = 1;  // s: a scene's time must be above 0; the objects of the scene start at this time
  const Scene scene = Scene::create();
  scene.set_time(begin);
  scene.load(options.scene);
  scene.set_time(begin + options.time);

  std::ifstream file;
  if (options.input != "-") {
    file.open(options.input);
    if (!file) throw std::runtime_error("cannot read " + options.input + ": " + std::strerror(errno));
  }
  std::istream& in = options.input == "-" ? std::cin : file;
  auto require_written = [](bool good) {
    if (!good) throw std::runtime_error(std::string("cannot write the forces: ") + std::strerror(errno));
  };

  Progress progress(options.input);
  std::vector<fs_vec3> positions, forces;
  std::size_t done = 0, line_number = 0;
  bool has_header = false;
  auto flush = [&] {
    forces.resize(positions.size());
    const char* const object = options.object.empty() ? nullptr : options.object.c_str();
    scene.evaluate_field(object, FS_NOW, positions.data(), positions.size(), forces.data());
    if (!has_header) require_written(std::puts("x,y,z,fx,fy,fz") >= 0);
    has_header = true;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const fs_vec3 &x = positions[i], &f = forces[i];
      const double row[] = {x.x, x.y, x.z, f.x, f.y, f.z};
      for (int k = 0; k < 6; ++k) {
        require_written(std::printf(k < 5 ? "%.17g," : "%.17g\n", row[k] + 0.0) > 0);  // + 0.0: no -0
      }
    }
    done += positions.size();
    positions.clear();
    if (done > batch_size) progress.print(done, in.tellg());
  };

  bool header_possible = true;
  for (std::string line; std::getline(in, line);) {
    ++line_number;
    std::string_view text(line);
    if (line_number == 1 && text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // a byte-order mark
    text = text.substr(0, text.find('#'));
    if (text.find_first_not_of(" \t\r") == text.npos) continue;
    const auto position = parse_position(text);
    std::string_view first_word = text;
    const bool header = !position && header_possible && !take_number(first_word);
    header_possible = false;
    if (header) continue;
    if (!position) {
      const std::string source = options.input == "-" ? "standard input" : options.input;
      throw std::runtime_error(source + ", line " + std::to_string(line_number) +
                               ": expected three finite numbers \"x y z\" or \"x,y,z\", found \"" + line + "\"");
    }
    positions.push_back(*position);
    if (positions.size() == batch_size) flush();
  }
  if (in.bad()) throw std::runtime_error("cannot read " + options.input + ": " + std::strerror(errno));
  flush();
  require_written(std::fflush(stdout) == 0);
  tell_contacts(scene, options.object);
  return exit_fine;
}
