// Batches and assets between client and server: what one end encodes is what the other decodes, and malformed data are
// refused.
#include <cstring>
#include <string>
#include <vector>

#include "base/text.h"
#include "ipc/blob.h"
#include "transfer/asset.h"
#include "transfer/batch.h"
#include "transfer/layout.h"
#include "transfer/records.h"
#include "transfer/shared_memory.h"
#include "unit/force_fixtures.h"

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
  wire::Target target{};
  put_text(target.name, "bob/spring");
  batch.add(wire::type_remove_other, target);
  ck_assert_int_eq(batch.message().type, wire::type_group);
  ck_assert(batch[0].is_foreign());
  ck_assert(batch[0].name() == "bob/spring");
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

START_TEST(assets_come_back_as_they_were) {
  const Vec3 points[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const uint32_t triangles[] = {0, 1, 2, 0, 2, 3};
  const double forces[] = {3, 2, 0};
  std::vector<Asset> assets = {{make_polyline(points, 4, true), nullptr},
                               {make_mesh(points, 4, triangles, 2), nullptr},
                               {nullptr, make_table_curve(forces, 3, 0.01)}};
  for (const Asset& asset : assets) {
    PackedAsset packed = pack(asset);
    ck_assert_uint_eq(packed.id(), asset.serial());
    ck_assert_uint_eq(packed.content_bytes(), asset.bytes());
    PackedAsset copy = PackedAsset::of(packed.type, packed.record(), std::move(packed.content));
    Wanted wanted;
    const Asset back = unpack(std::move(copy), wanted);
    ck_assert_uint_ne(back.serial(), asset.serial());
    ck_assert(bool(back.shape) == bool(asset.shape));
    if (asset.shape) {
      ck_assert(back.shape->points.size() == asset.shape->points.size());
      ck_assert(back.shape->triangles == asset.shape->triangles);
      ck_assert_int_eq(back.shape->closed, asset.shape->closed);
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
  const Assets assets = {Asset{make_polyline(points, 2, false), nullptr}, Asset{}, Asset{nullptr, make_table_curve(forces, 3, 0.01)}};
  fs_object object = fs_object_init("line", FS_PRIMITIVE_POLYLINE);
  object.shape = const_cast<fs_shape*>(assets[0].shape.get());
  object.back.curve = const_cast<fs_curve*>(assets[2].curve.get());
  ck_assert(ids_of(assets_of(object)) == ids_of(assets));
  ck_assert(ids_of(assets_of(object, FS_PART_SHAPE)) == (AssetIds{assets[0].serial(), 0, 0}));
  wire::Object record = to_record(object);
  ck_assert(ids_of(record) == AssetIds{});
  put_ids(record, ids_of(assets));
  ck_assert(ids_of(record, FS_PART_PROFILES) == (AssetIds{0, 0, assets[2].serial()}));
  const LinkedObject linked(record, assets);
  ck_assert_ptr_eq(linked.object.shape, object.shape);
  ck_assert_ptr_null(linked.object.front.curve);
  ck_assert_ptr_eq(linked.object.back.curve, object.back.curve);
}
END_TEST

// Each word of an outbox counts in the number of the layout: where it is, how long it is and what kind of number.
START_TEST(the_layout_has_all_words_of_an_outbox) {
  const std::string& text = wire::layout_text();
  const auto has = [&](const std::string& word, size_t offset, size_t size, char kind) {
    const std::string line = "Outbox " + word + ' ' + std::to_string(offset) + ' ' + std::to_string(size) + ' ' + kind + '\n';
    ck_assert_msg(text.find(line) != std::string::npos, "the layout lacks: %s", line.c_str());
  };
  has("heartbeat", offsetof(Outbox, heartbeat), 8, 'f');
  has("is_closed", offsetof(Outbox, is_closed), 4, 'u');
  has("is_asleep", offsetof(Outbox, is_asleep), 4, 'u');
  has("news", offsetof(Outbox, news), 8, 'u');
  has("applied", offsetof(Outbox, applied), 8, 'u');
  has("events_written", offsetof(Outbox, events_written), 8, 'u');
}
END_TEST

}  // namespace

int main() {
  return run("transfer", {one_change_is_its_own_message, a_group_comes_back_as_it_was, a_foreign_change_alone_is_a_group,
                          what_is_malformed_is_refused, assets_come_back_as_they_were, an_object_keeps_its_assets,
                          the_layout_has_all_words_of_an_outbox});
}
