#include "transfer/asset.h"

#include <cstddef>
#include <cstring>

#include "base/error.h"
#include "base/grown.h"
#include "base/text.h"
#include "ipc/blob.h"
#include "transfer/records.h"

namespace fs {

static Ref<const Surface> unpack_surface(const wire::Surface& record, std::span<const double> heights) {
  uint32_t size;
  std::memcpy(&size, record.settings, sizeof size);
  if (size > sizeof record.settings) fail(FS_ERROR_INVALID, "the settings of the surface are %u bytes long: too many", size);
  alignas(fs_surface_settings) std::byte given[sizeof record.settings];
  std::memcpy(given, record.settings, sizeof given);
  const auto repeats = static_cast<unsigned>(given[offsetof(fs_surface_settings, repeats)]);
  if (repeats > 1) fail(FS_ERROR_INVALID, "repeats is %u, must be 0 or 1", repeats);  // a bool must not be another number
  return make_surface(read_grown(reinterpret_cast<const fs_surface_settings*>(given)), heights);
}

uint64_t Asset::bytes() const noexcept {
  if (shape) return shape->points.size() * sizeof(Vec3) + shape->triangles.size() * sizeof(uint32_t);
  if (surface) return surface->texture ? surface->texture->heights().size() * sizeof(double) : 0;
  return curve && curve->table() ? curve->table()->size() * sizeof(double) : 0;
}

PackedAsset PackedAsset::of(wire::Type type, std::span<const std::byte> record, Descriptor&& content) {
  PackedAsset out{type, {}, {}, {}, std::move(content)};
  if (type == wire::type_shape) {
    std::memcpy(&out.shape, record.data(), sizeof out.shape);
  } else if (type == wire::type_curve) {
    std::memcpy(&out.curve, record.data(), sizeof out.curve);
  } else {
    std::memcpy(&out.surface, record.data(), sizeof out.surface);
  }
  return out;
}

std::span<const std::byte> PackedAsset::record() const noexcept {
  if (type == wire::type_shape) return bytes_of(&shape, 1);
  return type == wire::type_curve ? bytes_of(&curve, 1) : bytes_of(&surface, 1);
}

uint64_t PackedAsset::content_bytes() const {
  if (type != wire::type_shape) {
    const uint64_t count = type == wire::type_curve ? curve.count : surface.count;
    if (count > uint64_t{1} << 40) {
      fail(FS_ERROR_INVALID, "the %s %llu entries: too many", type == wire::type_curve ? "table has" : "heights have",
           static_cast<unsigned long long>(count));
    }
    return count * sizeof(double);
  }
  const bool is_mesh = shape.primitive == FS_PRIMITIVE_MESH;
  if (!is_mesh && shape.primitive != FS_PRIMITIVE_POLYLINE) {
    fail(FS_ERROR_INVALID, "the shape's primitive is %u, must be POLYLINE (1) or MESH (3)", shape.primitive);
  }
  if (shape.point_count > 4'000'000'000 || shape.triangle_count > 500'000'000 || (!is_mesh && shape.triangle_count != 0)) {
    fail(FS_ERROR_INVALID, "the shape has %llu points and %llu triangles: too many",
         static_cast<unsigned long long>(shape.point_count), static_cast<unsigned long long>(shape.triangle_count));
  }
  return shape.point_count * sizeof(Vec3) + shape.triangle_count * 3 * sizeof(uint32_t);
}

PackedAsset pack(const Asset& asset) {
  PackedAsset out{asset.shape ? wire::type_shape : asset.curve ? wire::type_curve : wire::type_surface, {}, {}, {}, {}};
  if (asset.shape) {
    const Shape& shape = *asset.shape;
    out.content =
        make_blob({bytes_of(shape.points.data(), shape.points.size()), bytes_of(shape.triangles.data(), shape.triangles.size())});
    out.shape = {shape.serial, static_cast<uint32_t>(shape.primitive), shape.primitive == FS_PRIMITIVE_POLYLINE && shape.closed,
                 shape.points.size(), shape.triangles.size() / 3};
    return out;
  }
  if (asset.surface) {
    out.surface.id = asset.surface->serial;
    std::memcpy(out.surface.settings, &asset.surface->settings, sizeof asset.surface->settings);
    if (const auto& texture = asset.surface->texture) {
      out.content = make_blob({bytes_of(texture->heights().data(), texture->heights().size())});
      out.surface.count = texture->heights().size();
    }
    return out;
  }
  out.curve.id = asset.curve->serial;
  if (const std::vector<double>* table = asset.curve->table()) {
    out.content = make_blob({bytes_of(table->data(), table->size())});
    out.curve.count = table->size();
    out.curve.step = asset.curve->step();
  } else {
    put_text(out.curve.expression, *asset.curve->expression());
  }
  return out;
}

Asset unpack(PackedAsset&& packed, StopToken& stop) {
  const bool is_surface = packed.type == wire::type_surface;
  if (!packed.has_content()) {
    if (is_surface) return {nullptr, nullptr, unpack_surface(packed.surface, {})};
    return {nullptr, make_expression_curve(text_of(packed.curve.expression).c_str()), nullptr};
  }
  check_blob(packed.content, packed.content_bytes());
  if (packed.type != wire::type_shape) {
    std::vector<double> numbers(packed.content_bytes() / sizeof(double));
    read_blob(packed.content, 0, std::as_writable_bytes(std::span(numbers)));
    packed.content.reset();
    if (is_surface) return {nullptr, nullptr, unpack_surface(packed.surface, numbers)};
    return {nullptr, make_table_curve(numbers.data(), numbers.size(), packed.curve.step), nullptr};
  }
  const wire::Shape& record = packed.shape;
  std::vector<Vec3> points(record.point_count);
  std::vector<uint32_t> triangles(3 * record.triangle_count);
  read_blob(packed.content, 0, std::as_writable_bytes(std::span(points)));
  read_blob(packed.content, points.size() * sizeof(Vec3), std::as_writable_bytes(std::span(triangles)));
  packed.content.reset();
  if (record.primitive == FS_PRIMITIVE_POLYLINE) {
    return {make_polyline(points.data(), points.size(), record.is_closed != 0, stop), nullptr, nullptr};
  }
  return {make_mesh(std::move(points), std::move(triangles), stop), nullptr, nullptr};
}

// ---------------------------------------------------------------------------------------------------------- of objects

Assets assets_of(const Object& object, uint64_t parts) {
  Assets out;
  if (parts & FS_PART_SHAPE) out[0].shape = object.shape;
  if (parts & FS_PART_PROFILES) {
    out[1].curve = object.law.front.curve;
    out[2].curve = object.law.back.curve;
  }
  if (parts & FS_PART_CONTACT) out[3].surface = object.surface;
  return out;
}

Assets assets_of(const fs_object& object, uint64_t parts) {
  Assets out;
  if (parts & FS_PART_SHAPE) out[0] = Asset::of(object.shape);
  if (parts & FS_PART_PROFILES) {
    out[1] = Asset::of(object.front.curve);
    out[2] = Asset::of(object.back.curve);
  }
  if (parts & FS_PART_CONTACT) out[3] = Asset::of(object.surface);
  return out;
}

AssetIds ids_of(const Assets& assets) noexcept {
  return {assets[0].serial(), assets[1].serial(), assets[2].serial(), assets[3].serial()};
}

AssetIds ids_of(const wire::Object& record, uint64_t parts) noexcept {
  AssetIds out = {record.shape, record.front.curve, record.back.curve, record.surface};
  for (size_t i = 0; i < out.size(); ++i) {
    if (!(parts & asset_parts[i])) out[i] = 0;
  }
  return out;
}

void put_ids(wire::Object& record, const AssetIds& ids) noexcept {
  record.shape = ids[0];
  record.front.curve = ids[1];
  record.back.curve = ids[2];
  record.surface = ids[3];
}

LinkedObject::LinkedObject(const wire::Object& record, Assets the_assets)
    : object(from_record(record)), assets(std::move(the_assets)) {
  object.shape = const_cast<fs_shape*>(assets[0].shape.get());
  object.front.curve = const_cast<fs_curve*>(assets[1].curve.get());
  object.back.curve = const_cast<fs_curve*>(assets[2].curve.get());
  object.surface = const_cast<fs_surface*>(assets[3].surface.get());
}

}  // namespace fs
