// What the surface of a solid object does, immutable. It is the fs_surface of the C contract itself.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>

#include <forceserver/object.h>

#include "base/counted.h"
#include "base/serial.h"
#include "law/impact.h"
#include "law/texture.h"

struct fs_surface : fs::Counted<fs_surface> {
  fs_surface(const fs_surface_settings& of, std::optional<fs::Texture> its) : settings(of), texture(std::move(its)) {}

  const uint64_t serial = fs::next_serial();
  const fs_surface_settings settings;
  const std::optional<fs::Texture> texture;

  fs::Impact impact() const noexcept { return {settings.impact_gain, settings.impact_frequency, settings.impact_decay}; }

  // Keeps `what` alive as long as the surface. Called before any other thread has the surface.
  void keep(std::shared_ptr<const void> what) const { kept_ = std::move(what); }

 private:
  mutable std::shared_ptr<const void> kept_;
};

namespace fs {

using Surface = fs_surface;

// Throws INVALID. heights: of its texture; empty: it has none, and columns and rows are 0.
Ref<const Surface> make_surface(const fs_surface_settings& settings, std::span<const double> heights = {});

// The figures that object.h gives for each fs_impact.
Impact impact_preset(fs_impact kind) noexcept;

// The Coulomb coefficient: `still` where the proxy sticks; less by `drop` once it has slipped for `distance`.
struct Friction {
  double still = 0, drop = 0;
  double distance = 0;  // m

  // [rt] slipped: the part of the distance, 0 to 1.
  double after(double slipped) const noexcept { return still - drop * std::min(slipped, 1.0); }
};

}  // namespace fs
