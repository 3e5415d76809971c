#include "server/claims.h"

#include <algorithm>

#include "server/client.h"

namespace fs {

Claim::~Claim() { claims_.end(*this); }

bool Claim::needs_whole(const Client& client) const { return is_about_all || others.contains(client.name); }

bool Claim::conflicts_with(const Claim& other) const {
  return (is_own && other.needs_whole(client_)) || (other.is_own && needs_whole(other.client_));
}

bool Claim::await_ready() {
  const bool may_begin = claims_.may_begin(*this);
  place_ = claims_.all_.insert(claims_.all_.end(), this);
  client_.claim = this;
  if (may_begin) claims_.begin(*this);
  return may_begin;
}

void Claim::await_suspend(std::coroutine_handle<> place) noexcept {
  client_.work.pause(Work::State::waiting).await_suspend(place);
}

// One that came earlier goes first, also where it waits itself.
bool Claims::may_begin(const Claim& claim) const {
  const auto end = claim.place_ ? std::list<Claim*>::const_iterator(*claim.place_) : all_.end();
  return std::none_of(all_.begin(), end, [&](const Claim* earlier) { return earlier->conflicts_with(claim); });
}

void Claims::begin(Claim& claim) noexcept {
  claim.has_begun_ = true;
  claim.client_.is_claimed = claim.is_own;
}

void Claims::end(Claim& claim) noexcept {
  if (!claim.place_) return;
  all_.erase(*claim.place_);
  claim.place_.reset();
  claim.client_.is_claimed = false;
  claim.client_.claim = nullptr;
  for (Claim* const next : all_) {
    if (next->has_begun_ || !may_begin(*next)) continue;
    begin(*next);
    next->client_.work.set_ready();
    next->client_.host.resume_later(next->client_);
  }
}

}  // namespace fs
