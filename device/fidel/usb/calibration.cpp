#include "device/fidel/usb/calibration.h"

#include <fcntl.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <nlohmann/json.hpp>

#include "device/support/refusal.h"

namespace fs::fidel_usb {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* format_name = "forceserver calibration of FIDEL";
constexpr int format_version = 1;
constexpr const char* what_to_do = "Correct it, or move it away and calibrate again";

[[noreturn]] void bad_file(const std::string& file, const std::string& what) {
  refuse(FS_ERROR_INVALID, "%s: %s. %s", file.c_str(), what.c_str(), what_to_do);
}

double number(const Json& value, const std::string& file, const char* field, double low, double high) {
  const double size = value.is_number() ? value.get<double>() : NAN;
  if (size >= low && size <= high) return size;
  char text[200];
  std::snprintf(text, sizeof text, "%s is %.60s, must be a number within %g..%g", field, value.dump().c_str(), low, high);
  bad_file(file, text);
}

Calibration parsed(const std::string& text, const std::string& file, const std::string& serial) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) bad_file(file, "it is no JSON object, or is damaged");
  if (json.value("format", Json()) != format_name) bad_file(file, std::string("format must be \"") + format_name + "\"");
  if (json.value("version", Json()) != format_version)
    bad_file(file, "version is " + json.value("version", Json()).dump() + ", must be 1");
  if (json.value("serial", Json()) != serial) {
    bad_file(file, "serial is " + json.value("serial", Json()).dump() + ", but the device is '" + serial + "'");
  }
  const Json offsets = json.value("joint_offsets", Json());
  if (!offsets.is_array() || offsets.size() != 3) bad_file(file, "joint_offsets must be three numbers (rad)");
  Calibration out;
  for (size_t i = 0; i < 3; ++i) out.offsets[i] = number(offsets[i], file, "an offset in joint_offsets", -offset_max, offset_max);
  out.scale = number(json.value("scale", Json()), file, "scale", scale_min, scale_max);
  return out;
}

[[noreturn]] void fail(const std::string& file, const char* what, int error) {
  refuse(FS_ERROR_IO, "%s: %s: %s", file.c_str(), what, std::strerror(error));
}

void write_whole(const std::string& file, const std::string& text) {
  const std::string temporary = file + "." + std::to_string(getpid()) + ".tmp";
  const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (descriptor < 0) fail(temporary, "the calibration cannot be written", errno);
  const bool is_written =
      ::write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(descriptor) == 0;
  const int error = errno;
  ::close(descriptor);
  if (is_written && std::rename(temporary.c_str(), file.c_str()) == 0) return;
  const int reason = is_written ? errno : error;
  unlink(temporary.c_str());
  fail(file, "the calibration cannot be written", reason);
}

}  // namespace

Calibration calibrated(const Arm& arm, const std::array<double, 3>& at_first, const std::array<double, 3>& at_second) {
  const auto wanted = delta_inverse(arm.geometry(), fidel::to_delta(first_place, arm.centre_depth()));
  if (!wanted) refuse(FS_ERROR_INTERNAL, "the centre of the workspace is out of reach");  // Arm makes sure that it is not
  const Vec3 offsets = *wanted - arm.angles(at_first);
  if (!(largest_coordinate(offsets) <= offset_max)) {
    refuse(
        FS_ERROR_INVALID,
        "the first place gives joint offsets of %.3f, %.3f, %.3f rad, must be within %g: home the device, put the handle into the hole at "
        "the centre, and begin again",
        offsets.x, offsets.y, offsets.z, offset_max);
  }
  const auto position = delta_forward(arm.geometry(), arm.angles(at_second) + offsets);
  const Vec3 way = position ? fidel::from_delta(*position, arm.centre_depth()) - first_place : Vec3{NAN, 0, 0};
  const Vec3 wanted_way = second_place - first_place;
  const double scale = norm(wanted_way) / norm(way);
  if (!(scale >= scale_min && scale <= scale_max)) {
    refuse(FS_ERROR_INVALID,
           "the second place is %.1f mm from the first, which gives a scale of %.3f, must be within %g..%g: begin again",
           1e3 * norm(way), scale, scale_min, scale_max);
  }
  constexpr double least_cosine = 0.985;  // 10 degrees
  if (dot(way, wanted_way) < least_cosine * norm(way) * norm(wanted_way)) {
    refuse(FS_ERROR_INVALID, "the second place is at (%.1f, %.1f, %.1f) mm, must be to the right of the first: begin again",
           1e3 * way.x, 1e3 * way.y, 1e3 * way.z);
  }
  return {{offsets.x, offsets.y, offsets.z}, scale};
}

std::string calibration_file(const std::string& serial) {  // config_folder in lib/program/doctor.cpp does the same
  std::string folder;
  const char* const config = std::getenv("XDG_CONFIG_HOME");
  if (config && config[0] == '/') {
    folder = config;
  } else {
    const char* home = std::getenv("HOME");
    if (!home || home[0] != '/') {
      const passwd* const user = getpwuid(getuid());
      home = user ? user->pw_dir : nullptr;
    }
    if (!home || home[0] != '/') return "";
    folder = std::string(home) + "/.config";
  }
  return folder + "/forceserver/fidel-" + serial + ".json";
}

std::optional<Calibration> read_calibration(const std::string& file, const std::string& serial) {
  if (file.empty()) return std::nullopt;
  std::error_code error;
  const auto kind = std::filesystem::status(file, error).type();
  if (kind == std::filesystem::file_type::not_found) return std::nullopt;
  if (kind == std::filesystem::file_type::none) fail(file, "the calibration cannot be read", error.value());
  if (kind != std::filesystem::file_type::regular) bad_file(file, "it is not a file");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  const int reason = errno != 0 ? errno : EIO;
  std::ostringstream text;
  constexpr uintmax_t most = 1 << 16;
  const uintmax_t size = std::filesystem::file_size(file, error);
  if (error) fail(file, "the calibration cannot be read", error.value());
  if (size > most) bad_file(file, "it is too long");
  text << stream.rdbuf();
  if (!stream) fail(file, "the calibration cannot be read", reason);
  return parsed(text.str(), file, serial);
}

void write_calibration(const std::string& file, const std::string& serial, const Calibration& calibration) {
  if (file.empty())
    refuse(FS_ERROR_IO, "this user has no home folder, so there is no place for the calibration; set XDG_CONFIG_HOME");
  static_cast<void>(read_calibration(file, serial));  // one that is bad stays
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(file).parent_path(), error);
  const Json json = {{"format", format_name},
                     {"version", format_version},
                     {"serial", serial},
                     {"joint_offsets", calibration.offsets},
                     {"scale", calibration.scale}};
  write_whole(file, json.dump(2) + "\n");
}

}  // namespace fs::fidel_usb
