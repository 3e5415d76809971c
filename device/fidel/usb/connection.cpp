#include "device/fidel/usb/connection.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <numbers>
#include <utility>

#include "device/support/clock.h"
#include "device/support/refusal.h"

namespace fs {
namespace fidel_usb {
namespace {

constexpr UsbKind kind{"FIDEL", vendor, product, product_text};
constexpr UsbEndpoints endpoints{report_endpoint, command_endpoint, 64, command_size, true};
constexpr double receive_within = 0.02, silence_most = 5e-3, lost_after = 1, send_within = 4e-3, last_within = 0.05;  // s
constexpr int damaged_most = 3;      // reports in a row, 3 ms
constexpr uint16_t gap_most = 1000;  // reports that are missing, or commands refused; more: the device has begun anew
constexpr uint16_t age_unknown = 65535;
constexpr double too_fast = 1.25;  // times the speed at which the device switches its motors off: no hand moves a joint so
constexpr double jump_slack = 16;  // counts
constexpr double stuck_part = 72;  // of a revolution: 5 degrees
constexpr int measure_reports = 200;
constexpr int measure_spread = 40;   // counts
constexpr const char* known_requests = "the requests are: status, home, clear, calibrate, calibrate=cancel";

// "usb": the first; "usb:WHICH": its number from 0, or its serial number.
std::string which_of(const std::string& place) {
  if (place == "usb") return "0";
  if (place.rfind("usb:", 0) == 0 && place.size() > 4) return place.substr(4);
  refuse(FS_ERROR_INVALID, "address is '%s', must be usb, usb:NUMBER or usb:SERIAL", shortened(place).c_str());
}

// Of the calibration. The option calibration: a file, or "none".
std::string file_of(const Address& address, const std::string& serial) {
  const auto file = address.text("calibration");
  return !file ? calibration_file(serial) : *file == "none" ? "" : *file;
}

EncoderWatch::Limits limits_of(const Identity& identity) noexcept {
  const double counts = identity.joint_counts, speed = 1e-3 * identity.joint_speed;
  return {too_fast * speed * counts / (2 * std::numbers::pi), jump_slack, counts / stuck_part};
}

uint32_t flags_of(uint16_t status) noexcept {
  uint32_t flags = 0;
  if (!(status & status_homed) || status & status_encoder) flags |= FS_STATE_NOT_HOMED;
  if (status & (status_emergency_stop | status_over_heated | status_no_supply)) flags |= FS_STATE_STOPPED;
  if (status & status_over_speed) flags |= FS_STATE_TOO_FAST;
  if (status & status_in_holder) flags |= FS_STATE_IN_HOLDER;
  if (status & status_no_firmware) flags |= FS_STATE_FIRMWARE_MISSING;
  if (status & status_watchdog) flags |= FS_STATE_CONNECTING;
  return flags;
}

std::string words_of(uint16_t status) {
  static constexpr std::pair<uint16_t, const char*> all[] = {
      {status_emergency_stop, "emergency stop"}, {status_over_speed, "a joint was too fast"},
      {status_watchdog, "no command for 20 ms"}, {status_limited, "torques limited"},
      {status_in_holder, "in its holder"},       {status_encoder, "an encoder is wrong"},
      {status_over_heated, "too hot"},           {status_no_supply, "no supply for the motors"},
      {status_no_firmware, "no firmware"}};
  std::string text = status & status_homed ? "homed" : "not homed, marks passed:";
  for (int joint = 0; joint < 3 && !(status & status_homed); ++joint) text += status & status_mark_1 << joint ? " yes" : " no";
  text += status & status_motors ? ", motors on" : ", motors off";
  for (const auto& [bit, words] : all) {
    if (status & bit) text += std::string(", ") + words;
  }
  return text;
}

}  // namespace

// ------------------------------------------------------------------------------------------------------------ opening

UsbConnection::UsbConnection(const Address& address)
    : device_(kind, which_of(address.place()), 0), identity_(ask_identity()), serial_(identity_.serial.data()), arm_(identity_),
      file_(file_of(address, serial_)), calibration_(read_calibration(file_, serial_).value_or(Calibration{})),
      watch_(limits_of(identity_)),
      pipes_(
          device_, endpoints,
          [](void* self, const uint8_t* data, size_t size) noexcept { static_cast<UsbConnection*>(self)->take({data, size}); },
          this),
      requests_(device_) {}

Identity UsbConnection::ask_identity() {
  constexpr int tries = 3;
  int newer = 0;  // a version that all answers tell; one alone may be damaged
  for (int i = 0; i < tries; ++i) {
    const std::vector<uint8_t> bytes = device_.control_answer(to_host, request_identity, 0, 0, identity_size);
    const uint8_t version = version_of_identity(bytes);
    if (version > protocol_version && (i == 0 || version == newer)) newer = version;
    else newer = 0;
    if (newer && i + 1 == tries) {
      refuse(FS_ERROR_VERSION, "the FIDEL speaks version %d of the protocol, this driver only %d: install a newer forceserver",
             newer, protocol_version);
    }
    const auto identity = parse_identity(bytes);
    if (!identity) continue;
    const std::string serial = identity->serial.data();
    const bool is_good =
        !serial.empty() &&
        serial.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.") == std::string::npos;
    if (!is_good) refuse(FS_ERROR_IO, "the FIDEL has a serial number with other signs than A..Z, a..z, 0..9, '-', '_' and '.'");
    const std::string& of_bus = device_.found().serial;
    if (!of_bus.empty() && of_bus != serial) {
      refuse(FS_ERROR_IO, "the FIDEL has the serial number '%s' on the bus, but says '%s': its firmware is wrong", of_bus.c_str(),
             serial.c_str());
    }
    return *identity;
  }
  refuse(FS_ERROR_IO, "the FIDEL '%s' does not say what it is: %d answers were damaged", device_.found().serial.c_str(), tries);
}

UsbConnection::~UsbConnection() {
  const auto zero = packed(Command{++command_, {}, {}});
  pipes_.send(zero.data(), zero.size(), last_within);
  pipes_.flush(last_within);
}

void UsbConnection::get_info(fs_device_info& out) const {
  out.force_axes = 3;
  out.torque_axes = arm_.torque_max() > 0 ? 3 : 0;
  std::snprintf(out.name, sizeof out.name, "FIDEL");
  std::snprintf(out.serial, sizeof out.serial, "%s", serial_.c_str());
  out.workspace_radius = fidel::workspace_radius;
  out.workspace_height = fidel::workspace_height;
  out.workspace_angle = identity_.wrist_counts ? fidel::wrist_angle : 0;
  out.force_max = arm_.force_max();
  out.torque_max = arm_.torque_max();
  out.resolution = arm_.resolution();
  out.rate = fidel::rate;
  out.delay = 1e-3;  // a frame of the bus; then get_link tells
  out.watchdog = 0.02;
}

// ---------------------------------------------------------------------------------------------- reports and commands

void UsbConnection::take(std::span<const uint8_t> bytes) noexcept {
  const auto report = parse_report(bytes);
  const uint16_t gap = report ? static_cast<uint16_t>(report->number - last_report_) : 0;
  if (!report || (has_report_ && gap == 0)) {
    reports_damaged_.fetch_add(1, std::memory_order_relaxed);
    ++damaged_in_a_row_;
    return;
  }
  damaged_in_a_row_ = 0;
  const uint32_t missing = has_report_ && gap <= gap_most ? gap - 1u : 0;
  last_report_ = report->number;
  has_report_ = true;
  const double now = came_ = steady_now();
  measure(*report, missing, now);
  state_ = {};
  state_.time = clock_.time_of(report->time, now);
  state_.buttons = report->buttons;
  for (size_t i = 0; i < 3; ++i) joints_[i].store(report->joints[i], std::memory_order_relaxed);
  judge(*report, clock_.last_step());
  reports_.fetch_add(1, std::memory_order_release);
  is_fresh_ = true;
}

// A report tells the newest command that has come: that closes a round trip.
void UsbConnection::measure(const Report& report, uint32_t missing, double now) noexcept {
  ++totals_.states;
  totals_.sent += 1 + missing;
  ++totals_.came;
  reports_lost_.fetch_add(missing, std::memory_order_relaxed);
  const auto refused = static_cast<uint16_t>(report.refused - std::exchange(refused_, report.refused));
  if (totals_.states > 1 && refused <= gap_most) totals_.came -= refused;
  double& sent = sent_at_[report.command % sent_at_.size()];
  if (sent == 0 || report.command_age == age_unknown) return;
  meter_.note_delay(std::max(0.0, now - sent - 1e-6 * report.command_age));
  sent = 0;
}

fs_status UsbConnection::get_link(fs_link& out) noexcept { return meter_.tell(steady_now(), totals_, out); }

// Sets pose and flags.
void UsbConnection::judge(const Report& report, double step) noexcept {
  if (is_to_change_.load(std::memory_order_acquire)) {
    calibration_ = next_;
    is_to_change_.store(false, std::memory_order_release);
  }
  const bool is_homed = report.status & status_homed;
  if (!is_homed || !was_homed_) watch_.forget();
  was_homed_ = is_homed;
  const auto verdict = is_homed ? watch_.judge(report.joints, step) : EncoderWatch::good;
  measured_ = arm_.measured(report.joints, report.wrist, calibration_);
  uint32_t flags = flags_of(report.status);
  const bool is_known =
      verdict == EncoderWatch::good && measured_.place == Arm::good && !is_calibrating_.load(std::memory_order_relaxed);
  // At a speed that was too great the encoders also seem to jump: that is told when the fault has been cleared.
  if (!is_known && !(report.status & status_over_speed)) flags |= FS_STATE_NOT_HOMED;
  state_.flags = flags ? flags : static_cast<uint32_t>(FS_STATE_READY);
  state_.pose = measured_.place == Arm::good ? measured_.pose : identity_pose();
  is_homed_.store(is_homed, std::memory_order_relaxed);
  verdict_.store(verdict, std::memory_order_relaxed);
  place_.store(measured_.place, std::memory_order_relaxed);
}

fs_status UsbConnection::receive(fs_state& out) noexcept {
  // Five reports that do not come are a fault; whoever has not begun to report has more time.
  const double until = steady_now() + (has_report_ ? silence_most : receive_within);
  for (;;) {
    const fs_status status = pipes_.receive(std::max(0.0, until - steady_now()));
    if (is_fresh_ && status == FS_OK) {
      is_fresh_ = false;
      out = state_;
      return FS_OK;
    }
    if (status != FS_OK) is_fresh_ = false;
    if (status == FS_ERROR_DISCONNECTED) return fs_fail(status, "the FIDEL was unplugged");
    if (status == FS_ERROR_IO) return fs_fail(status, "the USB has failed, or the FIDEL has stalled");
    if (status == FS_ERROR_TIMEOUT && has_report_) {
      const bool is_lost = steady_now() - came_ > lost_after;  // it is opened anew, which may wake it
      return fs_fail(is_lost ? FS_ERROR_DISCONNECTED : FS_ERROR_IO, "the reports of the FIDEL have stopped");
    }
    if (status != FS_OK) return status;
    if (damaged_in_a_row_ >= damaged_most) return fs_fail(FS_ERROR_IO, "the reports of the FIDEL are damaged");
  }
}

fs_status UsbConnection::send(const fs_wrench& wrench) noexcept {
  Command command = state_.flags & FS_STATE_READY ? arm_.command(measured_, wrench) : Command{};
  command.number = ++command_;
  const auto bytes = packed(command);
  const double now = steady_now();
  const fs_status status = pipes_.send(bytes.data(), bytes.size(), send_within);
  ++totals_.sent;
  if (status == FS_OK) {
    ++totals_.came;  // as far as is known: a report tells of refused ones
    sent_at_[command.number % sent_at_.size()] = now;
    return status;
  }
  commands_lost_.fetch_add(1, std::memory_order_relaxed);
  if (status == FS_ERROR_DISCONNECTED) return fs_fail(status, "the FIDEL was unplugged");
  return fs_fail(status, "the FIDEL does not take its commands");
}

// --------------------------------------------------------------------------------------------------------- requests

std::string UsbConnection::control(const std::string& request) {
  if (request == "status") return told_status();
  if (request == "home") {
    requests_.ask(to_device, request_home, 0);
    return "move the handle slowly down and up through the middle of its workspace, until `status` says that it is homed";
  }
  if (request == "clear") {
    requests_.ask(to_device, request_clear_fault, 0);
    return "the fault is cleared";
  }
  if (request == "calibrate") return calibrate("");
  if (request.rfind("calibrate=", 0) == 0) return calibrate(request.substr(10));
  refuse(FS_ERROR_UNSUPPORTED, "'%s' is no request of FIDEL; %s", shortened(request).c_str(), known_requests);
}

// What the driver has found wrong, as the end of a sentence.
std::string UsbConnection::trouble() const {
  std::string text;
  if (const auto verdict = static_cast<EncoderWatch::Verdict>(verdict_.load()); verdict != EncoderWatch::good) {
    text += std::string("; ") + EncoderWatch::words(verdict) + ": home the device";
  }
  if (const auto place = static_cast<Arm::Place>(place_.load()); place != Arm::good && is_homed_)
    text += std::string("; ") + Arm::words(place);
  if (is_calibrating_) text += "; it is being calibrated";
  return text;
}

std::string UsbConnection::told_status() {
  const auto status = parse_status(requests_.ask(to_host, request_status, status_size));
  if (!status) refuse(FS_ERROR_IO, "the status of the FIDEL was damaged; ask again");
  char counts[300];
  std::snprintf(
      counts, sizeof counts,
      ". Reports: %llu good, %llu lost, %llu damaged. Commands: %u accepted, %u refused, %u limited, %llu not taken; the watchdog "
      "ended them %u times. Firmware %d.%d.",
      static_cast<unsigned long long>(reports_.load()), static_cast<unsigned long long>(reports_lost_.load()),
      static_cast<unsigned long long>(reports_damaged_.load()), status->accepted, status->refused, status->limited,
      static_cast<unsigned long long>(commands_lost_.load()), status->watchdog, identity_.firmware >> 8,
      identity_.firmware & 255);
  return words_of(status->status) + trouble() + counts;
}

// The means of some reports, of a handle that is held still.
UsbConnection::Means UsbConnection::measure() {
  constexpr int waits_most = 5000;  // ms
  std::array<double, 3> sums{}, least{}, largest{};
  uint64_t last = reports_.load(std::memory_order_acquire);
  int count = 0;
  for (int waits = 0; count < measure_reports; ++waits) {
    if (waits == waits_most) refuse(FS_ERROR_TIMEOUT, "the reports of the FIDEL do not come");
    pause(1e-3);
    const uint64_t now = reports_.load(std::memory_order_acquire);
    if (now == last) continue;
    last = now;
    for (size_t i = 0; i < 3; ++i) {
      const double value = joints_[i].load(std::memory_order_relaxed);
      sums[i] += value;
      least[i] = count ? std::min(least[i], value) : value;
      largest[i] = count ? std::max(largest[i], value) : value;
    }
    ++count;
  }
  for (size_t i = 0; i < 3; ++i) {
    if (largest[i] - least[i] > measure_spread) {
      refuse(FS_ERROR_STATE, "the handle has moved: joint %zu by %.0f counts, must be at most %d. Hold it still and ask again",
             i + 1, largest[i] - least[i], measure_spread);
    }
    sums[i] /= count;
  }
  return {sums};
}

std::string UsbConnection::calibrate(const std::string& way) {
  const std::lock_guard lock(mutex_);
  if (way == "cancel") {
    step_ = idle;
    is_calibrating_ = false;
    return "the calibration has ended; what was known before stays";
  }
  if (!way.empty()) refuse(FS_ERROR_INVALID, "calibrate is '%s', must be cancel or nothing", shortened(way).c_str());
  if (!is_homed_) refuse(FS_ERROR_STATE, "the FIDEL is not homed: ask for `home` first");
  if (step_ == idle) {
    if (file_.empty())
      refuse(FS_ERROR_STATE, "no calibration can be kept: the device was opened with calibration=none, or the user has no home");
    static_cast<void>(read_calibration(file_, serial_));  // a bad file is told now
    is_calibrating_ = true;
    step_ = at_first;
    return "step 1 of 2: the motors are off; put the tip of the handle into the hole at the centre of the plate, hold it still, and ask again";
  }
  if (step_ == at_first) {
    first_ = measure();
    step_ = at_second;
    return "step 2 of 2: put the tip into the hole 100 mm to the right of the first, hold it still, and ask again";
  }
  const Means second = measure();
  step_ = idle;
  try {
    next_ = calibrated(arm_, first_.counts, second.counts);
    write_calibration(file_, serial_, next_);
  } catch (...) {
    is_calibrating_ = false;
    throw;
  }
  is_to_change_.store(true, std::memory_order_release);
  for (int i = 0; i < 1000 && is_to_change_.load(std::memory_order_acquire); ++i) pause(1e-3);
  is_calibrating_ = false;
  const char* const waits = is_to_change_ ? "; no report has come since, so it counts from the next report on" : "";
  char text[200];
  std::snprintf(text, sizeof text, "done: offsets %.5f, %.5f, %.5f rad, scale %.5f; kept in ", next_.offsets[0], next_.offsets[1],
                next_.offsets[2], next_.scale);
  return text + file_ + waits;
}

}  // namespace fidel_usb

std::unique_ptr<FidelConnection> connect_fidel_usb(const char* text) {
  return std::make_unique<fidel_usb::UsbConnection>(Address(text, {"calibration"}));
}

void list_fidel_usb(fs_device_entry* out, size_t capacity, size_t* count) {
  usb_entries(fidel_usb::kind, "fidel:usb:", out, capacity, count);
}

}  // namespace fs
