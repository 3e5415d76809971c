// Batches and assets between client and server: what one end encodes is what the other decodes, and malformed data are
// refused.
#include <cstring>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/hash.h"
#include "base/text.h"
#include "ipc/blob.h"
#include "transfer/asset.h"
#include "transfer/batch.h"
#include "transfer/records.h"
#include "transfer/shared_memory.h"
#include "unit/force_fixtures.h"
#include "unit/wire_layout.h"

using namespace fs;
using namespace fs::test;

namespace {

wire::Set set_of(const char* name) { return {3, all_parts, to_record(fs_object_init(name, FS_PRIMITIVE_POINT))}; }

wire::Remove removal_of(const char* name) {
  wire::Remove out{};
  put_text(out.name, name);
  return out;
}

// The body of a message, in memory that a reader may keep.
std::shared_ptr<std::vector<std::byte>> copy_of(std::span<const std::byte> body) {
  return std::make_shared<std::vector<std::byte>>(body.begin(), body.end());
}

// Decodes the message of a group; returns whether it is valid.
bool take_apart(std::span<const std::byte> body, Descriptor content, size_t most, Batch& out) {
  const auto memory = copy_of(body);
  Batch::Reader reader(*memory, memory, std::move(content), most);
  while (!reader.is_done()) reader.next();
  if (!reader.is_good()) return false;
  out = reader.take();
  return true;
}

START_TEST(one_change_is_its_own_message) {
  Batch batch;
  batch.add(wire::type_set, set_of("spring"));
  batch.put_slot(0, 7);
  const Batch::Message message = batch.message();
  ck_assert_int_eq(message.type, wire::type_set);
  ck_assert_uint_eq(message.body.size(), sizeof(wire::Set));
  const auto memory = copy_of(message.body);
  const Batch back = Batch::Reader::read(message.type, *memory, memory);
  ck_assert_uint_eq(back.size(), 1);
  ck_assert_uint_eq(back[0].as<wire::Set>().slot, 7);
  ck_assert(back[0].name() == "spring");
  ck_assert(!back[0].is_foreign());
}
END_TEST

START_TEST(a_group_comes_back_as_it_was) {
  for (const size_t count : {2, 20, 400}) {  // the last one is too long for a message
    Batch batch;
    for (size_t i = 0; i < count; ++i) {
      const std::string name = "o" + std::to_string(i);
      if (i % 2) {
        batch.add(wire::type_remove, removal_of(name.c_str()));
      } else {
        batch.add(wire::type_set, set_of(name.c_str()));
      }
    }
    batch.add(wire::type_clear, {});
    Batch::Message message = batch.message();
    ck_assert_int_eq(message.type, wire::type_group);
    ck_assert(bool(message.content) == (count == 400));
    Batch back;
    ck_assert(take_apart(message.body, std::move(message.content), count + 1, back));
    ck_assert_uint_eq(back.size(), batch.size());
    ck_assert(back.is_mapped() == (count == 400));
    for (size_t i = 0; i < back.size(); ++i) {
      ck_assert_int_eq(back[i].type, batch[i].type);
      ck_assert(back[i].name() == batch[i].name());
      ck_assert_uint_eq(back[i].record.size(), batch[i].record.size());
      if (!back[i].record.empty()) ck_assert_mem_eq(back[i].record.data(), batch[i].record.data(), back[i].record.size());
    }
  }
}
END_TEST

START_TEST(a_foreign_change_alone_is_a_group) {
  Batch batch;
  batch.add(wire::type_remove, removal_of("bob/spring"));
  ck_assert_int_eq(batch.message().type, wire::type_group);
  ck_assert(batch[0].is_foreign());
  ck_assert(batch[0].name() == "bob/spring");
  // An object can only be set by its own client, and this is a bad name of such a one.
  Batch other;
  other.add(wire::type_set, set_of("bob/spring"));
  ck_assert(!other[0].is_foreign());
}
END_TEST

START_TEST(what_is_malformed_is_refused) {
  Batch batch, back;
  batch.add(wire::type_set, set_of("a"));
  batch.add(wire::type_set, set_of("b"));
  const std::vector<std::byte> good = *copy_of(batch.message().body);
  ck_assert(take_apart(good, {}, 2, back));
  ck_assert(!take_apart(good, {}, 1, back));  // more changes than are allowed
  for (size_t size = sizeof(wire::Group); size < good.size(); ++size) {  // cut; then also with that size declared
    std::vector<std::byte> cut(good.begin(), good.begin() + static_cast<ptrdiff_t>(size));
    ck_assert(!take_apart(cut, {}, 2, back));
    const wire::Group group{size - sizeof(wire::Group)};
    std::memcpy(cut.data(), &group, sizeof group);
    const bool is_whole = group.bytes % (sizeof(wire::Header) + sizeof(wire::Set)) == 0;
    ck_assert(take_apart(cut, {}, 2, back) == is_whole);
  }
  std::vector<std::byte> unknown = good;
  const uint32_t type = 99;
  std::memcpy(unknown.data() + sizeof(wire::Group), &type, sizeof type);
  ck_assert(!take_apart(unknown, {}, 2, back));
  // With a file there is nothing else in the body, and the file has as many bytes as the group says.
  const std::span<const std::byte> changes = std::span(good).subspan(sizeof(wire::Group));
  const std::span<const std::byte> head = std::span(good).first(sizeof(wire::Group));
  ck_assert(take_apart(head, make_blob({changes}), 2, back));
  ck_assert(!take_apart(good, make_blob({changes}), 2, back));
  ck_assert(!take_apart(head, make_blob({changes.first(changes.size() - 8)}), 2, back));
  ck_assert(!take_apart(head, {}, 2, back));
}
END_TEST

static Ref<const Surface> sticky() {
  fs_surface_settings settings = fs_surface_settings_init();
  settings.static_friction = 0.7;
  settings.dynamic_friction = 0.3;
  settings.slip_distance = 1e-3;
  return make_surface(settings);
}

static Ref<const Surface> rough() {
  fs_surface_settings settings = fs_surface_settings_init();
  settings.columns = 2;
  settings.rows = 3;
  settings.column_width = settings.row_width = 1e-3;
  const double heights[] = {0, -1e-3, -2e-3, 0, -1e-4, 0};
  return make_surface(settings, heights);
}

// What a hostile end may send.
START_TEST(textures_that_are_refused) {
  const PackedAsset good = pack({nullptr, nullptr, rough()});
  const auto refused = [&](auto&& spoil, std::vector<double> heights) {
    PackedAsset bad = PackedAsset::of(good.type, good.record(), make_blob({bytes_of(heights.data(), heights.size())}));
    spoil(bad.surface);
    StopToken stop;
    try {
      unpack(std::move(bad), stop);
      ck_abort_msg("it is taken");
    } catch (const Error& error) {
      ck_assert_msg(error.status == FS_ERROR_INVALID || error.status == FS_ERROR_IO, "%s", error.text.c_str());
    }
  };
  const auto as_it_is = [](wire::Surface&) {};
  const std::vector<double> six(6, -1e-3);
  refused(as_it_is, {});
  refused(as_it_is, {-1e-3, -1e-3});
  refused(as_it_is, {0, 0, 0, 0, 0, NAN});
  refused(as_it_is, {0, 0, 0, 0, 0, 1e-3});
  refused([](wire::Surface& s) { s.settings[offsetof(fs_surface_settings, repeats)] = std::byte{7}; }, six);
  refused([](wire::Surface& s) { s.count = 0; }, six);  // the settings have columns and rows
  for (const uint64_t count : {uint64_t{5}, uint64_t{7}, uint64_t{1} << 40, uint64_t{1} << 61, ~uint64_t{0}}) {
    refused([count](wire::Surface& s) { s.count = count; }, six);
  }
}
END_TEST

// What a hostile end may send.
START_TEST(surfaces_that_are_refused) {
  const PackedAsset good = pack({nullptr, nullptr, sticky()});
  const auto refused = [&](size_t at, const auto& value, fs_status status) {
    PackedAsset bad = PackedAsset::of(good.type, good.record(), {});
    std::memcpy(bad.surface.settings + at, &value, sizeof value);
    StopToken stop;
    try {
      unpack(std::move(bad), stop);
      ck_abort_msg("byte %zu: it is taken", at);
    } catch (const Error& error) {
      ck_assert_msg(error.status == status, "byte %zu: %s", at, error.text.c_str());
    }
  };
  for (const uint32_t size : {0u, 3u, 257u, 4096u, ~0u}) refused(0, size, FS_ERROR_INVALID);
  refused(4, 1u, FS_ERROR_INVALID);
  for (const double bad : {-1.0, 2.5, double{NAN}, double{INFINITY}}) refused(8, bad, FS_ERROR_INVALID);
  // What a later version has appended, and this one does not know.
  PackedAsset later = PackedAsset::of(good.type, good.record(), {});
  const uint32_t size = sizeof(fs_surface_settings) + 8;
  std::memcpy(later.surface.settings, &size, sizeof size);
  StopToken stop;
  ck_assert(unpack(PackedAsset::of(later.type, later.record(), {}), stop).surface);
  later.surface.settings[sizeof(fs_surface_settings)] = std::byte{1};
  try {
    unpack(std::move(later), stop);
    ck_abort_msg("it is taken");
  } catch (const Error& error) {
    ck_assert_int_eq(error.status, FS_ERROR_VERSION);
  }
}
END_TEST

START_TEST(assets_come_back_as_they_were) {
  const Vec3 points[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
  const double forces[] = {3, 2, 0};
  std::vector<Asset> assets = {{make_polyline(points, 4, true), nullptr, nullptr},
                               {make_mesh(points, 4, triangles, 2), nullptr, nullptr},
                               {nullptr, make_table_curve(forces, 3, 0.01), nullptr},
                               {nullptr, nullptr, sticky()},
                               {nullptr, nullptr, rough()}};
  for (const Asset& asset : assets) {
    PackedAsset packed = pack(asset);
    ck_assert_uint_eq(packed.id(), asset.serial());
    ck_assert_uint_eq(packed.content_bytes(), asset.bytes());
    PackedAsset copy = PackedAsset::of(packed.type, packed.record(), std::move(packed.content));
    StopToken stop;
    const Asset back = unpack(std::move(copy), stop);
    ck_assert_uint_ne(back.serial(), asset.serial());
    ck_assert(bool(back.shape) == bool(asset.shape));
    if (asset.shape) {
      ck_assert(back.shape->points.size() == asset.shape->points.size());
      ck_assert(back.shape->triangles == asset.shape->triangles);
      ck_assert_int_eq(back.shape->closed, asset.shape->closed);
    } else if (asset.surface) {
      ck_assert_mem_eq(&back.surface->settings, &asset.surface->settings, sizeof(fs_surface_settings));
      ck_assert(!back.surface->texture == !asset.surface->texture);
      ck_assert(!back.surface->texture || back.surface->texture->heights() == asset.surface->texture->heights());
    } else {
      ck_assert(*back.curve->table() == *asset.curve->table());
      ck_assert_double_eq(back.curve->step(), asset.curve->step());
    }
  }
}
END_TEST

START_TEST(an_object_keeps_its_assets) {
  const Vec3 points[] = {{0, 0, 0}, {1, 0, 0}};
  const double forces[] = {3, 2, 0};
  const Assets assets = {Asset{make_polyline(points, 2, false), nullptr, nullptr}, Asset{},
                         Asset{nullptr, make_table_curve(forces, 3, 0.01), nullptr}, Asset{nullptr, nullptr, sticky()}};
  fs_object object = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
  object.shape = const_cast<fs_shape*>(assets[0].shape.get());
  object.back.curve = const_cast<fs_curve*>(assets[2].curve.get());
  object.surface = const_cast<fs_surface*>(assets[3].surface.get());
  ck_assert(ids_of(assets_of(object)) == ids_of(assets));
  ck_assert(ids_of(assets_of(object, FS_PART_SHAPE)) == (AssetIds{assets[0].serial(), 0, 0, 0}));
  wire::Object record = to_record(object);
  ck_assert(ids_of(record) == AssetIds{});
  put_ids(record, ids_of(assets));
  ck_assert(ids_of(record, FS_PART_PROFILES) == (AssetIds{0, 0, assets[2].serial(), 0}));
  const LinkedObject linked(record, assets);
  ck_assert_ptr_eq(linked.object.shape, object.shape);
  ck_assert_ptr_null(linked.object.front.curve);
  ck_assert_ptr_eq(linked.object.back.curve, object.back.curve);
  ck_assert_ptr_eq(linked.object.surface, object.surface);
}
END_TEST

// The layout is that of this version of the wire. Where it changes, change wire::version too, and this number.
START_TEST(the_layout_has_its_version) {
  const std::string layout = wire_layout();
  ck_assert_msg(wire::version == 4 && hash_of(layout) == 0xe13c83abe459880e, "the hash of version %u is 0x%lx now:\n%s", wire::version,
                static_cast<unsigned long>(hash_of(layout)), layout.c_str());
}
END_TEST

// An end that knows less of a record gets what it knows, and what it sends is filled with zeros.
START_TEST(records_have_the_common_size) {
  wire::Sizes theirs = own_sizes();
  ck_assert_uint_eq(theirs.object, sizeof(wire::Object));
  ck_assert(theirs.stats == sizeof(fs_servo_stats) && theirs.device == sizeof(fs_device_info));
  theirs.object += 8;
  theirs.later[12] = 77;  // a record of a later version
  ck_assert(common_sizes(theirs) && common_sizes(theirs)->object == sizeof(wire::Object));
  for (uint32_t wire::Sizes::*member : {&wire::Sizes::object, &wire::Sizes::stats, &wire::Sizes::device}) {
    wire::Sizes older = own_sizes();
    older.*member = first_sizes().*member;
    ck_assert(common_sizes(older) && (*common_sizes(older)).*member == first_sizes().*member);
    for (const uint32_t size : {0u, 8u, first_sizes().*member - 8, own_sizes().*member + 4, 4104u, ~0u}) {
      wire::Sizes bad = own_sizes();
      bad.*member = size;
      ck_assert(!common_sizes(bad));
    }
  }

  RecordSizes less = own_sizes();
  less.object -= 8;  // without surface
  fs_object object = fs_object_init("o", FS_PRIMITIVE_POINT);
  wire::Set set{3, all_parts, to_record(object)};
  set.object.surface = 5;
  ck_assert_uint_eq(sent_part(set, less).size(), sizeof set - 8);
  Batch refusing(less);
  try {
    refusing.add(wire::type_set, set);
    ck_abort_msg("a field that the server does not know was sent");
  } catch (const Error& error) {
    ck_assert(error.status == FS_ERROR_VERSION && error.text.find("first 576 bytes of fs_object") != std::string::npos);
  }
  set.object.surface = 0;
  for (const size_t count : {1, 2, 300}) {
    Batch batch(less);
    for (size_t i = 0; i < count; ++i) {
      batch.add(wire::type_set, wire::Set{static_cast<uint32_t>(i), all_parts, to_record(object)});
      if (count > 1) batch.add(wire::type_remove, removal_of("gone"));
    }
    Batch::Message message = batch.message();
    Batch back;
    if (count == 1) {
      ck_assert_uint_eq(message.body.size(), sizeof set - 8);
      const auto memory = copy_of(message.body);
      back = Batch::Reader::read(message.type, *memory, memory, less);
    } else {
      const auto memory = copy_of(message.body);
      Batch::Reader reader(*memory, memory, std::move(message.content), 2 * count, less);
      while (!reader.is_done()) reader.next();
      ck_assert(reader.is_good());
      back = reader.take();
    }
    Batch moved = std::move(back);
    ck_assert_uint_eq(moved.size(), batch.size());
    for (size_t i = 0; i < moved.size(); ++i) {
      if (moved[i].type != wire::type_set) continue;
      ck_assert_uint_eq(moved[i].record.size(), sizeof set);
      const auto& came = moved[i].as<wire::Set>();
      ck_assert(came.slot == (count == 1 ? 0 : i / 2) && came.object.surface == 0 && came.object.enabled == 1);
      ck_assert_uint_eq(came.object.known, sizeof(wire::Object) - 8);
      ck_assert_uint_eq(from_record(came.object).struct_size, 576);
    }
  }
  // What a client does not know stays in a change.
  fs_object present = fs_object_init("o", FS_PRIMITIVE_POINT), change = present;
  present.lifetime = 5;
  change.tool_points = 2;
  ck_assert_double_eq(merge_parts(present, change, FS_PART_OTHER).lifetime, 0);
  change.struct_size = 568;
  const fs_object merged = merge_parts(present, change, FS_PART_OTHER);
  ck_assert(merged.lifetime == 5 && merged.tool_points == 2);
}
END_TEST

}  // namespace

int main() {
  return run("transfer", {one_change_is_its_own_message, a_group_comes_back_as_it_was, a_foreign_change_alone_is_a_group,
                          what_is_malformed_is_refused, assets_come_back_as_they_were, an_object_keeps_its_assets,
                          surfaces_that_are_refused, textures_that_are_refused, the_layout_has_its_version, records_have_the_common_size});
}
