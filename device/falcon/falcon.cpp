#include "device/falcon/falcon.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "device/falcon/firmware.h"
#include "device/support/address.h"
#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs::falcon {
namespace {

constexpr double report_within = 0.005;    // s, then the command is sent again
constexpr double second_within = 0.003;    // s, for the report of a command that was sent again
constexpr uint64_t most_reports = 10;      // that are waited for then
constexpr double stale_after = 0.010;      // s without a report: no force
constexpr double silent_after = 1;         // s without a report: the device is closed, and opened again
constexpr double take_within = 0.003;      // s, for the command before
constexpr int reports_to_settle = 20;      // good ones, before the position is believed
constexpr double homing_at_least = 0.2;    // s, until the bits of a homing that was asked for are believed
constexpr double longest_step = 0.02;      // s, from report to report: in a longer one the hand may have gone anywhere

// About 7 m/s at the handle, and what a coarse clock adds. A count is 0.6 mrad of an arm, about 0.04 mm. An arm is stuck that stands
// still while another one turns by 15 degrees.
constexpr EncoderWatch::Limits encoder_limits{2e5, 32, 411};

// The Falcon's z points to who sits before it, and its y up; in the device frame y points away from him, and z up.
Vec3 to_device(Vec3 v) { return {v.x, -v.z, v.y}; }
Vec3 to_falcon(Vec3 v) { return {v.x, v.z, -v.y}; }

bool is_homed(const Report& report) { return (report.bits & all_homed) == all_homed; }

int lights_of(const std::string& text) {
  if (text == "auto") return -1;
  if (text == "off") return 0;
  constexpr std::pair<const char*, int> colours[] = {{"red", light_red}, {"green", light_green}, {"blue", light_blue}};
  int lights = 0;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find('+', begin), text.size());
    int light = 0;
    for (const auto& [name, bit] : colours) light = text.compare(begin, end - begin, name) == 0 ? bit : light;
    if (light == 0) {
      refuse(FS_ERROR_INVALID, "lights is '%s', must be auto, off, or red, green, blue, joined by '+' where several are to shine",
             text.c_str());
    }
    lights |= light;
    begin = end + 1;
  }
  return lights;
}

}  // namespace

Falcon::Falcon(const Address& address)
    : motor_constant_(address.number("motor", 1e3, 1e5).value_or(motor_constant)), usb_(falcon_kind, address.place(), 0),
      watch_(encoder_limits) {
  force_max_ = std::floor(10 * largest_command / motor_constant_ / longest_lever()) / 10;
  set_up(usb_);
  has_answered_ = has_firmware(usb_);
  if (const auto path = address.text("firmware"); path && !has_answered_) {
    load_firmware(usb_, *path);
    has_answered_ = true;
  }
  start_pipes();
}

Falcon::~Falcon() {
  if (!pipes_) return;
  const Packet none = packet_of({});
  for (int i = 0; i < 5; ++i) {  // the second is taken only after the first
    const uint64_t before = count_;
    if (pipes_->send(none.data(), none.size(), 0.02) == FS_ERROR_DISCONNECTED) break;
    pipes_->receive(report_within);
    if (i > 0 && count_ != before) break;
  }
  pipes_->flush(0.02);
}

void Falcon::start_pipes() {
  reports_.clear();
  report_time_ = steady_now();
  doubt(FS_STATE_CONNECTING);
  watch_.forget();
  verdict_ = EncoderWatch::good;
  pose_ = std::nullopt;
  is_waiting_ = has_sent_twice_ = false;
  const UsbEndpoints endpoints{endpoint_in, endpoint_out, usb_packet, packet_size, false};
  pipes_.emplace(usb_, endpoints, take, this);
}

void Falcon::get_info(fs_device_info& out) const {
  std::snprintf(out.name, sizeof out.name, "Novint Falcon");
  std::snprintf(out.serial, sizeof out.serial, "%s", usb_.found().serial.c_str());
  out.force_axes = 3;
  out.workspace_radius = workspace_radius;
  out.workspace_height = workspace_height;
  out.force_max = force_max_;
  out.resolution = radians_per_count * longest_lever();
  out.rate = 1000;
  out.delay = 0.001;
}

// Within receive and send.
void Falcon::take(void* self, const uint8_t* data, size_t size) noexcept {
  Falcon& falcon = *static_cast<Falcon*>(self);
  if (size <= modem_bytes) return;  // nothing has come from the Falcon: its USB chip says so
  falcon.reports_.put(data + modem_bytes, size - modem_bytes, [&](const Report& report) {
    falcon.newest_ = report;
    ++falcon.count_;
  });
}

void Falcon::doubt(uint32_t reason) noexcept {
  reason_ = reason;
  settled_ = 0;
  is_ready_ = false;
}

// Until there are more reports than `known`. IO: what came is no report, or a fault of the bus.
fs_status Falcon::await_report(double within, uint64_t known) noexcept {
  const double until = steady_now() + within;
  const uint64_t stray = reports_.stray();
  while (count_ == known) {
    const fs_status status = pipes_->receive(std::max(0.0, until - steady_now()));
    if (status != FS_OK) return status;
    if (count_ == known && reports_.stray() != stray) return FS_ERROR_IO;
  }
  return FS_OK;
}

fs_status Falcon::receive(fs_state& out) noexcept {
  out.pose.orientation.w = 1;
  std::unique_lock own(mutex_, std::try_to_lock);
  if (own && !is_wanted_ && !pipes_) return FS_ERROR_DISCONNECTED;
  if (is_wanted_ || !own || !pipes_) {
    if (own) {
      is_ready_ = false;
      own.unlock();
    }
    pause(report_within);
    out.flags = FS_STATE_FIRMWARE_MISSING;
    return FS_OK;
  }
  out.pose.position = position_;  // the last that is known
  fs_status status = await_report(report_within, told_);
  const bool is_answer = is_waiting_ && !has_sent_twice_;  // with two on their way nobody knows which is answered
  if (status == FS_OK && std::exchange(has_sent_twice_, false)) {
    // Either the first command was lost, or its report is late; then that of the second comes, too, and commands would queue for good.
    uint64_t before;
    do before = count_;
    while (await_report(second_within, before) == FS_OK && count_ - told_ < most_reports);
  }
  const double time = steady_now();
  if (status == FS_ERROR_DISCONNECTED) {
    is_ready_ = false;
    return fs_fail(status, "the Falcon was unplugged");
  }
  if (status == FS_OK) {
    told_ = count_;
    is_waiting_ = false;
    if (is_answer) meter_.note_delay(time - sent_at_);
    has_answered_ = true;
    judge(time, out);
    out.flags = is_ready_ ? uint32_t{FS_STATE_READY} : reason_;
    report_time_ = time;
  } else {
    status = without_report(status, time, out);
  }
  tell();
  return status;
}

fs_status Falcon::without_report(fs_status status, double time, fs_state& out) noexcept {
  const double silence = time - report_time_;
  if (status != FS_ERROR_TIMEOUT) doubt(FS_STATE_CONNECTING);
  if (!has_answered_ && status == FS_ERROR_TIMEOUT) {
    out.flags = FS_STATE_FIRMWARE_MISSING;
    return FS_OK;
  }
  if (silence > silent_after) return fs_fail(FS_ERROR_DISCONNECTED, "the Falcon does not answer");
  if (status != FS_ERROR_TIMEOUT) return fs_fail(status, "the USB has failed, or what came is no report");
  if (silence < stale_after) return status;
  out.flags = FS_STATE_CONNECTING;
  doubt(FS_STATE_CONNECTING);
  return FS_OK;
}

// What the newest report says, and whether that can be believed: is_ready_, and otherwise reason_.
void Falcon::judge(double time, fs_state& out) noexcept {
  out.buttons = newest_.bits & all_buttons;
  if (wants_homing_.exchange(false)) {
    is_homing_ = true;
    homing_since_ = time;
  }
  if (is_homing_ && is_homed(newest_) && time - homing_since_ > homing_at_least) {
    is_homing_ = false;
    doubt(FS_STATE_NOT_HOMED);
    watch_.forget();
  }
  if (is_homing_ || !is_homed(newest_)) {  // the origin jumps when it is homed
    doubt(FS_STATE_NOT_HOMED);
    watch_.forget();
    verdict_ = EncoderWatch::good;
    pose_ = std::nullopt;
    return;
  }
  const auto& counts = newest_.encoders;
  verdict_ = watch_.judge({counts[0], counts[1], counts[2]}, std::clamp(time - report_time_, 0.0, longest_step));
  if (verdict_ != EncoderWatch::good) {
    doubt(FS_STATE_NOT_HOMED);
    return;
  }
  const Vec3 angles = angles_of(newest_.encoders);
  auto pose = pose_ ? pose_from(angles, pose_->position) : pose_at(angles);
  if (!pose && pose_) pose = pose_at(angles);
  pose_ = pose;
  if (!pose_) {  // no position of the handle has these angles
    doubt(FS_STATE_NOT_HOMED);
    return;
  }
  position_ = out.pose.position = to_device(pose_->position - centre);
  settled_ = std::min(settled_ + 1, reports_to_settle);
  is_ready_ = settled_ == reports_to_settle;
}

Command Falcon::command_for(const fs_wrench& wrench, double time) const noexcept {
  Command command;
  if (is_ready_ && pose_ && time - report_time_ < stale_after) {
    command.motors = commands_of(transposed(pose_->jacobian) * to_falcon(wrench.force), motor_constant_);
  }
  const bool is_at_home = has_answered_ && !is_homing_ && is_homed(newest_);
  const int lights = lights_;
  if (lights >= 0) command.bits = static_cast<uint8_t>(lights);
  else if (verdict_ != EncoderWatch::good) command.bits = light_blue;
  else command.bits = is_at_home ? light_green : light_red;
  if (!is_at_home) command.bits |= bit_homing;
  return command;
}

fs_status Falcon::send(const fs_wrench& wrench) noexcept {
  std::unique_lock own(mutex_, std::try_to_lock);
  const bool is_none = wrench.force.x == 0 && wrench.force.y == 0 && wrench.force.z == 0;
  if (is_wanted_ || !own || !pipes_) return is_none ? FS_OK : FS_ERROR_TIMEOUT;  // without firmware there is no force
  const double time = steady_now();
  const Packet packet = packet_of(command_for(wrench, time));
  const fs_status status = pipes_->send(packet.data(), packet.size(), take_within);
  if (status == FS_OK) {
    ++sent_;
    sent_at_ = time;
    has_sent_twice_ = has_sent_twice_ || is_waiting_;
    is_waiting_ = true;
  } else {
    if (status != FS_ERROR_TIMEOUT) doubt(FS_STATE_CONNECTING);
    fs_fail(status, "the Falcon does not take its commands");
  }
  return status;
}

// Each command is answered by a report.
fs_status Falcon::get_link(fs_link& out) noexcept {
  const auto reports = static_cast<uint32_t>(count_);
  return meter_.tell(steady_now(), {reports, sent_, reports}, out);
}

// ----------------------------------------------------------------------------------------------------------------- requests

std::string Falcon::control(const std::string& text) {
  const size_t equals = text.find('=');
  const std::string name = text.substr(0, equals), value = equals == std::string::npos ? "" : text.substr(equals + 1);
  if (text == "home") {
    wants_homing_ = true;
    return "while the light is red: pull the handle out as far as it goes, then push it in";
  }
  if (text == "status") return status();
  if (equals != std::string::npos && name == "lights") {
    lights_ = lights_of(value);
    return "lights: " + value;
  }
  if (equals != std::string::npos && name == "firmware") return load(value);
  refuse(
      FS_ERROR_UNSUPPORTED,
      "a Falcon has no request '%s'; its requests are: home, status, lights=auto|off|red|green|blue (joined by '+'), firmware=PATH",
      text.c_str());
}

namespace {

// Asks the driver's thread to leave the device alone.
class Wanted {
 public:
  Wanted(std::atomic<bool>& flag, std::mutex& mutex) : flag_(flag) {
    if (flag_.exchange(true)) refuse(FS_ERROR_STATE, "another request has the device at present; ask again when it has ended");
    lock_ = std::unique_lock(mutex);
  }
  ~Wanted() {
    lock_.unlock();
    flag_ = false;
  }
  Wanted(const Wanted&) = delete;
  Wanted& operator=(const Wanted&) = delete;

 private:
  std::atomic<bool>& flag_;
  std::unique_lock<std::mutex> lock_;
};

}  // namespace

std::string Falcon::load(const std::string& path) {
  const Wanted wanted(is_wanted_, mutex_);
  pipes_.reset();
  // An event of libusb would use the pipes that are gone. Without pipes, receive says that the device is lost; it is opened anew.
  if (usb_.is_abandoned()) refuse(FS_ERROR_DISCONNECTED, "the Falcon does not answer; it is opened anew, then ask again");
  try {
    set_up(usb_);
    const bool had_it = has_firmware(usb_);
    if (!had_it) load_firmware(usb_, path);
    has_answered_ = true;
    start_pipes();
    return had_it ? "it has its firmware already; take its power away to give it another" : "it has its firmware; now home it";
  } catch (...) {
    has_answered_ = false;
    start_pipes();
    throw;
  }
}

void Falcon::tell() noexcept {
  const std::unique_lock lock(told_mutex_, std::try_to_lock);
  if (!lock) return;
  now_.report = newest_;
  now_.reports = count_;
  now_.stray = reports_.stray();
  now_.usb = pipes_->counts();
  if (!has_answered_) now_.condition = "no firmware";
  else if (verdict_ != EncoderWatch::good) now_.condition = EncoderWatch::words(verdict_);
  else if (is_homing_ || !is_homed(newest_)) now_.condition = "not homed";
  else now_.condition = is_ready_ ? "ready" : "not ready yet";
}

std::string Falcon::status() {
  const std::lock_guard lock(told_mutex_);
  const auto number = [](uint64_t value) { return static_cast<unsigned long long>(value); };
  const Report& report = now_.report;
  char text[400];
  std::snprintf(
      text, sizeof text,
      "%s; encoders %d, %d, %d; homed motors %d%d%d; %llu reports, %llu stray bytes; on the USB: stalls %llu, too long %llu, errors "
      "%llu, commands lost %llu",
      now_.condition, report.encoders[0], report.encoders[1], report.encoders[2], (report.bits >> 4) & 1, (report.bits >> 5) & 1,
      (report.bits >> 6) & 1, number(now_.reports), number(now_.stray), number(now_.usb.stalls), number(now_.usb.overlong),
      number(now_.usb.errors), number(now_.usb.lost));
  return text;
}

}  // namespace fs::falcon
