#include "transfer/sizes.h"

#include <algorithm>

#include "base/error.h"
#include "base/grown.h"

namespace fs {
namespace {

using SizeMember = uint32_t wire::Sizes::*;
constexpr SizeMember all_of_them[] = {&wire::Sizes::object, &wire::Sizes::stats, &wire::Sizes::device};
constexpr uint32_t largest = 4096;  // no record of any version is larger

}  // namespace

RecordSizes first_sizes() noexcept {
  RecordSizes out{};
  out.object = wire::record_bytes(sizes_of<fs_object>().first);
  out.stats = sizes_of<fs_servo_stats>().first;
  out.device = sizes_of<fs_device_info>().first;
  return out;
}

RecordSizes own_sizes() noexcept {
  RecordSizes out{};
  out.object = wire::record_bytes(sizes_of<fs_object>().known);
  out.stats = sizes_of<fs_servo_stats>().known;
  out.device = sizes_of<fs_device_info>().known;
  return out;
}

std::optional<RecordSizes> common_sizes(const RecordSizes& theirs) noexcept {
  const RecordSizes ours = own_sizes(), first = first_sizes();
  RecordSizes out{};
  for (const SizeMember member : all_of_them) {
    const uint32_t size = theirs.*member;
    if (size < first.*member || size > largest || size % 8 != 0) return {};
    out.*member = std::min(size, ours.*member);
  }
  return out;
}

std::optional<GrowingEnd> growing_end(uint32_t type) noexcept {
  switch (type) {
    case wire::type_set:
    case wire::type_change: return end_of<wire::Set>;
    default: return {};
  }
}

std::optional<size_t> record_size(uint32_t type, const RecordSizes& common) noexcept {
  using namespace wire;
  if (const auto end = growing_end(type)) return sent_size(*end, common);
  switch (type) {
    case type_shape: return sizeof(wire::Shape);
    case type_curve: return sizeof(wire::Curve);
    case type_surface: return sizeof(wire::Surface);
    case type_forget: return sizeof(Forget);
    case type_place: return sizeof(Place);
    case type_remove: return sizeof(Remove);
    case type_frame: return sizeof(Frame);
    case type_clutch: return sizeof(Clutch);
    case type_tool: return sizeof(wire::Tool);
    case type_tool_radius: return sizeof(ToolRadius);
    case type_accuracy: return sizeof(Accuracy);
    case type_max_stiffness: return sizeof(MaxStiffness);
    case type_bind: return sizeof(Bind);
    case type_clear:
    case type_wake:
    case type_sync:
    case type_reports:
    case type_clients:
    case type_views:
    case type_stats:
    case type_stop_force:
    case type_resume_force:
    case type_device: return 0;
    case type_get:
    case type_pull:
    case type_report:
    case type_view:
    case type_motions: return sizeof(Target);
    case type_motions_since: return sizeof(Since);
    case type_fetch: return sizeof(Fetch);
    case type_record: return sizeof(After);
    default: return {};
  }
}

std::span<const std::byte> sent_change(uint32_t type, std::span<const std::byte> record, const RecordSizes& common) {
  const auto end = growing_end(type);
  if (!end) return record;
  const size_t size = sent_size(*end, common);
  const auto rest = record.subspan(size);
  if (std::any_of(rest.begin(), rest.end(), [](std::byte byte) { return byte != std::byte{}; })) {
    fail(FS_ERROR_VERSION,
         "the server is older than this library (%s): it knows only the first %u bytes of fs_object, and a "
         "field after them is not 0",
         fs_version(), (wire::struct_bytes(common.object) + 7) / 8 * 8);
  }
  return record.first(size);
}

void require_known(const fs_object& object, const RecordSizes& common) {
  if (common.object == sizeof(wire::Object)) return;
  wire::Set set{0, 0, wire::to_record(object)};
  set.object.surface = object.surface ? 1 : 0;  // any number will do here
  sent_change(wire::type_set, std::as_bytes(std::span(&set, 1)), common);
}

std::string wire_difference(uint32_t client, const std::string& client_version, uint32_t server,
                            const std::string& server_version) {
  return "the client (version " + client_version + " of the library) speaks version " + std::to_string(client) +
         " of the wire, the server (" + server_version + ") version " + std::to_string(server) + ": both must speak the same";
}

void limit_known(wire::Object& object, const RecordSizes& common) noexcept {
  object.known = std::min<uint64_t>(object.known, common.object);
}

}  // namespace fs
