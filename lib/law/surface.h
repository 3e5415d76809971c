// What the surface of a solid object does, immutable. It is the fs_surface of the C contract itself.
#pragma once

#include <algorithm>
#include <memory>

#include <forceserver/object.h>

#include "base/counted.h"
#include "base/serial.h"

struct fs_surface : fs::Counted<fs_surface> {
  explicit fs_surface(const fs_surface_settings& of) : settings(of) {}

  const uint64_t serial = fs::next_serial();
  const fs_surface_settings settings;

  // Keeps `what` alive as long as the surface. Called before any other thread has the surface.
  void keep(std::shared_ptr<const void> what) const { kept_ = std::move(what); }

 private:
  mutable std::shared_ptr<const void> kept_;
};

namespace fs {

using Surface = fs_surface;

// Throws INVALID.
Ref<const Surface> make_surface(const fs_surface_settings& settings);

// The Coulomb coefficient: `still` where the proxy sticks; less by `drop` once it has slipped for `distance`.
struct Friction {
  double still = 0, drop = 0;
  double distance = 0;  // m

  // [rt] slipped: the part of the distance, 0 to 1.
  double after(double slipped) const noexcept { return still - drop * std::min(slipped, 1.0); }
};

}  // namespace fs
