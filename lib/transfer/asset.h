// The shapes, curves and surfaces that objects refer to. As they may be large and shared by many objects, they are sent once and on
// their own, and the record of an object has only their numbers. Both ends keep them as Assets, and send PackedAssets.
#pragma once

#include <array>
#include <span>

#include "base/counted.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "base/stop_token.h"
#include "field/object.h"
#include "law/curve.h"
#include "shape/shape.h"
#include "transfer/wire.h"

namespace fs {

// A shape, curve or surface that the server had offered, and offers no longer. Its status is STATE.
struct NotOffered : Error {};

// A shape, a curve, a surface, or nothing.
struct Asset {
  Ref<const Shape> shape;
  Ref<const Curve> curve;
  Ref<const Surface> surface;

  static Asset of(const fs_shape* shape) { return {Ref<const Shape>::retain(shape), nullptr, nullptr}; }
  static Asset of(const fs_curve* curve) { return {nullptr, Ref<const Curve>::retain(curve), nullptr}; }
  static Asset of(const fs_surface* surface) { return {nullptr, nullptr, Ref<const Surface>::retain(surface)}; }

  explicit operator bool() const noexcept { return shape || curve || surface; }
  uint64_t serial() const noexcept {  // 0: nothing
    return shape ? shape->serial : curve ? curve->serial : surface ? surface->serial : 0;
  }
  // Keeps `what` alive as long as the asset. Called before any other thread has it.
  void keep(std::shared_ptr<const void> what) const {
    if (shape) shape->keep(std::move(what));
    else if (curve) curve->keep(std::move(what));
    else if (surface) surface->keep(std::move(what));
  }
  uint64_t bytes() const noexcept;  // of the file when it is packed
};

// An asset as it travels: its record, and a sealed file with what does not fit into that.
struct PackedAsset {
  wire::Type type{};  // type_shape, type_curve or type_surface: which of the records counts
  wire::Shape shape{};
  wire::Curve curve{};
  wire::Surface surface{};
  Descriptor content;

  // From a message of such a type, whose size was checked.
  static PackedAsset of(wire::Type type, std::span<const std::byte> record, Descriptor&& content);

  uint64_t& id() noexcept { return type == wire::type_shape ? shape.id : type == wire::type_curve ? curve.id : surface.id; }
  bool has_content() const noexcept {
    return type == wire::type_shape || (type == wire::type_curve ? curve.count : surface.count) > 0;
  }
  std::span<const std::byte> record() const noexcept;
  uint64_t content_bytes() const;  // that the file must have. INVALID: the record is no good
};

// The id becomes the asset's serial. IO, FULL.
PackedAsset pack(const Asset& asset);
// Trusts nothing in it. INVALID, PARSE, UNSUPPORTED, IO; throws Stopped.
Asset unpack(PackedAsset&& packed, StopToken& stop);

inline constexpr bool is_asset(uint32_t type) {
  return type == wire::type_shape || type == wire::type_curve || type == wire::type_surface;
}

// What an object refers to, and the numbers of these: its shape, the curve of its front, the curve of its back, its surface.
using Assets = std::array<Asset, 4>;
using AssetIds = std::array<uint64_t, 4>;  // 0: none

inline constexpr std::array<uint32_t, 4> asset_parts = {FS_PART_SHAPE, FS_PART_PROFILES, FS_PART_PROFILES, FS_PART_CONTACT};
inline constexpr std::array<wire::Type, 4> asset_types = {wire::type_shape, wire::type_curve, wire::type_curve,
                                                          wire::type_surface};

// Only those that belong to `parts` (fs_part bits).
Assets assets_of(const Object& object, uint64_t parts = all_parts);
Assets assets_of(const fs_object& object, uint64_t parts = all_parts);
AssetIds ids_of(const Assets& assets) noexcept;
AssetIds ids_of(const wire::Object& record, uint64_t parts = all_parts) noexcept;
void put_ids(wire::Object& record, const AssetIds& ids) noexcept;

// The object of a record with its handles, and the assets that keep these alive.
struct LinkedObject {
  LinkedObject(const wire::Object& record, Assets assets);
  fs_object object;
  Assets assets;
};

}  // namespace fs
